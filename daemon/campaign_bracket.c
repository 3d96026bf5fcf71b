/* The order of readings: which step comes next, and the reference readings that open and close brackets around it
 * (measurement.md 3). The plan places them by its estimates; here they follow the clock: a bracket that grows too old
 * is closed and a new one opened, and one that ended without its closing reading has its points measured again. */
#include "daemon/campaign_private.h"

/* The plan makes brackets of nearly bracket_min; its estimate may be a little short. */
#define BRACKET_TOLERANCE 1.1

int campaign_next_step(struct campaign *c) {
    for (int k = 0; k < c->plan->n_steps; k++)
        if (!c->done[k])
            return k;
    return -1;
}

void campaign_mark_done(struct campaign *c, int k) {
    if (c->done[k])
        return;
    c->done[k] = true;
    c->n_done++;
    c->estimate_done_us += c->plan->step[k].estimate_us;
}

static void mark_open(struct campaign *c, int k) {
    if (!c->done[k])
        return;
    c->done[k] = false;
    c->n_done--;
    c->estimate_done_us -= c->plan->step[k].estimate_us;
}

/* ---- which sessions a reading belongs to ---- */

static bool is_sample_of(const struct campaign *c, int k, int bracket) {
    const struct step *s = &c->plan->step[k];
    return s->kind == STEP_SAMPLE && s->bracket == bracket && c->measured[s->sample].used;
}

static uint32_t samples_of_bracket(const struct campaign *c, int bracket) {
    uint32_t mask = 0;
    for (int k = 0; bracket && k < c->plan->n_steps; k++)
        if (is_sample_of(c, k, bracket))
            mask |= 1u << c->plan->step[k].sample;
    return mask;
}

static uint32_t all_samples(const struct campaign *c) {
    uint32_t mask = 0;
    for (int i = 0; i < c->job->n_samples; i++)
        if (c->measured[i].used)
            mask |= 1u << i;
    return mask;
}

static uint32_t samples_of_reading(const struct campaign *c, int k) {
    const struct step *s = &c->plan->step[k];
    uint32_t mask = 0;
    if (s->kind == STEP_SAMPLE)
        return 1u << s->sample;
    if (s->kind == STEP_TRAP || s->kind == STEP_OVERLAP)
        return all_samples(c);
    for (int j = k; j < c->plan->n_steps; j++)
        if (c->plan->step[j].reference == k && is_sample_of(c, j, s->bracket))
            mask |= 1u << c->plan->step[j].sample;
    return mask;
}

/* ---- control readings ---- */

static bool bracket_has_work(const struct campaign *c, int bracket) {
    for (int k = 0; k < c->plan->n_steps; k++)
        if (!c->done[k] && is_sample_of(c, k, bracket))
            return true;
    return false;
}

static int opening_step(const struct campaign *c, int bracket) {
    for (int k = 0; k < c->plan->n_steps; k++)
        if (c->plan->step[k].control && c->plan->step[k].opens == bracket)
            return k;
    return -1;
}

static int read_at(struct campaign *c, int k, const struct set *head, struct err *e) {
    int result = campaign_hold_for_step(c, k, e);
    if (result == 0)
        result = campaign_move(c, &c->plan->step[k], e);
    if (result < 0)
        return result;
    return c->plan->step[k].kind == STEP_OVERLAP ? campaign_expose_overlap(c, k, head, e)
                                                 : campaign_expose(c, k, head, e);
}

/* Reads the control geometry of step k: closes the bracket at hand and/or opens one for `opens` of the plan. */
static int read_control(struct campaign *c, int k, bool closes, int opens, struct err *e) {
    struct set head = {.x.control = true};
    head.closes_for = closes ? samples_of_bracket(c, c->plan_bracket) : 0;
    head.opens_for = samples_of_bracket(c, opens);
    head.samples = head.closes_for | head.opens_for;
    head.x.bracket = closes ? c->bracket : 0;
    head.x.opens = opens ? c->last_bracket + 1 : 0;
    int result = read_at(c, k, &head, e);
    if (result < 0)
        return result;
    c->bracket = head.x.opens;
    c->plan_bracket = opens;
    if (opens)
        c->last_bracket++;
    c->bracket_open_us = clock_now_us(c->clock);
    return 0;
}

