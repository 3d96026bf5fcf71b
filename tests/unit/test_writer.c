/* The writer thread: rows become durable by tickets, exchanges within a second, a full disk ends writing
 * whole. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "daemon/writer.h"
#include "proto/units.h"

#define DISK_US (300 * US_PER_S) /* a busy disk is slow to commit */

struct fixture {
    struct clock clock;
    struct bench bench;
    struct writer *writer;
    char dir[64], path[96];
    int file;
};

static void start(struct fixture *f, bool virtual_time) {
    if (virtual_time)
        clock_init_virtual(&f->clock);
    else
        clock_init_real(&f->clock);
    bench_init(&f->bench, &f->clock);
    assert_int_equal(writer_start(&f->writer, &f->bench, NULL), 0);
}

static int set_up(void **state) {
    static struct fixture f;
    memset(&f, 0, sizeof f);
    strcpy(f.dir, "/tmp/goniod-writer-XXXXXX");
    assert_non_null(mkdtemp(f.dir));
    snprintf(f.path, sizeof f.path, "%s/a.gonio", f.dir);
    *state = &f;
    return 0;
}

static int tear_down(void **state) {
    struct fixture *f = *state;
    char command[128];
    snprintf(command, sizeof command, "rm -rf %s", f->dir);
    return system(command);
}

static void add_exposure(struct fixture *f, int64_t id) {
    static uint16_t counts[2048];
    struct exposure x = {.id = id,
                         .kind = EXPOSURE_SAMPLE,
                         .settled_us = 10 * id,
                         .start_us = 10 * id + 1,
                         .end_us = 10 * id + 2,
                         .exposure_us = 1000,
                         .n_scans = 1,
                         .pixels = 2048,
                         .counts = counts};
    counts[0] = (uint16_t)id; /* the copy is the writer's: changing it afterwards must not show */
    writer_exposure(f->writer, f->file, &x);
    counts[0] = 0xffff;
}

static int check_exposure(void *arg, const struct exposure *x) {
    int *n = arg;
    assert_int_equal(x->id, ++*n);
    assert_int_equal(x->counts[0], *n);
    return 0;
}

static int count_exchange(void *arg, const struct exchange *x) {
    int *n = arg;
    assert_int_equal(x->request_size, 6);
    ++*n;
    return 0;
}

static void rows_are_durable_when_the_ticket_says_so(void **state) {
    struct fixture *f = *state;
    start(f, true);
    assert_int_equal(writer_create(f->writer, f->path, &f->file, NULL), 0);
    writer_text(f->writer, f->file, "seed", "1");
    for (int i = 1; i <= 20; i++)
        add_exposure(f, i);
    writer_event(f->writer, f->file, 5, "state", "{}");
    int64_t ticket = writer_commit(f->writer, f->file);
    assert_int_equal(bench_wait(&f->bench, US_PER_S, NULL, NULL, NULL), BENCH_UNTIL);
    assert_true(writer_durable(f->writer, ticket)); /* virtual time did not pass before */
    assert_int_equal(writer_failure(f->writer, NULL), 0);
    struct session *s;
    int n = 0;
    assert_int_equal(session_open(&s, f->path, true, NULL), 0); /* beside the live writer */
    assert_int_equal(session_each_exposure(s, check_exposure, &n, NULL), 0);
    assert_int_equal(n, 20);
    session_close(s, NULL);
    writer_stop(f->writer);
}

static int64_t every_ms_us(void *clock) {
    return clock_now_us(clock) / US_PER_MS * US_PER_MS + US_PER_MS;
}

static void nothing(void *self) {
    (void)self;
}

/* No ticket tells of it: the writer itself wakes the wait, before anything that is due later. */
static void a_wait_for_room_costs_no_virtual_time(void **state) {
    struct fixture *f = *state;
    static uint16_t counts[2 * WRITER_BYTES_MAX / sizeof(uint16_t)];
    struct exposure x = {.id = 1, .n_scans = 1, .pixels = sizeof counts / sizeof *counts, .counts = counts};
    start(f, true);
    struct bench_service axis = {.self = &f->clock, .due_us = every_ms_us, .run = nothing};
    assert_int_equal(bench_add(&f->bench, &axis), 0);
    assert_int_equal(writer_create(f->writer, f->path, &f->file, NULL), 0);
    writer_exposure(f->writer, f->file, &x);
    assert_int_equal(bench_wait(&f->bench, CLOCK_NEVER, writer_has_room, f->writer, NULL), BENCH_DONE);
    assert_int_equal(clock_now_us(&f->clock), 0);
    writer_stop(f->writer);
}

