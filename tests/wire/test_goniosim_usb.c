#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "drivers/usb_link.h"
#include "proto/units.h"
#include "tests/support/kept.h"
#include "tests/support/sim_process.h"

#define PATIENCE_MS 60000 /* far beyond what a busy machine needs */

/* goniosim in a process of its own, its spectrometer through the usbredir client of goniod. */
struct rig {
    struct sim_process sim;
    struct clock clock;
    struct bench bench;
    struct usb_link link;
    uint8_t in[8192];
    size_t n;
};

static void rig_start(struct rig *r, const char *yaml) {
    memset(r, 0, sizeof *r);
    assert_true(sim_process_start(&r->sim, yaml));
    clock_init_real(&r->clock);
}

static void rig_open(struct rig *r, uint16_t pid) {
    struct err e = {0};
    bench_init(&r->bench, &r->clock);
    if (usb_link_open(&r->link, r->sim.spectrometer, 0x2457, pid, NULL, &r->clock, &e) != 0)
        fail_msg("%s", e.text);
    assert_int_equal(usb_link_serve(&r->link, &r->bench, &e), 0);
}

static void rig_stop(struct rig *r) {
    assert_int_equal(sim_process_stop(&r->sim, SIGTERM), 0);
}

static int transfer(struct rig *r, uint8_t endpoint, const void *out, size_t length, int limit_ms) {
    static uint8_t copy[64];
    struct usb_transfer t = {.endpoint = endpoint, .data = endpoint & 0x80 ? r->in : copy, .length = length};
    if (!(endpoint & 0x80))
        memcpy(copy, out, length);
    clock_stamp(&r->clock);
    int rc = usb_link_transfer(&r->link, &r->bench, &t, clock_now_us(&r->clock) + limit_ms * US_PER_MS, NULL,
                               NULL);
    r->n = t.actual;
    return rc ? rc : t.status;
}

static void query(struct rig *r, const char *out, size_t n, size_t expected) {
    assert_int_equal(transfer(r, 0x01, out, n, PATIENCE_MS), 0);
    assert_int_equal(transfer(r, 0x81, NULL, 64, PATIENCE_MS), 0);
    assert_int_equal(r->n, expected);
}

static void test_a_spectrum_of_usb2000plus(void **state) {
    (void)state;
    struct rig r;
    rig_start(&r, "seed: 1\nmodbus: []\n");
    rig_open(&r, 0x101E);
    query(&r, "\x05\x00", 2, 17);
    assert_memory_equal(r.in + 2, "USB2+SIM001", 11);
    transfer(&r, 0x01, "\x02\x20\x4e\x00\x00", 5, PATIENCE_MS); /* 20 ms */
    query(&r, "\xfe", 1, 16);
    assert_int_equal(r.in[2] | r.in[3] << 8, 20000);
    int64_t took_us;
    int tries = 0;
    do {
        int64_t start_us = clock_stamp(&r.clock);
        transfer(&r, 0x01, "\x09", 1, PATIENCE_MS);
        assert_int_equal(transfer(&r, 0x82, NULL, 4608, PATIENCE_MS), 0);
        assert_int_equal(r.n, 4097);
        assert_int_equal(r.in[4096], 0x69);
        took_us = clock_stamp(&r.clock) - start_us;
        assert_true(took_us >= 20000);
    } while (!kept(&tries, "a spectrum of 20 ms", took_us, 100000));
    r.link.ops->close(r.link.self);
    rig_stop(&r);
}

static void test_a_spectrum_of_usb4000_over_a_unix_socket(void **state) {
    (void)state;
    struct rig r;
    char yaml[160];
    snprintf(yaml, sizeof yaml,
             "modbus: []\nspectrometer: {model: usb4000, listen: \"unix:/tmp/goniosim-%d.sock\"}\n",
             getpid());
    rig_start(&r, yaml);
    rig_open(&r, 0x1022);
    transfer(&r, 0x01, "\x09", 1, PATIENCE_MS);
    query(&r, "\xfe", 1, 16); /* the reply endpoint is free while a spectrum is held */
    assert_int_equal(transfer(&r, 0x86, NULL, 2048, PATIENCE_MS), 0);
    assert_int_equal(r.n, 2048);
    assert_int_equal(transfer(&r, 0x82, NULL, 6144, PATIENCE_MS), 0);
    assert_int_equal(r.n, 5633);
    r.link.ops->close(r.link.self);
    rig_stop(&r);
    assert_int_equal(access(r.sim.spectrometer + strlen("usbredir:unix:"), F_OK),
                     -1); /* it takes its socket with it */
}

static void test_deadlines_overflow_and_the_next_client(void **state) {
    (void)state;
    struct rig r;
    rig_start(&r, "modbus: []\n");
    rig_open(&r, 0x101E);
    assert_int_equal(transfer(&r, 0x81, NULL, 64, 50), -ERR_TIMEOUT); /* nothing was asked */
    query(&r, "\xfe", 1, 16);
    transfer(&r, 0x01, "\xfe", 1, PATIENCE_MS);
    assert_int_equal(transfer(&r, 0x81, NULL, 8, PATIENCE_MS), -EOVERFLOW);
    assert_int_equal(transfer(&r, 0x83, NULL, 64, PATIENCE_MS), -EPIPE);
    transfer(&r, 0x01, "\x09", 1, PATIENCE_MS);
    r.link.ops->close(r.link.self); /* with a frame on its way: it outlives the client */
    rig_open(&r, 0x101E);
    assert_int_equal(transfer(&r, 0x82, NULL, 4608, PATIENCE_MS), 0);
    assert_int_equal(r.n, 4097);
    r.link.ops->close(r.link.self);
    rig_stop(&r);
}

static void test_the_device_is_lost_with_its_process(void **state) {
    (void)state;
    struct rig r;
    rig_start(&r, "modbus: []\n");
    rig_open(&r, 0x101E);
    sim_process_stop(&r.sim, SIGKILL);
    assert_int_equal(transfer(&r, 0x82, NULL, 4608, PATIENCE_MS), -ENODEV);
    r.link.ops->close(r.link.self);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_spectrum_of_usb2000plus),
        cmocka_unit_test(test_a_spectrum_of_usb4000_over_a_unix_socket),
        cmocka_unit_test(test_deadlines_overflow_and_the_next_client),
        cmocka_unit_test(test_the_device_is_lost_with_its_process),
    };
    return cmocka_run_group_tests_name("goniosim_usb", tests, NULL, NULL);
}
