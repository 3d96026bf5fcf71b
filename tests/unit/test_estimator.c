/* The child process behind the estimator: answers, silence, death, nonsense; virtual time waits for it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "daemon/estimator.h"
#include "proto/units.h"

/* Stands for goniofit: what it does is told by the question. */
static const char stand_in[] = "#!/usr/bin/python3\n"
                               "import json, os, struct, sys, time\n"
                               "while True:\n"
                               "    head = sys.stdin.buffer.read(4)\n"
                               "    if len(head) < 4: sys.exit(0)\n"
                               "    q = json.loads(sys.stdin.buffer.read(struct.unpack('<I', head)[0]))\n"
                               "    if q['do'] == 'die': os._exit(3)\n"
                               "    if q['do'] == 'hang': time.sleep(300)\n"
                               "    text = b'{no' if q['do'] == 'babble' else json.dumps({'id': q['id'], "
                               "'size': len(q.get('pad', ''))}).encode()\n"
                               "    head = struct.pack('<I', 1 << 30 if q['do'] == 'boast' else len(text))\n"
                               "    sys.stdout.buffer.write(head + text)\n"
                               "    sys.stdout.buffer.flush()\n";

struct fixture {
    struct clock clock;
    struct bench bench;
    struct estimator *estimator;
    char program[64];
    int answers, id, size, code;
    char text[512];
};

static void answered(void *arg, const json_t *reply, const struct err *e) {
    struct fixture *f = arg;
    f->answers++;
    f->id = reply ? json_integer_value(json_object_get(reply, "id")) : -1;
    f->size = reply ? json_integer_value(json_object_get(reply, "size")) : -1;
    f->code = e ? e->code : 0;
    snprintf(f->text, sizeof f->text, "%s", e ? e->text : "");
}

static int set_up(void **state) {
    static struct fixture f;
    memset(&f, 0, sizeof f);
    strcpy(f.program, "/tmp/goniofit-stand-in-XXXXXX");
    int fd = mkstemp(f.program);
    assert_true(fd >= 0);
    assert_int_equal(write(fd, stand_in, sizeof stand_in - 1), sizeof stand_in - 1);
    fchmod(fd, 0700);
    close(fd);
    clock_init_virtual(&f.clock);
    bench_init(&f.bench, &f.clock);
    assert_int_equal(estimator_new(&f.estimator, &f.bench, f.program, 0, NULL), 0);
    *state = &f;
    return 0;
}

static int tear_down(void **state) {
    struct fixture *f = *state;
    estimator_free(f->estimator);
    unlink(f->program);
    return 0;
}

static void ask(struct fixture *f, const char *text) {
    struct err e = {0};
    assert_int_equal(estimator_ask(f->estimator, strdup(text), 0, answered, f, &e), 0);
    assert_int_equal(bench_wait(&f->bench, CLOCK_NEVER, estimator_idle, f->estimator, NULL), BENCH_DONE);
}

static void a_question_is_answered_and_virtual_time_waits(void **state) {
    struct fixture *f = *state;
    struct err e = {0};
    assert_int_equal(estimator_ask(f->estimator, strdup("{\"id\":7,\"do\":\"\"}"), 0, answered, f, NULL), 0);
    assert_int_equal(estimator_ask(f->estimator, strdup("{}"), 0, answered, f, &e), -ERR_BUSY);
    assert_int_equal(bench_wait(&f->bench, US_PER_S, NULL, NULL, NULL), BENCH_UNTIL);
    assert_int_equal(f->answers, 1); /* the second passed only after the answer had come */
    assert_int_equal(f->id, 7);
    char *large = malloc(3000100);
    memset(large, 'x', 3000100);
    memcpy(large, "{\"id\":8,\"do\":\"\",\"pad\":\"", 23);
    strcpy(large + 3000000, "\"}");
    ask(f, large);
    free(large);
    assert_int_equal(f->id, 8);
    assert_true(f->size > 2999000);
}

