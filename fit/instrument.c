#include "fit/instrument.h"

#include <math.h>

#include "fit/words.h"

#define FAR 4 /* u of a prior; once in 16,000 times by chance */

static void report_offset(const struct nuisance *z, double u, struct estimate *estimate) {
    const double off = fabs(z->at - z->mean) / z->u;
    estimate->mirror_offset_deg = z->at;
    estimate->u_mirror_offset_deg = u;
    if (off > FAR) {
        words_warn(
            estimate,
            "the mirror direction is off by %.3g deg, %.1f times what the zeros of the axes allow: align "
            "them again",
            z->at, off);
    }
}

static void report_polarisation(const struct nuisance *z, double u, struct estimate *estimate) {
    const double off = fabs(z->at - z->mean) / z->u;
    estimate->polarisation = z->at;
    estimate->u_polarisation = u;
    if (off > FAR) {
        words_warn(estimate,
                   "the points ask for a polarisation of %.3f, %.1f u from the stated %.3f: measure it again",
                   z->at, off, z->mean);
    }
}

void instrument_report(const struct problem *p, const struct uncertainty *u, struct estimate *estimate) {
    estimate->polarisation = p->input->polarisation;
    estimate->u_polarisation = p->input->u_polarisation;
    for (int j = 0; j < p->nuisance.m; j++) {
        const struct nuisance *z = &p->nuisance.of[j];
        const double known = sqrt(u->nuisance_u2[j] * fmax(1, u->scatter));
        if (z->kind == NUISANCE_OFFSET) {
            report_offset(z, known, estimate);
            nuisance_zeros(p->input, z->at, &estimate->zero_source_deg, &estimate->zero_sample_deg);
        } else {
            report_polarisation(z, known, estimate);
        }
    }
}

static void widen(double span[2], double value) {
    span[0] = fmin(span[0], value);
    span[1] = fmax(span[1], value);
}

int instrument_span(struct problem *p, const struct solve_result *best, struct estimate *estimate,
                    struct err *e) {
    struct material_span *span = &estimate->polarisation_span;
    const double before = p->optics.polarisation;
    if (reflectance_column(p->model, MATERIAL_N) < 0) {
        return 0;
    }
    *span = (struct material_span){.p_limit = INSTRUMENT_P_LIMIT};
    for (int end = 0; end < 2; end++) {
        span->n[end] = estimate->value[MATERIAL_N];
        span->beta_prime[end] = estimate->value[MATERIAL_BETA_PRIME];
    }
    int status = 0;
    for (int side = -1; side <= 1 && !status; side += 2) {
        struct solve_result at;
        double value[MATERIAL_PARAMETERS];
        p->optics.polarisation = side * INSTRUMENT_P_LIMIT;
        status = solve_run(p, best->x, NULL, &at, NULL, e);
        if (!status) {
            coordinates_to_value(p->model, at.x, value);
            widen(span->n, value[MATERIAL_N]);
            widen(span->beta_prime, value[MATERIAL_BETA_PRIME]);
        }
    }
    p->optics.polarisation = before;
    words_warn(
        estimate,
        "the polarisation is not known: with |P| <= %g n lies within %.4g .. %.4g, beta_prime within %.4g .. "
        "%.4g",
        INSTRUMENT_P_LIMIT, span->n[0], span->n[1], span->beta_prime[0], span->beta_prime[1]);
    return status;
}
