#include "fit/solve_tiny.h"

#include <algorithm>
#include <cmath>

#include <ceres/tiny_solver.h>

#include "fit/cholesky.h"
#include "fit/curvature.h"
#include "fit/stopwatch.h"
#include "fit/normal_equations.h"

namespace {

/* The square of it is what the normal equations lose: half of a double's digits, and beyond it the decisive ones. */
constexpr double CONDITION_MAX = 1e6;
/* The last step, in logarithms of parameters. By Gauss and Newton, and a secant, what it leaves is smaller by two orders
 * and more; by Newton alone it goes as the square, about once that, where a surface can be told from its points. */
constexpr double SETTLED = 5e-7, SETTLED_NEWTON = 1e-5;
constexpr double NEAR = 5e-4; /* farther apart, two gradients are no second derivative */
constexpr double CURVED =
    5e-3; /* a pass after a step below it may be the last, and asks for second derivatives */
constexpr double NEAR_RADIUS = 1e10; /* of the trust region; TinySolver's 1e4 leaves 1e-3 of a step undone */
/* Below it the cost's change is rounding. TinySolver takes absolute tolerances: those of where it starts. */
constexpr double FLAT = 1e-14;
constexpr int RUNS_MAX =
    4; /* a run from afar ends by its coarse tolerances and is followed by one from there */
constexpr int ITERATIONS_MAX = 50;

/* The passes of one minimisation: at a point x of the coordinates that are free. */
class Search {
  public:
    Search(const struct problem *p, const bool *held, struct solve_result *result,
           struct estimate_trace *trace)
        : p_(p), full_(result->x), trace_(trace), can_curve_(curvature_known(p)) {
        for (int j = 0; j < p->k; j++) {
            if (!held || !held[j]) {
                column_[k_++] = j;
            }
        }
        before_us_ = trace && trace->n ? trace->step[trace->n - 1].t_us : 0;
        begun_us_ = trace ? 1e6 * stopwatch_s() : 0;
        if (result->last.n == p->n && k_ == p->k && std::equal(full_, full_ + k_, result->last.x)) {
            take(result->last.sums, full_);
            begun_near_ = true;
        }
    }

    bool inside(const double *x) const;
    /* The pass at x, done or found done; false with a reason in trouble. */
    bool visit(const double *x);
    /* The last pass once more, with its second derivatives, if it lacks them. */
    bool sharpen();
    void leave(struct solve_pass *last) const;
    /* From the end of a fit of nearly the same points. */
    bool begun_near() const {
        return begun_near_ && passes == 0;
    }
    /* What a last step may be. */
    double settled() const {
        return now_.curved ? SETTLED_NEWTON : SETTLED;
    }
    double may_settle() const {
        return can_curve_ ? SETTLED_NEWTON : SETTLED;
    }
    bool factor();
    /* R^-T J^T r of the last pass, which is factored; l is R^T. */
    const double *reduce(double *y) const;
    bool newton(double *step, double *gain) const;
    bool well_conditioned();
    void put(const double *x) {
        for (int a = 0; a < k_; a++) {
            full_[column_[a]] = x[a];
        }
    }
    void get(double *x) const {
        for (int a = 0; a < k_; a++) {
            x[a] = full_[column_[a]];
        }
    }
    int k() const {
        return k_;
    }
    double chi2() const {
        return now_.chi2;
    }

    int passes = 0;
    const char *trouble = nullptr;

  private:
    struct place {
        double x[COORDINATES_MAX], chi2, g[COORDINATES_MAX];
        double m[COORDINATES_MAX * COORDINATES_MAX];
        bool factored;
        double l[COORDINATES_MAX * COORDINATES_MAX]; /* of m, where factored */
        bool curved;
        double second[COORDINATES_MAX * COORDINATES_MAX]; /* what m lacks, where curved */
    };
    bool pass(const double *x, bool curved);
    void take(const struct normal_equations &s, const double *x);
    void take_curvature(const double *second);
    bool near(const double *x, double limit) const;
    bool factor_whole(double *l) const;
    void add_secant(double *m) const;

