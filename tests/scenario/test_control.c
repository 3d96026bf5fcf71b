/* The socket against a desk whose campaign side is this test: rights, limits, routing of outcomes, slow
 * readers. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "daemon/control.h"
#include "daemon/control_access.h"
#include "proto/rpc.h"

#define PATIENCE_MS 120000 /* with the control thread, which a busy machine may keep waiting */

struct fixture {
    struct desk *desk;
    struct control *control;
    struct config config;
    char path[64];
};

static json_t *plan_or_mistakes(void *arg, const struct desk_run *run, struct err_list *errors) {
    struct err e = {0};
    (void)arg;
    if (strcmp(run->text, "good") == 0)
        return json_pack("{s:i}", "points", 18);
    err_at(&e, ERR_INPUT, run->name, 2, 5, "unknown key 'smaples', did you mean 'samples'?");
    err_list_add(errors, &e);
    return NULL;
}

static void no_signal(void *arg, int number) {
    (void)arg;
    (void)number;
}

static struct control_options options(struct fixture *f) {
    return (struct control_options){.socket_path = f->path,
                                    .config = &f->config,
                                    .desk = f->desk,
                                    .check = plan_or_mistakes,
                                    .on_signal = no_signal};
}

static void start(struct fixture *f) {
    struct err e = {0};
    assert_int_equal(desk_new(&f->desk, &e), 0);
    struct control_options o = options(f);
    assert_int_equal(control_start(&f->control, &o, &e), 0);
}

static void end(struct fixture *f) {
    char lock[80];
    control_stop(f->control);
    desk_free(f->desk);
    assert_int_equal(access(f->path, F_OK), -1);
    snprintf(lock, sizeof lock, "%s.lock", f->path);
    unlink(lock);
}

static int setup(void **state) {
    struct fixture *f = calloc(1, sizeof *f);
    snprintf(f->path, sizeof f->path, "/tmp/test_control.%d.sock", (int)getpid());
    start(f);
    *state = f;
    return 0;
}

static int teardown(void **state) {
    end(*state);
    free(*state);
    return 0;
}

static struct rpc_client *join(struct fixture *f) {
    struct rpc_client *c;
    struct err e = {0};
    assert_int_equal(rpc_connect(&c, f->path, &e), 0);
    return c;
}

static int call(struct rpc_client *c, const char *method, json_t *params, json_t **result, struct err *e) {
    err_clear(e);
    return rpc_call(c, method, params, PATIENCE_MS, result, NULL, e);
}

static void status_is_the_snapshot_with_its_age(void **state) {
    struct fixture *f = *state;
    struct rpc_client *c = join(f);
    struct err e = {0};
    json_t *status;
    assert_int_equal(call(c, "status", NULL, &status, &e), 0);
    json_decref(status);
    desk_publish(f->desk, strdup("{\"state\":\"running\",\"now_us\":5}"));
    assert_int_equal(call(c, "status", NULL, &status, &e), 0);
    assert_string_equal(json_string_value(json_object_get(status, "state")), "running");
    assert_true(json_integer_value(json_object_get(status, "snapshot_age_ms")) < 1000);
    json_decref(status);
    rpc_close(c);
}

static void mistakes_in_a_request_are_answered_in_words(void **state) {
    struct fixture *f = *state;
    struct rpc_client *c = join(f);
    struct err e = {0};
    assert_int_equal(call(c, "stauts", NULL, NULL, &e), -ERR_USAGE);
    assert_non_null(strstr(e.text, "there is no method \"stauts\""));
    assert_int_equal(call(c, "move", json_pack("{s:s}", "axis", "source"), NULL, &e), -ERR_USAGE);
    assert_non_null(strstr(e.text, "needs the parameter \"deg\", a number"));
    assert_int_equal(call(c, "move", json_pack("{s:s, s:s}", "axis", "source", "deg", "ten"), NULL, &e),
                     -ERR_USAGE);
    assert_int_equal(call(c, "pause", json_pack("{s:b}", "nwo", 1), NULL, &e), -ERR_USAGE);
    assert_int_equal(call(c, "resume", json_pack("{s:s}", "session", "../etc/passwd"), NULL, &e), -ERR_USAGE);
    rpc_close(c);
}

static void a_check_brings_the_plan_or_every_mistake(void **state) {
    struct fixture *f = *state;
    struct rpc_client *c = join(f);
    struct err e = {0};
    struct err_list errors = {0};
    json_t *plan;
    json_t *job = json_pack("{s:{s:s, s:s}}", "job", "name", "job.yaml", "text", "bad");
    assert_int_equal(rpc_call(c, "check", job, PATIENCE_MS, NULL, &errors, &e), -ERR_INPUT);
    assert_int_equal(errors.n, 1);
    assert_int_equal(errors.item[0].column, 5);
    assert_string_equal(errors.item[0].file, "job.yaml");
    err_list_free(&errors);
    job = json_pack("{s:{s:s, s:s}}", "job", "name", "job.yaml", "text", "good");
    assert_int_equal(call(c, "check", job, &plan, &e), 0);
    assert_int_equal(json_integer_value(json_object_get(plan, "points")), 18);
    json_decref(plan);
    rpc_close(c);
}

