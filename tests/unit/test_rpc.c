#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "proto/rpc.h"

static int parse(const char *line, struct rpc_request *rq) {
    struct err e = {0};
    return rpc_parse(line, strlen(line), rq, &e);
}

static void a_request_is_read(void **state) {
    (void)state;
    struct rpc_request rq;
    assert_int_equal(parse("{\"jsonrpc\":\"2.0\",\"id\":7,\"method\":\"status\",\"params\":{\"a\":1}}", &rq),
                     0);
    assert_string_equal(rq.method, "status");
    assert_int_equal(json_integer_value(rq.id), 7);
    assert_int_equal(json_integer_value(json_object_get(rq.params, "a")), 1);
    rpc_request_free(&rq);
}

static void each_mistake_has_its_code(void **state) {
    (void)state;
    const struct {
        const char *line;
        int code;
    } cases[] = {
        {"", RPC_PARSE},
        {"{", RPC_PARSE},
        {"{\"id\":1,\"id\":2}", RPC_PARSE},
        {"[]", RPC_REQUEST},
        {"{\"id\":{},\"jsonrpc\":\"2.0\",\"method\":\"status\"}", RPC_REQUEST},
        {"{\"id\":1,\"method\":\"status\"}", RPC_REQUEST},
        {"{\"id\":1,\"jsonrpc\":\"2.0\"}", RPC_REQUEST},
        {"{\"id\":1,\"jsonrpc\":\"2.0\",\"method\":\"status\",\"params\":[1]}", RPC_PARAMS},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct rpc_request rq;
        assert_int_equal(parse(cases[i].line, &rq), cases[i].code);
        rpc_request_free(&rq);
    }
}

static void an_error_names_every_mistake(void **state) {
    (void)state;
    struct err_list list = {0};
    struct err one = {0}, e = {0};
    err_at(&one, ERR_INPUT, "job.yaml", 4, 9, "unknown key");
    err_list_add(&list, &one);
    err_set(&e, ERR_INPUT, "the job has 1 mistake");
    char *text = rpc_error_text(NULL, rpc_code_of(&e), &e, &list);
    json_t *m = json_loads(text, 0, NULL);
    json_t *error = json_object_get(m, "error");
    assert_int_equal(json_integer_value(json_object_get(error, "code")), RPC_OWN - ERR_INPUT);
    json_t *data = json_object_get(error, "data");
    assert_string_equal(json_string_value(json_object_get(data, "code")), "input");
    json_t *first = json_array_get(json_object_get(data, "errors"), 0);
    assert_int_equal(json_integer_value(json_object_get(first, "column")), 9);
    assert_true(json_is_null(json_object_get(m, "id")));
    json_decref(m);
    free(text);
    err_list_free(&list);
}

struct peer {
    int listener;
    const char *answer;
};

/* Takes one connection, answers the first request with the text given, closes. */
static void *serve(void *arg) {
    struct peer *p = arg;
    int fd = accept(p->listener, NULL, NULL);
    char request[512];
    ssize_t n = recv(fd, request, sizeof request, 0);
    if (n > 0 && p->answer)
        (void)!write(fd, p->answer, strlen(p->answer));
    if (!p->answer)
        (void)!recv(fd, request, sizeof request, 0);
    close(fd);
    return NULL;
}

static int ask(const char *answer, json_t **result, json_t **event, struct err_list *errors, struct err *e) {
    struct peer p = {.answer = answer};
    struct sockaddr_un a = {.sun_family = AF_UNIX};
    snprintf(a.sun_path, sizeof a.sun_path, "/tmp/test_rpc.%d.sock", (int)getpid());
    unlink(a.sun_path);
    p.listener = socket(AF_UNIX, SOCK_STREAM, 0);
    assert_int_equal(bind(p.listener, (struct sockaddr *)&a, sizeof a), 0);
    assert_int_equal(listen(p.listener, 1), 0);
    pthread_t thread;
    pthread_create(&thread, NULL, serve, &p);
    struct rpc_client *c;
    assert_int_equal(rpc_connect(&c, a.sun_path, e), 0);
    const int patience_ms = answer ? 20000 : 200; /* a busy machine keeps the thread that answers waiting */
    int rc = rpc_call(c, "status", NULL, patience_ms, result, errors, e);
    if (event && rc == 0)
        assert_int_equal(rpc_next_event(c, patience_ms, event, e), 0);
    rpc_close(c);
    pthread_join(thread, NULL);
    close(p.listener);
    unlink(a.sun_path);
    return rc;
}

static void events_that_arrive_early_are_kept(void **state) {
    (void)state;
    json_t *result = NULL, *event = NULL;
    struct err e = {0};
    int rc = ask("{\"jsonrpc\":\"2.0\",\"method\":\"event\",\"params\":{\"n\":5}}\n"
                 "{\"jsonrpc\":\"2.0\",\"id\":1,\"result\":{\"state\":\"idle\"}}\n",
                 &result, &event, NULL, &e);
    assert_int_equal(rc, 0);
    assert_string_equal(json_string_value(json_object_get(result, "state")), "idle");
    assert_int_equal(json_integer_value(json_object_get(event, "n")), 5);
    json_decref(result);
    json_decref(event);
}

static void a_refusal_comes_back_as_its_own_error(void **state) {
    (void)state;
    struct err e = {0};
    struct err_list errors = {0};
    int rc =
        ask("{\"jsonrpc\":\"2.0\",\"id\":1,\"error\":{\"code\":-32002,\"message\":\"two mistakes\",\"data\":"
            "{\"errors\":[{\"file\":\"j\",\"line\":1,\"column\":2,\"text\":\"x\"},{\"text\":\"y\"}]}}}\n",
            NULL, NULL, &errors, &e);
    assert_int_equal(rc, -ERR_INPUT);
    assert_string_equal(e.text, "two mistakes");
    assert_int_equal(errors.n, 2);
    assert_int_equal(errors.item[0].column, 2);
    err_list_free(&errors);
}

static void silence_and_loss_are_told_apart(void **state) {
    (void)state;
    struct err e = {0};
    assert_int_equal(ask(NULL, NULL, NULL, NULL, &e), -ERR_TIMEOUT);
    err_clear(&e);
    assert_int_equal(ask("", NULL, NULL, NULL, &e), -ERR_LINK);
    err_clear(&e);
    assert_int_equal(ask("nonsense\n", NULL, NULL, NULL, &e), -ERR_LINK);
    err_clear(&e);
    struct rpc_client *c;
    assert_int_equal(rpc_connect(&c, "/tmp/no-such.sock", &e), -ERR_LINK);
    assert_non_null(strstr(e.text, "start goniod"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_request_is_read),
        cmocka_unit_test(each_mistake_has_its_code),
        cmocka_unit_test(an_error_names_every_mistake),
        cmocka_unit_test(events_that_arrive_early_are_kept),
        cmocka_unit_test(a_refusal_comes_back_as_its_own_error),
        cmocka_unit_test(silence_and_loss_are_told_apart),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
