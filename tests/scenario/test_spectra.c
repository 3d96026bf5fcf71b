/* Spectra of the simulated bench through the real driver, in virtual time: whatever changes between two sets,
 * and whenever, no frame shows two states. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "drivers/spectrometer.h"
#include "proto/units.h"
#include "sim/sim.h"
#include "tests/support/seed.h"

#define SETS 300
#define SCANS 3

static uint64_t seed, state;

static int64_t below(int64_t n) {
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return (int64_t)(state % (uint64_t)n);
}

struct rig {
    struct clock clock;
    struct bench bench;
    struct sim_bench *sim;
    struct usb_link link;
    struct spectrometer *s;
    struct err e;
    struct frame frames[SCANS];
};

static void rig_new(struct rig *r, const char *model, bool quiet) {
    struct sim_config config;
    memset(r, 0, sizeof *r);
    clock_init_virtual(&r->clock);
    bench_init(&r->bench, &r->clock);
    sim_config_default(&config);
    strcpy(config.spectrometer, model);
    config.quiet = quiet;
    config.n_axes = 0;
    config.lamp_warm_up_min = 0;
    assert_int_equal(sim_bench_new(&r->sim, &config, &r->clock, &r->e), 0);
    assert_int_equal(sim_bench_turn(r->sim, "source", 45, &r->e), 0);
    assert_int_equal(sim_bench_hold(r->sim, "reference", &r->e), 0);
    assert_int_equal(sim_usb_link(r->sim, &r->link, &r->e), 0);
    assert_int_equal(usb_link_serve(&r->link, &r->bench, &r->e), 0);
    int rc = spectrometer_open(&r->s, spectrometer_model_find(model), &r->link, &r->bench, NULL, &r->e);
    if (rc)
        print_error("%s\n", r->e.text);
    assert_int_equal(rc, 0);
}

static void rig_free(struct rig *r) {
    spectrometer_close(r->s);
    usb_link_close(&r->link, &r->bench);
    sim_bench_free(r->sim);
}

static void pass(struct rig *r, int64_t us) {
    bench_wait(&r->bench, r->clock.now_us + us, NULL, NULL, NULL);
}

static double level(const struct rig *r, const struct frame *f) {
    const struct calibration *c = spectrometer_calibration(r->s);
    double sum = 0;
    for (int p = c->active_first; p <= c->active_last; p++)
        sum += f->counts[p];
    return sum / (c->active_last - c->active_first + 1);
}

static const int EXPOSURE_US[] = {8000, 20000, 50000};

struct setting {
    bool light;
    int exposure; /* index into EXPOSURE_US */
};

/* Switches the light without the driver: to it this is what a move of the stage is, a change in front of the
 * fibre that it learns of by not_before_us alone. */
static void set_light(struct rig *r, bool on) {
    uint8_t command[] = {0x03, on, 0x00};
    struct usb_transfer t = {.endpoint = 0x01, .data = command, .length = sizeof command};
    assert_int_equal(usb_link_transfer(&r->link, &r->bench, &t, r->clock.now_us, NULL, &r->e), 0);
}

static void apply(struct rig *r, const struct setting *to) {
    assert_int_equal(spectrometer_set_exposure(r->s, EXPOSURE_US[to->exposure], NULL, &r->e), 0);
    set_light(r, to->light);
}

/* What each setting shows once everything has long been at rest. */
static void learn(struct rig *r, double truth[2][3]) {
    for (int i = 0; i < 6; i++) {
        struct setting k = {i & 1, i >> 1};
        apply(r, &k);
        pass(r, US_PER_S);
        assert_int_equal(spectrometer_acquire(r->s, 3, r->clock.now_us, r->frames, NULL, &r->e), 0);
        truth[k.light][k.exposure] = level(r, &r->frames[2]);
        assert_int_equal(r->frames[2].saturated_pixels, 0);
    }
}

static struct setting another(const struct setting *old) {
    struct setting k = *old;
    if (below(2))
        k.light = !k.light;
    else
        k.exposure = (int)below(3);
    return k;
}

static int64_t a_while(void) {
    return below(3) ? below(60000) : below(400000);
}

static void no_frame_shows_two_states(void **s) {
    static const char *const MODEL[] = {"usb2000plus", "usb4000"};
    (void)s;
    for (int m = 0; m < 2; m++) {
        struct rig r;
        double truth[2][3];
        rig_new(&r, MODEL[m], true);
        learn(&r, truth);
        struct setting k = {0};
        apply(&r, &k);
        for (int i = 0; i < SETS; i++) {
            k = another(&k);
            pass(&r, a_while());
            apply(&r, &k);
            int64_t settled = r.clock.now_us;
            if (below(2))
                pass(&r, a_while());
            int n = 1 + (int)below(SCANS);
            assert_int_equal(spectrometer_acquire(r.s, n, settled, r.frames, NULL, &r.e), 0);
            for (int f = 0; f < n; f++) {
                double expected = truth[k.light][k.exposure];
                assert_true(fabs(level(&r, &r.frames[f]) - expected) < 0.51);
                assert_true(r.frames[f].start_us >= settled && r.frames[f].end_us <= r.clock.now_us);
                assert_int_equal(r.frames[f].exposure_us, EXPOSURE_US[k.exposure]);
            }
        }
        rig_free(&r);
    }
}

