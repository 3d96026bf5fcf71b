#include "fit/solve_tiny.h"

#include <algorithm>
#include <cmath>

#include "fit/cholesky.h"
#include "fit/curvature.h"
#include "fit/stopwatch.h"
#include "fit/normal_equations.h"
#include "fit/tiny_descent.h"

namespace {

/* The last step, in logarithms of parameters. By Gauss and Newton, and a secant, what it leaves is smaller by two orders
 * and more; by Newton alone it goes as the square, about once that, where a surface can be told from its points. */
constexpr double SETTLED = 5e-7, SETTLED_NEWTON = 1e-5;
constexpr double NEAR = 5e-4; /* farther apart, two gradients are no second derivative */
constexpr double CURVED =
    5e-3; /* a pass after a step below it may be the last, and asks for second derivatives */
constexpr double NEAR_RADIUS = 1e10; /* of the trust region; TinySolver's 1e4 leaves 1e-3 of a step undone */
constexpr int RUNS_MAX =
    4; /* a run from afar ends by its coarse tolerances and is followed by one from there */

/* The passes of one minimisation: at a point x of the coordinates that are free. */
class Search : public TinyDescent {
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
    bool visit(const double *x) override;
    /* The last pass once more, with its second derivatives, if it lacks them. */
    bool sharpen();
    void leave(struct solve_pass *last) const;
    /* From the end of a fit of nearly the same points. */
    bool begun_near() const {
        return begun_near_ && passes == 0;
    }
    /* What a last step may be. */
    double settled() const {
        return curved_ ? SETTLED_NEWTON : SETTLED;
    }
    double may_settle() const {
        return can_curve_ ? SETTLED_NEWTON : SETTLED;
    }
    bool newton(double *step, double *gain) const;
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

    int passes = 0;

  private:
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
    int column_[COORDINATES_MAX], places_ = 0;
    double before_us_, begun_us_;
    bool curved_ = false;
    double second_[COORDINATES_MAX * COORDINATES_MAX]; /* what J^T J lacks, where curved */
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
    now_.factored = curved_ = false;
    for (int a = 0; a < k_; a++) {
        now_.g[a] = s.jtr[column_[a]];
        for (int b = 0; b < k_; b++) {
            now_.m[a * k_ + b] = s.jtj[column_[a] * p_->k + column_[b]];
        }
    }
}

void Search::take_curvature(const double *second) {
    curved_ = true;
    for (int a = 0; a < k_; a++) {
        for (int b = 0; b < k_; b++) {
            second_[a * k_ + b] = second[column_[a] * p_->k + column_[b]];
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
    if (curved_ || !can_curve_) {
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
    for (int a = 0; a < k_ * k_ && curved_; a++) {
        m[a] = now_.m[a] + second_[a];
    }
    if (curved_ && cholesky_factor(k_, m, l)) {
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
    search->descend(x, search->may_settle(), search->begun_near() ? NEAR_RADIUS : TINY_RADIUS);
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