static bool wait_order(struct fixture *f, struct desk_order *order) {
    struct pollfd fd = {.fd = desk_campaign_fd(f->desk), .events = POLLIN};
    if (poll(&fd, 1, PATIENCE_MS) != 1)
        return false;
    desk_campaign_clear(f->desk);
    return desk_take_order(f->desk, order);
}

static void send_text(struct rpc_client *c, const char *text) {
    ssize_t size = (ssize_t)strlen(text);
    assert_int_equal(send(rpc_descriptor(c), text, (size_t)size, MSG_NOSIGNAL), size);
}

static void read_line(struct rpc_client *c, char *line, size_t size) {
    size_t n = 0;
    struct pollfd fd = {.fd = rpc_descriptor(c), .events = POLLIN};
    while (n + 1 < size && poll(&fd, 1, PATIENCE_MS) == 1 && recv(fd.fd, line + n, 1, 0) == 1 &&
           line[n] != '\n')
        n++;
    line[n] = '\0';
}

static void an_outcome_reaches_who_asked(void **state) {
    struct fixture *f = *state;
    struct rpc_client *a = join(f), *b = join(f);
    struct desk_order first, second;
    char line[512];
    send_text(a, "{\"jsonrpc\":\"2.0\",\"id\":\"a\",\"method\":\"move\",\"params\":{\"axis\":\"source\","
                 "\"deg\":12.5}}\n");
    assert_true(wait_order(f, &first));
    send_text(b, "{\"jsonrpc\":\"2.0\",\"id\":\"b\",\"method\":\"abort\"}\n");
    assert_true(wait_order(f, &second));
    assert_int_equal(first.command, COMMAND_MANUAL);
    assert_string_equal(first.manual.axis, "source");
    assert_true(first.manual.deg == 12.5);
    assert_int_equal(second.command, COMMAND_ABORT);
    desk_finish(f->desk, second.ticket, 0, "", NULL);
    desk_finish(f->desk, first.ticket, -ERR_STATE, "a campaign is running; abort it first", NULL);
    read_line(b, line, sizeof line);
    assert_string_equal(line, "{\"jsonrpc\":\"2.0\",\"id\":\"b\",\"result\":{}}");
    read_line(a, line, sizeof line);
    assert_non_null(strstr(line, "\"id\":\"a\""));
    assert_non_null(strstr(line, "a campaign is running; abort it first"));
    rpc_close(a);
    rpc_close(b);
}

static void the_outcome_for_a_client_that_left_is_dropped(void **state) {
    struct fixture *f = *state;
    struct rpc_client *a = join(f);
    struct desk_order order;
    send_text(a, "{\"jsonrpc\":\"2.0\",\"id\":1,\"method\":\"abort\"}\n");
    assert_true(wait_order(f, &order));
    rpc_close(a);
    desk_finish(f->desk, order.ticket, 0, "", NULL);
    struct rpc_client *b = join(f);
    struct err e = {0};
    assert_int_equal(call(b, "version", NULL, NULL, &e), 0);
    rpc_close(b);
}

static void a_watcher_sees_events_in_order(void **state) {
    struct fixture *f = *state;
    struct rpc_client *c = join(f);
    struct err e = {0};
    assert_int_equal(call(c, "watch", NULL, NULL, &e), 0);
    for (int i = 0; i < 20; i++)
        desk_event_post(f->desk, "point", false, strdup("{\"beta\":0.5}"));
    int64_t last = 0;
    for (int i = 0; i < 20; i++) {
        json_t *event;
        assert_int_equal(rpc_next_event(c, PATIENCE_MS, &event, &e), 0);
        assert_string_equal(json_string_value(json_object_get(event, "event")), "point");
        assert_true(json_integer_value(json_object_get(event, "serial")) > last);
        last = json_integer_value(json_object_get(event, "serial"));
        json_decref(event);
    }
    rpc_close(c);
}

/* Each event is 16 KiB; the control thread gets the time to take each one off the desk. */
static void flood(struct fixture *f, int n) {
    static char json[16384];
    memset(json, 'x', sizeof json);
    memcpy(json, "{\"x\":\"", 6);
    memcpy(json + sizeof json - 3, "\"}", 3);
    for (int i = 0; i < n; i++) {
        desk_event_post(f->desk, "point", false, strdup(json));
        usleep(500);
    }
}

static void a_slow_reader_loses_events_and_is_told(void **state) {
    struct fixture *f = *state;
    struct rpc_client *slow = join(f), *quick = join(f);
    struct err e = {0};
    assert_int_equal(call(slow, "watch", NULL, NULL, &e), 0);
    flood(f, 200); /* 3 MiB against 256 KiB of patience and the socket's buffer */
    assert_int_equal(call(quick, "version", NULL, NULL, &e), 0);
    long long missed = 0;
    int seen = 0;
    while (missed == 0) {
        json_t *event;
        assert_int_equal(rpc_next_event(slow, PATIENCE_MS, &event, &e), 0);
        if (strcmp(json_string_value(json_object_get(event, "event")), "missed") == 0)
            missed = json_integer_value(json_object_get(event, "count"));
        else
            seen++;
        json_decref(event);
    }
    assert_int_equal(seen + missed, 200);
    rpc_close(slow);
    rpc_close(quick);
}

