#include "fit/points_surface.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>

struct channels { /* which of a file's wavelengths make the mean */
    size_t n;     /* of the mean */
    bool banded;  /* all of them fall into bands */
    bool named;   /* wavelengths are stated */
};

static bool in_range(const struct fitset *d, double nm) {
    return nm >= d->input.mean_low_nm && nm <= d->input.mean_high_nm;
}

/* The nearest band, or -1. */
static int band_of(double nm) {
    long band = lround((nm - BAND_FIRST_NM) / BAND_STEP_NM);
    return isnan(nm) || band < 0 || band >= BANDS ? -1 : (int)band;
}

static struct channels choose(const struct brdf *b, const struct fitset *d) {
    struct channels c = {.banded = true};
    for (size_t k = 0; k < b->n_lambda; k++) {
        double nm = b->lambda_nm[k];
        c.named = c.named || !isnan(nm);
        if (in_range(d, nm)) {
            c.n++;
            c.banded = c.banded && band_of(nm) >= 0;
        }
    }
    c.banded = c.banded && c.n > 0;
    return c;
}

static int refuse_range(const struct brdf *b, const char *file, const struct fitset *d, struct err *e) {
    double low = INFINITY, high = 0;
    for (size_t k = 0; k < b->n_lambda; k++) {
        low = fmin(low, b->lambda_nm[k]);
        high = fmax(high, b->lambda_nm[k]);
    }
    return err_at(e, ERR_INPUT, file, 0, 0,
                  "no wavelength of this file lies in %d to %d nm; it has %zu from %g to %g nm: choose with "
                  "--wavelength LO:HI",
                  d->input.mean_low_nm, d->input.mean_high_nm, b->n_lambda, low, high);
}

static void note(struct points_report *r, const char *format, ...) {
    va_list arguments;
    if (r->n_notes == (int)(sizeof r->note / sizeof *r->note)) {
        return;
    }
    va_start(arguments, format);
    vsnprintf(r->note[r->n_notes++], sizeof r->note[0], format, arguments);
    va_end(arguments);
}

/* Mean and independent u of channels, by their square sum; u NaN where one is not stated. */
struct mean {
    double sum, u2;
    int n;
};

static void add(struct mean *m, double beta, double u) {
    m->sum += beta;
    m->u2 += u * u;
    m->n++;
}

static double mean_beta(const struct mean *m) {
    return m->n ? m->sum / m->n : NAN;
}

static double mean_u(const struct mean *m) {
    return m->n ? sqrt(m->u2) / m->n : NAN;
}

static void fill_bands(const struct brdf *b, size_t i, double *bands, double *bands_u) {
    struct mean of_band[BANDS] = {{0}};
    for (size_t k = 0; k < b->n_lambda; k++) {
        size_t at = i * b->n_lambda + k;
        int band = band_of(b->lambda_nm[k]);
        if (band >= 0) {
            add(&of_band[band], b->beta[at], b->u ? b->u[at] : NAN);
        }
    }
    for (int band = 0; band < BANDS; band++) {
        bands[band] = mean_beta(&of_band[band]);
        bands_u[band] = mean_u(&of_band[band]);
    }
}

static struct mean mean_of_bands(const struct brdf *b, const struct fitset *d, const double *bands,
                                 const double *bands_u) {
    struct mean m = {0};
    bool holds[BANDS] = {false};
    for (size_t k = 0; k < b->n_lambda; k++) {
        int band = band_of(b->lambda_nm[k]);
        if (band >= 0 && in_range(d, b->lambda_nm[k]) && !holds[band]) {
            holds[band] = true;
            add(&m, bands[band], bands_u[band]);
        }
    }
    return m;
}

static struct mean mean_of_channels(const struct brdf *b, const struct fitset *d, bool named, size_t i) {
    struct mean m = {0};
    for (size_t k = 0; k < b->n_lambda; k++) {
        size_t at = i * b->n_lambda + k;
        if (!named || in_range(d, b->lambda_nm[k])) {
            add(&m, b->beta[at], b->u ? b->u[at] : NAN);
        }
    }
    return m;
}

static int add_point(const struct brdf *b, size_t i, const struct channels *c, struct fitset *d,
                     struct err *e) {
    const struct brdf_geometry *g = &b->geometry[i];
    double bands[BANDS], bands_u[BANDS];
    struct mean mean;
    if (c->banded) {
        fill_bands(b, i, bands, bands_u);
        mean = mean_of_bands(b, d, bands, bands_u);
    } else {
        mean = mean_of_channels(b, d, c->named, i);
    }
    if (isnan(mean_beta(&mean))) {
        d->mask.left_out[MASK_NO_VALUE]++;
        return 0;
    }
    if (!mask_admits(&d->mask, g->theta_i_deg, g->theta_s_deg, g->delta_phi_deg)) {
        return 0;
    }
    struct fitset_point point = {.theta_i_deg = g->theta_i_deg,
                                 .theta_v_deg = g->in_plane             ? g->theta_v_deg
                                                : g->delta_phi_deg > 90 ? g->theta_s_deg
                                                                        : -g->theta_s_deg,
                                 .delta_phi_deg = g->in_plane ? 0 : g->delta_phi_deg,
                                 .beta = mean_beta(&mean),
                                 .u_ind = mean_u(&mean),
                                 .bands = c->banded ? bands : NULL,
                                 .bands_u = c->banded && b->u ? bands_u : NULL};
    return fitset_add_point(d, &point, e);
}

int points_surface_add(const struct brdf *b, const char *file, struct fitset *d, struct points_report *report,
                       struct err *e) {
    struct channels c = choose(b, d);
    int status = 0;
    if (c.named && c.n == 0) {
        return refuse_range(b, file, d, e);
    }
    if (!c.named) {
        note(report, "no wavelengths are stated: the value is the mean of %zu channels", b->n_lambda);
    } else {
        note(report, "the value is the mean of %zu of %zu wavelengths%s", c.n, b->n_lambda,
             c.banded ? "" : ", not all within 380-780 nm: no S(lambda), q = 1");
    }
    for (size_t i = 0; i < b->n && !status; i++) {
        status = add_point(b, i, &c, d, e);
    }
    return status;
}
