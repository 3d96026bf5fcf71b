#include "sim/ocean.h"

#include <math.h>
#include <string.h>

#define EP1_PACKET 64 /* the vendor's sheets; spectrometer-ocean.md 2.1 */
#define BULK_PACKET 512
#define FPGA_VERSION 0x04

/* Spectrometers warm up by a few degrees in the first half hour. */
static double board_celsius(int64_t now_us) {
    return 31.5 - 5.5 * exp(-(double)now_us / 1200e6);
}

int ocean_max_packet(uint8_t endpoint) {
    return endpoint == 0x01 || endpoint == 0x81   ? EP1_PACKET
           : endpoint == 0x82 || endpoint == 0x86 ? BULK_PACKET
                                                  : 0;
}

static void put(struct ocean_queue *q, const uint8_t *data, size_t size, size_t packet) {
    for (size_t done = 0; done < size; done += packet) {
        size_t n = size - done < packet ? size - done : packet;
        if (q->n == OCEAN_PACKETS || q->used + n > sizeof q->data)
            return; /* endpoint memory is full: the device would not answer either */
        memcpy(q->data + q->used, data + done, n);
        q->used += n;
        q->packet[q->n++] = (uint16_t)n;
    }
}

static void take(struct ocean_queue *q, uint8_t *data) {
    size_t n = q->packet[0];
    if (data)
        memcpy(data, q->data, n);
    q->used -= n;
    memmove(q->data, q->data + n, q->used);
    memmove(q->packet, q->packet + 1, sizeof q->packet[0] * (size_t)--q->n);
}

static void reply(struct ocean *o, const void *data, size_t size) {
    put(&o->reply, data, size, EP1_PACKET);
}

/* FE, spectrometer-ocean.md 3.2. */
static void reply_status(struct ocean *o) {
    uint32_t t = o->exposure_us;
    int pixels = o->model->pixels;
    uint8_t s[16] = {(uint8_t)pixels,    (uint8_t)(pixels >> 8), (uint8_t)t, (uint8_t)(t >> 8),
                     (uint8_t)(t >> 16), (uint8_t)(t >> 24),     o->lamp,    o->trigger};
    int loaded = o->first.n + o->rest.n;
    s[8] = (uint8_t)((o->requested ? 2 : 0) | (loaded || o->fifo_full ? 4 : 0));
    s[9] = (uint8_t)(pixels * 2 / BULK_PACKET);
    s[11] = (uint8_t)loaded;
    s[14] = 0x80;
    s[15] = 0xFF;
    reply(o, s, sizeof s);
}

static void reply_temperature(struct ocean *o, int64_t now_us) {
    int16_t t = (int16_t)lround(board_celsius(now_us) / 0.003906);
    reply(o, (uint8_t[]){0x08, (uint8_t)t, (uint8_t)(t >> 8)}, 3);
}

static void reply_slot(struct ocean *o, uint8_t slot) {
    uint8_t r[2 + OCEAN_SLOT_BYTES] = {0x05, slot};
    memset(r + 2, 0xFF, OCEAN_SLOT_BYTES);
    if (slot < OCEAN_SLOTS)
        memcpy(r + 2, o->eeprom[slot], OCEAN_SLOT_BYTES);
    reply(o, r, sizeof r);
}

static void set_exposure(struct ocean *o, const uint8_t *b) {
    uint32_t t = b[0] | (uint32_t)b[1] << 8 | (uint32_t)b[2] << 16 | (uint32_t)b[3] << 24;
    if (t >= o->model->min_us && t <= o->model->max_us)
        o->exposure_us = t; /* out of range is ignored without a word, spectrometer-ocean.md 3 */
}

static void set_lamp(struct ocean *o, int64_t now_us, bool on) {
    o->lamp = on;
    o->bench.lamp(o->bench.self, now_us, on);
}

static void execute(struct ocean *o, int64_t now_us, const uint8_t *b, size_t n) {
    switch (b[0]) {
    case 0x01:
        o->trigger = 0;
        break;
    case 0x02:
        if (n >= 5)
            set_exposure(o, b + 1);
        break;
    case 0x03:
        if (n >= 2)
            set_lamp(o, now_us, b[1] != 0);
        break;
    case 0x05:
        if (n >= 2)
            reply_slot(o, b[1]);
        break;
    case 0x09:
        ocean_request(o, now_us);
        break;
    case 0x0A:
        if (n >= 2 && b[1] <= 4)
            o->trigger = b[1];
        break;
    case 0x6A:
        if (n >= 4 && b[1] != FPGA_VERSION)
            o->fpga[b[1]] = (uint16_t)(b[2] | b[3] << 8);
        break;
    case 0x6B:
        if (n >= 2)
            reply(o, (uint8_t[]){b[1], (uint8_t)o->fpga[b[1]], (uint8_t)(o->fpga[b[1]] >> 8)}, 3);
        break;
    case 0x6C:
        reply_temperature(o, now_us);
        break;
    case 0xFE:
        reply_status(o);
        break;
    default: /* an unknown opcode gets no reply */
        break;
    }
}