static void a_wrong_number_is_a_failure(void **state) {
    struct fixture *f = *state;
    struct err e = {0};
    start(f, true);
    assert_int_equal(writer_create(f->writer, f->path, &f->file, NULL), 0);
    add_exposure(f, 7);
    writer_commit(f->writer, f->file);
    assert_int_equal(bench_wait(&f->bench, CLOCK_NEVER, writer_idle, f->writer, NULL), BENCH_DONE);
    assert_int_equal(writer_failure(f->writer, &e), -ERR_IO);
    assert_non_null(strstr(e.text, "number 1"));
    writer_stop(f->writer);
}

static void exchanges_commit_within_a_second(void **state) {
    struct fixture *f = *state;
    start(f, false);
    assert_int_equal(writer_create(f->writer, f->path, &f->file, NULL), 0);
    int64_t begun = clock_stamp(&f->clock);
    writer_commit(f->writer, f->file);
    bench_wait(&f->bench, begun + DISK_US, writer_idle, f->writer, NULL);
    writer_exchange(f->writer, f->file, 1, 2, "sim:a", "123456", 6, "78", 2, 0);
    assert_true(writer_idle(f->writer));
    bench_wait(&f->bench, clock_stamp(&f->clock) + 1100 * US_PER_MS, NULL, NULL, NULL);
    bench_wait(&f->bench, begun + DISK_US, writer_idle, f->writer, NULL);
    struct session *s;
    struct err e = {0};
    int n = 0;
    if (session_open(&s, f->path, true, &e) < 0)
        fail_msg("%s", e.text);
    assert_int_equal(session_each_exchange(s, count_exchange, &n, NULL), 0);
    assert_int_equal(n, 1);
    session_close(s, NULL);
    writer_stop(f->writer);
}

/* A limit on the size of files stands in for a full disk: what was durable stays, the rest goes whole. */
static void a_full_disk_ends_writing_whole(void **state) {
    struct fixture *f = *state;
    struct rlimit old, small;
    struct err e = {0};
    start(f, true);
    assert_int_equal(writer_create(f->writer, f->path, &f->file, NULL), 0);
    for (int i = 1; i <= 3; i++)
        add_exposure(f, i);
    writer_commit(f->writer, f->file);
    bench_wait(&f->bench, CLOCK_NEVER, writer_idle, f->writer, NULL);
    assert_int_equal(writer_failure(f->writer, NULL), 0);
    signal(SIGXFSZ, SIG_IGN);
    getrlimit(RLIMIT_FSIZE, &old);
    small = old;
    small.rlim_cur = 600000;
    setrlimit(RLIMIT_FSIZE, &small);
    int written = 3;
    for (; writer_failure(f->writer, NULL) == 0 && written < 1000; written++) {
        add_exposure(f, written + 1);
        writer_commit(f->writer, f->file);
        bench_wait(&f->bench, CLOCK_NEVER, writer_idle, f->writer, NULL);
    }
    setrlimit(RLIMIT_FSIZE, &old);
    assert_in_range(written, 4, 999);
    assert_true(writer_failure(f->writer, &e) < 0);
    assert_true(strlen(e.text) > 20);
    writer_stop(f->writer);
    struct session *s;
    int n = 0;
    assert_int_equal(session_open(&s, f->path, true, NULL), 0);
    assert_int_equal(session_each_exposure(s, check_exposure, &n, NULL), 0);
    assert_int_equal(n, written - 1);
    session_close(s, NULL);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(rows_are_durable_when_the_ticket_says_so, set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_wait_for_room_costs_no_virtual_time, set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_wrong_number_is_a_failure, set_up, tear_down),
        cmocka_unit_test_setup_teardown(exchanges_commit_within_a_second, set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_full_disk_ends_writing_whole, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
