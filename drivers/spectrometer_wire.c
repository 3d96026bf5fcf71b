#include "drivers/spectrometer_wire.h"

#include <errno.h>
#include <string.h>

#include "proto/units.h"

#define EP_COMMAND 0x01 /* spectrometer-ocean.md 2.1 */
#define EP_TAIL 0x82
#define EP_HEAD 0x86
#define EP_REPLY 0x81
#define FULL_SPEED 64 /* bytes a packet of the spectrum, spectrometer-ocean.md 2.1 */
#define HIGH_SPEED 512
#define OP_SLOT 0x05 /* spectrometer-ocean.md 3 */
#define OP_REQUEST 0x09
#define OP_TEMPERATURE 0x6c
#define OP_STATUS 0xfe
#define SYNC 0x69
#define REPLY_US US_PER_S          /* spectrometer-ocean.md 4: EP1 replies 1000 ms */
#define QUIET_US (100 * US_PER_MS) /* spectrometer-ocean.md 4, recovery (1) */
#define SKIPS 2                    /* leftover sync bytes seen in the field: at most two */
#define DRAIN_READS 200            /* far more than endpoints and FIFO hold */
#define CELSIUS_PER_COUNT 0.003906 /* opcode 6C */
#define TEMPERATURE_OK 0x08

static int gone(struct err *e) {
    return err_set(e, ERR_LINK, "the spectrometer is gone from USB: check its cable and its power");
}

static int not_home(int rc, const char *what, struct err *e) {
    if (rc == BENCH_UNTIL)
        return err_set(e, ERR_TIMEOUT, "the spectrometer sent no %s in time", what);
    return err_set(e, rc == -ERR_CANCELLED ? ERR_CANCELLED : ERR_STATE, "the wait for a %s was ended", what);
}

static int bad_transfer(const struct usb_transfer *t, struct err *e) {
    if (t->status == -ENODEV)
        return gone(e);
    return err_errno(e, ERR_IO, -t->status, "USB endpoint %02x of the spectrometer failed after %zu bytes",
                     t->endpoint, t->actual);
}

int spectrometer_wire_init(struct spectrometer_wire *w, const struct spectrometer_model *model,
                           struct usb_link *link, struct bench *bench, struct err *e) {
    *w = (struct spectrometer_wire){.link = link, .bench = bench, .model = model};
    if (!usb_link_has(link, EP_COMMAND) || !usb_link_has(link, EP_REPLY) || !usb_link_has(link, EP_TAIL))
        return err_set(e, ERR_DEVICE, "the USB device lacks endpoint 01, 81 or 82: no %s", model->title);
    int packet = usb_link_max_packet(link, EP_TAIL);
    if (packet != FULL_SPEED && packet != HIGH_SPEED) /* the frame buffer is made for these */
        return err_set(e, ERR_DEVICE,
                       "endpoint 82 of the USB device has packets of %d bytes, a %s has %d or %d", packet,
                       model->title, FULL_SPEED, HIGH_SPEED);
    bool high_speed = packet == HIGH_SPEED;
    w->head_bytes = high_speed ? model->head_bytes : 0;
    if (w->head_bytes && !usb_link_has(link, EP_HEAD))
        return err_set(e, ERR_DEVICE, "the USB device lacks endpoint 86: no %s", model->title);
    return 0;
}

static int all_transfers(struct spectrometer_wire *w, struct usb_transfer *all[5]) {
    struct usb_transfer *const list[] = {&w->command, &w->request, &w->reply, &w->head, &w->tail};
    memcpy(all, list, sizeof list);
    return 5;
}

void spectrometer_wire_recall(struct spectrometer_wire *w) {
    struct usb_transfer *all[5];
    int n = all_transfers(w, all);
    usb_link_recall(w->link, w->bench, all, n);
    w->requested = false;
}

static int submit(struct spectrometer_wire *w, struct usb_transfer *t, uint8_t endpoint, uint8_t *data,
                  size_t length, struct err *e) {
    *t = (struct usb_transfer){.endpoint = endpoint, .data = data, .length = length};
    return w->link->ops->submit(w->link->self, t, e);
}

static int submit_command(struct spectrometer_wire *w, const uint8_t *bytes, size_t n, struct err *e) {
    memcpy(w->command_data, bytes, n);
    return submit(w, &w->command, EP_COMMAND, w->command_data, n, e);
}

