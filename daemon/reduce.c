#include "daemon/reduce_internal.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct chain { /* readings in the order of their exposures */
    struct reading *first, **end;
};

struct reducer {
    struct reduce_setup setup;
    struct resampler bands;
    struct drift drift;
    struct dark *dark;      /* newest first */
    struct chain waiting;   /* for a dark */
    struct chain sample;    /* of the open bracket */
    struct chain reference; /* of the open bracket: readings of single geometries */
    struct reading *slow;   /* overlap reading whose short one is still to come, NULL = none */
    double linearity_prior;
    struct reading *open; /* control reading that opened it, NULL = none open */
    int number, highest;  /* of the open bracket; of all so far */
    int64_t last_exposure_id;
};

static void chain_init(struct chain *c) {
    c->first = NULL;
    c->end = &c->first;
}

static void chain_add(struct chain *c, struct reading *x) {
    x->next = NULL;
    *c->end = x;
    c->end = &x->next;
}

static void chain_free(struct chain *c) {
    while (c->first) {
        struct reading *x = c->first;
        c->first = x->next;
        free(x);
    }
    chain_init(c);
}

static struct reading *chain_take(struct chain *c) {
    struct reading *x = c->first;
    c->first = x->next;
    if (!c->first)
        c->end = &c->first;
    return x;
}

static int check_setup(const struct reduce_setup *setup, struct err *e) {
    if (!setup->certificate)
        return err_set(e, ERR_INPUT, "the reduction needs the certificate of the reference diffuser");
    if (setup->mean_nm[0] < BAND_FIRST_NM || setup->mean_nm[1] > band_nm(BANDS - 1) ||
        mean_first_band(setup) > mean_last_band(setup))
        return err_set(e, ERR_RANGE, "mean_nm [%d, %d] holds no band; bands lie every %d nm from %d to %d nm",
                       setup->mean_nm[0], setup->mean_nm[1], BAND_STEP_NM, BAND_FIRST_NM, band_nm(BANDS - 1));
    return 0;
}

int reducer_new(struct reducer **out, const struct reduce_setup *setup, struct err *e) {
    int rc = check_setup(setup, e);
    if (rc < 0)
        return rc;
    struct reducer *r = calloc(1, sizeof *r);
    if (!r)
        return err_set(e, ERR_NOMEM, "out of memory for the reduction");
    r->setup = *setup;
    r->linearity_prior = setup->linearity_rel;
    chain_init(&r->waiting);
    chain_init(&r->sample);
    chain_init(&r->reference);
    rc = resampler_init(&r->bands, &setup->calibration, e);
    if (rc < 0) {
        free(r);
        return rc;
    }
    *out = r;
    return 0;
}

static void drop_bracket(struct reducer *r) {
    chain_free(&r->sample);
    chain_free(&r->reference);
    free(r->open);
    r->open = NULL;
}

void reducer_free(struct reducer *r) {
    if (!r)
        return;
    drop_bracket(r);
    chain_free(&r->waiting);
    free(r->slow);
    while (r->dark) {
        struct dark *d = r->dark;
        r->dark = d->next;
        free(d);
    }
    resampler_free(&r->bands);
    free(r);
}

/* Nothing measured on the far side of the normal: theta_i < 0 is the same geometry seen in the mirror. */
static void set_angles(struct reading *r, const struct exposure *x) {
    int32_t theta_v = x->sample_udeg, theta_i = x->source_udeg - x->sample_udeg;
    int sign = theta_i < 0 || (theta_i == 0 && x->mirrored) ? -1 : 1;
    r->theta_i_udeg = sign * theta_i;
    r->theta_v_udeg = sign * theta_v;
    r->nominal_i_udeg = x->theta_i_udeg;
    r->nominal_v_udeg = x->theta_v_udeg;
    r->mirrored = x->mirrored;
}

static int make_reading(struct reducer *r, const struct exposure *x, struct reading **out, struct err *e) {
    struct reading *reading = calloc(1, sizeof *reading);
    if (!reading)
        return err_set(e, ERR_NOMEM, "out of memory for the reduction");
    reading->kind = x->kind;
    reading->exposure_id = x->id;
    reading->step = x->step;
    reading->bracket = x->bracket;
    reading->opens = x->opens;
    reading->control = x->control;
    reading->at_us = ((double)x->start_us + (double)x->end_us) / 2;
    reading->exposure_us = x->exposure_us;
    reading->n_scans = x->n_scans;
    set_angles(reading, x);
    int rc = spectrum_make(&reading->light, &r->setup.calibration, &r->bands, x, e);
    if (rc < 0)
        free(reading);
    else
        *out = reading;
    return rc;
}