int ocean_out(struct ocean *o, int64_t now_us, uint8_t endpoint, const uint8_t *data, size_t size) {
    if (endpoint != 0x01)
        return OCEAN_STALL;
    ocean_advance(o, now_us);
    if (size > 0)
        execute(o, now_us, data, size);
    ocean_advance(o, now_us);
    return (int)size;
}

static void load(struct ocean *o) {
    uint16_t counts[DETECTOR_PIXELS_MAX];
    uint8_t bytes[2 * DETECTOR_PIXELS_MAX];
    size_t size = 2 * (size_t)o->model->pixels, first = o->model->pixels == 3840 ? 4 * BULK_PACKET : 0;
    o->bench.frame(o->bench.self, &o->fifo, counts);
    for (int p = 0; p < o->model->pixels; p++) {
        bytes[2 * p] = (uint8_t)counts[p];
        bytes[2 * p + 1] = (uint8_t)(counts[p] >> 8);
    }
    put(&o->first, bytes, first, BULK_PACKET);
    put(&o->rest, bytes + first, size - first, BULK_PACKET);
    put(&o->rest, (const uint8_t[]){0x69}, 1, BULK_PACKET);
    o->fifo_full = false;
    o->requested = false;
}

/* A frame leaves the FIFO when it is asked for, read out, and the endpoints are empty. */
static void hand_over(struct ocean *o, int64_t now_us) {
    ocean_advance(o, now_us);
    if (o->fifo_full && o->requested && now_us >= o->fifo_ready_us && o->first.n == 0 && o->rest.n == 0)
        load(o);
}

static struct ocean_queue *queue_of(struct ocean *o, uint8_t endpoint) {
    return endpoint == 0x81 ? &o->reply : endpoint == 0x82 ? &o->rest : endpoint == 0x86 ? &o->first : NULL;
}

int ocean_in(struct ocean *o, int64_t now_us, uint8_t endpoint, uint8_t *data, size_t length,
             size_t *actual) {
    struct ocean_queue *q = queue_of(o, endpoint);
    int packet = ocean_max_packet(endpoint), result = OCEAN_NAK;
    if (!q)
        return OCEAN_STALL;
    if (q != &o->reply)
        hand_over(o, now_us);
    bool loaded = o->first.n + o->rest.n > 0;
    while (result == OCEAN_NAK && q->n > 0) {
        size_t n = q->packet[0];
        bool fits = n <= length - *actual;
        take(q, fits ? data + *actual : NULL);
        *actual += fits ? n : 0;
        result = !fits ? OCEAN_BABBLE : n < (size_t)packet || *actual == length ? 0 : OCEAN_NAK;
    }
    if (loaded && o->first.n + o->rest.n == 0)
        o->read_us = now_us;
    if (q != &o->reply)
        ocean_advance(o, now_us);
    return result;
}

int64_t ocean_due_us(struct ocean *o) {
    if (o->first.n + o->rest.n > 0 || !o->requested || o->trigger != 0)
        return INT64_MAX;
    return o->fifo_full ? o->fifo_ready_us : ocean_next_us(o);
}

void ocean_reset(struct ocean *o) {
    o->reply.n = o->first.n = o->rest.n = 0;
    o->reply.used = o->first.used = o->rest.used = 0;
}

void ocean_init(struct ocean *o, const struct detector_model *model, const char *serial,
                const struct ocean_bench *bench) {
    memset(o, 0, sizeof *o);
    o->model = model;
    o->bench = *bench;
    o->exposure_us = 100000; /* power-on value seen on a Flame-T, spectrometer-ocean.md 3.1 */
    o->cycle = (struct ocean_window){0, o->exposure_us, o->exposure_us};
    o->fpga[FPGA_VERSION] = model->pixels == 2048 ? 0x2020 : 0x3006;
    ocean_eeprom_fill(o, serial);
}