/* The answer has its own time: not when the child has found it, which no two runs have in common. */
static void virtual_time_goes_on_to_the_time_of_the_answer(void **state) {
    struct fixture *f = *state;
    assert_int_equal(
        estimator_ask(f->estimator, strdup("{\"id\":7,\"do\":\"\"}"), 2 * US_PER_S, answered, f, NULL), 0);
    assert_int_equal(bench_wait(&f->bench, US_PER_S, NULL, NULL, NULL), BENCH_UNTIL);
    struct timespec ample = {.tv_nsec = 300000000};
    nanosleep(&ample, NULL);
    assert_int_equal(bench_wait(&f->bench, 2 * US_PER_S - 1, NULL, NULL, NULL), BENCH_UNTIL);
    assert_int_equal(f->answers, 0);
    assert_int_equal(bench_wait(&f->bench, CLOCK_NEVER, estimator_idle, f->estimator, NULL), BENCH_DONE);
    assert_int_equal(f->answers, 1);
    assert_int_equal(clock_now_us(&f->clock), 2 * US_PER_S);
    assert_int_equal(
        estimator_ask(f->estimator, strdup("{\"id\":8,\"do\":\"die\"}"), US_PER_S, answered, f, NULL), 0);
    assert_int_equal(bench_wait(&f->bench, CLOCK_NEVER, estimator_idle, f->estimator, NULL), BENCH_DONE);
    assert_int_equal(f->code, ERR_FIT);
    assert_int_equal(clock_now_us(&f->clock), 3 * US_PER_S);
}

static void death_is_an_answer_and_the_next_question_starts_a_new_child(void **state) {
    struct fixture *f = *state;
    ask(f, "{\"id\":1,\"do\":\"die\"}");
    assert_int_equal(f->code, ERR_FIT);
    assert_non_null(strstr(f->text, "ended without an answer"));
    ask(f, "{\"id\":2,\"do\":\"\"}");
    assert_int_equal(f->id, 2);
}

static void silence_ends_the_child(void **state) {
    struct fixture *f = *state;
    estimator_free(f->estimator);
    assert_int_equal(estimator_new(&f->estimator, &f->bench, f->program, 1, NULL), 0);
    ask(f, "{\"id\":1,\"do\":\"hang\"}");
    assert_non_null(strstr(f->text, "did not answer in time"));
}

static void babble_and_boasts_end_the_child(void **state) {
    struct fixture *f = *state;
    ask(f, "{\"id\":1,\"do\":\"babble\"}");
    assert_non_null(strstr(f->text, "not JSON"));
    ask(f, "{\"id\":1,\"do\":\"boast\"}");
    assert_non_null(strstr(f->text, "too long"));
    ask(f, "{\"id\":3,\"do\":\"\"}");
    assert_int_equal(f->id, 3);
}

static void restarts_are_bounded_until_forgiven(void **state) {
    struct fixture *f = *state;
    struct err e = {0};
    for (int i = 0; i <= ESTIMATOR_RESTARTS; i++)
        ask(f, "{\"id\":1,\"do\":\"die\"}");
    assert_int_equal(estimator_ask(f->estimator, strdup("{}"), 0, answered, f, &e), -ERR_FIT);
    estimator_forgive(f->estimator);
    ask(f, "{\"id\":4,\"do\":\"\"}");
    assert_int_equal(f->id, 4);
}

static void an_absent_program_is_named(void **state) {
    (void)state;
    struct clock clock;
    struct bench bench;
    struct estimator *s;
    struct err e = {0};
    clock_init_virtual(&clock);
    bench_init(&bench, &clock);
    assert_int_equal(estimator_new(&s, &bench, "/nowhere/goniofit", 0, NULL), 0);
    assert_int_equal(estimator_ask(s, strdup("{}"), 0, answered, NULL, &e), -ERR_FIT);
    assert_non_null(strstr(e.text, "/nowhere/goniofit"));
    estimator_free(s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_question_is_answered_and_virtual_time_waits, set_up, tear_down),
        cmocka_unit_test_setup_teardown(virtual_time_goes_on_to_the_time_of_the_answer, set_up, tear_down),
        cmocka_unit_test_setup_teardown(death_is_an_answer_and_the_next_question_starts_a_new_child, set_up,
                                        tear_down),
        cmocka_unit_test_setup_teardown(silence_ends_the_child, set_up, tear_down),
        cmocka_unit_test_setup_teardown(babble_and_boasts_end_the_child, set_up, tear_down),
        cmocka_unit_test_setup_teardown(restarts_are_bounded_until_forgiven, set_up, tear_down),
        cmocka_unit_test(an_absent_program_is_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
