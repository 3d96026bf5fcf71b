#include "daemon/reduce_internal.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "proto/cosine.h"

#define FULL_SCALE 65535.0

/* One reading's share in a point: d beta / d counts, by band. */
struct share {
    const struct reading *reading;
    double gradient[BANDS];
};

enum { SAMPLE, OPEN, CLOSE, OWN, SHARES };

struct cause { /* noise that several readings of a point share by name */
    char name[40];
    const struct band_noise *noise;
    double gradient[BANDS];
};

struct forming { /* a point in the making */
    const struct reduce_setup *setup;
    struct point *p;
    struct share share[SHARES]; /* reading NULL = has no part in it */
    double factor;              /* K */
    double beta_ref[BANDS], u_ref[BANDS], angular_u_rel;
    bool covered[BANDS];
    int n_causes;
    struct cause cause[2 * SHARES];
};

static const struct reading *reference_of(const struct reading *sample, const struct bridge *bridge) {
    return sample->reference ? sample->reference : bridge->open;
}

/* Irradiance (view inside the beam) or viewed area (beam inside the view) of the sample over that of the diffuser,
 * measurement.md 1. */
static double filling_factor(const struct reduce_setup *setup, const struct reading *sample,
                             const struct reading *reference) {
    if (setup->beam_in_view)
        return cosine_udeg(reference->theta_v_udeg) / cosine_udeg(sample->theta_v_udeg);
    return cosine_udeg(reference->theta_i_udeg) / cosine_udeg(sample->theta_i_udeg);
}

static double snr(const struct reading *x, int band) {
    double u = noise_of_band(&x->light.noise, band),
           d = x->dark ? noise_of_band(&x->dark->spectrum.noise, band) : 0;
    double total = sqrt(u * u + d * d);
    return total > 0 ? x->net[band] / total : (x->net[band] > 0 ? INFINITY : 0);
}

static bool strong_enough(const struct forming *f, int band) {
    double least = f->setup->reference_snr_min > 0 ? f->setup->reference_snr_min : REDUCE_SNR_MIN;
    for (int k = OPEN; k < SHARES; k++)
        if (f->share[k].reading && !(snr(f->share[k].reading, band) >= least))
            return false;
    return true;
}

static double place(const struct bridge *bridge, double at_us) {
    if (!bridge->close)
        return 0;
    return (at_us - bridge->open->at_us) / (bridge->close->at_us - bridge->open->at_us);
}

/* Counts per microsecond of a control reading at the place f of the bracket. */
static double lamp(const struct bridge *bridge, int band, double f) {
    double open = bridge->open->net[band] / bridge->open->exposure_us;
    if (!bridge->close)
        return open;
    return open + (bridge->close->net[band] / bridge->close->exposure_us - open) * f;
}

/* beta and its gradients in one band. R is the reference's rate at the time of the sample: the control reading's
 * line itself, or the geometry's own reading carried along it. */
static void divide(struct forming *f, const struct bridge *bridge, int band) {
    const struct reading *sample = f->share[SAMPLE].reading, *own = f->share[OWN].reading;
    double f_s = place(bridge, sample->at_us), lamp_s = lamp(bridge, band, f_s);
    double r = lamp_s, by_open = (1 - f_s) / lamp_s, by_close = f_s / lamp_s; /* of ln R, by the rates */
    if (own) {
        double f_r = place(bridge, own->at_us), lamp_r = lamp(bridge, band, f_r);
        r = own->net[band] / own->exposure_us * (lamp_s / lamp_r);
        by_open -= (1 - f_r) / lamp_r;
        by_close -= f_r / lamp_r;
    }
    double per_count = f->beta_ref[band] * f->factor / r / sample->exposure_us;
    double beta = per_count * sample->net[band];
    f->p->beta[band] = beta;
    f->share[SAMPLE].gradient[band] = per_count;
    f->share[OPEN].gradient[band] = -beta * by_open / bridge->open->exposure_us;
    if (bridge->close)
        f->share[CLOSE].gradient[band] = -beta * by_close / bridge->close->exposure_us;
    if (own)
        f->share[OWN].gradient[band] = -beta / own->net[band];
}

