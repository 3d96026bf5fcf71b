#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include <string.h>

#include "sim/sim.h"

#define MS 1000LL

struct rig {
    struct clock clock;
    struct sim_config config;
    struct sim_bench *bench;
    struct usb_link link;
    uint8_t reply[8192];
    size_t n;
};

static void rig_new(struct rig *r, const char *model) {
    struct err e = {0};
    clock_init_virtual(&r->clock);
    sim_config_default(&r->config);
    strcpy(r->config.spectrometer, model);
    r->config.quiet = true;
    assert_int_equal(sim_bench_new(&r->bench, &r->config, &r->clock, &e), 0);
    assert_int_equal(sim_usb_link(r->bench, &r->link, &e), 0);
}

static void rig_free(struct rig *r) {
    r->link.ops->close(r->link.self);
    sim_bench_free(r->bench);
}

static void out(struct rig *r, const void *bytes, size_t n) {
    uint8_t copy[64];
    memcpy(copy, bytes, n);
    struct usb_transfer t = {.endpoint = 0x01, .data = copy, .length = n};
    assert_int_equal(r->link.ops->submit(r->link.self, &t, NULL), 0);
    assert_false(t.pending);
    assert_int_equal(t.status, 0);
    assert_int_equal(t.actual, n);
}

/* Reads, moving time to whatever the link says is due, for at most limit_ms. */
static int in(struct rig *r, uint8_t endpoint, size_t length, int64_t limit_ms) {
    int64_t until_us = clock_now_us(&r->clock) + limit_ms * MS;
    struct usb_transfer t = {.endpoint = endpoint, .data = r->reply, .length = length};
    assert_int_equal(r->link.ops->submit(r->link.self, &t, NULL), 0);
    while (t.pending) {
        int64_t due_us = r->link.ops->due_us(r->link.self);
        if (due_us > until_us) {
            clock_advance(&r->clock, until_us);
            r->link.ops->cancel(r->link.self, &t);
            assert_false(t.pending);
            break;
        }
        clock_advance(&r->clock, due_us);
        r->link.ops->reap(r->link.self);
    }
    r->n = t.actual;
    return t.status;
}

static void query(struct rig *r, const void *bytes, size_t n, size_t expected) {
    out(r, bytes, n);
    assert_int_equal(in(r, 0x81, 64, 0), 0);
    assert_int_equal(r->n, expected);
}

static void set_ms(struct rig *r, int ms) {
    uint32_t t = (uint32_t)ms * 1000;
    out(r, (uint8_t[]){2, (uint8_t)t, (uint8_t)(t >> 8), (uint8_t)(t >> 16), (uint8_t)(t >> 24)}, 5);
}

static void test_replies_have_their_exact_length(void **state) {
    (void)state;
    struct rig r;
    rig_new(&r, "usb2000plus");
    query(&r, "\xfe", 1, 16);
    static const uint8_t status[16] = {0x00, 0x08, 0xA0, 0x86, 0x01, 0, 0, 0, 0, 8, 0, 0, 0, 0, 0x80, 0xFF};
    assert_memory_equal(r.reply, status, 16);
    query(&r, "\x05\x00", 2, 17);
    assert_memory_equal(r.reply, "\x05\x00USB2+SIM001", 14); /* with its NUL */
    assert_int_not_equal(r.reply[14], 0);                    /* and garbage after it */
    query(&r, "\x05\x11", 2, 17);
    assert_int_equal(r.reply[6] | r.reply[7] << 8, 59957);
    query(&r, "\x05\x0e", 2, 17);
    assert_string_equal((char *)r.reply + 2, "7");
    query(&r, "\x05\x01", 2, 17);
    assert_string_equal((char *)r.reply + 2, "340.3217");
    query(&r, "\x6b\x04", 2, 3);
    query(&r, "\x6c", 1, 3);
    assert_int_equal(r.reply[0], 8);
    out(&r, "\x77", 1); /* unknown: no reply */
    assert_int_equal(in(&r, 0x81, 64, 50), -ECANCELED);
    assert_int_equal(r.n, 0);
    rig_free(&r);
}

static void test_integration_time_out_of_range_is_ignored(void **state) {
    (void)state;
    struct rig r;
    rig_new(&r, "usb2000plus");
    set_ms(&r, 250);
    out(&r, "\x02\xe7\x03\x00\x00", 5); /* 999 us */
    query(&r, "\xfe", 1, 16);
    assert_int_equal(r.reply[2] | r.reply[3] << 8 | r.reply[4] << 16, 250000);
    rig_free(&r);
}