    const struct problem *p_;
    double *full_;
    struct estimate_trace *trace_;
    bool can_curve_, begun_near_ = false;
    int k_ = 0, column_[COORDINATES_MAX], places_ = 0;
    double before_us_, begun_us_;
    struct place now_; /* the last pass */
    double before_x_[COORDINATES_MAX], before_g_[COORDINATES_MAX];
};

bool Search::inside(const double *x) const {
    for (int a = 0; a < k_; a++) {
        if (!(x[a] >= p_->low[column_[a]] && x[a] <= p_->high[column_[a]])) {
            return false;
        }
    }
    return true;
}

bool Search::near(const double *x, double limit) const {
    for (int a = 0; a < k_; a++) {
        if (!(std::fabs(x[a] - now_.x[a]) < limit)) {
            return false;
        }
    }
    return true;
}

void Search::take(const struct normal_equations &s, const double *x) {
    if (places_++ > 0) {
        std::copy(now_.x, now_.x + k_, before_x_);
        std::copy(now_.g, now_.g + k_, before_g_);
    }
    std::copy(x, x + k_, now_.x);
    now_.chi2 = s.chi2;
    now_.factored = now_.curved = false;
    for (int a = 0; a < k_; a++) {
        now_.g[a] = s.jtr[column_[a]];
        for (int b = 0; b < k_; b++) {
            now_.m[a * k_ + b] = s.jtj[column_[a] * p_->k + column_[b]];
        }
    }
}

void Search::take_curvature(const double *second) {
    now_.curved = true;
    for (int a = 0; a < k_; a++) {
        for (int b = 0; b < k_; b++) {
            now_.second[a * k_ + b] = second[column_[a] * p_->k + column_[b]];
        }
    }
}

bool Search::pass(const double *x, bool curved) {
    double point[COORDINATES_MAX], second[COORDINATES_MAX * COORDINATES_MAX];
    struct normal_equations s;
    std::copy(full_, full_ + p_->k, point);
    for (int a = 0; a < k_; a++) {
        point[column_[a]] = x[a];
    }
    if (curved ? normal_equations_curved(p_, point, &s, second, &curved, nullptr)
               : normal_equations_form(p_, point, &s, nullptr)) {
        trouble = "the cost could not be evaluated";
        return false;
    }
    passes++;
    take(s, x);
    if (curved) {
        take_curvature(second);
    }
    if (trace_ && trace_->n < ESTIMATE_TRACE_MAX) {
        struct estimate_step *step = &trace_->step[trace_->n++];
        *step = {before_us_ + 1e6 * stopwatch_s() - begun_us_, s.chi2 / 2, {}};
        std::copy(point, point + p_->k, step->x);
    }
    return true;
}

bool Search::visit(const double *x) {
    if (places_ > 0 && std::equal(x, x + k_, now_.x)) {
        return true;
    }
    if (!inside(x)) {
        trouble = "a step met a bound";
        return false;
    }
    return pass(x, can_curve_ && places_ > 0 && near(x, CURVED));
}

bool Search::sharpen() {
    double x[COORDINATES_MAX];
    if (now_.curved || !can_curve_) {
        return true;
    }
    std::copy(now_.x, now_.x + k_, x);
    places_ = 0; /* one place: no secant */
    return pass(x, true);
}

void Search::leave(struct solve_pass *last) const {
    last->n = k_ == p_->k && places_ > 0 ? p_->n : 0;
    std::copy(now_.x, now_.x + k_, last->x);
    last->sums.chi2 = now_.chi2;
    std::copy(now_.g, now_.g + k_, last->sums.jtr);
    std::copy(now_.m, now_.m + k_ * k_, last->sums.jtj);
}

bool Search::factor() {
    now_.factored = now_.factored || cholesky_factor(k_, now_.m, now_.l);
    return now_.factored;
}

const double *Search::reduce(double *y) const {
    cholesky_lower(k_, now_.l, now_.g, y);
    return now_.l;
}

/* The Jacobian scaled to columns of length 1. Its determinant answers for most: with k eigenvalues of mean 1 the least of
 * them is above det (1 - 1/k)^(k - 1), that is det / e. */
bool Search::well_conditioned() {
    if (!factor()) {
        return false;
    }
    double determinant = 1;
    for (int a = 0; a < k_; a++) {
        determinant *= now_.l[a * k_ + a] * now_.l[a * k_ + a] / now_.m[a * k_ + a];
    }
    return k_ * M_E < determinant * CONDITION_MAX ||
           std::sqrt(cholesky_condition(k_, now_.m)) < CONDITION_MAX;
}

/* The second derivatives that J^T J lacks, along the last step, from its two gradients (a BFGS update, as NL2SOL's). */
void Search::add_secant(double *m) const {
    double s[COORDINATES_MAX], y[COORDINATES_MAX], ms[COORDINATES_MAX] = {}, ys = 0, sms = 0;
    bool far = false;
    for (int a = 0; a < k_; a++) {
        s[a] = now_.x[a] - before_x_[a];
        y[a] = now_.g[a] - before_g_[a];
    }
    for (int a = 0; a < k_; a++) {
        for (int b = 0; b < k_; b++) {
            ms[a] += m[a * k_ + b] * s[b];
        }
        ys += y[a] * s[a];
        sms += ms[a] * s[a];
        far = far || !(std::fabs(s[a]) < NEAR);
    }
    for (int a = 0; a < k_ * k_ && !far && ys > 0 && sms > 0; a++) {
        m[a] += y[a / k_] * y[a % k_] / ys - ms[a / k_] * ms[a % k_] / sms;
    }
}

/* J^T J with the second derivatives, or the secant in their place where they are not known or make no minimum. */
bool Search::factor_whole(double *l) const {
    double m[COORDINATES_MAX * COORDINATES_MAX];
    for (int a = 0; a < k_ * k_ && now_.curved; a++) {
        m[a] = now_.m[a] + now_.second[a];
    }
    if (now_.curved && cholesky_factor(k_, m, l)) {
        return true;
    }
    std::copy(now_.m, now_.m + k_ * k_, m);
    if (places_ > 1) {
        add_secant(m);
    }
    return cholesky_factor(k_, m, l);
}

/* Newton's step from the last pass; gain is what it takes off chi-square. */
bool Search::newton(double *step, double *gain) const {
    double l[COORDINATES_MAX * COORDINATES_MAX];
    if (!factor_whole(l)) {
        return false;
    }
    cholesky_solve(k_, l, now_.g, step);
    *gain = 0;
    for (int a = 0; a < k_; a++) {
        *gain += step[a] * now_.g[a];
        step[a] = -step[a];
    }
    return std::isfinite(*gain);
}

/* TinySolver's cost function: K columns, of which those beyond the free ones are a unit matrix and stay where they
 * are. A trial that cannot be made gets the present cost, at which the solver ends. */
template <int K> struct Normal {
    using Scalar = double;
    enum { NUM_RESIDUALS = K + 1, NUM_PARAMETERS = K };

    bool operator()(const double *x, double *residuals, double *jacobian) const {
        const bool visited = search->visit(x);
        std::fill(residuals, residuals + K + 1, 0.0);
        if (!jacobian) {
            residuals[K] = std::sqrt(visited ? search->chi2() : taken_chi2);
            return true;
        }
        taken_chi2 = search->chi2();
        std::fill(jacobian, jacobian + K * (K + 1), 0.0);
        reduce(residuals, jacobian);
        return true;
    }

    /* The small problem with the points' J^T J, J^T r and cost. */
    void reduce(double *residuals, double *jacobian) const {
        double rest = search->chi2();
        const int k = search->k();
        if (!search->factor()) { /* no slope: the solver ends here */
            search->trouble = "the normal equations are singular";
            std::fill(residuals, residuals + K + 1, 0.0);
            return;
        }
        const double *l = search->reduce(residuals);
        for (int a = 0; a < K; a++) {
            jacobian[a * (K + 1) + a] = 1;
            for (int b = 0; b <= a && a < k; b++) {
                jacobian[a * (K + 1) + b] = l[a * k + b];
            }
            rest -= residuals[a] * residuals[a];
        }
        residuals[K] = std::sqrt(std::max(0.0, rest));
    }

    Search *search;
    mutable double taken_chi2; /* TinySolver calls through a const reference */
};

template <int K> void go_down(Search *search, double *x) {
    Normal<K> f{search, search->chi2()};
    ceres::TinySolver<Normal<K>> solver;
    typename ceres::TinySolver<Normal<K>>::Parameters v;
    v.setZero();
    std::copy(x, x + search->k(), v.data());
    solver.options.max_num_iterations = ITERATIONS_MAX;
    solver.options.gradient_tolerance = 0;
    solver.options.cost_threshold = 0;
    solver.options.parameter_tolerance = search->may_settle() / (v.norm() + search->may_settle());
    solver.options.function_tolerance = FLAT * search->chi2();
    if (search->begun_near()) { /* the first step is Gauss and Newton's to the digits that count */
        solver.options.initial_trust_region_radius = NEAR_RADIUS;
    }
    solver.Solve(f, &v);
    std::copy(v.data(), v.data() + search->k(), x);
}

/* Newton's step from x, which was visited last; NULL, or why there is none. */
const char *last_step(Search *search, double *x, double *size, double *gain) {
    double step[COORDINATES_MAX];
    if (!search->newton(step, gain)) {
        return "the condition of the Jacobian is above 1e6";
    }
    *size = 0;
    for (int a = 0; a < search->k(); a++) {
        *size = std::max(*size, std::fabs(step[a]));
        x[a] += step[a];
    }
    return search->inside(x) ? nullptr : "a step met a bound";
}

/* TinySolver from where x stands, then the step it declines to take. */
const char *run_once(Search *search, bool *done, double *chi2) {
    double x[COORDINATES_MAX], size, gain = 0;
    search->get(x);
    if (!search->visit(x)) {
        return search->trouble;
    }
    search->k() <= 5 ? go_down<5>(search, x) : go_down<COORDINATES_MAX>(search, x);
    search->put(x);
    if (!search->visit(x)) {
        return search->trouble;
    }
    *chi2 = search->chi2();
    if (search->trouble) {
        return search->trouble;
    }
    if (!search->well_conditioned()) {
        return "the condition of the Jacobian is above 1e6";
    }
    const char *why = last_step(search, x, &size, &gain);
    if (!why && size > search->settled() && size <= search->may_settle()) {
        search->get(x);
        why = search->sharpen() ? last_step(search, x, &size, &gain) : search->trouble;
    }
    *done = !why && size <= search->settled();
    if (*done) {
        search->put(x);
        *chi2 = std::max(0.0, *chi2 - gain);
    }
    return why;
}

} // namespace

const char *solve_tiny(const struct problem *p, const bool *held, struct solve_result *result,
                       struct estimate_trace *trace) {
    Search search(p, held, result, trace);
    bool done = false;
    const char *why = nullptr;
    for (int i = 0; i < RUNS_MAX && !why && !done; i++) {
        why = run_once(&search, &done, &result->chi2);
    }
    search.leave(&result->last);
    result->iterations += search.passes;
    result->converged = done;
    return why || done ? why : "it did not settle";
}
