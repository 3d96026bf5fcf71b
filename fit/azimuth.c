#include "fit/azimuth.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define SAME_INCIDENCE_DEG 1 /* irregular grids repeat an incidence to a fraction of this */

struct view { /* one in-plane row */
    double theta_i_deg, theta_s_deg, beta;
    bool forward;
};

static int by_incidence(const void *a, const void *b) {
    double x = ((const struct view *)a)->theta_i_deg, y = ((const struct view *)b)->theta_i_deg;
    return (x > y) - (x < y);
}

static int by_number(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double mean_of(const struct brdf *b, size_t i) {
    double sum = 0;
    size_t n = 0;
    for (size_t k = 0; k < b->n_lambda; k++) {
        double beta = b->beta[i * b->n_lambda + k];
        if (!isnan(beta)) {
            sum += beta;
            n++;
        }
    }
    return n ? sum / (double)n : NAN;
}

static size_t take_views(const struct brdf *b, struct view *view) {
    size_t n = 0;
    for (size_t i = 0; i < b->n; i++) {
        const struct brdf_geometry *g = &b->geometry[i];
        if (g->in_plane && g->theta_i_deg >= AZIMUTH_FROM_DEG && g->theta_s_deg > BRDF_PLANE_DEG) {
            view[n++] = (struct view){g->theta_i_deg, g->theta_s_deg, mean_of(b, i), g->theta_v_deg > 0};
        }
    }
    qsort(view, n, sizeof *view, by_incidence);
    return n;
}

/* ln of the strongest reflection at delta phi = 180 over that at 0, of one incidence; NaN where a side lacks. */
static double forward_excess(const struct view *view, size_t n) {
    double reach[2] = {0, 0}, strongest[2] = {0, 0};
    for (size_t i = 0; i < n; i++) {
        reach[view[i].forward] = fmax(reach[view[i].forward], view[i].theta_s_deg);
    }
    for (size_t i = 0; i < n; i++) {
        if (view[i].theta_s_deg <= fmin(reach[0], reach[1]) + SAME_INCIDENCE_DEG) {
            strongest[view[i].forward] = fmax(strongest[view[i].forward], view[i].beta);
        }
    }
    return strongest[0] > 0 && strongest[1] > 0 ? log(strongest[1] / strongest[0]) : NAN;
}

/* The median over the incidences; *n_incidences of them could be judged. */
static double median_excess(const struct view *view, size_t n, double *excess, size_t *n_incidences) {
    *n_incidences = 0;
    for (size_t from = 0; from < n;) {
        size_t to = from + 1;
        while (to < n && view[to].theta_i_deg - view[from].theta_i_deg < SAME_INCIDENCE_DEG) {
            to++;
        }
        double ln_ratio = forward_excess(&view[from], to - from);
        if (!isnan(ln_ratio)) {
            excess[(*n_incidences)++] = ln_ratio;
        }
        from = to;
    }
    qsort(excess, *n_incidences, sizeof *excess, by_number);
    return *n_incidences ? excess[*n_incidences / 2] : 0;
}

static int detect(const struct brdf *b, double *excess, size_t *n_incidences, struct err *e) {
    struct view *view = calloc(b->n + 1, sizeof *view);
    double *all = calloc(b->n + 1, sizeof *all);
    int status = 0;
    if (view && all) {
        *excess = median_excess(view, take_views(b, view), all, n_incidences);
    } else {
        status = err_set(e, ERR_NOMEM, "no memory to judge the sides of %zu geometries", b->n);
    }
    free(view);
    free(all);
    return status;
}

static enum azimuth decide(const struct brdf *b, enum azimuth wanted, double excess, const char **how) {
    if (wanted != AZIMUTH_DETECT) {
        *how = "as given";
        return wanted;
    }
    if (b->azimuth_stated) {
        *how = "as the file states";
        return AZIMUTH_FORWARD_PI;
    }
    if (!(fabs(excess) > log(AZIMUTH_RATIO))) {
        *how = "assumed, for the data do not tell";
        return AZIMUTH_FORWARD_PI;
    }
    *how = "detected";
    return excess > 0 ? AZIMUTH_FORWARD_PI : AZIMUTH_FORWARD_ZERO;
}

int azimuth_settle(struct brdf *b, enum azimuth wanted, char *words, size_t size, struct err *e) {
    double excess = 0;
    size_t n = 0;
    int status = detect(b, &excess, &n, e);
    if (status) {
        return status;
    }
    const char *how;
    bool zero = decide(b, wanted, excess, &how) == AZIMUTH_FORWARD_ZERO;
    if (n > 0) {
        snprintf(
            words, size,
            "forward at delta phi = %d deg (%s): its strongest reflections are %.3g times those of the other "
            "side, median of %zu incidences",
            zero ? 0 : 180, how, exp(zero ? -excess : excess), n);
    } else {
        snprintf(words, size,
                 "forward at delta phi = %d deg (%s): no incidence of %d deg or more shows both sides",
                 zero ? 0 : 180, how, AZIMUTH_FROM_DEG);
    }
    if (zero) {
        brdf_turn(b);
    }
    return 0;
}
