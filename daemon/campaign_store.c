/* From a set of scans to durable rows: every session it belongs to gets the exposure and what the reduction makes of
 * it in one transaction. It happens in a service of the bench, while the stage is already on its way. */
#include "daemon/campaign_private.h"

#include <string.h>

/* ---- one set into one session ---- */

static int sink_point(void *arg, struct point *p, struct err *e) {
    struct measured *m = arg;
    struct campaign *c = m->campaign;
    p->id = ++m->last_point;
    writer_point(c->writer, m->file, p);
    m->n_provisional += p->provisional ? 1 : p->supersedes ? -1 : 0;
    m->n_points += p->supersedes ? 0 : 1;
    if (fit_points_add(m->points, p) < 0)
        return err_set(e, ERR_NOMEM, "no memory for the points of %s", m->name);
    json_t *event = json_pack("{s:s, s:i, s:b, s:f, s:f}", "session", m->name, "point", (int)p->id,
                              "provisional", p->provisional, "theta_i_deg", deg_from_udeg(p->theta_i_udeg),
                              "theta_v_deg", deg_from_udeg(p->theta_v_udeg));
    json_object_set_new(event, "beta", isfinite(p->mean) ? json_real(p->mean) : json_null());
    campaign_event(c, "point", true, event);
    campaign_fit_point(c, m);
    return 0;
}

static int sink_bracket(void *arg, const struct bracket *b, struct err *e) {
    struct measured *m = arg;
    (void)e;
    writer_bracket(m->campaign->writer, m->file, b);
    fit_points_bracket(m->points, b);
    return 0;
}

/* The reading is shared: each session gets the row, a person the warning once. */
static bool is_first(const struct campaign *c, const struct measured *m) {
    const struct measured *first = c->measured;
    while (!first->used)
        first++;
    return m == first;
}

static int sink_linearity(void *arg, struct linearity *l, struct err *e) {
    struct measured *m = arg;
    (void)e;
    writer_linearity(m->campaign->writer, m->file, l);
    if (l->beyond && is_first(m->campaign, m))
        campaign_warn(
            m->campaign,
            "the light path is not linear as far as stated: the diffuser is %.5f times as bright in %g ms "
            "as in %g ms (u %.5f); %.1g of full scale goes into the uncertainty instead of %.1g",
            l->ratio, l->long_us / 1e3, l->short_us / 1e3, l->u_ratio, l->used_rel, l->prior_rel);
    return 0;
}

struct reduce_sink campaign_store_sink(struct measured *m, struct campaign *c) {
    m->campaign = c;
    return (struct reduce_sink){
        .arg = m, .point = sink_point, .bracket = sink_bracket, .linearity = sink_linearity};
}

static int store_in(struct campaign *c, int sample, struct err *e) {
    struct measured *m = &c->measured[sample];
    struct exposure x = c->set.x;
    struct reduce_sink sink = campaign_store_sink(m, c);
    if (x.control && !(c->set.closes_for >> sample & 1))
        x.bracket = 0;
    if (x.control && !(c->set.opens_for >> sample & 1))
        x.opens = 0;
    x.id = ++m->last_exposure;
    writer_exposure(c->writer, m->file, &x);
    if (fit_points_exposure(m->points, x.id, x.mirrored) < 0)
        return err_set(e, ERR_NOMEM, "no memory for the points of %s", m->name);
    int result = reducer_add(m->reducer, &x, &sink, e);
    c->ticket = writer_commit(c->writer, m->file);
    return result;
}

static void process(struct campaign *c) {
    int result = 0;
    for (int i = 0; i < JOB_SAMPLES && result == 0; i++)
        if (c->set.samples >> i & 1 && c->measured[i].used)
            result = store_in(c, i, &c->store_failure);
    c->set.full = false;
    campaign_fit_next(c);
}

/* ---- waiting ---- */

static int failure(struct campaign *c, struct err *e) {
    if (c->store_failure.code) {
        *e = c->store_failure;
        return -e->code;
    }
    return writer_failure(c->writer, e);
}

static bool has_room(void *arg) {
    struct campaign *c = arg;
    return !c->set.full && writer_durable(c->writer, c->ticket) && writer_has_room(c->writer);
}

