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
#include <unistd.h>

#include "tests/support/laboratory.h"
#include "tests/support/tap.h"

#define LONG_MS "4000"
#define IN_EXPOSURE_MS 1500 /* after the axes have arrived */
#define UNITS 3
#define BUSY_MACHINE_US 1000000 /* the figures themselves are measured by `make bench` */

static struct laboratory lab;
static struct tap *tap;

static int open_lab(void **state) {
    (void)state;
    struct laboratory_choice choice = {0};
    laboratory_open(&lab, &choice);
    tap = tap_open(lab.modbus, lab.modbus);
    laboratory_write_config(&lab);
    laboratory_job(&lab, "pairs: [[20, 10], [20, 12]]", "fixed",
                   "target: 0.8, min_ms: " LONG_MS ", max_ms: " LONG_MS ", average: 1");
    return 0;
}

static int close_lab(void **state) {
    (void)state;
    laboratory_close(&lab);
    tap_close(tap);
    unsetenv("LD_PRELOAD");
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

static void abort_and_look(bool mute) {
    laboratory_goniod_start(&lab);
    run_until_exposing();
    tap_mute(tap, mute);
    int64_t ordered_us = real_us();
    laboratory_expect(&lab, 0, "", NULL, "abort", NULL);
    real_sleep_ms(1000);
    for (int unit = 1; unit <= UNITS; unit++) {
        int64_t stop_us = tap_stop_us(tap, unit, ordered_us);
        assert_true(stop_us > 0);
        print_message("# %s: stop order of unit %d after %.1f ms\n", mute ? "mute" : "answering", unit,
                      (double)(stop_us - ordered_us) * 1e-3);
        assert_true(stop_us - ordered_us < BUSY_MACHINE_US);
    }
}

static void abort_in_a_long_exposure(void **state) {
    (void)state;
    abort_and_look(false);
    laboratory_await(&lab, "\"state\":\"aborted\"", 20000);
    laboratory_await(&lab, "\"lamp\":false", 5000);
}

static void abort_on_a_mute_bus(void **state) {
    (void)state;
    abort_and_look(true);
    laboratory_await(&lab, "\"stop_confirmed\":false", 5000);
    tap_mute(tap, false);
    laboratory_await(&lab, "\"state\":\"aborted\"", 30000);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, open_lab, close_lab)

int main(void) {
    const struct CMUnitTest tests[] = {
        TEST(abort_in_a_long_exposure),
        TEST(abort_on_a_mute_bus),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
