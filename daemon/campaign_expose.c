/* One set of scans: exposure time, dark, lamp, scans, and shorter again while it saturates. Exposure times come from
 * a ladder of quarter octaves, so that few darks are needed. What one set of a surface showed chooses the time of the
 * next. */
#include "daemon/campaign_private.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define FIRST_GUESS_US (32 * US_PER_MS)
#define LADDER 1.189207115002721 /* 2^(1/4): a set within 16 % of what was aimed at, and darks are shared */
#define NEAR_LOW 0.8             /* of the target: less loses light */
#define NEAR_HIGH 1.08           /* of the target: more comes near saturation at the usual target of 0.8 */
#define PROBE_TRIES 12           /* by 16 a time the whole range of a spectrometer takes 6 */
#define PROBE_SEEN 0.02  /* a peak above this share of saturation is known well enough to extrapolate */
#define UNDEREXPOSED 8   /* a set this many times below the target is taken again longer */
#define GROWTH_MAX 4     /* towards a mirror peak the signal rises from view to view */
#define OVERLAP_RATIO 4  /* noise of the short reading against distance between the two: best at 3 to 4 */
#define SATURATED_STEP 4 /* shorter by this, when all that is known is that it was too long */

/* ---- the ladder ---- */

/* The longest time of the ladder that is not above the one wanted: LADDER^n of the shortest, or the limit itself. */
static int rung(const struct campaign *c, double wanted_us) {
    double limit[2];
    plan_exposure_limits_us(c->job, c->instruments.model, limit);
    double us = limit[0], high = limit[1];
    while (us * LADDER <= wanted_us && us * LADDER <= high)
        us *= LADDER;
    if (us * LADDER > high && wanted_us >= high)
        us = high;
    return spectrometer_round_exposure((int)us);
}

struct light *campaign_light_of(struct campaign *c, const struct step *s) {
    bool own = s->kind == STEP_REFERENCE && !s->control;
    return &c->light[s->kind == STEP_SAMPLE ? s->sample : SURFACE_REFERENCE + own];
}

/* The time in use is kept while it is near enough: a change costs a frame and perhaps a dark. */
static int choose_exposure(const struct campaign *c, const struct light *l) {
    double trend = fmin(fmax(l->growth, 1), GROWTH_MAX);
    double wanted_us = c->job->exposure.target / (l->rate * trend);
    double share = c->last_exposure_us / wanted_us;
    return share > NEAR_LOW && share < NEAR_HIGH ? c->last_exposure_us : rung(c, wanted_us);
}

static void learn(struct light *l, double peak, int exposure_us) {
    double rate = peak / exposure_us;
    l->growth = l->known ? rate / l->rate : 1;
    l->rate = rate;
    l->known = true;
}

static double peak_of(const struct campaign *c, const struct frame *frames, int n) {
    const struct calibration *k = spectrometer_calibration(c->instruments.spectrometer);
    double peak = 0;
    for (int i = 0; i < n; i++)
        peak = fmax(peak, reduce_peak(k, frames[i].counts));
    return fmax(peak, 1e-6);
}

/* ---- the spectrometer ---- */

int campaign_set_lamp(struct campaign *c, bool on, struct err *e) {
    if (c->setup.config->shutter == SHUTTER_NONE || c->lamp == on)
        return 0;
    if (c->setup.config->shutter == SHUTTER_MANUAL) {
        int result = campaign_hold(c, on ? "Open the shutter" : "Shut the shutter", true, 0, e);
        if (result < 0)
            return result;
        c->lamp = on;
        c->shutter_us = clock_now_us(c->clock);
        if (c->setup.wiring->shutter)
            c->setup.wiring->shutter(c->setup.wiring->self, on);
        return 0;
    }
    int result = spectrometer_set_lamp(c->instruments.spectrometer, on, &c->cancel, e);
    c->lamp = result == 0 ? on : -1;
    c->spectrometer_suspect |= result < 0;
    return result;
}

static int scan(struct campaign *c, int exposure_us, int n, int64_t not_before_us, struct err *e) {
    struct spectrometer *s = c->instruments.spectrometer;
    int result = spectrometer_set_exposure(s, exposure_us, &c->cancel, e);
    if (result == 0)
        result = spectrometer_acquire(s, n, not_before_us, c->frames, &c->cancel, e);
    c->spectrometer_suspect |= result < 0;
    if (result < 0)
        return result;
    c->last_peak = peak_of(c, c->frames, n);
    c->last_exposure_us = exposure_us;
    c->last_set_us = clock_now_us(c->clock);
    return 0;
}

