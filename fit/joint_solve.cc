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

#include "fit/joint_shape.h"

namespace {

using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Columns = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

constexpr int INNER_STEPS = 12;     /* the quadratic part is a few per cent: four reach the last bits */
constexpr double INNER_END = 1e-15; /* relative step */

/* A column of the Jacobian of a band, as a combination of the shape's functions. */
struct Combination {
    int function[3];
    double factor[3];
    int count;

    void add(int f, double x) {
        if (f >= 0) {
            function[count] = f;
            factor[count++] = x;
        }
    }
};

/* Sums over points of w f_a f_b for every band: row b, column at(a, b). */
class Moments {
  public:
    explicit Moments(int functions) : functions_(functions) {
    }
    static int at(int a, int b) {
        return a < b ? b * (b + 1) / 2 + a : a * (a + 1) / 2 + b;
    }
    void take(const Eigen::Map<const Rows> &weight, const Eigen::Map<const Columns> &f) {
        Columns product(f.rows(), functions_ * (functions_ + 1) / 2);
        for (int a = 0; a < functions_; a++) {
            for (int b = 0; b <= a; b++) {
                product.col(at(a, b)) = f.col(a).cwiseProduct(f.col(b));
            }
        }
        sums_.noalias() = weight * product;
    }
    double operator()(int band, int a, int b) const {
        return sums_(band, at(a, b));
    }
    double dot(int band, const Combination &x, const Combination &y) const {
        double sum = 0;
        for (int i = 0; i < x.count; i++) {
            for (int j = 0; j < y.count; j++) {
                sum += x.factor[i] * y.factor[j] * sums_(band, at(x.function[i], y.function[j]));
            }
        }
        return sum;
    }

  private:
    int functions_;
    Columns sums_;
};

class Projection {
  public:
    Projection(const struct joint_data *d, const double *start, bool per_band)
        : d_(d), per_band_(per_band), weight_(d->weight, d->n_bands, d->n), beta_(d->beta, d->n_bands, d->n),
          weighted_beta_(weight_.cwiseProduct(beta_)), s_(Vector::Constant(d->n_bands, 0.1)),
          t_(Vector::Ones(d->n_bands)) {
        std::copy(start, start + d->p->k, x_);
    }
    ~Projection() {
        joint_shape_free(&shape_);
    }
    Projection(const Projection &) = delete;
    Projection &operator=(const Projection &) = delete;

    int init(struct err *e);
    int shared() const {
        return shape_.k;
    }
    int column(int j) const {
        return shape_.column[j];
    }
    double start(int j) const {
        return x_[column(j)];
    }
    /* Cost is the sum of squares, gradient and normal those of half of it, over the shared coordinates. */
    bool evaluate(const double *x, double *cost, Vector *gradient, Columns *normal);
    void report(struct joint_solution *out, double *model) const;

  private:
    void solve_inside(const Moments &m, const Columns &pulled, int band);
    double take_residuals();
    void project(const Moments &m, const Columns &pulled, int band, Vector *gradient, Columns *normal) const;