static void an_endless_line_ends_the_connection_with_a_sentence(void **state) {
    struct fixture *f = *state;
    struct rpc_client *c = join(f);
    const size_t size = RPC_LINE_MAX + 70000;
    char *much = malloc(size), line[300];
    memset(much, 'a', size);
    size_t sent = 0;
    ssize_t n = 1;
    struct pollfd fd = {.fd = rpc_descriptor(c), .events = POLLOUT};
    while (sent < size && n > 0 && poll(&fd, 1, PATIENCE_MS) == 1) {
        n = send(fd.fd, much + sent, size - sent, MSG_NOSIGNAL | MSG_DONTWAIT);
        sent += n > 0 ? (size_t)n : 0;
    }
    read_line(c, line, sizeof line);
    assert_non_null(strstr(line, "send one request a line"));
    free(much);
    rpc_close(c);
}

static void the_65th_client_is_refused_in_words(void **state) {
    struct fixture *f = *state;
    struct rpc_client *c[64];
    struct err e = {0};
    for (int i = 0; i < 64; i++)
        c[i] = join(f);
    assert_int_equal(call(c[63], "version", NULL, NULL, &e), 0);
    struct rpc_client *one_more = join(f);
    char line[300];
    read_line(one_more, line, sizeof line);
    assert_non_null(strstr(line, "64 clients are connected already"));
    rpc_close(one_more);
    for (int i = 0; i < 64; i++)
        rpc_close(c[i]);
}

static void two_daemons_on_one_socket(void **state) {
    struct fixture *f = *state;
    struct control *second;
    struct err e = {0};
    struct control_options o = options(f);
    assert_int_equal(control_start(&second, &o, &e), -ERR_BUSY);
    assert_non_null(strstr(e.text, "another goniod serves"));
    struct rpc_client *c = join(f);
    assert_int_equal(call(c, "version", NULL, NULL, &e), 0);
    rpc_close(c);
}

static void a_dead_daemons_socket_is_replaced(void **state) {
    struct fixture f = {0};
    struct sockaddr_un a = {.sun_family = AF_UNIX};
    struct err e = {0};
    (void)state;
    snprintf(f.path, sizeof f.path, "/tmp/test_control.%d.old", (int)getpid());
    snprintf(a.sun_path, sizeof a.sun_path, "%s", f.path);
    int fd = socket(AF_UNIX, SOCK_STREAM, 0);
    assert_int_equal(bind(fd, (struct sockaddr *)&a, sizeof a), 0);
    close(fd);
    start(&f);
    struct rpc_client *c = join(&f);
    assert_int_equal(call(c, "version", NULL, NULL, &e), 0);
    rpc_close(c);
    end(&f);
}

static void the_rule_of_access(void **state) {
    (void)state;
    /* Debian gives `daemon` gid 1 and `bin` gid 2. */
    struct config config = {.n_watch = 1, .n_operate = 1, .watch = {"daemon"}, .operate = {"bin"}};
    const gid_t none[] = {12345}, watch[] = {12345, 1}, operate[] = {12345, 2};
    struct control_rights r = control_access_rule(4321, none, 1, &config);
    assert_false(r.watch || r.operate);
    r = control_access_rule(4321, watch, 2, &config);
    assert_true(r.watch && !r.operate);
    r = control_access_rule(4321, operate, 2, &config);
    assert_true(r.watch && r.operate);
    r = control_access_rule(0, none, 1, &config);
    assert_true(r.watch && r.operate);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(status_is_the_snapshot_with_its_age, setup, teardown),
        cmocka_unit_test_setup_teardown(mistakes_in_a_request_are_answered_in_words, setup, teardown),
        cmocka_unit_test_setup_teardown(a_check_brings_the_plan_or_every_mistake, setup, teardown),
        cmocka_unit_test_setup_teardown(an_outcome_reaches_who_asked, setup, teardown),
        cmocka_unit_test_setup_teardown(the_outcome_for_a_client_that_left_is_dropped, setup, teardown),
        cmocka_unit_test_setup_teardown(a_watcher_sees_events_in_order, setup, teardown),
        cmocka_unit_test_setup_teardown(a_slow_reader_loses_events_and_is_told, setup, teardown),
        cmocka_unit_test_setup_teardown(an_endless_line_ends_the_connection_with_a_sentence, setup, teardown),
        cmocka_unit_test_setup_teardown(the_65th_client_is_refused_in_words, setup, teardown),
        cmocka_unit_test_setup_teardown(two_daemons_on_one_socket, setup, teardown),
        cmocka_unit_test(a_dead_daemons_socket_is_replaced),
        cmocka_unit_test(the_rule_of_access),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