/* The light that reaches a band is not even inside it: lamp and spectrometer weigh its red half more or less than its
 * blue half, and the ratio is beta about the centroid of that light, as the diffuser shows it. What the slope of beta
 * makes of it is taken off; to the noise it adds less than a thousandth. */
static void centre_bands(struct forming *f) {
    const struct reading *white = f->share[OWN].reading ? f->share[OWN].reading : f->share[OPEN].reading;
    struct point *p = f->p;
    double seen[BANDS];
    memcpy(seen, p->beta, sizeof seen);
    for (int band = 0; band < BANDS; band++) {
        int low = band > 0 && p->present[band - 1] ? band - 1 : band;
        int high = band + 1 < BANDS && p->present[band + 1] ? band + 1 : band;
        if (!p->present[band] || low == high)
            continue;
        double across = (high - low) * BAND_STEP_NM + white->centroid_nm[high] - white->centroid_nm[low];
        p->beta[band] -= white->centroid_nm[band] * (seen[high] - seen[low]) / across;
    }
}

static void own_noise(struct forming *f, int band) {
    const struct band_noise *noise = &f->share[SAMPLE].reading->light.noise;
    const double *g = f->share[SAMPLE].gradient;
    f->p->u_ind[band] = fabs(g[band]) * noise_of_band(noise, band);
    if (band + 1 < BANDS && f->p->present[band + 1])
        f->p->cov_next[band] = g[band] * g[band + 1] *
                               (noise->cov_next[band] + noise->electric[band] * noise->electric[band + 1]);
}

static void add_cause(struct forming *f, const char *kind, int64_t id, const struct band_noise *noise,
                      double sign, const double *gradient) {
    char name[40];
    int k = 0;
    snprintf(name, sizeof name, "%s/%lld", kind, (long long)id);
    while (k < f->n_causes && strcmp(f->cause[k].name, name) != 0)
        k++;
    struct cause *c = &f->cause[k];
    if (k == f->n_causes) {
        f->n_causes++;
        memset(c, 0, sizeof *c);
        memcpy(c->name, name, sizeof name);
        c->noise = noise;
    }
    for (int band = 0; band < BANDS; band++)
        c->gradient[band] += sign * gradient[band];
}

/* Noise of the readings that other points use too: references, and the dark of every reading. */
static void collect_causes(struct forming *f) {
    for (int k = OPEN; k < SHARES; k++)
        if (f->share[k].reading)
            add_cause(f, "reference", f->share[k].reading->exposure_id, &f->share[k].reading->light.noise, 1,
                      f->share[k].gradient);
    for (int k = 0; k < SHARES; k++) {
        const struct dark *dark = f->share[k].reading ? f->share[k].reading->dark : NULL;
        if (dark)
            add_cause(f, "dark", dark->exposure_id, &dark->spectrum.noise, -1, f->share[k].gradient);
    }
}

static bool has_mean(const struct forming *f) {
    for (int band = mean_first_band(f->setup); band <= mean_last_band(f->setup); band++)
        if (band < 0 || band >= BANDS || !f->p->present[band])
            return false;
    return true;
}

static double average(const struct forming *f, const double *value) {
    int first = mean_first_band(f->setup), last = mean_last_band(f->setup);
    double sum = 0;
    for (int band = first; band <= last; band++)
        sum += value[band];
    return sum / (last - first + 1);
}

static double average_noise(const struct forming *f, const struct band_noise *noise, const double *gradient) {
    int first = mean_first_band(f->setup), last = mean_last_band(f->setup);
    return sqrt(noise_of_sum(noise, gradient, first, last)) / (last - first + 1);
}