static int add_dark(struct reducer *r, const struct exposure *x, struct err *e) {
    struct dark *d = calloc(1, sizeof *d);
    if (!d)
        return err_set(e, ERR_NOMEM, "out of memory for the reduction");
    int rc = spectrum_make(&d->spectrum, &r->setup.calibration, &r->bands, x, e);
    if (rc < 0) {
        free(d);
        return rc;
    }
    d->exposure_id = x->id;
    d->exposure_us = x->exposure_us;
    d->n_scans = x->n_scans;
    d->next = r->dark;
    r->dark = d;
    return 0;
}

static bool subtract_dark(struct reducer *r, struct reading *x) {
    const struct dark *d = r->setup.without_dark ? NULL : r->dark;
    while (d && (d->exposure_us != x->exposure_us || d->n_scans != x->n_scans))
        d = d->next;
    if (!d && !r->setup.without_dark)
        return false;
    x->dark = d;
    for (int band = 0; band < BANDS; band++) {
        x->net[band] = x->light.value[band] - (d ? d->spectrum.value[band] : 0);
        double moment = x->light.moment[band] - (d ? d->spectrum.moment[band] : 0);
        x->centroid_nm[band] = x->net[band] > 0 ? moment / x->net[band] : 0;
    }
    return true;
}

static int emit_point(struct reducer *r, struct reading *x, const struct bridge *bridge,
                      const struct reduce_sink *sink, struct err *e) {
    struct point p;
    int rc = point_make(&p, &r->setup, &r->bands, x, bridge, e);
    if (rc < 0)
        return rc;
    p.supersedes = bridge->close ? x->point_id : 0;
    rc = sink->point(sink->arg, &p, e);
    if (rc == 0)
        x->point_id = p.id;
    return rc;
}

static void describe_bracket(const struct reducer *r, struct bracket *b) {
    memset(b, 0, sizeof *b);
    b->number = r->open ? r->number : 0;
    b->open_us = r->open ? (int64_t)r->open->at_us : 0;
    b->last_exposure_id = r->last_exposure_id;
    drift_rates(&r->drift, r->setup.drift_rate_prior, b->rate, &b->mean_rate);
}

static int close_bracket(struct reducer *r, const struct reading *closing, const struct reduce_sink *sink,
                         struct err *e) {
    struct bridge bridge = {r->open, closing};
    struct bracket b;
    if (!(closing->at_us > r->open->at_us))
        return err_set(e, ERR_STATE,
                       "the reading %lld that closes bracket %d is not later than the one that opened it",
                       (long long)closing->exposure_id, r->number);
    drift_add(&r->drift, &bridge, &r->setup);
    describe_bracket(r, &b);
    b.close_us = (int64_t)closing->at_us;
    snprintf(b.ended_by, sizeof b.ended_by, "reference");
    int rc = sink->bracket(sink->arg, &b, e);
    for (struct reading *x = r->sample.first; rc == 0 && x; x = x->next)
        rc = emit_point(r, x, &bridge, sink, e);
    drop_bracket(r);
    return rc;
}

static int take_control(struct reducer *r, struct reading *x, const struct reduce_sink *sink, struct err *e) {
    int rc = 0;
    if (r->open && x->bracket != r->number)
        rc = err_set(e, ERR_STATE, "reading %lld closes bracket %d, but bracket %d is open",
                     (long long)x->exposure_id, x->bracket, r->number);
    else if (r->open)
        rc = close_bracket(r, x, sink, e);
    if (rc == 0 && x->opens && x->opens <= r->highest)
        rc = err_set(e, ERR_STATE,
                     "reading %lld opens bracket %d again; after %d a higher number was expected",
                     (long long)x->exposure_id, x->opens, r->highest);
    if (rc < 0 || !x->opens) {
        free(x);
        return rc;
    }
    r->open = x;
    r->number = r->highest = x->opens;
    return 0;
}

static bool same_geometry(const struct reading *a, const struct reading *b) {
    return a->nominal_i_udeg == b->nominal_i_udeg && a->nominal_v_udeg == b->nominal_v_udeg &&
           a->mirrored == b->mirrored;
}

/* The reading of the diffuser at the sample's own geometry (every_geometry), the latest before it. */
static struct reading *find_own(const struct reducer *r, const struct reading *sample) {
    struct reading *found = NULL;
    for (struct reading *x = r->reference.first; x; x = x->next)
        if (same_geometry(x, sample))
            found = x;
    return found;
}

static int choose_reference(const struct reducer *r, struct reading *x, struct err *e) {
    bool same_incidence = r->open->nominal_i_udeg == x->nominal_i_udeg;
    switch (r->setup.mode) {
    case REFERENCE_EVERY_GEOMETRY:
        x->reference = find_own(r, x);
        if (x->reference || same_geometry(r->open, x))
            return 0;
        break;
    case REFERENCE_PER_INCIDENCE:
        if (same_incidence)
            return 0;
        break;
    default:
        return 0;
    }
    return err_set(
        e, ERR_STATE,
        "exposure %lld of the sample at theta_i %g, theta_v %g deg has no reference reading of its own "
        "%s in bracket %d",
        (long long)x->exposure_id, x->nominal_i_udeg / 1e6, x->nominal_v_udeg / 1e6,
        r->setup.mode == REFERENCE_PER_INCIDENCE ? "incidence" : "geometry", r->number);
}

