#include "fit/joint_solve.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <new>
#include <string>
#include <vector>

#include <Eigen/Dense>
#include <ceres/ceres.h>
#include <glog/logging.h>

#include "fit/cholesky.h"
#include "fit/joint_projection.h"
#include "fit/tiny_descent.h"

namespace {

constexpr double SETTLED = 5e-7; /* as fit/solve_tiny.cc: what such a step leaves is smaller by two orders */
constexpr int RUNS_MAX = 4;
constexpr int ROUNDS_MAX = 12; /* of holding and letting go */

enum outcome { SETTLED_INSIDE, MET_BOUND, FAILED };

/* The projected problem for TinySolver, over the shared coordinates that no bound holds. */
class Search : public TinyDescent {
  public:
    Search(Projection *projection, const struct problem *p, double *x)
        : projection_(projection), p_(p), shared_(projection->shared()), x_(x) {
        choose();
    }
    bool visit(const double *x) override;
    /* Down to where nothing moves, or a step leads out; x is there. */
    enum outcome run();
    /* Puts those that the last step led out on their bounds. */
    void hold();
    /* Frees the one on a bound from which the cost falls fastest inwards; false where there is none. */
    bool release();

  private:
    void choose();
    bool inside(const double *x);
    double low(int j) const {
        return p_->low[projection_->column(j)];
    }
    double high(int j) const {
        return p_->high[projection_->column(j)];
    }
    enum outcome last_step(double *size);

    Projection *projection_;
    const struct problem *p_;
    int shared_, free_[COORDINATES_MAX];
    bool held_[COORDINATES_MAX] = {};
    double *x_,
        led_[COORDINATES_MAX]; /* all shared coordinates; where the last step that left the bounds led */
    double gradient_[COORDINATES_MAX]; /* of all */
    bool begun_ = false, left_ = false;
};

void Search::choose() {
    k_ = 0;
    begun_ = left_ = false;
    trouble = nullptr;
    for (int j = 0; j < shared_; j++) {
        if (!held_[j]) {
            free_[k_++] = j;
        }
    }
}

bool Search::inside(const double *x) {
    bool in = true;
    for (int a = 0; a < k_; a++) {
        in = in && x[a] >= low(free_[a]) && x[a] <= high(free_[a]);
    }
    for (int a = 0; a < k_ && !in; a++) {
        led_[a] = x[a];
    }
    left_ = !in;
    return in;
}

bool Search::visit(const double *x) {
    double full[COORDINATES_MAX], normal[COORDINATES_MAX * COORDINATES_MAX];
    if (begun_ && std::equal(x, x + k_, now_.x)) {
        return true;
    }
    if (!inside(x)) {
        trouble = "a step met a bound";
        return false;
    }
    std::copy(x_, x_ + shared_, full);
    for (int a = 0; a < k_; a++) {
        full[free_[a]] = now_.x[a] = x[a];
    }
    begun_ = projection_->evaluate(full, &now_.chi2, gradient_, normal);
    now_.factored = false;
    for (int a = 0; a < k_; a++) {
        now_.g[a] = gradient_[free_[a]];
        for (int b = 0; b < k_; b++) {
            now_.m[a * k_ + b] = normal[free_[a] * shared_ + free_[b]];
        }
    }
    trouble = begun_ ? nullptr : "the cost could not be evaluated";
    return begun_;
}

/* The step that TinySolver declines to take, from where it was last. */
enum outcome Search::last_step(double *size) {
    double x[COORDINATES_MAX] = {};
    *size = 0;
    if (k_ > 0 && !well_conditioned()) {
        return FAILED;
    }
    if (k_ > 0) {
        cholesky_solve(k_, now_.l, now_.g, x);
    }
    for (int a = 0; a < k_; a++) {
        *size = std::max(*size, std::fabs(x[a]));
        x[a] = now_.x[a] - x[a];
    }
    if (!inside(x)) {
        return MET_BOUND;
    }
    for (int a = 0; a < k_; a++) {
        x_[free_[a]] = x[a];
    }
    return SETTLED_INSIDE;
}

enum outcome Search::run() {
    double x[COORDINATES_MAX], size = INFINITY;
    enum outcome out = FAILED;
    for (int i = 0; i < RUNS_MAX && !(size <= SETTLED); i++) {
        for (int a = 0; a < k_; a++) {
            x[a] = x_[free_[a]];
        }
        if (!visit(x)) {
            return FAILED;
        }
        if (k_ > 0) {
            descend(x, SETTLED, TINY_RADIUS);
        }
        for (int a = 0; a < k_; a++) {
            x_[free_[a]] = x[a];
        }
        if (trouble) {
            return left_ ? MET_BOUND : FAILED;
        }
        out = visit(x) ? last_step(&size) : FAILED;
        if (out != SETTLED_INSIDE) {
            return out;
        }
    }
    return size <= SETTLED ? out : FAILED;
}

void Search::hold() {
    for (int a = 0; a < k_; a++) {
        const int j = free_[a];
        if (led_[a] < low(j) || led_[a] > high(j)) {
            x_[j] = led_[a] < low(j) ? low(j) : high(j);
            held_[j] = true;
        }
    }
    choose();
}

bool Search::release() {
    int steepest = -1;
    for (int j = 0; j < shared_; j++) {
        const bool inwards = held_[j] && (x_[j] <= low(j) ? gradient_[j] < 0 : gradient_[j] > 0);
        if (inwards && (steepest < 0 || std::fabs(gradient_[j]) > std::fabs(gradient_[steepest]))) {
            steepest = j;
        }
    }
    if (steepest >= 0) {
        held_[steepest] = false;
        choose();
    }
    return steepest >= 0;
}

/* Settled inside, and against the bounds that hold; false where a solver with bounds of its own should go on from x. */
bool settle(Projection *projection, const struct problem *p, double *x) {
    Search search(projection, p, x);
    for (int round = 0; round < ROUNDS_MAX; round++) {
        const enum outcome out = search.run();
        if (out == FAILED || (out == SETTLED_INSIDE && !search.release())) {
            return out != FAILED;
        }
        if (out == MET_BOUND) {
            search.hold();
        }
    }
    return false;
}

using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Columns = Eigen::MatrixXd;

/* The projected problem for Ceres: k residuals that carry gradient and normal matrix, one that carries what no step can
 * take away. */
class Outer : public ceres::CostFunction {
  public:
    explicit Outer(Projection *projection) : projection_(projection) {
        set_num_residuals(projection->shared() + 1);
        mutable_parameter_block_sizes()->assign(1, projection->shared());
    }