int campaign_store_room(struct campaign *c, struct err *e) {
    int result = bench_wait(c->bench, CLOCK_NEVER, has_room, c, &c->cancel);
    if (result < 0)
        return err_set(e, -result, "stopped while waiting for the disk");
    return failure(c, e);
}

void campaign_store_set(struct campaign *c) {
    c->set.full = true;
}

int campaign_store_drain(struct campaign *c, const struct cancel *cancel, struct err *e) {
    if (c->set.full)
        process(c);
    c->ticket = writer_commit_all(c->writer);
    int result = bench_wait(c->bench, CLOCK_NEVER, writer_idle, c->writer, cancel);
    return result < 0 ? err_set(e, -result, "stopped while waiting for the disk") : failure(c, e);
}

/* ---- facts that belong to every session ---- */

void campaign_store_event(struct campaign *c, const char *kind, json_t *json) {
    char *text = c->writer ? json_dumps(json, JSON_COMPACT) : NULL;
    for (int i = 0; text && i < JOB_SAMPLES; i++)
        if (c->measured[i].used)
            writer_event(c->writer, c->measured[i].file, campaign_now_us(c), kind, text);
    free(text);
    json_decref(json);
}

static size_t put16(uint8_t *to, unsigned value) {
    to[0] = (uint8_t)(value >> 8);
    to[1] = (uint8_t)value;
    return 2;
}

static size_t put_registers(uint8_t *to, const struct modbus_request *rq) {
    size_t n = 0;
    to[n++] = (uint8_t)(2 * rq->count);
    for (int i = 0; i < rq->count; i++)
        n += put16(to + n, rq->regs[i]);
    return n;
}

/* The frame as it was on the wire, without checksum or transaction number: unit, function, data. */
static size_t request_bytes(const struct modbus_request *rq, uint8_t *to) {
    size_t n = 0;
    to[n++] = (uint8_t)rq->unit;
    to[n++] = (uint8_t)rq->function;
    n += put16(to + n, rq->addr);
    if (rq->function == 6)
        return n + put16(to + n, rq->regs[0]);
    n += put16(to + n, rq->count);
    return rq->function == 16 ? n + put_registers(to + n, rq) : n;
}

static size_t reply_bytes(const struct modbus_request *rq, int result, uint8_t *to) {
    size_t n = 0;
    if (result < 0 && !rq->exception)
        return 0;
    to[n++] = (uint8_t)rq->unit;
    to[n++] = (uint8_t)(rq->function | (rq->exception ? 0x80 : 0));
    if (rq->exception) {
        to[n++] = (uint8_t)rq->exception;
        return n;
    }
    if (rq->function == 3)
        return n + put_registers(to + n, rq);
    n += put16(to + n, rq->addr);
    return n + put16(to + n, rq->function == 6 ? rq->regs[0] : (unsigned)rq->count);
}

void campaign_seen_exchange(void *campaign, const char *link, int64_t sent_us, int64_t done_us,
                            const struct modbus_request *sent, const struct modbus_request *reply,
                            int result) {
    struct campaign *c = campaign;
    uint8_t request[8 + 2 * MODBUS_REGS_MAX], answer[8 + 2 * MODBUS_REGS_MAX];
    if (!c->writer)
        return;
    size_t request_size = request_bytes(sent, request);
    size_t answer_size = reply_bytes(reply, result, answer);
    for (int i = 0; i < JOB_SAMPLES; i++)
        if (c->measured[i].used)
            writer_exchange(c->writer, c->measured[i].file, sent_us + c->offset_us, done_us + c->offset_us,
                            link, request, request_size, answer, answer_size, result);
}

/* ---- the bench service ---- */

static struct campaign *of_set(void *self) {
    return (struct campaign *)((char *)self - offsetof(struct campaign, set));
}

static int64_t due_us(void *self) {
    const struct campaign *c = of_set(self);
    return c->set.full ? clock_now_us(c->clock) : CLOCK_NEVER;
}

static void run(void *self) {
    struct campaign *c = of_set(self);
    if (c->set.full)
        process(c);
}

int campaign_store_start(struct campaign *c) {
    struct bench_service service = {.name = "reduce", .self = &c->set, .due_us = due_us, .run = run};
    return bench_add(c->bench, &service);
}
