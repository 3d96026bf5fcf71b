#include "fit/solve.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <new>

#include <ceres/version.h>

#include "fit/solve_bounded.h"
#include "fit/solve_tiny.h"
#include "fit/normal_equations.h"

namespace {

int take_start(const struct problem *p, const double *start, const bool *held, struct solve_result *result,
               struct err *e) {
    double x[COORDINATES_MAX];
    std::copy(start, start + p->k, x); /* start may be result->x */
    *result = {};
    for (int j = 0; j < p->k; j++) {
        if (!std::isfinite(x[j])) {
            return err_set(e, ERR_FIT,
                           "the start of the fit is not a number; the points do not resemble a surface");
        }
        const bool fixed = held && held[j];
        result->x[j] = fixed ? x[j] : std::min(std::max(x[j], p->low[j]), p->high[j]);
    }
    return p->n ? 0 : err_set(e, ERR_FIT, "nothing to fit: there are no points");
}

bool all_of(const struct problem *p, const bool *held) {
    return std::all_of(held, held + p->k, [](bool h) { return h; });
}

/* Nothing to search for: the cost where it is held. */
void evaluate_held(const struct problem *p, struct solve_result *result) {
    struct normal_equations s;
    result->chi2 = normal_equations_form(p, result->x, &s, nullptr) ? NAN : s.chi2;
    result->converged = true;
}

/* Those held, and those that stand on a bound; false where none of these does. */
bool find_active(const struct problem *p, const bool *held, const double *x, bool *active) {
    bool any = false;
    for (int j = 0; j < p->k; j++) {
        const bool fixed = held && held[j], on = x[j] <= p->low[j] || x[j] >= p->high[j];
        active[j] = fixed || on;
        any = any || (on && !fixed);
    }
    return any;
}

/* Whether the cost would rise from each of the bounds inwards. */
bool bounds_hold(const struct problem *p, const bool *held, const double *x) {
    struct normal_equations s;
    if (normal_equations_form(p, x, &s, nullptr)) {
        return false;
    }
    for (int j = 0; j < p->k; j++) {
        const bool fixed = held && held[j];
        if (!fixed && ((x[j] <= p->low[j] && s.jtr[j] < 0) || (x[j] >= p->high[j] && s.jtr[j] > 0))) {
            return false;
        }
    }
    return true;
}

/* With a coordinate on its bound Solver creeps, and may stop 0.1 of chi-square short: its steps are those of the
 * free problem, cut off. So the others are settled by themselves, and the bound is let go where the cost wants it. */
int solve_inside(const struct problem *p, const bool *held, bool normal_equations,
                 struct solve_result *result, struct estimate_trace *trace, struct err *e) {
    bool active[COORDINATES_MAX];
    for (int round = 0; round <= p->k; round++) {
        int status = solve_bounded(p, held, normal_equations, result, trace, e);
        if (status || !find_active(p, held, result->x, active) || all_of(p, active)) {
            return status;
        }
        struct solve_result rest = *result;
        const char *why = solve_tiny(p, active, &rest, trace);
        if (!(rest.chi2 <= result->chi2)) {
            return 0;
        }
        rest.last.n = 0;
        rest.handed_over = result->handed_over;
        rest.converged = rest.converged || result->converged;
        *result = rest;
        if (!why && bounds_hold(p, held, result->x)) {
            return 0;
        }
    }
    return 0;
}

int minimise(enum solve_method method, const struct problem *p, const bool *held, struct solve_result *result,
             struct estimate_trace *trace, struct err *e) {
    if (held && all_of(p, held)) {
        evaluate_held(p, result);
        return 0;
    }
    if (method == SOLVE_TINY) {
        result->handed_over = solve_tiny(p, held, result, trace);
        if (!result->handed_over) {
            return 0;
        }
    }
    result->last.n = 0;
    return solve_inside(p, held, method == SOLVE_CHOLESKY, result, trace, e);
}

} // namespace

namespace {

/* known: all points' sums at the start, or NULL. */
int attempt(enum solve_method method, const struct problem *p, const double *start, const bool *held,
            const struct solve_pass *known, struct solve_result *result, struct estimate_trace *trace,
            struct err *e) {
    try {
        int status = take_start(p, start, held, result, e);
        if (status) {
            return status;
        }
        if (known) {
            result->last = *known;
        }
        if ((status = minimise(method, p, held, result, trace, e))) {
            return status;
        }
        return std::isfinite(result->chi2) ? 0
                                           : err_set(e, ERR_FIT, "the solver failed: its cost is no number");
    } catch (const std::bad_alloc &) {
        return err_set(e, ERR_NOMEM, "no memory for a fit of %zu points", p->n);
    } catch (const std::exception &x) {
        return err_set(e, ERR_FIT, "the solver failed: %s", x.what());
    }
}

} // namespace

int solve_by(enum solve_method method, const struct problem *p, const double *start, const bool *held,
             struct solve_result *result, struct estimate_trace *trace, struct err *e) {
    return attempt(method, p, start, held, nullptr, result, trace, e);
}

int solve_more(const struct problem *p, const struct solve_pass *before, struct solve_result *result,
               struct err *e) {
    struct solve_pass known = *before;
    if (known.n == 0 || known.n > p->n || p->nuisance.m > 0 ||
        normal_equations_add(p, known.x, known.n, &known.sums, nullptr)) {
        return solve_run(p, result->x, nullptr, result, nullptr, e);
    }
    known.n = p->n;
    return attempt(SOLVE_TINY, p, known.x, nullptr, &known, result, nullptr, e);
}

int solve_run(const struct problem *p, const double *start, const bool *held, struct solve_result *result,
              struct estimate_trace *trace, struct err *e) {
    return solve_by(SOLVE_TINY, p, start, held, result, trace, e);
}

const char *solve_name(enum solve_method method) {
    static const char *const name[] = {
        "Ceres " CERES_VERSION_STRING " TinySolver; Solver with dense QR where a step meets a bound",
        "Ceres " CERES_VERSION_STRING " Solver, Levenberg-Marquardt, dense QR",
        "Ceres " CERES_VERSION_STRING " Solver, Levenberg-Marquardt, normal equations"};
    return name[method];
}