static void test_a_frame_of_usb2000plus(void **state) {
    (void)state;
    struct rig r;
    rig_new(&r, "usb2000plus");
    set_ms(&r, 20);
    out(&r, "\x09", 1);
    query(&r, "\xfe", 1, 16); /* EP1 answers while a frame is on its way */
    assert_int_equal(r.reply[8], 2);
    assert_int_equal(in(&r, 0x82, 4608, 1000), 0);
    assert_int_equal(r.n, 4097);
    assert_int_equal(r.reply[4096], 0x69);
    assert_int_equal(clock_now_us(&r.clock), 20 * MS + 870);
    rig_free(&r);
}

static void test_a_frame_of_usb4000_comes_on_two_endpoints(void **state) {
    (void)state;
    struct rig r;
    rig_new(&r, "usb4000");
    set_ms(&r, 20);
    out(&r, "\x09", 1);
    assert_int_equal(in(&r, 0x86, 2048, 1000), 0);
    assert_int_equal(r.n, 2048);
    assert_int_equal(in(&r, 0x82, 6144, 0), 0);
    assert_int_equal(r.n, 5633);
    assert_int_equal(r.reply[5632], 0x69);
    /* power-up cycle of 100 ms was idle; then 20 ms of it, 3.8 ms of read-out */
    assert_int_equal(clock_now_us(&r.clock), 120 * MS + 3800);
    query(&r, "\xfe", 1, 16);
    assert_int_equal(r.reply[9], 15);
    rig_free(&r);
}

static void test_packets_end_transfers_and_overflow_them(void **state) {
    (void)state;
    struct rig r;
    rig_new(&r, "usb2000plus");
    out(&r, "\x09", 1);
    assert_int_equal(in(&r, 0x82, 4096, 1000), 0); /* full before the sync byte: it stays behind */
    assert_int_equal(r.n, 4096);
    assert_int_equal(in(&r, 0x82, 512, 0), 0);
    assert_int_equal(r.n, 1);
    out(&r, "\x09", 1);
    assert_int_equal(in(&r, 0x82, 700, 1000), -EOVERFLOW); /* the second packet does not fit */
    assert_int_equal(r.n, 512);
    assert_int_equal(in(&r, 0x82, 8192, 0), 0);
    assert_int_equal(r.n, 4097 - 1024);
    assert_int_equal(in(&r, 0x83, 64, 0), -EPIPE);
    query(&r, "\xfe", 1, 16);
    out(&r, "\xfe", 1);
    assert_int_equal(in(&r, 0x81, 8, 0), -EOVERFLOW);
    rig_free(&r);
}

static void test_bytes_that_came_are_counted_when_cancelled(void **state) {
    (void)state;
    struct rig r;
    rig_new(&r, "usb4000");
    out(&r, "\x09", 1);
    assert_int_equal(in(&r, 0x86, 4096, 1000), -ECANCELED); /* 2048 end on a full packet: it waits for more */
    assert_int_equal(r.n, 2048);
    rig_free(&r);
}

static void test_a_frame_outlives_its_client(void **state) {
    (void)state;
    struct rig r;
    rig_new(&r, "usb2000plus");
    set_ms(&r, 20);
    out(&r, "\x09", 1);
    r.link.ops->close(r.link.self);
    clock_advance(&r.clock, 500 * MS);
    assert_int_equal(sim_usb_link(r.bench, &r.link, NULL), 0);
    query(&r, "\xfe", 1, 16);
    assert_true(r.reply[8] & 6);
    assert_int_equal(in(&r, 0x82, 4608, 0), 0);
    assert_int_equal(r.n, 4097);
    rig_free(&r);
}

static int brightest(const struct rig *r) {
    int best = 0;
    for (int p = 20; p < 2048; p++) {
        int v = r->reply[2 * p] | r->reply[2 * p + 1] << 8;
        best = v > best ? v : best;
    }
    return best;
}

static int64_t frame(struct rig *r) {
    int64_t asked_us = clock_now_us(&r->clock);
    out(r, "\x09", 1);
    assert_int_equal(in(r, 0x82, 4608, 2000), 0);
    assert_int_equal(r->n, 4097);
    return clock_now_us(&r->clock) - asked_us;
}