static int64_t lit_and_settled_us(const struct campaign *c, const struct stage_reading *at) {
    return at->settled_us > c->shutter_us ? at->settled_us : c->shutter_us;
}

/* Finds an exposure time for a surface not seen before, by single scans that are not kept. */
static int probe(struct campaign *c, struct light *l, int64_t settled_us, struct err *e) {
    int exposure_us = rung(c, FIRST_GUESS_US);
    for (int i = 0; i < PROBE_TRIES; i++) {
        int result = scan(c, exposure_us, 1, settled_us, e);
        if (result < 0)
            return result;
        bool saturated = c->frames[0].saturated_pixels > 0;
        learn(l, c->last_peak, exposure_us);
        l->growth = 1;
        int next = saturated ? rung(c, exposure_us / (double)(SATURATED_STEP * SATURATED_STEP))
                             : rung(c, fmin(c->job->exposure.target / l->rate, 16.0 * exposure_us));
        if (next == exposure_us || (!saturated && c->last_peak > PROBE_SEEN))
            return 0;
        exposure_us = next;
    }
    return 0;
}

/* ---- a set on its way to the sessions ---- */

static int copy_counts(struct campaign *c, int n, struct err *e) {
    struct set *set = &c->set;
    int pixels = c->frames[0].pixels;
    size_t wanted = (size_t)n * pixels;
    if (wanted > set->capacity) {
        uint16_t *larger = realloc(set->counts, wanted * sizeof *larger);
        if (!larger)
            return err_set(e, ERR_NOMEM, "no memory for %d scans", n);
        set->counts = larger;
        set->capacity = wanted;
    }
    for (int i = 0; i < n; i++)
        memcpy(set->counts + (size_t)i * pixels, c->frames[i].counts, pixels * sizeof *set->counts);
    return 0;
}

static void fill_times(struct campaign *c, struct exposure *x, const struct stage_reading *at, int n) {
    x->source_udeg = at->udeg[STAGE_SOURCE];
    x->sample_udeg = at->udeg[STAGE_SAMPLE];
    x->holder_udeg = at->udeg[STAGE_HOLDER];
    x->settled_us = at->settled_us + c->offset_us;
    x->start_us = c->frames[0].start_us + c->offset_us;
    x->end_us = c->frames[n - 1].end_us + c->offset_us;
    x->utc_us = clock_utc_us(c->clock);
}

static int fill_set(struct campaign *c, int k, const struct set *head, const struct stage_reading *at, int n,
                    struct err *e) {
    static const enum exposure_kind kind[] = {[STEP_REFERENCE] = EXPOSURE_REFERENCE,
                                              [STEP_SAMPLE] = EXPOSURE_SAMPLE,
                                              [STEP_TRAP] = EXPOSURE_TRAP,
                                              [STEP_OVERLAP] = EXPOSURE_OVERLAP};
    const struct step *s = &c->plan->step[k];
    uint16_t *counts = c->set.counts;
    size_t capacity = c->set.capacity;
    c->set = *head;
    c->set.counts = counts;
    c->set.capacity = capacity;
    struct exposure *x = &c->set.x;
    x->step = k;
    x->kind = head->dark ? EXPOSURE_DARK : kind[s->kind];
    x->attempt = head->dark ? c->dark_attempt[k]++ : c->attempt[k]++;
    x->theta_i_udeg = s->theta_i_udeg;
    x->theta_v_udeg = s->theta_v_udeg;
    x->mirrored = s->mirrored;
    x->exposure_us = c->last_exposure_us;
    x->n_scans = n;
    x->pixels = c->frames[0].pixels;
    x->lamp = c->setup.config->shutter == SHUTTER_LAMP_LINE ? c->frames[0].lamp : !head->dark;
    x->temperature_c = NAN;
    for (int i = 0; i < n; i++)
        if (c->frames[i].saturated_pixels > x->saturated_pixels)
            x->saturated_pixels = c->frames[i].saturated_pixels;
    fill_times(c, x, at, n);
    if (head->dark || s->control)
        spectrometer_temperature(c->instruments.spectrometer, &x->temperature_c, NULL);
    if (isfinite(x->temperature_c))
        c->last_temperature_c = x->temperature_c;
    int result = copy_counts(c, n, e);
    x->counts = c->set.counts;
    return result;
}

