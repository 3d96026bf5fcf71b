/* goniod's link over libusb: the same campaign, with the spectrometer on a USB that umockdev pretends and usb_bridge
 * connects to goniosim. Skips where umockdev is not installed. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "tests/support/judgement.h"
#include "tests/support/laboratory.h"
#include "tests/support/skipping.h"

#define N_POINTS 4

static struct laboratory lab;

static int close_lab(void **state) {
    (void)state;
    laboratory_close(&lab);
    return 0;
}

static void judge(const char *path) {
    struct judgement j = {0};
    struct session *s;
    assert_int_equal(sim_paint_find(LABORATORY_SAMPLE_PAINT, LABORATORY_SAMPLE_SUPPORT, 0, &j.surface, NULL),
                     0);
    assert_int_equal(session_open(&s, path, true, NULL), 0);
    judge_session(s, &j);
    session_close(s, NULL);
    print_message("# %d points; pulls: mean %.2f, worst %.2f\n", j.n, j.sum / j.n, j.worst);
    assert_int_equal(j.n, N_POINTS);
    assert_true(j.worst < 5);
}

static void need_the_bridge(void) {
    char path[256];
    const char *build = getenv("BUILD");
    skip_under_asan();
    snprintf(path, sizeof path, "%s/tests/bridge/usb_bridge", build ? build : "build");
    if (access(path, X_OK) != 0)
        skip_because("libumockdev-dev and umockdev are not both installed");
}

static void campaign(const char *model, const char *ids) {
    const struct laboratory_choice choice = {.model = model, .spectrometer = "usb", .bridged = ids};
    char job[96], path[256], name[160];
    struct said said;
    need_the_bridge();
    laboratory_open(&lab, &choice);
    laboratory_job(&lab, "theta_i_deg: [20, 30], theta_v_deg: [-10, 10]", "fixed",
                   "target: 0.4, min_ms: 4, max_ms: 64, average: 2");
    laboratory_goniod_start(&lab);
    laboratory_expect(&lab, 0, "USB 1-1", NULL, "devices", NULL);
    laboratory_expect(&lab, 0, "USB2+SIM001", NULL, "spectrum", "--average", "3", "--json", NULL);
    snprintf(job, sizeof job, "%s/job.yaml", lab.dir);
    laboratory_ctl(&lab, &said, NULL, "run", "--wait", job, NULL);
    if (said.status != 0)
        fail_msg("%s\n%s", said.out, said.err);
    laboratory_session_path(&lab, said.out, path, name);
    said_free(&said);
    laboratory_expect(&lab, 0, "\"same\":true", NULL, "reduce", "--json", name, NULL);
    judge(path);
}

static void a_usb2000plus(void **state) {
    (void)state;
    campaign("usb2000plus", "2457:101e");
}

static void a_usb4000(void **state) {
    (void)state;
    campaign("usb4000", "2457:1022");
}

/* The instrument goes in mid-session and nobody hangs: the next order says that it is gone. */
static void an_instrument_that_is_unplugged(void **state) {
    (void)state;
    const struct laboratory_choice choice = {.spectrometer = "usb", .bridged = "2457:101e"};
    need_the_bridge();
    laboratory_open(&lab, &choice);
    laboratory_goniod_start(&lab);
    laboratory_expect(&lab, 0, "USB2+SIM001", NULL, "spectrum", "--json", NULL);
    sim_process_stop(&lab.sim, SIGKILL);
    laboratory_expect(&lab, 1, "gonioctl", NULL, "spectrum", "--json", NULL);
    laboratory_expect(&lab, 0, "state", NULL, "status", "--json", NULL);
}

/* Somebody else's device, and one that another program holds: said by the order that needs it, and by `devices`. */
static void refused(const char *ids, const char *said_by_spectrum, const char *said_by_devices) {
    const struct laboratory_choice choice = {.spectrometer = "usb", .bridged = ids};
    need_the_bridge();
    laboratory_open(&lab, &choice);
    laboratory_goniod_start(&lab);
    laboratory_expect(&lab, 1, said_by_spectrum, NULL, "spectrum", "--json", NULL);
    laboratory_expect(&lab, 0, said_by_devices, NULL, "devices", NULL);
    laboratory_expect(&lab, 0, "\"state\":\"idle\"", NULL, "status", "--json", NULL);
}

static void an_instrument_without_permission(void **state) {
    (void)state;
    refused("2457:101e,denied", "udev rule", "no permission");
}

static void an_instrument_that_another_program_holds(void **state) {
    (void)state;
    refused("2457:101e,busy", "another program", "another program");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(a_usb2000plus, close_lab),
        cmocka_unit_test_teardown(a_usb4000, close_lab),
        cmocka_unit_test_teardown(an_instrument_that_is_unplugged, close_lab),
        cmocka_unit_test_teardown(an_instrument_without_permission, close_lab),
        cmocka_unit_test_teardown(an_instrument_that_another_program_holds, close_lab),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
