#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include <jansson.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "drivers/usb_link.h"
#include "proto/units.h"

/* goniosim in a process of its own, its spectrometer through the usbredir client of goniod. */
struct rig {
    pid_t pid;
    char target[128];
    struct clock clock;
    struct bench bench;
    struct usb_link link;
    uint8_t in[8192];
    size_t n;
};

extern char **environ;

static const char *folder(void) {
    const char *build = getenv("BUILD");
    return build ? build : "build";
}

static void rig_start(struct rig *r, const char *yaml) {
    char program[256], config[] = "/tmp/goniosim-XXXXXX", line[512];
    int pipe_fd[2], fd = mkstemp(config);
    memset(r, 0, sizeof *r);
    assert_int_equal(write(fd, yaml, strlen(yaml)), strlen(yaml));
    close(fd);
    snprintf(program, sizeof program, "%s/goniosim", folder());
    assert_int_equal(pipe(pipe_fd), 0);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, pipe_fd[1], 1);
    posix_spawn_file_actions_addclose(&actions, pipe_fd[0]);
    char *argv[] = {program, "--config", config, NULL};
    assert_int_equal(posix_spawn(&r->pid, program, &actions, NULL, argv, environ), 0);
    posix_spawn_file_actions_destroy(&actions);
    close(pipe_fd[1]);
    FILE *out = fdopen(pipe_fd[0], "r");
    assert_non_null(fgets(line, sizeof line, out));
    fclose(out);
    unlink(config);
    json_t *endpoints = json_loads(line, 0, NULL);
    snprintf(r->target, sizeof r->target, "%s",
             json_string_value(json_object_get(endpoints, "spectrometer")));
    json_decref(endpoints);
    clock_init_real(&r->clock);
}

static void rig_open(struct rig *r, uint16_t pid) {
    struct err e = {0};
    bench_init(&r->bench, &r->clock);
    if (usb_link_open(&r->link, r->target, 0x2457, pid, NULL, &r->clock, &e) != 0)
        fail_msg("%s", e.text);
    assert_int_equal(usb_link_serve(&r->link, &r->bench, &e), 0);
}

static void rig_stop(struct rig *r) {
    int status;
    kill(r->pid, SIGTERM);
    assert_int_equal(waitpid(r->pid, &status, 0), r->pid);
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 0);
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
    assert_int_equal(transfer(r, 0x01, out, n, 1000), 0);
    assert_int_equal(transfer(r, 0x81, NULL, 64, 1000), 0);
    assert_int_equal(r->n, expected);
}

static void test_a_spectrum_of_usb2000plus(void **state) {
    (void)state;
    struct rig r;
    rig_start(&r, "seed: 1\nmodbus: []\n");
    rig_open(&r, 0x101E);
    query(&r, "\x05\x00", 2, 17);
    assert_memory_equal(r.in + 2, "USB2+SIM001", 11);
    transfer(&r, 0x01, "\x02\x20\x4e\x00\x00", 5, 1000); /* 20 ms */
    query(&r, "\xfe", 1, 16);
    assert_int_equal(r.in[2] | r.in[3] << 8, 20000);
    int64_t start_us = clock_stamp(&r.clock);
    transfer(&r, 0x01, "\x09", 1, 1000);
    assert_int_equal(transfer(&r, 0x82, NULL, 4608, 2000), 0);
    assert_int_equal(r.n, 4097);
    assert_int_equal(r.in[4096], 0x69);
    int64_t took_us = clock_stamp(&r.clock) - start_us;
    assert_true(took_us >= 20000 && took_us < 200000); /* the upper figure leaves room for a busy machine */
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
    transfer(&r, 0x01, "\x09", 1, 1000);
    query(&r, "\xfe", 1, 16); /* the reply endpoint is free while a spectrum is held */
    assert_int_equal(transfer(&r, 0x86, NULL, 2048, 2000), 0);
    assert_int_equal(r.n, 2048);
    assert_int_equal(transfer(&r, 0x82, NULL, 6144, 2000), 0);
    assert_int_equal(r.n, 5633);
    r.link.ops->close(r.link.self);
    rig_stop(&r);
    assert_int_equal(access(r.target + strlen("usbredir:unix:"), F_OK), -1); /* it takes its socket with it */
}

static void test_deadlines_overflow_and_the_next_client(void **state) {
    (void)state;
    struct rig r;
    rig_start(&r, "modbus: []\n");
    rig_open(&r, 0x101E);
    assert_int_equal(transfer(&r, 0x81, NULL, 64, 50), -ERR_TIMEOUT); /* nothing was asked */
    query(&r, "\xfe", 1, 16);
    transfer(&r, 0x01, "\xfe", 1, 1000);
    assert_int_equal(transfer(&r, 0x81, NULL, 8, 1000), -EOVERFLOW);
    assert_int_equal(transfer(&r, 0x83, NULL, 64, 1000), -EPIPE);
    transfer(&r, 0x01, "\x09", 1, 1000);
    r.link.ops->close(r.link.self); /* with a frame on its way: it outlives the client */
    rig_open(&r, 0x101E);
    assert_int_equal(transfer(&r, 0x82, NULL, 4608, 2000), 0);
    assert_int_equal(r.n, 4097);
    r.link.ops->close(r.link.self);
    rig_stop(&r);
}

static void test_the_device_is_lost_with_its_process(void **state) {
    (void)state;
    struct rig r;
    int status;
    rig_start(&r, "modbus: []\n");
    rig_open(&r, 0x101E);
    kill(r.pid, SIGKILL);
    assert_int_equal(waitpid(r.pid, &status, 0), r.pid);
    assert_int_equal(transfer(&r, 0x82, NULL, 4608, 2000), -ENODEV);
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