/* ---- darks ---- */

static struct dark *dark_of(struct campaign *c, int exposure_us, int n_scans) {
    for (int i = 0; i < c->n_darks; i++)
        if (c->dark[i].exposure_us == exposure_us && c->dark[i].n_scans == n_scans)
            return &c->dark[i];
    /* There is always a place (CAMPAIGN_DARKS); were there none, another time would be measured anew. */
    struct dark *d = &c->dark[c->n_darks < CAMPAIGN_DARKS ? c->n_darks++ : c->last_bracket % CAMPAIGN_DARKS];
    *d = (struct dark){.exposure_us = exposure_us, .n_scans = n_scans};
    for (int i = 0; i < JOB_SAMPLES; i++)
        d->taken_us[i] = INT64_MIN;
    return d;
}

static uint32_t without_dark(const struct campaign *c, const struct dark *d, uint32_t samples) {
    int64_t oldest_us = clock_now_us(c->clock) - (int64_t)(c->job->exposure.dark_every_min * US_PER_MIN);
    uint32_t mask = 0;
    for (int i = 0; i < JOB_SAMPLES; i++)
        if (samples >> i & 1 && d->taken_us[i] < oldest_us)
            mask |= 1u << i;
    return mask;
}

static int take_dark(struct campaign *c, int k, struct dark *d, uint32_t samples, struct err *e) {
    struct set head = {.dark = true, .samples = samples};
    struct stage_reading at;
    int result = campaign_set_lamp(c, false, e);
    stage_read(&c->instruments.stage, &at);
    if (result == 0)
        result = campaign_store_room(c, e);
    if (result == 0)
        result = scan(c, d->exposure_us, d->n_scans, clock_now_us(c->clock), e);
    if (result == 0)
        result = fill_set(c, k, &head, &at, d->n_scans, e);
    if (result < 0)
        return result;
    for (int i = 0; i < JOB_SAMPLES; i++)
        if (samples >> i & 1)
            d->taken_us[i] = clock_now_us(c->clock);
    d->owed &= ~samples;
    campaign_store_set(c);
    return 0;
}

int campaign_owed_darks(struct campaign *c, int k, struct err *e) {
    int result = 0;
    for (int i = 0; i < c->n_darks && result == 0; i++)
        if (c->dark[i].owed)
            result = take_dark(c, k, &c->dark[i], c->dark[i].owed, e);
    return result;
}

/* With a shutter worked by hand the first dark of an exposure time may follow its readings, which wait for it
 * (reduce.h): so it is asked for once in dark_every_min, not at each new exposure time. */
static int owe_dark(struct campaign *c, int k, struct dark *d, uint32_t samples, struct err *e) {
    int64_t now_us = clock_now_us(c->clock), oldest_us = now_us;
    bool grown_old = false;
    if (!d->owed)
        d->owed_us = now_us;
    for (int i = 0; i < JOB_SAMPLES; i++)
        grown_old |= samples >> i & 1 && d->taken_us[i] != INT64_MIN;
    d->owed |= samples;
    for (int i = 0; i < c->n_darks; i++)
        if (c->dark[i].owed && c->dark[i].owed_us < oldest_us)
            oldest_us = c->dark[i].owed_us;
    if (!grown_old && now_us - oldest_us < (int64_t)(c->job->exposure.dark_every_min * US_PER_MIN))
        return 0;
    return campaign_owed_darks(c, k, e);
}

static int ensure_dark(struct campaign *c, int k, int exposure_us, int n, uint32_t samples, struct err *e) {
    struct dark *d = dark_of(c, exposure_us, n);
    uint32_t missing = without_dark(c, d, samples);
    if (c->setup.config->shutter == SHUTTER_NONE || !missing)
        return 0;
    return c->setup.config->shutter == SHUTTER_MANUAL ? owe_dark(c, k, d, missing, e)
                                                      : take_dark(c, k, d, missing, e);
}

/* ---- a reading ---- */