/* Light only while a frame integrates is light in that frame: the two unasked frames are stale. */
static void test_stale_frames_of_usb2000plus(void **state) {
    (void)state;
    struct rig r;
    rig_new(&r, "usb2000plus");
    struct sim_surface white = {.sigma = 0.2, .gamma = 0.1, .n = 1.5};
    for (int k = 0; k < BANDS; k++)
        white.s_lambda[k] = 0.9;
    assert_int_equal(sim_bench_mount(r.bench, "sample", &white, NULL), 0);
    set_ms(&r, 50);
    assert_int_equal(frame(&r), 50 * MS + 870);
    int dark = brightest(&r);
    out(&r, "\x03\x01\x00",
        3); /* at once after read-out: the second frame has begun and sees nearly all of it */
    clock_advance(&r.clock, clock_now_us(&r.clock) + 25 * MS);
    out(&r, "\x03\x00\x00", 3);
    clock_advance(&r.clock, clock_now_us(&r.clock) + 20 * MS);
    assert_int_equal(frame(&r), 5 * MS + 870); /* asked for in its last 5 ms: it is given that frame */
    int half = brightest(&r);
    assert_int_equal(frame(&r), 50 * MS + 870);
    assert_int_equal(brightest(&r), dark);
    out(&r, "\x03\x01\x00", 3);
    frame(&r);
    int full = brightest(&r);
    assert_true(full - dark > 5000);
    assert_in_range(half - dark, (full - dark) * 0.45, (full - dark) * 0.55);
    clock_advance(&r.clock, clock_now_us(&r.clock) + 500 * MS); /* both extra frames are dropped, it idles */
    assert_int_equal(frame(&r), 50 * MS + 870);
    rig_free(&r);
}

static int64_t frame_4000(struct rig *r) {
    int64_t asked_us = clock_now_us(&r->clock);
    out(r, "\x09", 1);
    assert_int_equal(in(r, 0x86, 2048, 5000), 0);
    assert_int_equal(in(r, 0x82, 6144, 0), 0);
    assert_int_equal(r->n, 5633);
    return clock_now_us(&r->clock) - asked_us;
}

static void test_latency_of_usb4000(void **state) {
    (void)state;
    struct rig r;
    rig_new(&r, "usb4000");
    set_ms(&r, 50);
    frame_4000(&r);                            /* at 100 ms idle + 50 + 3.8: t = 153.8 */
    assert_int_equal(frame_4000(&r), 50 * MS); /* back to back: the parallel integration ends at 200 */
    clock_advance(&r.clock, clock_now_us(&r.clock) + 60 * MS);
    assert_int_equal(frame_4000(&r),
                     0); /* its data has waited in the FIFO: latency 0, older than the request */
    int64_t asked_us = clock_now_us(&r.clock);
    clock_advance(&r.clock, asked_us + 400 * MS);
    assert_int_equal(frame_4000(&r), 0); /* one frame waits, however long; the ones after it were discarded */
    int64_t latency_us = frame_4000(&r); /* idle cycles run: up to one of them, then a fresh frame */
    assert_true(latency_us > 50 * MS && latency_us <= 104 * MS);
    rig_free(&r);
}

static void test_a_changed_time_does_not_end_the_running_frame(void **state) {
    (void)state;
    struct rig r;
    rig_new(&r, "usb2000plus");
    set_ms(&r, 200);
    out(&r, "\x09", 1);
    set_ms(&r, 10);
    assert_int_equal(in(&r, 0x82, 4608, 1000), 0);
    assert_int_equal(clock_now_us(&r.clock), 200 * MS + 870);
    rig_free(&r);
}

static void test_reset_clears_endpoint_memory_only(void **state) {
    (void)state;
    struct rig r;
    rig_new(&r, "usb2000plus");
    out(&r, "\x09", 1);
    assert_int_equal(in(&r, 0x82, 512, 1000), 0);
    assert_int_equal(r.link.ops->reset(r.link.self, NULL), 0);
    assert_int_equal(in(&r, 0x82, 4608, 100), -ECANCELED);
    set_ms(&r, 300);
    frame(&r); /* a frame of the old or the new time, whole */
    out(&r, "\x09", 1);
    assert_int_equal(r.link.ops->reset(r.link.self, NULL), 0);
    assert_int_equal(in(&r, 0x82, 4608, 2000), 0); /* the request lives on inside */
    assert_int_equal(r.n, 4097);
    rig_free(&r);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_replies_have_their_exact_length),
        cmocka_unit_test(test_integration_time_out_of_range_is_ignored),
        cmocka_unit_test(test_a_frame_of_usb2000plus),
        cmocka_unit_test(test_a_frame_of_usb4000_comes_on_two_endpoints),
        cmocka_unit_test(test_packets_end_transfers_and_overflow_them),
        cmocka_unit_test(test_bytes_that_came_are_counted_when_cancelled),
        cmocka_unit_test(test_a_frame_outlives_its_client),
        cmocka_unit_test(test_stale_frames_of_usb2000plus),
        cmocka_unit_test(test_latency_of_usb4000),
        cmocka_unit_test(test_a_changed_time_does_not_end_the_running_frame),
        cmocka_unit_test(test_reset_clears_endpoint_memory_only),
    };
    return cmocka_run_group_tests_name("sim_ocean", tests, NULL, NULL);
}