    bool Evaluate(double const *const *x, double *residuals, double **jacobians) const override {
        const int k = projection_->shared();
        double cost;
        std::fill(residuals, residuals + k + 1, 0.0);
        if (!jacobians || !jacobians[0]) {
            const bool fine = projection_->evaluate(x[0], &cost, nullptr, nullptr);
            residuals[k] = std::sqrt(cost);
            return fine;
        }
        double g[COORDINATES_MAX], m[COORDINATES_MAX * COORDINATES_MAX];
        if (!projection_->evaluate(x[0], &cost, g, m)) {
            return false;
        }
        const Eigen::Map<const Eigen::VectorXd> gradient(g, k);
        const Columns normal = Eigen::Map<const Columns>(m, k, k);
        Eigen::SelfAdjointEigenSolver<Columns> eigen(normal);
        Eigen::Map<Rows> j(jacobians[0], k + 1, k);
        j.setZero();
        const double least = 1e-24 * std::max(eigen.eigenvalues()(k - 1), 0.0);
        double rest = cost;
        for (int i = 0; i < k; i++) {
            const double value = eigen.eigenvalues()(i);
            if (value > least) {
                j.row(i) = std::sqrt(value) * eigen.eigenvectors().col(i).transpose();
                residuals[i] = eigen.eigenvectors().col(i).dot(gradient) / std::sqrt(value);
                rest -= residuals[i] * residuals[i];
            }
        }
        residuals[k] = std::sqrt(std::max(rest, 0.0));
        return true;
    }

  private:
    Projection *projection_;
};

ceres::Solver::Options make_options() {
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_QR;
    options.logging_type = ceres::SILENT;
    options.max_num_iterations = 200;
    options.function_tolerance = 1e-14; /* as solve.cc */
    options.gradient_tolerance = 1e-12;
    options.parameter_tolerance = 1e-10;
    return options;
}

/* From x on, inside the bounds. */
int go_on(Projection *projection, const struct joint_data *d, std::vector<double> &x,
          struct joint_solution *out, struct err *e) {
    const int k = projection->shared();
    ceres::Problem::Options ownership;
    ownership.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    ceres::Problem problem(ownership);
    Outer outer(projection);
    problem.AddResidualBlock(&outer, nullptr, x.data());
    for (int j = 0; j < k; j++) {
        const int c = projection->column(j);
        problem.SetParameterLowerBound(x.data(), j, d->p->low[c]);
        problem.SetParameterUpperBound(x.data(), j, d->p->high[c]);
    }
    ceres::Solver::Summary summary;
    ceres::Solve(make_options(), &problem, &summary);
    if (summary.termination_type == ceres::FAILURE) {
        return err_set(e, ERR_FIT, "the joint fit failed: %s", summary.message.c_str());
    }
    out->converged = summary.termination_type == ceres::CONVERGENCE;
    return 0;
}

int minimise(Projection *projection, const struct joint_data *d, struct joint_solution *out, struct err *e) {
    std::vector<double> x(projection->shared());
    for (int j = 0; j < projection->shared(); j++) {
        const int c = projection->column(j);
        x[j] = std::min(std::max(projection->start(j), d->p->low[c]), d->p->high[c]);
    }
    out->converged = settle(projection, d->p, x.data());
    int status = out->converged ? 0 : go_on(projection, d, x, out, e);
    if (status) {
        return status;
    }
    return projection->evaluate(x.data(), &out->chi2, nullptr, nullptr)
               ? 0
               : err_set(e, ERR_FIT, "the joint fit failed: its cost is no number");
}

int run(const struct joint_data *d, const double *start, bool per_band, struct joint_solution *out,
        double *model, struct err *e) {
    Projection projection(d, start, per_band);
    int status = projection.init(e);
    if (!status && projection.shared() > 0) {
        status = minimise(&projection, d, out, e);
    } else if (!status) { /* Lambert's surface: each band for itself */
        out->converged = projection.evaluate(nullptr, &out->chi2, nullptr, nullptr);
    }
    if (!status) {
        projection.report(out, model);
    }
    return status;
}

} // namespace

int joint_solve(const struct joint_data *d, const double *start, bool beta_prime_per_band,
                struct joint_solution *solution, double *model, struct err *e) {
    *solution = {};
    FLAGS_minloglevel = google::GLOG_FATAL;
    if (d->n_bands == 0 ||
        !std::all_of(start + 1, start + d->p->k, [](double x) { return std::isfinite(x); })) {
        return err_set(e, ERR_FIT, "a joint fit needs bands, and a start that is a number");
    }
    try {
        return run(d, start, beta_prime_per_band, solution, model, e);
    } catch (const std::bad_alloc &) {
        return err_set(e, ERR_NOMEM, "no memory for a joint fit of %zu values", d->n_values);
    } catch (const std::exception &x) {
        return err_set(e, ERR_FIT, "the joint fit failed: %s", x.what());
    }
}