/* A set of the same step measured again in the same bracket takes the place of the earlier one. */
static void drop_earlier(struct reducer *r, int step) {
    struct chain kept;
    chain_init(&kept);
    while (r->sample.first) {
        struct reading *x = chain_take(&r->sample);
        if (x->step == step)
            free(x);
        else
            chain_add(&kept, x);
    }
    r->sample = kept;
    if (!kept.first)
        chain_init(&r->sample);
}

static int take_sample(struct reducer *r, struct reading *x, const struct reduce_sink *sink, struct err *e) {
    int rc = choose_reference(r, x, e);
    if (rc < 0) {
        free(x);
        return rc;
    }
    drop_earlier(r, x->step);
    chain_add(&r->sample, x);
    return emit_point(r, x, &(struct bridge){r->open, NULL}, sink, e);
}

static int emit_linearity(struct reducer *r, const struct reading *fast, const struct reduce_sink *sink,
                          struct err *e) {
    struct linearity l;
    double rate[BANDS], mean_rate;
    drift_rates(&r->drift, r->setup.drift_rate_prior, rate, &mean_rate);
    if (!linearity_make(&l, r->slow, fast, r->bands.covered, r->linearity_prior, mean_rate))
        return 0;
    r->setup.linearity_rel = l.used_rel;
    return sink->linearity ? sink->linearity(sink->arg, &l, e) : 0;
}

/* A step that is taken again begins with its long reading. */
static int take_overlap(struct reducer *r, struct reading *x, const struct reduce_sink *sink, struct err *e) {
    int rc = 0;
    if (r->slow && r->slow->step == x->step && x->exposure_us < r->slow->exposure_us) {
        rc = emit_linearity(r, x, sink, e);
        free(x);
        x = NULL;
    }
    free(r->slow);
    r->slow = x;
    return rc;
}

static int take_reading(struct reducer *r, struct reading *x, const struct reduce_sink *sink, struct err *e) {
    if (x->kind == EXPOSURE_OVERLAP)
        return take_overlap(r, x, sink, e);
    if (x->control)
        return take_control(r, x, sink, e);
    if (!r->open || x->bracket != r->number) {
        int rc =
            err_set(e, ERR_STATE, "exposure %lld belongs to bracket %d, which no control reading has opened",
                    (long long)x->exposure_id, x->bracket);
        free(x);
        return rc;
    }
    if (x->kind == EXPOSURE_SAMPLE)
        return take_sample(r, x, sink, e);
    chain_add(&r->reference, x);
    return 0;
}

static int take_ready(struct reducer *r, const struct reduce_sink *sink, struct err *e) {
    int rc = 0;
    while (rc == 0 && r->waiting.first && subtract_dark(r, r->waiting.first))
        rc = take_reading(r, chain_take(&r->waiting), sink, e);
    return rc;
}

int reducer_add(struct reducer *r, const struct exposure *x, const struct reduce_sink *sink, struct err *e) {
    r->last_exposure_id = x->id;
    if (x->saturated_pixels > 0 || x->kind == EXPOSURE_TRAP)
        return 0;
    int rc;
    if (x->kind == EXPOSURE_DARK) {
        rc = add_dark(r, x, e);
    } else {
        struct reading *reading = NULL;
        rc = make_reading(r, x, &reading, e);
        if (rc == 0)
            chain_add(&r->waiting, reading);
    }
    return rc < 0 ? rc : take_ready(r, sink, e);
}

static void report_again(const struct chain *c, void (*again)(void *arg, int step), void *arg) {
    for (const struct reading *x = c->first; again && x; x = x->next)
        if (x->kind == EXPOSURE_SAMPLE || x->kind == EXPOSURE_OVERLAP)
            again(arg, x->step);
}

int reducer_end_bracket(struct reducer *r, const char *why, const struct reduce_sink *sink,
                        void (*again)(void *arg, int step), void *arg, struct err *e) {
    if (!r->open && !r->waiting.first)
        return 0;
    struct bracket b;
    describe_bracket(r, &b);
    snprintf(b.ended_by, sizeof b.ended_by, "%s", why);
    report_again(&r->sample, again, arg);
    report_again(&r->waiting, again, arg);
    drop_bracket(r);
    chain_free(&r->waiting);
    return sink->bracket(sink->arg, &b, e);
}

bool reducer_open_bracket(const struct reducer *r, struct bracket *b) {
    describe_bracket(r, b);
    return r->open != NULL;
}

int reducer_waiting(const struct reducer *r) {
    int n = 0;
    for (const struct reading *x = r->waiting.first; x; x = x->next)
        n++;
    return n;
}