static int read_control_step(struct campaign *c, int k, struct err *e) {
    const struct step *s = &c->plan->step[k];
    int closes_plan = s->bracket != s->opens ? s->bracket : 0;
    bool closes = c->bracket && c->plan_bracket == closes_plan;
    bool opens = s->opens && bracket_has_work(c, s->opens);
    if (!closes && !opens)
        return 0;
    return read_control(c, k, closes, opens ? s->opens : 0, e);
}

/* A geometry's own reference reading and its sample belong into one bracket (every_geometry). */
static bool splits_a_pair(const struct campaign *c) {
    for (int k = 0; k < c->plan->n_steps; k++) {
        const struct step *s = &c->plan->step[k];
        if (s->kind == STEP_SAMPLE && !c->done[k] && s->reference >= 0 && c->done[s->reference] &&
            !c->plan->step[s->reference].control)
            return true;
    }
    return false;
}

/* A bracket of start_end is as long as its campaign. */
static bool is_due(const struct campaign *c, const struct step *s) {
    double limit_us = BRACKET_TOLERANCE * c->job->reference.bracket_min * US_PER_MIN;
    if (c->job->reference.mode == REFERENCE_START_END)
        return false;
    return clock_now_us(c->clock) + s->estimate_us - c->bracket_open_us > limit_us && !splits_a_pair(c);
}

static int ensure_bracket(struct campaign *c, const struct step *s, struct err *e) {
    bool open = c->bracket && c->plan_bracket == s->bracket;
    if (open && !is_due(c, s))
        return 0;
    int opener = opening_step(c, s->bracket);
    if (opener < 0)
        return err_set(e, ERR_STATE, "the plan has no reading that opens bracket %d", s->bracket);
    return read_control(c, opener, open, s->bracket, e);
}

int campaign_read_step(struct campaign *c, int k, struct err *e) {
    const struct step *s = &c->plan->step[k];
    if (c->state == CAMPAIGN_PREPARING)
        campaign_set_state(c, CAMPAIGN_RUNNING);
    if (s->control)
        return read_control_step(c, k, e);
    struct set head = {.samples = samples_of_reading(c, k)};
    if (!head.samples)
        return 0;
    bool outside = s->kind == STEP_TRAP || s->kind == STEP_OVERLAP; /* of all brackets */
    int result = outside ? 0 : ensure_bracket(c, s, e);
    if (result < 0)
        return result;
    head.x.bracket = outside ? 0 : c->bracket;
    return read_at(c, k, &head, e);
}

/* ---- a bracket that ends without its closing reading ---- */

static void again(void *arg, int step) {
    mark_open(arg, step);
}

/* A sample that has to be read (again) needs its own reference reading from the same bracket. */
static void reopen_own_references(struct campaign *c) {
    for (int k = 0; k < c->plan->n_steps; k++) {
        const struct step *s = &c->plan->step[k];
        if (!c->done[k] && s->kind == STEP_SAMPLE && s->reference >= 0 &&
            !c->plan->step[s->reference].control)
            mark_open(c, s->reference);
    }
}

int campaign_end_bracket(struct campaign *c, const char *why, struct err *e) {
    if (!c->bracket)
        return 0;
    int result = campaign_store_drain(c, NULL, e);
    for (int i = 0; i < c->job->n_samples && result == 0; i++) {
        struct measured *m = &c->measured[i];
        struct reduce_sink sink = campaign_store_sink(m, c);
        if (m->used)
            result = reducer_end_bracket(m->reducer, why, &sink, again, c, e);
    }
    c->bracket = c->plan_bracket = 0;
    reopen_own_references(c);
    c->ticket = writer_commit_all(c->writer);
    return result;
}