int spectrometer_wire_send(struct spectrometer_wire *w, const uint8_t *bytes, size_t n,
                           const struct cancel *cancel, struct err *e) {
    memcpy(w->command_data, bytes, n);
    w->command = (struct usb_transfer){.endpoint = EP_COMMAND, .data = w->command_data, .length = n};
    int64_t until = clock_stamp(w->bench->clock) + REPLY_US;
    int rc = usb_link_transfer(w->link, w->bench, &w->command, until, cancel, e);
    if (rc == 0 && w->command.status != 0)
        rc = bad_transfer(&w->command, e);
    return rc;
}

/* ---- queries ---- */

static bool query_settled(void *arg) {
    const struct spectrometer_wire *w = arg;
    return (!w->command.pending && (w->command.status || !w->reply.pending)) ||
           (!w->reply.pending && w->reply.status);
}

static int query_once(struct spectrometer_wire *w, const uint8_t *bytes, size_t n,
                      const struct cancel *cancel, struct err *e) {
    int rc = submit(w, &w->reply, EP_REPLY, w->reply_data, sizeof w->reply_data, e);
    if (rc == 0)
        rc = submit_command(w, bytes, n, e);
    if (rc == 0)
        rc = bench_wait(w->bench, clock_stamp(w->bench->clock) + REPLY_US, query_settled, w, cancel);
    struct usb_transfer *both[] = {&w->command, &w->reply};
    if (w->command.pending || w->reply.pending)
        usb_link_recall(w->link, w->bench, both, 2);
    if (rc < 0 && rc != -ERR_CANCELLED && rc != -ERR_STATE)
        return rc;
    if (rc != BENCH_DONE)
        return not_home(rc, "reply", e);
    if (w->command.status)
        return bad_transfer(&w->command, e);
    return w->reply.status ? bad_transfer(&w->reply, e) : 0;
}

/* Takes old replies off endpoint 81: after an interrupted query the next one would be answered by the last.
 */
static void drop_old_replies(struct spectrometer_wire *w) {
    for (int i = 0; i < 8; i++) {
        w->reply = (struct usb_transfer){
            .endpoint = EP_REPLY, .data = w->reply_data, .length = sizeof w->reply_data};
        int64_t until = clock_stamp(w->bench->clock) + 10 * US_PER_MS;
        if (usb_link_transfer(w->link, w->bench, &w->reply, until, NULL, NULL) != 0 || w->reply.status)
            break;
    }
    w->replies_stale = false;
}

/* A query has no effect, so one repeat is safe. The reply has at least `want` bytes (exactly, where the
 * reply has no echo) and repeats the first `echo` bytes of the query. */
static int query(struct spectrometer_wire *w, const uint8_t *bytes, size_t n, size_t want, size_t echo,
                 const struct cancel *cancel, struct err *e) {
    struct err last = {0};
    int rc = 0;
    for (int attempt = 0; attempt < 2; attempt++) {
        err_clear(&last);
        if (w->replies_stale)
            drop_old_replies(w);
        rc = query_once(w, bytes, n, cancel, &last);
        if (rc == 0 && (w->reply.actual < want || (echo == 0 && w->reply.actual != want) ||
                        memcmp(w->reply_data, bytes, echo) != 0))
            rc = err_set(&last, ERR_IO, "the spectrometer answered query %02x with %zu bytes, expected %zu",
                         bytes[0], w->reply.actual, want);
        if (rc == 0)
            return 0;
        w->replies_stale = true;
        if (rc == -ERR_CANCELLED || rc == -ERR_LINK)
            break;
    }
    return err_set(e, -rc, "%s", last.text);
}

int spectrometer_wire_status(struct spectrometer_wire *w, struct spectrometer_status *status,
                             const struct cancel *cancel, struct err *e) {
    int rc = query(w, (uint8_t[]){OP_STATUS}, 1, 16, 0, cancel, e);
    if (rc)
        return rc;
    const uint8_t *b = w->reply_data; /* spectrometer-ocean.md 3.2 */
    *status = (struct spectrometer_status){
        .pixels = b[0] | b[1] << 8,
        .exposure_us = b[2] | b[3] << 8 | b[4] << 16 | (uint32_t)b[5] << 24,
        .lamp = b[6] != 0,
        .trigger = b[7],
        .frame_pending = (b[8] & 0x06) != 0,
        .packets_left = b[11] != 0,
    };
    return 0;
}