/* The control of the test above: a driver that is told of no change hands out old and mixed frames. */
static void untold_it_would(void **s) {
    static const char *const MODEL[] = {"usb2000plus", "usb4000"};
    (void)s;
    for (int m = 0; m < 2; m++) {
        struct rig r;
        double truth[2][3];
        int wrong = 0;
        rig_new(&r, MODEL[m], true);
        learn(&r, truth);
        struct setting k = {true, 1};
        apply(&r, &k);
        pass(&r, US_PER_S);
        int64_t long_ago = r.clock.now_us;
        assert_int_equal(spectrometer_acquire(r.s, 3, long_ago, r.frames, NULL, &r.e), 0);
        for (int i = 0; i < 30; i++) {
            k.light = !k.light;
            pass(&r, below(30000));
            set_light(&r, k.light);
            assert_int_equal(spectrometer_acquire(r.s, 1, long_ago, r.frames, NULL, &r.e), 0);
            wrong += fabs(level(&r, &r.frames[0]) - truth[k.light][1]) > 5;
        }
        assert_true(wrong >= 10);
        rig_free(&r);
    }
}

/* Time for sets of three after moves of 0.9 s, against scans + required discards + half an idle cycle. */
static void no_frame_is_wasted(void **s) {
    static const char *const MODEL[] = {"usb2000plus", "usb4000"};
    (void)s;
    for (int m = 0; m < 2; m++) {
        struct rig r;
        rig_new(&r, MODEL[m], true);
        const struct spectrometer_model *model = spectrometer_model(r.s);
        assert_int_equal(spectrometer_set_exposure(r.s, 100000, NULL, &r.e), 0);
        int64_t spent = 0;
        for (int i = 0; i < 40; i++) {
            pass(&r, 900000 + below(100000));
            int64_t settled = r.clock.now_us;
            assert_int_equal(spectrometer_acquire(r.s, 3, settled, r.frames, NULL, &r.e), 0);
            spent += r.clock.now_us - settled;
        }
        double allowed = 40 * ((3 + model->discards + model->idle_cycles) * 100000. + 5 * model->readout_us);
        print_message("# %s: %.3f of the time that scans, discards and idle cycles may take\n", MODEL[m],
                      spent / allowed);
        assert_true(spent < 1.02 * allowed);
        rig_free(&r);
    }
}

static void the_bench_is_read_as_it_describes_itself(void **s) {
    (void)s;
    struct rig r;
    rig_new(&r, "usb2000plus", false);
    const struct calibration *c = spectrometer_calibration(r.s);
    double celsius;
    assert_string_equal(c->serial, r.link.info.serial);
    assert_true(c->nonlinearity_used);
    assert_true(c->saturation > 10000);
    assert_int_equal(spectrometer_temperature(r.s, &celsius, &r.e), 0);
    assert_in_range(celsius, 20, 40);
    /* A long exposure saturates; the flag follows the raw counts. */
    assert_int_equal(spectrometer_set_lamp(r.s, true, NULL, &r.e), 0);
    assert_int_equal(spectrometer_set_exposure(r.s, 60 * US_PER_S, NULL, &r.e), 0);
    assert_int_equal(spectrometer_acquire(r.s, 1, 0, r.frames, NULL, &r.e), 0);
    int clipped = 0;
    for (int p = c->active_first; p <= c->active_last; p++)
        clipped += r.frames[0].counts[p] >= c->saturation;
    assert_true(clipped > 0);
    assert_int_equal(r.frames[0].saturated_pixels, clipped);
    rig_free(&r);
}

/* What a killed session leaves in the unit must not reach the next one. */
static void a_dead_session_leaves_no_trace(void **s) {
    static const char *const MODEL[] = {"usb2000plus", "usb4000"};
    (void)s;
    for (int m = 0; m < 2; m++) {
        struct rig r;
        double truth[2][3];
        rig_new(&r, MODEL[m], true);
        learn(&r, truth);
        struct setting k = {true, 2};
        apply(&r, &k);
        spectrometer_close(r.s);
        uint8_t request = 0x09;
        struct usb_transfer t = {.endpoint = 0x01, .data = &request, .length = 1};
        assert_int_equal(usb_link_transfer(&r.link, &r.bench, &t, r.clock.now_us, NULL, &r.e), 0);
        assert_int_equal(
            spectrometer_open(&r.s, spectrometer_model_find(MODEL[m]), &r.link, &r.bench, NULL, &r.e), 0);
        k = (struct setting){false, 0};
        apply(&r, &k);
        assert_int_equal(spectrometer_acquire(r.s, 2, r.clock.now_us, r.frames, NULL, &r.e), 0);
        assert_true(fabs(level(&r, &r.frames[0]) - truth[0][0]) < 0.51);
        rig_free(&r);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_frame_shows_two_states),
        cmocka_unit_test(untold_it_would),
        cmocka_unit_test(no_frame_is_wasted),
        cmocka_unit_test(the_bench_is_read_as_it_describes_itself),
        cmocka_unit_test(a_dead_session_leaves_no_trace),
    };
    seed = state = test_seed(20261122);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
