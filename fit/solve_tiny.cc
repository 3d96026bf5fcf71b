#include "fit/solve_tiny.h"

#include <algorithm>
#include <cmath>

#include <ceres/tiny_solver.h>

#include "fit/cholesky.h"
#include "fit/stopwatch.h"
#include "fit/normal_equations.h"

namespace {

/* The square of it is what the normal equations lose: half of a double's digits, and beyond it the decisive ones. */
constexpr double CONDITION_MAX = 1e6;
/* Newton's last step, in logarithms of parameters: what it leaves is smaller by two orders and more. */
constexpr double SETTLED = 5e-7;
constexpr double NEAR = 5e-4; /* farther apart, two gradients are no second derivative */
/* Below it the cost's change is rounding. TinySolver takes absolute tolerances: those of where it starts. */
constexpr double FLAT = 1e-14;
constexpr int RUNS_MAX =
    4; /* a run from afar ends by its coarse tolerances and is followed by one from there */
constexpr int ITERATIONS_MAX = 50;

/* The passes of one minimisation: at a point x of the coordinates that are free. */
class Search {
  public:
    Search(const struct problem *p, const bool *held, double *full, struct estimate_trace *trace)
        : p_(p), full_(full), trace_(trace) {
        for (int j = 0; j < p->k; j++) {
            if (!held || !held[j]) {
                column_[k_++] = j;
            }
        }
        before_us_ = trace && trace->n ? trace->step[trace->n - 1].t_us : 0;
        begun_us_ = trace ? 1e6 * stopwatch_s() : 0;
    }

    bool inside(const double *x) const;
    /* The pass at x, done or found done; false with a reason in trouble. */
    bool visit(const double *x);
    bool factor(double *l, double *y) const;
    bool newton(double *step, double *gain) const;
    double condition() const;
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
    };
    void gather(const struct normal_equations &s);
    void add_secant(double *m) const;

    const struct problem *p_;
    double *full_;
    struct estimate_trace *trace_;
    int k_ = 0, column_[COORDINATES_MAX];
    double before_us_, begun_us_;
    struct place now_, before_; /* the last pass, and the one before it */
};

bool Search::inside(const double *x) const {
    for (int a = 0; a < k_; a++) {
        if (!(x[a] >= p_->low[column_[a]] && x[a] <= p_->high[column_[a]])) {
            return false;
        }
    }
    return true;
}

void Search::gather(const struct normal_equations &s) {
    now_.chi2 = s.chi2;
    for (int a = 0; a < k_; a++) {
        now_.g[a] = s.jtr[column_[a]];
        for (int b = 0; b < k_; b++) {
            now_.m[a * k_ + b] = s.jtj[column_[a] * p_->k + column_[b]];
        }
    }
}

bool Search::visit(const double *x) {
    if (passes > 0 && std::equal(x, x + k_, now_.x)) {
        return true;
    }
    double point[COORDINATES_MAX];
    struct normal_equations s;
    if (!inside(x)) {
        trouble = "a step met a bound";
        return false;
    }
    std::copy(full_, full_ + p_->k, point);
    for (int a = 0; a < k_; a++) {
        point[column_[a]] = x[a];
    }
    if (normal_equations_form(p_, point, &s, nullptr)) {
        trouble = "the cost could not be evaluated";
        return false;
    }
    before_ = now_;
    passes++;
    gather(s);
    std::copy(x, x + k_, now_.x);
    if (trace_ && trace_->n < ESTIMATE_TRACE_MAX) {
        struct estimate_step *step = &trace_->step[trace_->n++];
        *step = {before_us_ + 1e6 * stopwatch_s() - begun_us_, s.chi2 / 2, {}};
        std::copy(point, point + p_->k, step->x);
    }
    return true;
}

/* R^T = l and y = R^-T J^T r of the last pass. */
bool Search::factor(double *l, double *y) const {
    const bool regular = cholesky_factor(k_, now_.m, l);
    if (regular) {
        cholesky_lower(k_, l, now_.g, y);
    }
    return regular;
}

double Search::condition() const {
    return std::sqrt(cholesky_condition(k_, now_.m));
}

/* The second derivatives that J^T J lacks, along the last step, from its two gradients (a BFGS update, as NL2SOL's). */
void Search::add_secant(double *m) const {
    double s[COORDINATES_MAX], y[COORDINATES_MAX], ms[COORDINATES_MAX] = {}, ys = 0, sms = 0;
    bool far = false;
    for (int a = 0; a < k_; a++) {
        s[a] = now_.x[a] - before_.x[a];
        y[a] = now_.g[a] - before_.g[a];
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

/* Newton's step from the last pass; gain is what it takes off chi-square. */
bool Search::newton(double *step, double *gain) const {
    double m[COORDINATES_MAX * COORDINATES_MAX], l[COORDINATES_MAX * COORDINATES_MAX];
    std::copy(now_.m, now_.m + k_ * k_, m);
    if (passes > 1) {
        add_secant(m);
    }
    if (!cholesky_factor(k_, m, l)) {
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
        double l[COORDINATES_MAX * COORDINATES_MAX], rest = search->chi2();
        const int k = search->k();
        if (!search->factor(l, residuals)) { /* no slope: the solver ends here */
            search->trouble = "the normal equations are singular";
            std::fill(residuals, residuals + K + 1, 0.0);
            return;
        }
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
    solver.options.parameter_tolerance = SETTLED / (v.norm() + SETTLED);
    solver.options.function_tolerance = FLAT * search->chi2();
    solver.Solve(f, &v);
    std::copy(v.data(), v.data() + search->k(), x);
}

/* TinySolver from where x stands, then the step it declines to take. *size is that step's. */
const char *run_once(Search *search, double *size, double *chi2) {
    double x[COORDINATES_MAX], step[COORDINATES_MAX], gain = 0;
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
    if (!(search->condition() < CONDITION_MAX) || !search->newton(step, &gain)) {
        return "the condition of the Jacobian is above 1e6";
    }
    *size = 0;
    for (int a = 0; a < search->k(); a++) {
        *size = std::max(*size, std::fabs(step[a]));
        x[a] += step[a];
    }
    if (!search->inside(x)) {
        return "a step met a bound";
    }
    if (*size <= SETTLED) {
        search->put(x);
        *chi2 = std::max(0.0, *chi2 - gain);
    }
    return nullptr;
}

} // namespace

const char *solve_tiny(const struct problem *p, const bool *held, struct solve_result *result,
                       struct estimate_trace *trace) {
    Search search(p, held, result->x, trace);
    double size = INFINITY;
    const char *why = nullptr;
    for (int i = 0; i < RUNS_MAX && !why && !(size <= SETTLED); i++) {
        why = run_once(&search, &size, &result->chi2);
    }
    result->iterations += search.passes;
    result->converged = !why && size <= SETTLED;
    return why || result->converged ? why : "it did not settle";
}
