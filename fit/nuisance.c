#include "fit/nuisance.h"

#include <math.h>
#include <stdlib.h>

#include "fit/problem.h"
#include "fit/spot.h"

/* What a shift of the mirror direction by 1 deg says of both axes, on the average over their prior. */
struct leverage {
    double source, sample;
};

static struct leverage leverage_of(const struct estimate_input *in) {
    double source2 = in->u_zero_source_deg * in->u_zero_source_deg;
    double sample2 = in->u_zero_sample_deg * in->u_zero_sample_deg;
    double share = source2 / 2 / (source2 / 4 + sample2);
    return (struct leverage){share, share / 2 - 1};
}

static double nuisance_u_offset_deg(const struct estimate_input *in) {
    return hypot(in->u_zero_source_deg / 2, in->u_zero_sample_deg);
}

void nuisance_zeros(const struct estimate_input *in, double offset_deg, double *source_deg,
                    double *sample_deg) {
    const struct leverage by = leverage_of(in);
    *source_deg = by.source * offset_deg;
    *sample_deg = by.sample * offset_deg;
}

static void add(struct nuisances *s, enum nuisance_kind kind, double mean, double u) {
    s->of[s->m++] = (struct nuisance){.kind = kind, .mean = mean, .u = u, .at = mean};
}

int nuisance_init(struct problem *p, struct err *e) {
    const struct estimate_input *in = p->input;
    struct nuisances *s = &p->nuisance;
    *s = (struct nuisances){0};
    if (p->loss != MATERIAL_LOSS_ML || reflectance_column(p->model, MATERIAL_GAMMA) < 0) {
        return 0;
    }
    if (!in->hold_offset && nuisance_u_offset_deg(in) > 0) {
        add(s, NUISANCE_OFFSET, 0, nuisance_u_offset_deg(in));
    }
    if (in->u_polarisation > 0) {
        add(s, NUISANCE_POLARISATION, in->polarisation, in->u_polarisation);
    }
    for (int j = 0; j < s->m; j++) {
        s->of[j].slope = calloc(p->n + 1, sizeof(double));
        s->axis[j] = calloc(p->n + 1, sizeof(double));
        if (!s->of[j].slope || !s->axis[j]) {
            return err_set(e, ERR_NOMEM, "no memory for a fit of %zu points", p->n);
        }
    }
    return 0;
}

void nuisance_free(struct problem *p) {
    for (int j = 0; j < NUISANCES_MAX; j++) {
        free(p->nuisance.of[j].slope);
        free(p->nuisance.axis[j]);
    }
    p->nuisance = (struct nuisances){0};
}

void nuisance_shift(const struct problem *p, size_t i, double *di_deg, double *dv_deg, double *factor) {
    const struct estimate_input *in = p->input;
    const double sign = in->mirrored && in->mirrored[i] ? -1 : 1;
    *di_deg = *dv_deg = 0;
    *factor = 1;
    for (int j = 0; j < p->nuisance.m; j++) {
        const struct nuisance *z = &p->nuisance.of[j];
        if (z->kind == NUISANCE_OFFSET) {
            const struct leverage by = leverage_of(in);
            struct spot spot;
            spot_at(in, i, &spot);
            *di_deg = sign * (by.source - by.sample) * z->at;
            *dv_deg = sign * by.sample * z->at;
            *factor += spot.zeros_cancel ? 0 : (spot.source * by.source + spot.sample * by.sample) * z->at;
        }
    }
}

void nuisance_slope(const struct problem *p, int z, size_t i, double *lobe, double *spot) {
    const struct leverage by = leverage_of(p->input);
    const bool offset = p->nuisance.of[z].kind == NUISANCE_OFFSET;
    *lobe =
        offset ? by.source * p->slope_source[i] + by.sample * p->slope_sample[i] : p->slope_polarisation[i];
    *spot = offset ? by.source * p->spot_source[i] + by.sample * p->spot_sample[i] : 0;
}