/* The stage must stand where it had settled, from before the first scan until after the last (design 4.1, 4.2). */
static int check_still(const struct campaign *c, const struct stage_reading *before, struct err *e) {
    struct stage_reading after;
    stage_read(&c->instruments.stage, &after);
    if (after.settled_us == before->settled_us && after.settled_us != CLOCK_NEVER)
        return 0;
    return err_set(e, ERR_BUSY,
                   "the stage moved while the spectrometer was exposing: the reading is taken again");
}

/* Takes and stores one set at this exposure time. */
static int take_set(struct campaign *c, int k, const struct set *head, int exposure_us, struct err *e) {
    struct stage_reading at;
    int n = head->n_scans ? head->n_scans : c->job->exposure.average;
    int result = ensure_dark(c, k, exposure_us, n, head->samples, e);
    if (result == 0)
        result = campaign_set_lamp(c, true, e);
    stage_read(&c->instruments.stage, &at);
    if (result == 0)
        result = campaign_store_room(c, e);
    if (result == 0)
        result = scan(c, exposure_us, n, lit_and_settled_us(c, &at) + 1, e); /* strictly after: design 4.1 */
    if (result == 0)
        result = check_still(c, &at, e);
    if (result == 0)
        result = fill_set(c, k, head, &at, n, e);
    return result;
}

/* Whether the set that lies in c->set is too weak to be worth keeping, when it could be exposed longer. */
static bool is_too_weak(const struct campaign *c, int exposure_us) {
    double share = c->last_peak / c->job->exposure.target;
    return share * UNDEREXPOSED < 1 && rung(c, exposure_us / share) > exposure_us;
}

static int next_exposure(struct campaign *c, struct light *l, int exposure_us) {
    bool saturated = c->set.x.saturated_pixels > 0;
    learn(l, c->last_peak, exposure_us);
    if (saturated) {
        l->growth = 1;
        l->rate = fmax(l->rate, SATURATED_STEP * c->job->exposure.target / exposure_us);
        return rung(c, exposure_us / (double)SATURATED_STEP);
    }
    return rung(c, c->job->exposure.target / l->rate);
}

int campaign_expose(struct campaign *c, int k, const struct set *head, struct err *e) {
    struct light *l = campaign_light_of(c, &c->plan->step[k]);
    struct stage_reading at;
    int result = campaign_ready_spectrometer(c, e);
    stage_read(&c->instruments.stage, &at);
    if (result == 0 && !l->known) {
        result = campaign_set_lamp(c, true, e);
        if (result == 0)
            result = probe(c, l, lit_and_settled_us(c, &at), e);
    }
    int exposure_us = result == 0 ? choose_exposure(c, l) : 0;
    for (bool weak_before = false; result == 0;) {
        result = take_set(c, k, head, exposure_us, e);
        if (result < 0)
            break;
        bool saturated = c->set.x.saturated_pixels > 0;
        bool weak = !saturated && !weak_before && is_too_weak(c, exposure_us);
        int next = next_exposure(c, l, exposure_us);
        if (!weak)
            campaign_store_set(c);
        if (saturated && next < exposure_us)
            campaign_store_event(
                c, "saturated",
                json_pack("{s:i, s:i, s:i}", "step", k, "exposure_us", exposure_us, "next_us", next));
        if (saturated && next >= exposure_us)
            campaign_warn(c, "step %d saturates at the shortest exposure: its reading is marked and not used",
                          k);
        if (!weak && !(saturated && next < exposure_us))
            break;
        weak_before = weak;
        exposure_us = next;
    }
    return result;
}

int campaign_expose_overlap(struct campaign *c, int k, const struct set *head, struct err *e) {
    struct set many = *head;
    many.n_scans = c->n_frames;
    int result = campaign_expose(c, k, &many, e);
    if (result < 0)
        return result;
    int long_us = c->last_exposure_us, short_us = rung(c, long_us / (double)OVERLAP_RATIO);
    if (short_us * PLAN_OVERLAP_SPAN > long_us) {
        campaign_warn(
            c,
            "the linearity of the light path was not tested: the diffuser fills the scale in %g ms, and "
            "exposure.min_ms is %g",
            long_us / 1e3, c->job->exposure.min_ms);
        return 0;
    }
    result = take_set(c, k, &many, short_us, e);
    if (result == 0)
        campaign_store_set(c);
    return result;
}
