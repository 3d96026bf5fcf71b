#include "fit/limit.h"

#include <math.h>
#include <string.h>

#define RISE_95 2.7055434540954146 /* 1.6448536^2 */

struct walk {
    const struct problem *p;
    int column;
    double ceiling;         /* chi2 at the limit */
    struct solve_result at; /* warm start of the next fit */
};

/* chi2 with the parameter held at x, relative to the ceiling. */
static int excess(struct walk *w, double x, double *over, struct err *e) {
    bool held[COORDINATES_MAX] = {false};
    struct solve_result next;
    held[w->column] = true;
    w->at.x[w->column] = x;
    int status = solve_run(w->p, w->at.x, held, &next, NULL, e);
    if (!status) {
        w->at = next;
        *over = next.chi2 - w->ceiling;
    }
    return status;
}

int limit_find(const struct problem *p, const struct solve_result *best, int column, double scale,
               double *at_limit, bool *found, struct err *e) {
    double over = 0;
    bool from_low = fabs(best->x[column] - p->low[column]) < fabs(best->x[column] - p->high[column]);
    double inner = best->x[column], far = from_low ? p->high[column] : p->low[column];
    double outer = inner, step = from_low ? 0.05 : -0.05;
    struct walk w = {.p = p, .column = column, .ceiling = best->chi2 + RISE_95 * scale, .at = *best};
    while (outer != far && over <= 0) { /* steps double until the rise is passed or the other bound is met */
        inner = outer;
        outer = from_low ? fmin(outer + step, far) : fmax(outer + step, far);
        step *= 2;
        int status = excess(&w, outer, &over, e);
        if (status) {
            return status;
        }
    }
    *found = over > 0;
    struct solve_result limit = w.at;
    for (int i = 0; *found && i < 20 && fabs(outer - inner) > 1e-4;
         i++) { /* a limit to 1e-4 relative is plenty */
        double middle = (inner + outer) / 2;
        int status = excess(&w, middle, &over, e);
        if (status) {
            return status;
        }
        *(over > 0 ? &outer : &inner) = middle;
        limit = over > 0 ? w.at : limit;
    }
    memcpy(at_limit, limit.x, sizeof limit.x);
    return 0;
}
