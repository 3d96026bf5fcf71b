/* A campaign as a laboratory runs it: goniod with a config file and the real clock, over goniosim's wires, driven by
 * gonioctl. Points must agree with the truth, and be derived again from their raw rows to the last bit. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <netinet/in.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "tests/support/judgement.h"
#include "tests/support/laboratory.h"

#define GEOMETRY "theta_i_deg: [20, 30], theta_v_deg: [-10, 10]"
#define EXPOSURE "target: 0.4, min_ms: 4, max_ms: 64, average: 2"
#define N_POINTS 4
#define WATCHDOG_ALARM 0x85

static struct laboratory lab;

static int close_lab(void **state) {
    (void)state;
    laboratory_close(&lab);
    return 0;
}

/* ---- commissioning ---- */

/* "Turn the axis by some degrees with the drive's own means": another master on the bus, while goniod polls. The direct
 * data operation of the AZ: 8 values from register 58h on, by function 16. */
static void jog(int unit, int32_t steps) {
    const int32_t items[] = {0, 1, steps, 2000, 4000, 4000, 1000, 1};
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    uint8_t frame[13 + 32] = {0, 1, 0, 0, 0, 7 + 32, (uint8_t)unit, 16, 0, 0x58, 0, 16, 32}, reply[12];
    for (int i = 0; i < 32; i++)
        frame[13 + i] = (uint8_t)((uint32_t)items[i / 4] >> 8 * (3 - i % 4));
    to.sin_port = htons((uint16_t)atoi(strrchr(lab.sim.modbus[0], ':') + 1));
    int fd = socket(AF_INET, SOCK_STREAM, 0);
    assert_int_equal(connect(fd, (struct sockaddr *)&to, sizeof to), 0);
    assert_int_equal(send(fd, frame, sizeof frame, 0), sizeof frame);
    assert_int_equal(recv(fd, reply, sizeof reply, MSG_WAITALL), sizeof reply);
    assert_int_equal(reply[7], 16);
    close(fd);
}

static void commission_all(void) {
    static const char *const axis[] = {"source", "sample", "holder"};
    char job[96];
    snprintf(job, sizeof job, "%s/job.yaml", lab.dir);
    laboratory_expect(&lab, 1, "gonioctl commission", NULL, "run", "--wait", job, NULL);
    laboratory_expect(&lab, 0, "position not valid", NULL, "where", NULL);
    for (int unit = 1; unit <= 3; unit++)
        jog(unit, 400);
    real_sleep_ms(1000);
    laboratory_expect(&lab, 1, "Nothing was moved", "yes\nyes\nno\n", "commission", axis[0], NULL);
    for (int a = 0; a < 3; a++)
        laboratory_expect(&lab, 0, "Passed", "yes\nyes\nyes\nyes\nyes\nyes\nyes\nyes\n", "commission",
                          axis[a], NULL);
}

/* ---- what is left of a campaign ---- */

static void judge(const char *path) {
    struct judgement j = {0};
    struct session *s;
    struct err e = {0};
    assert_int_equal(sim_paint_find(LABORATORY_SAMPLE_PAINT, LABORATORY_SAMPLE_SUPPORT, 0, &j.surface, NULL),
                     0);
    if (session_open(&s, path, true, &e) < 0)
        fail_msg("%s", e.text);
    judge_session(s, &j);
    session_close(s, NULL);
    print_message("# %d points; pulls: mean %.2f, worst %.2f\n", j.n, j.sum / j.n, j.worst);
    assert_int_equal(j.n, N_POINTS);
    assert_int_equal(j.provisional, 0);
    assert_true(j.worst < 5);
}

static void look_into(const char *path, const char *name) {
    laboratory_expect(&lab, 0, "hg", NULL, "show", name, NULL);
    laboratory_expect(&lab, 0, "", NULL, "verify", name, NULL);
    laboratory_expect(&lab, 0, "\"same\":true", NULL, "reduce", "--json", name, NULL);
    laboratory_expect(&lab, 0, "hg", NULL, "compare", name, NULL);
    judge(path);
}

static void run_campaign(char path[256], char name[160]) {
    struct said said;
    char job[96];
    int64_t begun_us = real_us();
    snprintf(job, sizeof job, "%s/job.yaml", lab.dir);
    laboratory_expect(&lab, 0, "4 geometries", NULL, "check", job, NULL);
    laboratory_ctl(&lab, &said, NULL, "run", "--wait", job, NULL);
    if (said.status != 0)
        fail_msg("%s\n%s", said.out, said.err);
    laboratory_session_path(&lab, said.out, path, name);
    said_free(&said);
    print_message("# %s took %.1f s\n", name, (double)(real_us() - begun_us) * 1e-6);
    laboratory_expect(&lab, 0, "done", NULL, "status", NULL);
}

static void first_light(const char *n_counts) {
    char csv[96];
    snprintf(csv, sizeof csv, "%s/spectrum.csv", lab.dir);
    laboratory_expect(&lab, 0, "source", NULL, "devices", NULL);
    laboratory_expect(&lab, 0, "there", NULL, "move", "source", "12.5", NULL);
    laboratory_expect(&lab, 0, "12.500 deg", NULL, "where", NULL);
    laboratory_expect(&lab, 0, "there", NULL, "move", "holder", "0", NULL);
    laboratory_expect(&lab, 2, "limit", NULL, "move", "source", "151", NULL);
    laboratory_expect(&lab, 0, n_counts, NULL, "spectrum", "--average", "2", "--json", NULL);
    laboratory_expect(&lab, 0, "", NULL, "spectrum", "--exposure", "20", "-o", csv, NULL);
    assert_int_equal(access(csv, R_OK), 0);
}

/* ---- tests ---- */

static void tcp_and_a_unix_socket(void **state) {
    (void)state;
    const struct laboratory_choice choice = {.model = "usb2000plus", .not_commissioned = true};
    char path[256], name[160];
    laboratory_open(&lab, &choice);
    laboratory_job(&lab, GEOMETRY, "fixed", EXPOSURE);
    laboratory_goniod_start(&lab);
    commission_all();
    first_light("\"model\":\"usb2000plus\"");
    laboratory_expect(&lab, 0, "homed", NULL, "home", "sample", NULL);
    run_campaign(path, name);
    look_into(path, name);
    laboratory_goniod_stop(&lab, SIGTERM, 0);
}

static void rtu_and_a_tcp_socket(void **state) {
    (void)state;
    const struct laboratory_choice choice = {.model = "usb4000", .rtu = true, .usb_tcp = true};
    char path[256], name[160];
    laboratory_open(&lab, &choice);
    laboratory_job(&lab, GEOMETRY, "every_geometry", EXPOSURE);
    laboratory_goniod_start(&lab);
    first_light("\"model\":\"usb4000\"");
    run_campaign(path, name);
    look_into(path, name);
    laboratory_goniod_stop(&lab, SIGTERM, 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(tcp_and_a_unix_socket, close_lab),
        cmocka_unit_test_teardown(rtu_and_a_tcp_socket, close_lab),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
