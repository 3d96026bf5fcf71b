#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "drivers/bench.h"
#include "tests/support/kept.h"

static char trace[64]; /* names of the services in the order they ran */

struct beat { /* runs every period_us, n times */
    struct clock *clock;
    char name;
    int64_t next_us, period_us;
    int runs;
    int pipe[2]; /* or woken by a byte */
    bool working;
    struct bench *bench;
};

static int64_t beat_due(void *self) {
    return ((struct beat *)self)->next_us;
}

static void beat_run(void *self) {
    struct beat *b = self;
    size_t used = strlen(trace);
    if (used < sizeof trace - 1)
        trace[used] = b->name;
    b->runs++;
    if (b->next_us != CLOCK_NEVER)
        b->next_us += b->period_us;
    char byte;
    if (b->pipe[0] && read(b->pipe[0], &byte, 1) == 1 && byte == 'f') {
        b->working = false;
        b->bench->frozen = false;
    }
}

static bool beat_working(void *self) {
    return ((struct beat *)self)->working;
}

static int beat_descriptors(void *self, struct pollfd *fd, int max) {
    struct beat *b = self;
    if (!b->pipe[0] || max < 1)
        return 0;
    fd[0] = (struct pollfd){.fd = b->pipe[0], .events = POLLIN};
    return 1;
}

static void add(struct bench *bench, struct beat *beat) {
    struct bench_service s = {"beat", beat, beat_due, beat_run, beat_working, beat_descriptors, 0};
    beat->clock = bench->clock;
    beat->bench = bench;
    assert_int_equal(bench_add(bench, &s), 0);
}

static void start(struct bench *bench, struct clock *clock, bool is_virtual) {
    memset(trace, 0, sizeof trace);
    if (is_virtual)
        clock_init_virtual(clock);
    else
        clock_init_real(clock);
    bench_init(bench, clock);
}

static void virtual_time_goes_from_event_to_event(void **state) {
    (void)state;
    struct clock clock;
    struct bench bench;
    start(&bench, &clock, true);
    struct beat a = {.name = 'a', .next_us = 10, .period_us = 20},
                b = {.name = 'b', .next_us = 30, .period_us = 15};
    add(&bench, &a);
    add(&bench, &b);
    assert_int_equal(bench_wait(&bench, 60, NULL, NULL, NULL), BENCH_UNTIL);
    assert_string_equal(trace, "aabbab"); /* a 10 30 50, b 30 45 60: at 30 in the order added, 60 inclusive */
    assert_int_equal(clock_now_us(&clock), 60);
}

static bool thrice(void *arg) {
    return ((struct beat *)arg)->runs >= 3;
}

static void done_ends_the_wait_at_once(void **state) {
    (void)state;
    struct clock clock;
    struct bench bench;
    start(&bench, &clock, true);
    struct beat a = {.name = 'a', .next_us = 10, .period_us = 10};
    add(&bench, &a);
    assert_int_equal(bench_wait(&bench, 1000, thrice, &a, NULL), BENCH_DONE);
    assert_int_equal(clock_now_us(&clock), 30);
    assert_int_equal(bench_wait(&bench, 1000, thrice, &a, NULL), BENCH_DONE);
    assert_int_equal(a.runs, 3);
}

static void cancel_wins_over_done(void **state) {
    (void)state;
    struct clock clock;
    struct bench bench;
    start(&bench, &clock, true);
    struct beat a = {.name = 'a', .next_us = 10, .period_us = 10, .runs = 3};
    struct cancel cancel = {true};
    add(&bench, &a);
    assert_int_equal(bench_wait(&bench, 1000, thrice, &a, &cancel), -ERR_CANCELLED);
    assert_int_equal(clock_now_us(&clock), 0);
}

static void *finish_soon(void *arg) {
    struct beat *b = arg;
    usleep(30000);
    assert_int_equal(write(b->pipe[1], "f", 1), 1);
    return NULL;
}

/* Another thread ends the work just after the wait has asked for it. */
static bool missed_by_a_moment(void *self) {
    struct beat *writer = self;
    bool done = !writer->working;
    if (!done)
        assert_int_equal(write(writer->pipe[1], "w", 1), 1);
    writer->working = false;
    return done;
}

