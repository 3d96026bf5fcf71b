/* Abort in the middle of a long exposure, with the wire looked at between goniod and the drives; and a long exposure, a
 * hold and a disk that stalls, all longer than goniod may be silent. */
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
#define STALL_MS 4000
#define SILENCE_US 2000000 /* shorter than hold, exposure and stall; goniod polls every 250 ms */
#define UNITS 3
#define MUTE_UNIT 2
#define BUSY_MACHINE_US                                                                                      \
    3000000             /* the exposure lasts longer; the figures themselves are measured by `make bench` */
#define AWAIT_MS 300000 /* far beyond what a busy machine needs */

static struct laboratory lab;
static struct tap *tap;

static void open_with(struct laboratory_choice choice, const char *exposure) {
    laboratory_open(&lab, &choice);
    tap = tap_open(lab.modbus, lab.modbus);
    tap_patient(tap);
    laboratory_write_config(&lab);
    laboratory_job(&lab, "pairs: [[20, 10]]", "fixed", exposure);
}

static int open_lab(void **state) {
    (void)state;
    open_with((struct laboratory_choice){0}, "target: 0.8, min_ms: 6000, max_ms: 6000, average: 1");
    return 0;
}

static int open_slow_lab(void **state) {
    (void)state;
    open_with((struct laboratory_choice){.manual_holder = true, .stall_ms = STALL_MS},
              "target: 0.8, min_ms: 2400, max_ms: 2400, average: 1");
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
    laboratory_await(&lab, "\"state\":\"running\"", AWAIT_MS);
    laboratory_await(&lab, "\"phase\":\"reference\"", AWAIT_MS);
    for (int i = 0; i < UNITS; i++)
        laboratory_await(&lab, "\"phase\":\"idle\"", AWAIT_MS);
    real_sleep_ms(IN_EXPOSURE_MS);
}

static void abort_and_look(int mute) {
    laboratory_goniod_start(&lab);
    run_until_exposing();
    tap_mute(tap, mute);
    int64_t ordered_us = tap_now_us(tap);
    laboratory_expect(&lab, 0, "", NULL, "abort", NULL);
    for (int unit = 1; unit <= UNITS; unit++) {
        int64_t stop_us;
        while ((stop_us = tap_stop_us(tap, unit, ordered_us)) <= 0 &&
               tap_now_us(tap) - ordered_us < BUSY_MACHINE_US)
            real_sleep_ms(20);
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
    laboratory_await(&lab, "\"state\":\"aborted\"", AWAIT_MS);
    laboratory_await(&lab, "\"lamp\":false", AWAIT_MS);
}

static void abort_on_a_mute_bus(void **state) {
    (void)state;
    abort_and_look(TAP_EVERYBODY);
    laboratory_await(&lab, "\"stop_confirmed\":false", AWAIT_MS);
    tap_mute(tap, TAP_NOBODY);
    laboratory_await(&lab, "\"state\":\"aborted\"", AWAIT_MS);
}

/* Its neighbours on the bus are stopped and seen to stand; of it alone that is not known. */
static void abort_with_one_mute_unit(void **state) {
    (void)state;
    abort_and_look(MUTE_UNIT);
    laboratory_await(&lab, "\"stop_confirmed\":false", AWAIT_MS);
    laboratory_await(&lab, "\"state\":\"aborted\"", AWAIT_MS);
    tap_mute(tap, TAP_NOBODY);
}

/* Of the drives; a scan that came too late is the machine's. */
static int no_trouble(void *arg, int64_t us, const char *kind, const char *json) {
    (void)arg;
    (void)us;
    if (!strcmp(kind, "repeat") && strstr(json, "axis"))
        fail_msg("%s: %s", kind, json);
    return 0;
}

/* A person at the holder for 3 s, exposures of 2.4 s, a stall of 4 s: in each of them drives with the built-in watchdog
 * of 1 s, not polled, would give up. */
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
    laboratory_await(&lab, "\"state\":\"held\"", AWAIT_MS);
    int64_t from_us = tap_now_us(tap), until_us = real_us() + AWAIT_MS * INT64_C(1000);
    real_sleep_ms(3000);
    laboratory_expect(&lab, 0, "", NULL, "continue", NULL);
    assert_true(laboratory_stall(&lab, AWAIT_MS));
    while (program_runs(&run) && real_us() < until_us) {
        laboratory_ctl(&lab, &said, NULL, "continue", NULL); /* refused where nothing is held */
        said_free(&said);
        real_sleep_ms(200);
    }
    program_wait(&run, AWAIT_MS, &said);
    int64_t silence_us = tap_silence_us(tap, from_us, tap_now_us(tap));
    print_message("# longest silence on the bus: %.0f ms\n%s", (double)silence_us * 1e-3, said.err);
    assert_int_equal(said.status, 0);
    assert_true(silence_us < SILENCE_US);
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