int spectrometer_wire_slot(struct spectrometer_wire *w, int slot, uint8_t data[SPECTROMETER_WIRE_SLOT],
                           const struct cancel *cancel, struct err *e) {
    int rc = query(w, (uint8_t[]){OP_SLOT, slot}, 2, 2 + SPECTROMETER_WIRE_SLOT, 2, cancel, e);
    if (rc == 0)
        memcpy(data, w->reply_data + 2, SPECTROMETER_WIRE_SLOT);
    return rc;
}

int spectrometer_wire_temperature(struct spectrometer_wire *w, double *celsius, struct err *e) {
    int rc = query(w, (uint8_t[]){OP_TEMPERATURE}, 1, 3, 0, NULL, e);
    if (rc)
        return rc;
    if (w->reply_data[0] != TEMPERATURE_OK)
        return err_set(e, ERR_DEVICE, "the spectrometer cannot read its temperature (result %d)",
                       w->reply_data[0]);
    *celsius = (int16_t)(w->reply_data[1] | w->reply_data[2] << 8) * CELSIUS_PER_COUNT;
    return 0;
}

/* ---- frames ---- */

static size_t frame_bytes(const struct spectrometer_wire *w) {
    return (size_t)w->model->pixels * 2 + 1;
}

/* Whole packets and more than the payload, so that the one-byte sync packet ends the read and a packet too
 * many is seen instead of lost (spectrometer-ocean.md 2.2). */
static int submit_tail(struct spectrometer_wire *w, struct err *e) {
    size_t packet = (size_t)usb_link_max_packet(w->link, EP_TAIL);
    size_t payload = frame_bytes(w) - w->head_bytes;
    size_t length = (payload + packet - 1) / packet * packet;
    return submit(w, &w->tail, EP_TAIL, w->frame_data + w->head_bytes, length, e);
}

int spectrometer_wire_request(struct spectrometer_wire *w, struct err *e) {
    int rc = 0;
    w->head = (struct usb_transfer){.actual = 0};
    w->skipped = 0;
    if (w->head_bytes)
        rc = submit(w, &w->head, EP_HEAD, w->frame_data, w->head_bytes, e);
    if (rc == 0)
        rc = submit_tail(w, e);
    w->request_data[0] = OP_REQUEST;
    w->requested_us = clock_stamp(w->bench->clock);
    if (rc == 0)
        rc = submit(w, &w->request, EP_COMMAND, w->request_data, 1, e);
    if (rc)
        spectrometer_wire_recall(w);
    w->requested = rc == 0;
    return rc;
}

static bool failed(const struct usb_transfer *t) {
    return !t->pending && t->status != 0;
}

static bool frame_settled(void *arg) {
    const struct spectrometer_wire *w = arg;
    if (failed(&w->request) || failed(&w->head) || failed(&w->tail))
        return true;
    bool leftover = !w->tail.pending && w->tail.actual == 1;
    return leftover || (!w->request.pending && !w->head.pending && !w->tail.pending);
}

/* A lone sync byte of an earlier frame in front of this one would shift every pixel. */
static bool is_leftover(const struct spectrometer_wire *w) {
    return !w->tail.pending && w->tail.status == 0 && w->tail.actual == 1 && w->tail.data[0] == SYNC &&
           w->skipped < SKIPS;
}

static int wait_frame(struct spectrometer_wire *w, int64_t until_us, const struct cancel *cancel,
                      struct err *e) {
    int rc = bench_wait(w->bench, until_us, frame_settled, w, cancel);
    while (rc == BENCH_DONE && is_leftover(w)) {
        w->skipped++;
        rc = submit_tail(w, e);
        if (rc)
            return rc;
        rc = bench_wait(w->bench, until_us, frame_settled, w, cancel);
    }
    return rc == BENCH_DONE ? 0 : not_home(rc, "spectrum", e);
}

static bool all_equal(const uint16_t *counts, int n) {
    for (int i = 1; i < n; i++)
        if (counts[i] != counts[0])
            return false;
    return true;
}

static int check_frame(const struct spectrometer_wire *w, struct err *e) {
    const struct usb_transfer *const parts[] = {&w->request, &w->head, &w->tail};
    for (int i = 0; i < 3; i++)
        if (failed(parts[i]))
            return bad_transfer(parts[i], e);
    size_t got = w->head.actual + w->tail.actual, want = frame_bytes(w);
    if (w->head.actual != (size_t)w->head_bytes || got != want)
        return err_set(e, ERR_IO, "the spectrometer sent a spectrum of %zu bytes, expected %zu", got, want);
    if (w->frame_data[want - 1] != SYNC)
        return err_set(e, ERR_IO, "the spectrum ends in byte %02x, expected the sync byte %02x",
                       w->frame_data[want - 1], SYNC);
    return 0;
}

