/* The spectrometer driver in real time against goniosim's usbredir wire: the time a set takes, an unplugged
 * unit, and a session that dies with a frame on its way. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "drivers/spectrometer.h"
#include "proto/units.h"
#include "tests/support/kept.h"
#include "tests/support/sim_process.h"

#define EXPOSURE_US 60000
#define SCANS 3
#define SETS 5

static const char *const MODEL[] = {"usb2000plus", "usb4000"};

struct rig {
    struct sim_process sim;
    struct clock clock;
    struct bench bench;
    struct usb_link link;
    struct spectrometer *s;
    struct err e;
    struct frame frames[SCANS];
};

static void sim_start(struct rig *r, const char *model, const char *listen) {
    char yaml[256];
    memset(r, 0, sizeof *r);
    snprintf(yaml, sizeof yaml, "modbus: []\nspectrometer: {model: %s, listen: \"%s\"}\n", model, listen);
    assert_true(sim_process_start(&r->sim, yaml));
    clock_init_real(&r->clock);
    bench_init(&r->bench, &r->clock);
}

static void driver_open(struct rig *r, const char *model) {
    const struct spectrometer_model *m = spectrometer_model_find(model);
    int rc = usb_link_open(&r->link, r->sim.spectrometer, m->vid, m->pid, NULL, &r->clock, &r->e);
    if (rc == 0)
        rc = usb_link_serve(&r->link, &r->bench, &r->e);
    if (rc == 0)
        rc = spectrometer_open(&r->s, m, &r->link, &r->bench, NULL, &r->e);
    if (rc)
        print_error("%s\n", r->e.text);
    assert_int_equal(rc, 0);
}

static void driver_close(struct rig *r) {
    spectrometer_close(r->s);
    usb_link_close(&r->link, &r->bench);
    r->s = NULL;
}

/* INT64_MAX: this machine stood still, so that a scan came too late to be taken. */
static int64_t take_sets(struct rig *r) {
    int64_t spent = 0;
    for (int i = 0; i < SETS; i++) {
        bench_wait(&r->bench, clock_stamp(&r->clock) + 200000 + i * 9000, NULL, NULL, NULL);
        int64_t settled = clock_stamp(&r->clock);
        err_clear(&r->e);
        int result = spectrometer_acquire(r->s, SCANS, settled, r->frames, NULL, &r->e);
        if (result == -ERR_TIMEOUT)
            return INT64_MAX;
        assert_int_equal(result, 0);
        spent += clock_stamp(&r->clock) - settled;
        for (int f = 0; f < SCANS; f++)
            assert_true(r->frames[f].start_us >= settled && r->frames[f].end_us <= clock_now_us(&r->clock));
    }
    return spent;
}

/* Scans, required discards, half an idle cycle and the read-outs, and a tenth on top. */
static int64_t sets_limit_us(const struct rig *r) {
    const struct spectrometer_model *m = spectrometer_model(r->s);
    int frames = SCANS + m->discards;
    return (int64_t)(1.10 * SETS * ((frames + m->idle_cycles) * EXPOSURE_US + frames * m->readout_us));
}

static void a_set_takes_no_longer_than_it_must(void **state) {
    (void)state;
    for (int m = 0; m < 2; m++) {
        struct rig r;
        sim_start(&r, MODEL[m], "tcp:0");
        driver_open(&r, MODEL[m]);
        assert_int_equal(spectrometer_set_exposure(r.s, EXPOSURE_US, NULL, &r.e), 0);
        for (int tries = 0; !kept(&tries, MODEL[m], take_sets(&r), sets_limit_us(&r));)
            ;
        driver_close(&r);
        assert_int_equal(sim_process_stop(&r.sim, SIGTERM), 0);
    }
}

struct killer { /* ends goniosim in the middle of an exposure */
    struct sim_process *sim;
    int64_t at_us;
};

static int64_t killer_due(void *self) {
    const struct killer *k = self;
    return k->sim->pid ? k->at_us : CLOCK_NEVER;
}

static void killer_run(void *self) {
    sim_process_stop(((struct killer *)self)->sim, SIGKILL);
}

/* How long after the unplugging the acquisition ended. */
static int64_t unplug(void) {
    struct rig r;
    sim_start(&r, MODEL[1], "tcp:0");
    driver_open(&r, MODEL[1]);
    assert_int_equal(spectrometer_set_exposure(r.s, 2000000, NULL, &r.e), 0);
    struct killer k = {&r.sim, clock_stamp(&r.clock) + 100000};
    bench_add(&r.bench,
              &(struct bench_service){.name = "killer", .self = &k, .due_us = killer_due, .run = killer_run});
    int64_t now = clock_now_us(&r.clock);
    assert_int_equal(spectrometer_acquire(r.s, 1, now, r.frames, NULL, &r.e), -ERR_LINK);
    assert_non_null(strstr(r.e.text, "cable"));
    int64_t took_us = clock_stamp(&r.clock) - k.at_us;
    driver_close(&r);
    return took_us;
}

static void an_unplugged_unit_is_noticed_at_once(void **state) {
    (void)state;
    for (int tries = 0; !kept(&tries, "the loss of a unit", unplug(), 500000);)
        ;
}

static void a_session_that_died_leaves_no_trace(void **state) {
    (void)state;
    for (int m = 0; m < 2; m++) {
        struct rig r;
        char listen[64];
        snprintf(listen, sizeof listen, "unix:/tmp/goniod-test-spectra-%d.sock", (int)getpid());
        sim_start(&r, MODEL[m], listen);
        driver_open(&r, MODEL[m]);
        assert_int_equal(spectrometer_set_exposure(r.s, 400000, NULL, &r.e), 0);
        struct cancel dead = {true};
        uint8_t request = 0x09;
        struct usb_transfer t = {.endpoint = 0x01, .data = &request, .length = 1};
        assert_int_equal(
            usb_link_transfer(&r.link, &r.bench, &t, clock_stamp(&r.clock) + US_PER_S, NULL, &r.e), 0);
        assert_int_equal(spectrometer_acquire(r.s, 1, clock_stamp(&r.clock), r.frames, &dead, &r.e),
                         -ERR_CANCELLED);
        driver_close(&r);
        err_clear(&r.e);
        driver_open(&r, MODEL[m]);
        assert_int_equal(spectrometer_set_exposure(r.s, 20000, NULL, &r.e), 0);
        assert_int_equal(spectrometer_acquire(r.s, 2, clock_stamp(&r.clock), r.frames, NULL, &r.e), 0);
        assert_int_equal(r.frames[1].exposure_us, 20000);
        assert_int_equal(r.frames[1].saturated_pixels, 0);
        driver_close(&r);
        assert_int_equal(sim_process_stop(&r.sim, SIGTERM), 0);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_set_takes_no_longer_than_it_must),
        cmocka_unit_test(an_unplugged_unit_is_noticed_at_once),
        cmocka_unit_test(a_session_that_died_leaves_no_trace),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