static void what_ends_just_after_it_was_asked_for_costs_no_virtual_time(void **state) {
    (void)state;
    struct clock clock;
    struct bench bench;
    start(&bench, &clock, true);
    struct beat writer = {.name = 'w', .next_us = CLOCK_NEVER, .working = true};
    struct beat axis = {.name = 'a', .next_us = 500, .period_us = 500};
    assert_int_equal(pipe(writer.pipe), 0);
    add(&bench, &axis);
    add(&bench, &writer);
    assert_int_equal(bench_wait(&bench, CLOCK_NEVER, missed_by_a_moment, &writer, NULL), BENCH_DONE);
    assert_int_equal(clock_now_us(&clock), 0);
    close(writer.pipe[0]);
    close(writer.pipe[1]);
}

/* Virtual time stands still while a write is outstanding; its descriptor lets time go on. */
static void outstanding_work_holds_virtual_time(void **state) {
    (void)state;
    for (int frozen = 0; frozen < 2; frozen++) {
        struct clock clock;
        struct bench bench;
        start(&bench, &clock, true);
        struct beat writer = {.name = 'w', .next_us = CLOCK_NEVER, .working = !frozen};
        struct beat axis = {.name = 'a', .next_us = 500, .period_us = 500};
        bench.frozen = frozen;
        assert_int_equal(pipe(writer.pipe), 0);
        add(&bench, &axis);
        add(&bench, &writer);
        pthread_t thread;
        assert_int_equal(pthread_create(&thread, NULL, finish_soon, &writer), 0);
        assert_int_equal(bench_wait(&bench, 1000, NULL, NULL, NULL), BENCH_UNTIL);
        pthread_join(thread, NULL);
        assert_string_equal(trace, "waa");
        close(writer.pipe[0]);
        close(writer.pipe[1]);
    }
}

static bool ran(void *arg) {
    return ((struct beat *)arg)->runs > 0;
}

static void descriptors_alone_block_in_poll(void **state) {
    (void)state;
    struct clock clock;
    struct bench bench;
    start(&bench, &clock, true);
    struct beat b = {.name = 'b', .next_us = CLOCK_NEVER};
    assert_int_equal(pipe(b.pipe), 0);
    add(&bench, &b);
    pthread_t thread;
    assert_int_equal(pthread_create(&thread, NULL, finish_soon, &b), 0);
    assert_int_equal(bench_wait(&bench, CLOCK_NEVER, ran, &b, NULL), BENCH_DONE);
    pthread_join(thread, NULL);
    assert_int_equal(clock_now_us(&clock), 0);
    close(b.pipe[0]);
    close(b.pipe[1]);
}

static void a_wait_nothing_can_end_is_refused(void **state) {
    (void)state;
    struct clock clock;
    struct bench bench;
    start(&bench, &clock, true);
    assert_int_equal(bench_wait(&bench, CLOCK_NEVER, NULL, NULL, NULL), -ERR_STATE);
    bench.frozen = true;
    assert_int_equal(bench_wait(&bench, 100, NULL, NULL, NULL), -ERR_STATE);
    bench.frozen = false;
    struct beat stuck = {.name = 's', .next_us = 5, .period_us = 0};
    add(&bench, &stuck);
    assert_int_equal(bench_wait(&bench, 100, NULL, NULL, NULL), -ERR_STATE);
    start(&bench, &clock, false);
    assert_int_equal(bench_wait(&bench, CLOCK_NEVER, NULL, NULL, NULL), -ERR_STATE);
}

static int64_t wait_for_140_ms(void) {
    struct clock clock;
    struct bench bench;
    start(&bench, &clock, false);
    struct beat a = {.name = 'a', .next_us = 20000, .period_us = 50000};
    add(&bench, &a);
    assert_int_equal(bench_wait(&bench, 140000, NULL, NULL, NULL), BENCH_UNTIL);
    assert_true(clock_now_us(&clock) >= 140000);
    return clock_now_us(&clock);
}

static void real_time_waits_and_serves(void **state) {
    (void)state;
    for (int tries = 0; !kept(&tries, "a wait of 140 ms", wait_for_140_ms(), 165000);)
        ;
    assert_string_equal(trace, "aaa"); /* at 20, 70 and 120 ms */
}

