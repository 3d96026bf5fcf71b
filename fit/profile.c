#include "fit/profile.h"

#include <math.h>

#define WORTH_A_LOOK 0.5 /* u to the bound: nearer there is nothing to see */
#define STRETCH_MAX 1e3

/* How far to look, in u, and from which factor on it is more than what the third order does to a good fit. */
static const struct { double reach_u, tolerated; } looks[] = {{3, 1.15}, {6, 1.5}};

/* Chi-square's rise with the coordinate held at x, or at another minimum that is found from there: *x moves to it. */
static int rise_at(const struct problem *p, const struct solve_result *best, int column, double *x,
                   double *rise, struct err *e) {
    bool held[COORDINATES_MAX] = {false};
    struct solve_result start = *best, moved, other;
    held[column] = true;
    start.x[column] = *x;
    int status = solve_run(p, start.x, held, &moved, NULL, e);
    if (status || (status = solve_run(p, moved.x, NULL, &other, NULL, e))) {
        return status;
    }
    bool elsewhere = fabs(other.x[column] - best->x[column]) > fabs(*x - best->x[column]) / 2;
    *x = elsewhere ? other.x[column] : *x;
    *rise = fmax((elsewhere ? other.chi2 : moved.chi2) - best->chi2, 0);
    return 0;
}

/* The factor of one look; 1 where it is tolerable. */
static int look(const struct problem *p, const struct solve_result *best, int column, double away, double u,
                double tolerated, double scale, double *factor, struct err *e) {
    double x = fmin(fmax(best->x[column] + away, p->low[column]), p->high[column]), rise;
    *factor = 1;
    if (fabs(x - best->x[column]) < WORTH_A_LOOK * u) {
        return 0;
    }
    int status = rise_at(p, best, column, &x, &rise, e);
    double away_u = fabs(x - best->x[column]) / u;
    double wanted = fmin(away_u / sqrt(fmax(rise / scale, 1e-12)), STRETCH_MAX);
    *factor = !status && wanted > tolerated ? wanted : 1;
    return status;
}

/* Beyond all looks: a bound that is told from the minimum by less than this many standard deviations. */
static int look_at_bound(const struct problem *p, const struct solve_result *best, int column, bool high,
                         double u, double scale, double *factor, struct err *e) {
    const double told = 3.5; /* 1 in 2,000 */
    double away = (high ? p->high[column] : p->low[column]) - best->x[column], wanted;
    int status = look(p, best, column, away, u, 1, scale, &wanted, e);
    *factor = !status && wanted * told > fabs(away) / u ? wanted : 1;
    return status;
}

int profile_stretch(const struct problem *p, const struct solve_result *best, int column, double u,
                    double scale, double *stretch, struct err *e) {
    int status = 0;
    *stretch = 1;
    for (size_t i = 0; i < 2 * sizeof looks / sizeof *looks && !status; i++) {
        double away = (i % 2 ? -1 : 1) * looks[i / 2].reach_u * u, factor;
        status = look(p, best, column, away, u, looks[i / 2].tolerated, scale, &factor, e);
        *stretch = fmax(*stretch, factor);
    }
    for (int high = 0; high < 2 && !status; high++) {
        double factor;
        status = look_at_bound(p, best, column, high, u, scale, &factor, e);
        *stretch = fmax(*stretch, factor);
    }
    return status;
}
