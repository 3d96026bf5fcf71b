#include "fit/sweeps.h"

#include <math.h>
#include <stdlib.h>

#define WIDTH_DEG 1.0

struct place {
    double theta_i_deg, theta_v_deg;
    size_t sweep, point;
};

static int by_incidence(const void *a, const void *b) {
    const struct place *x = a, *y = b;
    return (x->theta_i_deg > y->theta_i_deg) - (x->theta_i_deg < y->theta_i_deg);
}

/* Ties by index: the order must not depend on the sort. */
static int by_sweep(const void *a, const void *b) {
    const struct place *x = a, *y = b;
    if (x->sweep != y->sweep) {
        return x->sweep < y->sweep ? -1 : 1;
    }
    if (x->theta_v_deg != y->theta_v_deg) {
        return x->theta_v_deg < y->theta_v_deg ? -1 : 1;
    }
    return x->point < y->point ? -1 : x->point > y->point;
}

static void number_sweeps(struct sweeps *s, struct place *place) {
    double first_deg = 0;
    s->n_sweeps = 0;
    qsort(place, s->n, sizeof *place, by_incidence);
    for (size_t i = 0; i < s->n; i++) {
        if (i == 0 || place[i].theta_i_deg > first_deg + WIDTH_DEG) {
            first_deg = place[i].theta_i_deg;
            s->n_sweeps++;
        }
        place[i].sweep = s->n_sweeps - 1;
    }
    qsort(place, s->n, sizeof *place, by_sweep);
    for (size_t i = 0; i < s->n; i++) {
        s->order[i] = place[i].point;
        s->sweep[place[i].point] = place[i].sweep;
    }
}

int sweeps_find(struct sweeps *s, size_t n, const double *theta_i_deg, const double *theta_v_deg,
                struct err *e) {
    struct place *place = calloc(n + 1, sizeof *place);
    *s = (struct sweeps){
        .n = n, .sweep = calloc(n + 1, sizeof *s->sweep), .order = calloc(n + 1, sizeof *s->order)};
    if (!place || !s->sweep || !s->order) {
        free(place);
        sweeps_free(s);
        return err_set(e, ERR_NOMEM, "no memory for the sweeps of %zu points", n);
    }
    for (size_t i = 0; i < n; i++) {
        place[i] = (struct place){theta_i_deg[i], theta_v_deg[i], 0, i};
    }
    number_sweeps(s, place);
    free(place);
    return 0;
}

void sweeps_free(struct sweeps *s) {
    free(s->sweep);
    free(s->order);
    *s = (struct sweeps){0};
}

/* Mean product of residuals that are so many points apart in their sweep, over the mean square. */
static double correlation(const struct sweeps *s, const double *residual, size_t lag, double square) {
    double sum = 0;
    for (size_t i = lag; i < s->n; i++) {
        size_t a = s->order[i - lag], b = s->order[i];
        sum += s->sweep[a] == s->sweep[b] ? residual[a] * residual[b] : 0;
    }
    return sum / square;
}

/* Lags grow by a quarter beyond the fourth, each standing for those since the last: n log n steps, not n^2. */
double sweeps_effective(const struct sweeps *s, const double *residual) {
    double square = 0, sum = 0, n = (double)s->n, chance = 2 / sqrt(n);
    for (size_t i = 0; i < s->n; i++) {
        square += residual[i] * residual[i];
    }
    for (size_t lag = 1, step = 1; square > 0 && lag < s->n; step = 1 + lag / 4, lag += step) {
        double r = correlation(s, residual, lag, square);
        if (!(r > chance)) {
            break;
        }
        sum += r * (double)step;
    }
    return fmax(n / (1 + 2 * sum), (double)s->n_sweeps);
}

double sweeps_agreement(const struct sweeps *s, const double *residual) {
    double sum = 0, pairs = 0;
    for (size_t i = 1; i < s->n; i++) {
        size_t a = s->order[i - 1], b = s->order[i];
        if (s->sweep[a] == s->sweep[b]) {
            sum += residual[a] * residual[b] > 0 ? 1 : -1;
            pairs++;
        }
    }
    return pairs > 0 ? sum / sqrt(pairs) : 0;
}