static int64_t wait_for_a_descriptor(void) {
    struct clock clock;
    struct bench bench;
    start(&bench, &clock, false);
    struct beat b = {.name = 'b', .next_us = CLOCK_NEVER};
    assert_int_equal(pipe(b.pipe), 0);
    add(&bench, &b);
    pthread_t thread;
    assert_int_equal(pthread_create(&thread, NULL, finish_soon, &b), 0);
    assert_int_equal(bench_wait(&bench, CLOCK_NEVER, ran, &b, NULL), BENCH_DONE);
    int64_t took_us = clock_now_us(&clock);
    assert_true(took_us >= 20000);
    pthread_join(thread, NULL);
    close(b.pipe[0]);
    close(b.pipe[1]);
    return took_us;
}

static void a_descriptor_wakes_a_real_wait(void **state) {
    (void)state;
    for (int tries = 0; !kept(&tries, "a wake after 30 ms", wait_for_a_descriptor(), 3000000);)
        ;
}

static void *raise_soon(void *arg) {
    usleep(20000);
    atomic_store(&((struct cancel *)arg)->raised, true);
    return NULL;
}

static void a_cancel_of_another_thread_is_noticed(void **state) {
    (void)state;
    struct clock clock;
    struct bench bench;
    start(&bench, &clock, false);
    struct cancel cancel = {false};
    pthread_t thread;
    assert_int_equal(pthread_create(&thread, NULL, raise_soon, &cancel), 0);
    assert_int_equal(bench_wait(&bench, CLOCK_NEVER, NULL, NULL, &cancel), -ERR_CANCELLED);
    pthread_join(thread, NULL);
}

static void nested_run(void *self) {
    bench_wait(self, 100, NULL, NULL, NULL);
}

static int64_t always(void *self) {
    (void)self;
    return 0;
}

static void waiting_inside_a_service_asserts(void **state) {
    (void)state;
    pid_t child = fork();
    if (child == 0) {
        struct clock clock;
        struct bench bench;
        start(&bench, &clock, true);
        fclose(stderr);
        signal(SIGABRT, SIG_DFL);
        struct bench_service s = {.name = "nested", .self = &bench, .due_us = always, .run = nested_run};
        bench_add(&bench, &s);
        bench_wait(&bench, 100, NULL, NULL, NULL);
        _exit(0);
    }
    int status;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFSIGNALED(status) && WTERMSIG(status) == SIGABRT);
}

static void services_come_and_go(void **state) {
    (void)state;
    struct clock clock;
    struct bench bench;
    start(&bench, &clock, true);
    struct beat beat[BENCH_SERVICES];
    for (int i = 0; i < BENCH_SERVICES; i++) {
        beat[i] = (struct beat){.name = 'a' + i, .next_us = 10, .period_us = 10};
        add(&bench, &beat[i]);
    }
    struct bench_service more = {"more", &clock, beat_due, beat_run, NULL, NULL, 0};
    assert_int_equal(bench_add(&bench, &more), -ERR_RANGE);
    for (int i = 1; i < BENCH_SERVICES; i++)
        bench_remove(&bench, &beat[i]);
    assert_int_equal(bench_wait(&bench, 20, NULL, NULL, NULL), BENCH_UNTIL);
    assert_string_equal(trace, "aa");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(virtual_time_goes_from_event_to_event),
        cmocka_unit_test(done_ends_the_wait_at_once),
        cmocka_unit_test(cancel_wins_over_done),
        cmocka_unit_test(outstanding_work_holds_virtual_time),
        cmocka_unit_test(what_ends_just_after_it_was_asked_for_costs_no_virtual_time),
        cmocka_unit_test(descriptors_alone_block_in_poll),
        cmocka_unit_test(a_wait_nothing_can_end_is_refused),
        cmocka_unit_test(real_time_waits_and_serves),
        cmocka_unit_test(a_descriptor_wakes_a_real_wait),
        cmocka_unit_test(a_cancel_of_another_thread_is_noticed),
        cmocka_unit_test(waiting_inside_a_service_asserts),
        cmocka_unit_test(services_come_and_go),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