int spectrometer_wire_frame(struct spectrometer_wire *w, int64_t until_us, uint16_t *counts, int64_t *done_us,
                            const struct cancel *cancel, struct err *e) {
    int rc = wait_frame(w, until_us, cancel, e);
    if (rc == -ERR_CANCELLED)
        return rc;
    if (rc == 0)
        rc = check_frame(w, e);
    if (rc) {
        spectrometer_wire_recall(w);
        return rc;
    }
    w->requested = false;
    for (int i = 0; i < w->model->pixels; i++)
        counts[i] = w->frame_data[2 * i] | w->frame_data[2 * i + 1] << 8;
    *done_us = w->tail.completed_us > w->head.completed_us ? w->tail.completed_us : w->head.completed_us;
    if (all_equal(counts, w->model->active_last + 1))
        return err_set(e, ERR_IO, "every pixel of the spectrum reads %d: that is no spectrum", counts[0]);
    return 0;
}

/* ---- draining ---- */

static bool any_home(void *arg) {
    const struct spectrometer_wire *w = arg;
    return (w->head.endpoint && !w->head.pending) || !w->tail.pending || !w->reply.pending;
}

static int submit_drain(struct spectrometer_wire *w, struct usb_transfer *t, struct err *e) {
    if (t == &w->reply)
        return submit(w, t, EP_REPLY, w->reply_data, sizeof w->reply_data, e);
    if (t == &w->tail)
        return submit_tail(w, e);
    return submit(w, t, EP_HEAD, w->frame_data, w->head_bytes, e);
}

/* What a drain read brought home: its bytes are dropped, a stall is cleared, the read is queued again. */
static int renew_drain(struct spectrometer_wire *w, struct usb_transfer *t, bool *saw, struct err *e) {
    if (t->pending || !t->endpoint)
        return 0;
    if (t->status == -ENODEV)
        return gone(e);
    *saw = *saw || t->actual > 0;
    int rc = 0;
    if (t->status == -EPIPE)
        rc = w->link->ops->clear_halt(w->link->self, t->endpoint, e);
    return rc ? rc : submit_drain(w, t, e);
}

static int drain_until_quiet(struct spectrometer_wire *w, int64_t first_us, const struct cancel *cancel,
                             struct err *e) {
    struct usb_transfer *const reads[] = {&w->tail, &w->head, &w->reply};
    int64_t until = clock_stamp(w->bench->clock) + (first_us > QUIET_US ? first_us : QUIET_US);
    for (int round = 0; round < DRAIN_READS; round++) {
        int rc = bench_wait(w->bench, until, any_home, w, cancel);
        if (rc == BENCH_UNTIL)
            return 0;
        if (rc < 0)
            return not_home(rc, "quiet", e);
        bool saw = false;
        for (int i = 0; i < 3 && rc == 0; i++)
            rc = renew_drain(w, reads[i], &saw, e);
        if (rc)
            return rc;
        if (saw)
            until = clock_now_us(w->bench->clock) + QUIET_US;
    }
    return err_set(e, ERR_IO, "the spectrometer does not stop sending");
}

int spectrometer_wire_drain(struct spectrometer_wire *w, int64_t first_us, const struct cancel *cancel,
                            struct err *e) {
    spectrometer_wire_recall(w);
    int rc = submit_drain(w, &w->tail, e);
    w->head = (struct usb_transfer){.actual = 0};
    if (rc == 0 && w->head_bytes)
        rc = submit_drain(w, &w->head, e);
    if (rc == 0)
        rc = submit_drain(w, &w->reply, e);
    if (rc == 0)
        rc = drain_until_quiet(w, first_us, cancel, e);
    spectrometer_wire_recall(w);
    w->replies_stale = false;
    return rc;
}

int spectrometer_wire_clear_halts(struct spectrometer_wire *w, struct err *e) {
    static const uint8_t IN[] = {EP_TAIL, EP_HEAD, EP_REPLY};
    for (size_t i = 0; i < sizeof IN; i++) {
        int rc = usb_link_has(w->link, IN[i]) ? w->link->ops->clear_halt(w->link->self, IN[i], e) : 0;
        if (rc)
            return rc;
    }
    return 0;
}