    const struct joint_data *d_;
    bool per_band_;
    Eigen::Map<const Rows> weight_, beta_;
    Rows weighted_beta_, residual_;
    struct joint_shape shape_ = {};
    double x_[COORDINATES_MAX] = {};
    Vector s_, t_;
    int evaluations_ = 0;
};

int Projection::init(struct err *e) {
    bool held[COORDINATES_MAX] = {};
    for (int c = 0; c < d_->p->k; c++) {
        held[c] = per_band_ && reflectance_parameter(d_->p->model, c) == MATERIAL_BETA_PRIME;
    }
    residual_.resize(d_->n_bands, static_cast<Eigen::Index>(d_->n));
    return joint_shape_init(&shape_, d_->p, held, e);
}

/* Gauss-Newton for S, and for t where it is free, on the moments alone. */
void Projection::solve_inside(const Moments &m, const Columns &pulled, int band) {
    double s = s_(band), t = t_(band);
    for (int step = 0; step < INNER_STEPS; step++) {
        double off[3];
        for (int f = 0; f < 3; f++) {
            off[f] = m(band, f, JOINT_L1) * s + m(band, f, JOINT_L2) * s * s + m(band, f, JOINT_P) * t -
                     pulled(band, f);
        }
        const double g = off[JOINT_L1] + 2 * s * off[JOINT_L2];
        const double h = m(band, JOINT_L1, JOINT_L1) + 4 * s * m(band, JOINT_L1, JOINT_L2) +
                         4 * s * s * m(band, JOINT_L2, JOINT_L2);
        const double cross = m(band, JOINT_L1, JOINT_P) + 2 * s * m(band, JOINT_L2, JOINT_P);
        const double hp = m(band, JOINT_P, JOINT_P), det = h * hp - cross * cross;
        double ds = g / h, dt = 0;
        if (per_band_ && det > 1e-12 * h * hp) {
            ds = (hp * g - cross * off[JOINT_P]) / det;
            dt = (h * off[JOINT_P] - cross * g) / det;
        }
        s -= ds;
        t -= dt;
        if (std::fabs(ds) <= INNER_END * std::fabs(s) && std::fabs(dt) <= INNER_END * std::fabs(t)) {
            break;
        }
    }
    s_(band) = s;
    t_(band) = t;
}

double Projection::take_residuals() {
    Eigen::Map<const Columns> f(shape_.f, static_cast<Eigen::Index>(shape_.n), shape_.functions);
    double cost = 0;
    for (int b = 0; b < d_->n_bands; b++) {
        const double s = s_(b), s2 = s * s, t = t_(b);
        auto r = (s * f.col(JOINT_L1) + s2 * f.col(JOINT_L2) + t * f.col(JOINT_P)).transpose() - beta_.row(b);
        residual_.row(b) = r.cwiseProduct(weight_.row(b));
        cost += residual_.row(b).dot(r);
    }
    return cost;
}

/* One band's part of the outer problem: its normal block less what S and t take up. */
void Projection::project(const Moments &m, const Columns &pulled, int band, Vector *gradient,
                         Columns *normal) const {
    const int k = shape_.k, inner = per_band_ ? 2 : 1;
    const double s = s_(band), t = t_(band);
    Combination outer[COORDINATES_MAX] = {}, own[2] = {};
    for (int j = 0; j < k; j++) {
        outer[j].add(shape_.l1[j], s);
        outer[j].add(shape_.l2[j], s * s);
        outer[j].add(shape_.specular[j], t);
    }
    own[0].add(JOINT_L1, 1);
    own[0].add(JOINT_L2, 2 * s);
    own[1].add(JOINT_P, 1);
    Eigen::Matrix2d block = Eigen::Matrix2d::Identity();
    Eigen::Matrix<double, 2, COORDINATES_MAX> cross = Eigen::Matrix<double, 2, COORDINATES_MAX>::Zero();
    for (int a = 0; a < inner; a++) {
        for (int b = 0; b < inner; b++) {
            block(a, b) = m.dot(band, own[a], own[b]);
        }
        for (int j = 0; j < k; j++) {
            cross(a, j) = m.dot(band, own[a], outer[j]);
        }
    }
    if (block.determinant() <= 1e-12 * block(0, 0) * block(1, 1)) { /* no lobe in this band: t stays */
        block(0, 1) = block(1, 0) = 0;
        block(1, 1) = 1;
        cross.row(1).setZero();
    }
    const auto taken = (block.inverse() * cross).eval();
    for (int j = 0; j < k; j++) {
        for (int i = 0; i < outer[j].count; i++) {
            (*gradient)(j) += outer[j].factor[i] * pulled(band, outer[j].function[i]);
        }
        for (int i = 0; i <= j; i++) {
            const double sum = m.dot(band, outer[i], outer[j]) - cross.col(i).dot(taken.col(j));
            (*normal)(i, j) += sum;
            (*normal)(j, i) += i == j ? 0 : sum;
        }
    }
}

bool Projection::evaluate(const double *x, double *cost, Vector *gradient, Columns *normal) {
    for (int j = 0; j < shape_.k; j++) {
        x_[shape_.column[j]] = x[j];
    }
    if (joint_shape_at(&shape_, x_, nullptr)) {
        return false;
    }
    evaluations_++;
    Eigen::Map<const Columns> f(shape_.f, static_cast<Eigen::Index>(shape_.n), shape_.functions);
    Moments moments(normal ? shape_.functions : JOINT_P + 1);
    moments.take(weight_, f);
    Columns pulled = weighted_beta_ * f.leftCols(JOINT_P + 1);
    for (int b = 0; b < d_->n_bands; b++) {
        solve_inside(moments, pulled, b);
    }
    *cost = take_residuals();
    if (normal) {
        pulled.noalias() = residual_ * f;
        gradient->setZero(shape_.k);
        normal->setZero(shape_.k, shape_.k);
        for (int b = 0; b < d_->n_bands; b++) {
            project(moments, pulled, b, gradient, normal);
        }
    }
    return std::isfinite(*cost);
}

void Projection::report(struct joint_solution *out, double *model) const {
    std::copy(x_, x_ + d_->p->k, out->x);
    coordinates_order(d_->p->model, out->x);
    Eigen::Map<const Columns> f(shape_.f, static_cast<Eigen::Index>(shape_.n), shape_.functions);
    for (int b = 0; b < d_->n_bands; b++) {
        out->s[b] = s_(b);
        out->t[b] = t_(b);
        if (model) {
            Vector row = s_(b) * f.col(JOINT_L1) + s_(b) * s_(b) * f.col(JOINT_L2) + t_(b) * f.col(JOINT_P);
            std::copy(row.data(), row.data() + row.size(), model + b * d_->n);
        }
    }
    out->evaluations += evaluations_;
}

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
        Vector gradient;
        Columns normal;
        if (!projection_->evaluate(x[0], &cost, &gradient, &normal)) {
            return false;
        }
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

int minimise(Projection *projection, const struct joint_data *d, struct joint_solution *out, struct err *e) {
    const int k = projection->shared();
    const double *low = d->p->low, *high = d->p->high;
    std::vector<double> x(k);
    ceres::Problem::Options ownership;
    ownership.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    ceres::Problem problem(ownership);
    Outer outer(projection);
    problem.AddResidualBlock(&outer, nullptr, x.data());
    for (int j = 0; j < k; j++) {
        const int c = projection->column(j);
        x[j] = std::min(std::max(projection->start(j), low[c]), high[c]);
        problem.SetParameterLowerBound(x.data(), j, low[c]);
        problem.SetParameterUpperBound(x.data(), j, high[c]);
    }
    ceres::Solver::Summary summary;
    ceres::Solve(make_options(), &problem, &summary);
    if (summary.termination_type == ceres::FAILURE) {
        return err_set(e, ERR_FIT, "the joint fit failed: %s", summary.message.c_str());
    }
    out->converged = summary.termination_type == ceres::CONVERGENCE;
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