static void find_slope(struct problem *p, int z) {
    for (size_t i = 0; i < p->n; i++) {
        double lobe, spot;
        nuisance_slope(p, z, i, &lobe, &spot);
        p->nuisance.of[z].slope[i] = lobe + spot;
    }
}

static double scaled(const struct problem *p, const struct nuisance *z, size_t i) {
    return z->slope[i] * z->u * p->root_weight[i];
}

/* The Gram matrix of G; off its diagonal where there are two. */
static void gram(const struct problem *p, double cell[2][2]) {
    for (int a = 0; a < 2; a++) {
        for (int b = 0; b < 2; b++) {
            cell[a][b] = 0;
            for (size_t i = 0; i < p->n && a < p->nuisance.m && b < p->nuisance.m; i++) {
                cell[a][b] += scaled(p, &p->nuisance.of[a], i) * scaled(p, &p->nuisance.of[b], i);
            }
        }
    }
}

static void find_axes(struct problem *p) {
    struct nuisances *s = &p->nuisance;
    double g[2][2];
    gram(p, g);
    const double turn = s->m == 2 ? atan2(2 * g[0][1], g[0][0] - g[1][1]) / 2 : 0;
    const double mix[2][2] = {{cos(turn), sin(turn)}, {-sin(turn), cos(turn)}};
    for (int j = 0; j < s->m; j++) {
        double length2 = 0;
        for (size_t i = 0; i < p->n; i++) {
            s->axis[j][i] = 0;
            for (int z = 0; z < s->m; z++) {
                s->axis[j][i] += mix[j][z] * scaled(p, &s->of[z], i);
            }
            length2 += s->axis[j][i] * s->axis[j][i];
        }
        s->shrink[j] = length2 > 1e-12 ? (1 - 1 / sqrt(1 + length2)) / length2 : 0.5;
        s->removed[j] = 1 / (1 + length2);
    }
}

void nuisance_weigh(struct problem *p) {
    for (int j = 0; j < p->nuisance.m; j++) {
        find_slope(p, j);
    }
    find_axes(p);
}

static void take_out(const struct problem *p, int j, double factor, double *vector) {
    const double *axis = p->nuisance.axis[j];
    double along = 0;
    for (size_t i = 0; i < p->n; i++) {
        along += axis[i] * vector[i];
    }
    for (size_t i = 0; i < p->n; i++) {
        vector[i] -= factor * along * axis[i];
    }
}

void nuisance_whiten(const struct problem *p, double *vector) {
    for (int j = 0; j < p->nuisance.m; j++) {
        take_out(p, j, p->nuisance.shrink[j], vector);
    }
}

double nuisance_taken(const struct problem *p, size_t i) {
    double sum = 0;
    for (int j = 0; j < p->nuisance.m; j++) {
        const struct nuisance *z = &p->nuisance.of[j];
        sum += z->slope[i] * (z->at - z->mean) * p->root_weight[i];
    }
    return sum;
}

static void take_back(const struct problem *p, double *vector) {
    for (size_t i = 0; i < p->n; i++) {
        vector[i] -= nuisance_taken(p, i);
    }
}

void nuisance_residuals(const struct problem *p, double *vector) {
    take_back(p, vector);
    nuisance_whiten(p, vector);
}

double nuisance_chi2(const struct problem *p) {
    double sum = 0;
    for (int j = 0; j < p->nuisance.m; j++) {
        const struct nuisance *z = &p->nuisance.of[j];
        sum += (z->at - z->mean) * (z->at - z->mean) / (z->u * z->u);
    }
    return sum;
}

/* The best step from the mean of each prior, in units of its u: -(I + G^T G)^-1 G^T r. */
static void best_steps(const struct problem *p, const double *residual, double step[2]) {
    double a[2][2], right[2] = {0, 0};
    gram(p, a);
    a[0][0] += 1;
    a[1][1] += 1;
    for (int j = 0; j < p->nuisance.m; j++) {
        for (size_t i = 0; i < p->n; i++) {
            right[j] -= scaled(p, &p->nuisance.of[j], i) * residual[i];
        }
    }
    const double det = a[0][0] * a[1][1] - a[0][1] * a[1][0];
    step[0] = (right[0] * a[1][1] - right[1] * a[0][1]) / det;
    step[1] = (right[1] * a[0][0] - right[0] * a[1][0]) / det;
}