static struct point_common *new_common(struct forming *f, const char *name) {
    struct point_common *c = &f->p->common[f->p->n_common++];
    memset(c, 0, sizeof *c);
    snprintf(c->name, sizeof c->name, "%s", name);
    return c;
}

/* The mean takes the sign of the summed gradient, so that two points that share the reading covary as they do. */
static void common_from_noise(struct forming *f, const struct cause *cause, bool mean) {
    struct point_common *c = new_common(f, cause->name);
    for (int band = 0; band < BANDS; band++)
        if (f->p->present[band])
            c->sensitivity[band] = cause->gradient[band] * noise_of_band(cause->noise, band);
    double sign = mean && average(f, cause->gradient) < 0 ? -1 : 1;
    c->mean = mean ? sign * average_noise(f, cause->noise, cause->gradient) : NAN;
}

/* A cause that moves all bands together: the mean moves by the mean. */
static void finish_together(struct forming *f, struct point_common *c, bool mean) {
    for (int band = 0; band < BANDS; band++)
        if (!f->p->present[band])
            c->sensitivity[band] = 0;
    c->mean = mean ? average(f, c->sensitivity) : NAN;
}

/* e^-x for x >= 0 without a mathematics library: a series at x / 2^k, squared k times. */
static double decay(double x) {
    int squarings = 0;
    if (x > 700)
        return 0;
    while (x > 1.0 / 128) {
        x /= 2;
        squarings++;
    }
    double y = 1 - x * (1 - x / 2 * (1 - x / 3 * (1 - x / 4 * (1 - x / 5 * (1 - x / 6 * (1 - x / 7))))));
    while (squarings--)
        y *= y;
    return y;
}

/* Standard uncertainty of the mean where the certificate's error fades over wavelength. */
static double faded_mean(const struct forming *f, const double *sensitivity) {
    int first = mean_first_band(f->setup), last = mean_last_band(f->setup);
    double step = decay(BAND_STEP_NM / f->setup->certificate->correlation_nm), sum = 0;
    for (int a = first; a <= last; a++) {
        double rho = 1;
        sum += sensitivity[a] * sensitivity[a];
        for (int b = a + 1; b <= last; b++) {
            rho *= step;
            sum += 2 * rho * sensitivity[a] * sensitivity[b];
        }
    }
    return sqrt(sum > 0 ? sum : 0) / (last - first + 1);
}

static void common_certificate(struct forming *f, bool mean) {
    struct point_common *c = new_common(f, "certificate");
    for (int band = 0; band < BANDS; band++)
        if (f->p->present[band])
            c->sensitivity[band] = f->p->beta[band] * f->u_ref[band] / f->beta_ref[band];
    finish_together(f, c, mean);
    if (mean && f->setup->certificate->correlation_nm > 0)
        c->mean = faded_mean(f, c->sensitivity);
}

static void common_angular(struct forming *f, const struct reading *reference, bool mean) {
    char name[40];
    if (!(f->angular_u_rel > 0))
        return;
    snprintf(name, sizeof name, "angular/%d/%d", reference->nominal_i_udeg, reference->nominal_v_udeg);
    struct point_common *c = new_common(f, name);
    for (int band = 0; band < BANDS; band++)
        c->sensitivity[band] = f->p->beta[band] * f->angular_u_rel;
    finish_together(f, c, mean);
}

/* The spectrometer's own stray light lifts every band by the same share of the mean signal. */
static void common_stray(struct forming *f, bool mean) {
    if (!(f->setup->stray_light_rel > 0))
        return;
    struct point_common *c = new_common(f, "stray");
    for (int k = 0; k < SHARES; k++) {
        const struct reading *x = f->share[k].reading;
        double level = x ? x->light.mean - (x->dark ? x->dark->spectrum.mean : 0) : 0;
        for (int band = 0; x && band < BANDS; band++)
            c->sensitivity[band] += f->share[k].gradient[band] * level * f->setup->stray_light_rel;
    }
    finish_together(f, c, mean);
}

