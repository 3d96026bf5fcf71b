/* Abort in the middle of a long exposure, with the wire looked at between goniod and the drives; and a long exposure, a
 * hold and a disk that stalls, all longer than the drives' watchdogs. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "proto/session.h"
#include "tests/support/laboratory.h"
#include "tests/support/tap.h"
#include "tests/support/skipping.h"

#define IN_EXPOSURE_MS 1500 /* after the axes have arrived */
#define STALL_MS 2000
#define WATCHDOG_US 1000000 /* of goniosim's drives */
#define UNITS 3
#define MUTE_UNIT 2
#define BUSY_MACHINE_US 1000000 /* the figures themselves are measured by `make bench` */

static struct laboratory lab;
static struct tap *tap;

static void open_with(struct laboratory_choice choice, const char *exposure) {
    laboratory_open(&lab, &choice);
    tap = tap_open(lab.modbus, lab.modbus);
    laboratory_write_config(&lab);
    laboratory_job(&lab, "pairs: [[20, 10]]", "fixed", exposure);
}

static int open_lab(void **state) {
    (void)state;
    open_with((struct laboratory_choice){0}, "target: 0.8, min_ms: 4000, max_ms: 4000, average: 1");
    return 0;
}

static int open_slow_lab(void **state) {
    (void)state;
    open_with((struct laboratory_choice){.manual_holder = true, .stall_ms = STALL_MS},
              "target: 0.8, min_ms: 1200, max_ms: 1200, average: 1");
    return 0;
}

static int close_lab(void **state) {
    (void)state;
    laboratory_close(&lab);
    tap_close(tap);
    return 0;
}

static void run_until_exposing(void) {
    char job[96];
    snprintf(job, sizeof job, "%s/job.yaml", lab.dir);
    laboratory_expect(&lab, 0, "", NULL, "run", job, NULL);
    laboratory_await(&lab, "\"state\":\"running\"", 20000);
    laboratory_await(&lab, "\"phase\":\"reference\"", 20000);
    for (int i = 0; i < UNITS; i++)
        laboratory_await(&lab, "\"phase\":\"idle\"", 20000);
    real_sleep_ms(IN_EXPOSURE_MS);
}

static void abort_and_look(int mute) {
    laboratory_goniod_start(&lab);
    run_until_exposing();
    tap_mute(tap, mute);
    int64_t ordered_us = real_us();
    laboratory_expect(&lab, 0, "", NULL, "abort", NULL);
    real_sleep_ms(1000);
    for (int unit = 1; unit <= UNITS; unit++) {
        int64_t stop_us = tap_stop_us(tap, unit, ordered_us);
        assert_true(stop_us > 0);
        print_message("# %s: stop order of unit %d after %.1f ms\n",
                      mute == TAP_EVERYBODY ? "mute"
                      : mute                ? "one mute unit"
                                            : "answering",
                      unit, (double)(stop_us - ordered_us) * 1e-3);
        assert_true(stop_us - ordered_us < BUSY_MACHINE_US);
    }
}

static void abort_in_a_long_exposure(void **state) {
    (void)state;
    abort_and_look(TAP_NOBODY);
    laboratory_await(&lab, "\"state\":\"aborted\"", 20000);
    laboratory_await(&lab, "\"lamp\":false", 5000);
}

static void abort_on_a_mute_bus(void **state) {
    (void)state;
    abort_and_look(TAP_EVERYBODY);
    laboratory_await(&lab, "\"stop_confirmed\":false", 5000);
    tap_mute(tap, TAP_NOBODY);
    laboratory_await(&lab, "\"state\":\"aborted\"", 30000);
}

/* Its neighbours on the bus are stopped and seen to stand; of it alone that is not known. */
static void abort_with_one_mute_unit(void **state) {
    (void)state;
    abort_and_look(MUTE_UNIT);
    laboratory_await(&lab, "\"stop_confirmed\":false", 5000);
    laboratory_await(&lab, "\"state\":\"aborted\"", 30000);
    tap_mute(tap, TAP_NOBODY);
}

static int no_trouble(void *arg, int64_t us, const char *kind, const char *json) {
    (void)arg;
    (void)us;
    if (!strcmp(kind, "repeat"))
        fail_msg("%s: %s", kind, json);
    return 0;
}

/* A person at the holder, exposures of 1.2 s, a stall of 2 s: in each of them the drives would have given up alone. */
static void nothing_keeps_the_drives_waiting(void **state) {
    (void)state;
    char job[96], path[256], name[160];
    struct said said;
    struct session *s;
    skip_under_asan();
    laboratory_goniod_start(&lab);
    snprintf(job, sizeof job, "%s/job.yaml", lab.dir);
    struct program run;
    const char *const words[] = {"gonioctl", "run", "--wait", job, NULL};
    assert_true(laboratory_ctl_begin(&lab, &run, words));
    laboratory_await(&lab, "\"state\":\"held\"", 20000);
    int64_t from_us = real_us();
    real_sleep_ms(1500);
    laboratory_expect(&lab, 0, "", NULL, "continue", NULL);
    assert_true(laboratory_stall(&lab, 20000));
    while (program_runs(&run) && real_us() < from_us + 120 * INT64_C(1000000)) {
        laboratory_ctl(&lab, &said, NULL, "continue", NULL); /* refused where nothing is held */
        said_free(&said);
        real_sleep_ms(200);
    }
    program_wait(&run, 1000, &said);
    int64_t silence_us = tap_silence_us(tap, from_us, real_us());
    print_message("# longest silence on the bus: %.0f ms\n%s", (double)silence_us * 1e-3, said.err);
    assert_int_equal(said.status, 0);
    assert_true(silence_us < WATCHDOG_US);
    laboratory_session_path(&lab, said.out, path, name);
    said_free(&said);
    assert_int_equal(session_open(&s, path, true, NULL), 0);
    assert_int_equal(session_each_event(s, no_trouble, NULL, NULL), 0);
    session_close(s, NULL);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, open_lab, close_lab)

int main(void) {
    const struct CMUnitTest tests[] = {
        TEST(abort_in_a_long_exposure),
        TEST(abort_on_a_mute_bus),
        TEST(abort_with_one_mute_unit),
        cmocka_unit_test_setup_teardown(nothing_keeps_the_drives_waiting, open_slow_lab, close_lab),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