static int move_model(struct problem *p, struct err *e) {
    int status = 0;
    for (int j = 0; j < p->nuisance.m; j++) {
        if (p->nuisance.of[j].kind == NUISANCE_POLARISATION) {
            p->optics.polarisation = p->nuisance.of[j].at;
        }
    }
    for (size_t i = 0; i < p->n && !status; i++) {
        double di_deg, dv_deg, factor;
        if (problem_out_of_plane(p->input, i)) {
            continue;
        }
        nuisance_shift(p, i, &di_deg, &dv_deg, &factor);
        status = aperture_move(&p->aperture, i, p->input->theta_i_deg[i] + di_deg,
                               p->input->theta_v_deg[i] + dv_deg, factor, e);
    }
    aperture_refill(&p->aperture);
    return status;
}

int nuisance_adopt(struct problem *p, const double *value, double *moved, struct err *e) {
    double step[2], *residual = malloc((p->n + 1) * sizeof *residual);
    *moved = 0;
    if (!residual) {
        return err_set(e, ERR_NOMEM, "no memory for a fit of %zu points", p->n);
    }
    for (size_t i = 0; i < p->n; i++) {
        residual[i] = (p->model_beta[i] - p->input->beta[i]) * p->root_weight[i];
    }
    take_back(p, residual);
    best_steps(p, residual, step);
    free(residual);
    for (int j = 0; j < p->nuisance.m; j++) {
        struct nuisance *z = &p->nuisance.of[j];
        const double next = z->mean + z->u * step[j];
        *moved = fmax(*moved, fabs(next - z->at) / z->u);
        z->at = z->kind == NUISANCE_POLARISATION ? fmax(-1, fmin(next, 1)) : next;
    }
    int status = p->nuisance.m > 0 ? move_model(p, e) : 0;
    if (status || p->nuisance.m == 0 || (status = problem_evaluate(p, value, e)) ||
        (status = problem_slopes(p, value, e))) {
        return status;
    }
    nuisance_weigh(p);
    return 0;
}

int nuisance_take(struct problem *p, const struct estimate *estimate, struct err *e) {
    for (int j = 0; j < p->nuisance.m; j++) {
        struct nuisance *z = &p->nuisance.of[j];
        z->at = z->kind == NUISANCE_OFFSET ? estimate->mirror_offset_deg : estimate->polarisation;
    }
    return p->nuisance.m > 0 ? move_model(p, e) : 0;
}

int nuisance_move(struct problem *p, const double step[NUISANCES_MAX], struct err *e) {
    for (int j = 0; j < p->nuisance.m; j++) {
        struct nuisance *z = &p->nuisance.of[j];
        z->at += step[j];
        z->at = z->kind == NUISANCE_POLARISATION ? fmax(-1, fmin(z->at, 1)) : z->at;
    }
    return p->nuisance.m > 0 ? move_model(p, e) : 0;
}

static int add_cause(struct nuisance_cause *cause, int n, struct nuisance_cause one) {
    cause[n] = one;
    return one.u > 0 ? n + 1 : n;
}

int nuisance_causes(const struct problem *p, const double *none,
                    struct nuisance_cause cause[NUISANCE_CAUSES]) {
    const struct estimate_input *in = p->input;
    int n = add_cause(cause, 0,
                      (struct nuisance_cause){p->slope_source, p->spot_source, in->u_zero_source_deg,
                                              NUISANCE_OFFSET, 0.5});
    n = add_cause(
        cause, n,
        (struct nuisance_cause){p->slope_sample, p->spot_sample, in->u_zero_sample_deg, NUISANCE_OFFSET, -1});
    return add_cause(
        cause, n,
        (struct nuisance_cause){p->slope_polarisation, none, in->u_polarisation, NUISANCE_POLARISATION, 1});
}