/* What linearisation leaves grows with the level, so it cancels where sample and reference are equally bright. */
static void common_linearity(struct forming *f, bool mean) {
    if (!(f->setup->linearity_rel > 0))
        return;
    struct point_common *c = new_common(f, "linearity");
    for (int k = 0; k < SHARES; k++) {
        const struct reading *x = f->share[k].reading;
        for (int band = 0; x && band < BANDS; band++)
            c->sensitivity[band] += f->share[k].gradient[band] * x->net[band] *
                                    (f->setup->linearity_rel * x->light.value[band] / FULL_SCALE);
    }
    finish_together(f, c, mean);
}

/* Light from elsewhere on the bench is added to sample and reference alike. */
static void common_bench_stray(struct forming *f, bool mean) {
    if (!(f->setup->bench_stray_beta > 0))
        return;
    struct point_common *c = new_common(f, "bench_stray");
    for (int band = 0; band < BANDS; band++)
        if (f->p->present[band])
            c->sensitivity[band] = f->setup->bench_stray_beta * (1 - f->p->beta[band] / f->beta_ref[band]);
    finish_together(f, c, mean);
}

static void fill_bands(struct forming *f, const struct resampler *bands, const struct bridge *bridge) {
    struct point *p = f->p;
    for (int band = 0; band < BANDS; band++) {
        p->beta[band] = p->u_ind[band] = NAN;
        p->present[band] = bands->covered[band] && f->covered[band] && strong_enough(f, band);
        if (p->present[band])
            divide(f, bridge, band);
    }
    centre_bands(f);
    for (int band = 0; band < BANDS; band++)
        if (p->present[band])
            own_noise(f, band);
}

static void fill_commons(struct forming *f, const struct reading *reference, bool mean) {
    common_certificate(f, mean);
    common_angular(f, reference, mean);
    collect_causes(f);
    for (int k = 0; k < f->n_causes; k++)
        common_from_noise(f, &f->cause[k], mean);
    common_stray(f, mean);
    common_linearity(f, mean);
    common_bench_stray(f, mean);
}

static void describe(struct point *p, const struct reading *sample, const struct bridge *bridge) {
    p->provisional = !bridge->close;
    p->exposure_id = sample->exposure_id;
    p->bracket = sample->bracket;
    p->tau_us = sample->at_us - bridge->open->at_us;
    p->tau_r_us = sample->reference ? sample->reference->at_us - bridge->open->at_us : 0;
    p->theta_i_udeg = sample->theta_i_udeg;
    p->theta_v_udeg = sample->theta_v_udeg;
    p->scan_f = sample->light.scan_f;
    p->noisy = sample->light.noisy;
}

int point_make(struct point *p, const struct reduce_setup *setup, const struct resampler *bands,
               const struct reading *sample, const struct bridge *bridge, struct err *e) {
    const struct reading *reference = reference_of(sample, bridge);
    struct forming f = {.setup = setup, .p = p, .factor = filling_factor(setup, sample, reference)};
    memset(p, 0, sizeof *p);
    int rc =
        certificate_at(setup->certificate, reference->nominal_i_udeg / 1e6, reference->nominal_v_udeg / 1e6,
                       setup->angular_u_rel, f.beta_ref, f.u_ref, f.covered, &f.angular_u_rel, e);
    if (rc < 0)
        return rc;
    f.share[SAMPLE].reading = sample;
    f.share[OPEN].reading = bridge->open;
    f.share[CLOSE].reading = bridge->close;
    f.share[OWN].reading = sample->reference;
    describe(p, sample, bridge);
    fill_bands(&f, bands, bridge);
    bool mean = has_mean(&f);
    p->mean = mean ? average(&f, p->beta) : NAN;
    p->mean_u_ind = mean ? average_noise(&f, &sample->light.noise, f.share[SAMPLE].gradient) : NAN;
    fill_commons(&f, reference, mean);
    return 0;
}
