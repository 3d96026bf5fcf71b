/* The desk between control and campaign: bounds, order, coalescing, and two threads at once. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <poll.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/desk.h"

static struct desk *make(void) {
    struct desk *d;
    struct err e = {0};
    assert_int_equal(desk_new(&d, &e), 0);
    return d;
}

static bool readable(int fd) {
    struct pollfd p = {.fd = fd, .events = POLLIN};
    return poll(&p, 1, 0) == 1;
}

static void an_order_crosses_with_its_texts(void **state) {
    (void)state;
    struct desk *d = make();
    struct desk_order order = {.command = COMMAND_RUN}, got;
    order.run.text = strdup("name: x\n");
    order.run.n_files = 1;
    order.run.file[0].text = strdup("lambda_nm,beta,u\n");
    int64_t ticket = 0;
    assert_int_equal(desk_post(d, &order, &ticket, NULL), 0);
    assert_true(readable(desk_campaign_fd(d)));
    desk_campaign_clear(d);
    assert_false(readable(desk_campaign_fd(d)));
    assert_true(desk_take_order(d, &got));
    assert_int_equal(got.ticket, ticket);
    assert_string_equal(got.run.text, "name: x\n");
    assert_false(desk_take_order(d, &got));
    desk_order_free(&got);
    desk_finish(d, ticket, -ERR_STATE, "not now", strdup("{}"));
    struct desk_outcome o;
    assert_true(readable(desk_control_fd(d)));
    assert_true(desk_take_outcome(d, &o));
    assert_int_equal(o.ticket, ticket);
    assert_int_equal(o.code, ERR_STATE);
    assert_string_equal(o.text, "not now");
    free(o.json);
    assert_false(desk_take_outcome(d, &o));
    desk_free(d);
}

static void a_full_desk_refuses_until_an_outcome_is_taken(void **state) {
    (void)state;
    struct desk *d = make();
    struct desk_order order = {.command = COMMAND_PAUSE}, got;
    struct desk_outcome o;
    struct err e = {0};
    int64_t first;
    assert_int_equal(desk_post(d, &order, &first, &e), 0);
    for (int i = 1; i < DESK_ORDERS; i++)
        assert_int_equal(desk_post(d, &order, NULL, &e), 0);
    assert_int_equal(desk_post(d, &order, NULL, &e), -ERR_BUSY);
    assert_true(desk_take_order(d, &got));
    desk_finish(d, got.ticket, 0, "", NULL);
    err_clear(&e);
    assert_int_equal(desk_post(d, &order, NULL, &e), -ERR_BUSY); /* the outcome's place is still promised */
    assert_true(desk_take_outcome(d, &o));
    err_clear(&e);
    assert_int_equal(desk_post(d, &order, NULL, &e), 0);
    desk_free(d);
}

static void a_snapshot_outlives_its_successor(void **state) {
    (void)state;
    struct desk *d = make();
    const struct desk_snapshot *first = desk_snapshot_get(d);
    assert_string_equal(first->json, "{}");
    desk_publish(d, strdup("{\"state\":\"idle\"}"));
    const struct desk_snapshot *second = desk_snapshot_get(d);
    assert_string_equal(first->json, "{}");
    assert_string_equal(second->json, "{\"state\":\"idle\"}");
    assert_int_equal(second->size, strlen(second->json));
    desk_snapshot_put(first);
    desk_free(d);
    assert_string_equal(second->json, "{\"state\":\"idle\"}");
    desk_snapshot_put(second);
}

static void events_coalesce_and_say_what_was_missed(void **state) {
    (void)state;
    struct desk *d = make();
    struct desk_event got[DESK_EVENTS + 1];
    char text[32];
    desk_event_post(d, "state", false, strdup("{\"a\":1}"));
    for (int i = 0; i < 1000; i++) {
        snprintf(text, sizeof text, "{\"step\":%d}", i);
        desk_event_post(d, "step", true, strdup(text));
    }
    assert_int_equal(desk_events_after(d, 0, got, DESK_EVENTS), 2);
    assert_int_equal(got[0].serial, 1);
    assert_int_equal(got[1].serial, 1001);
    assert_string_equal(got[1].json, "{\"step\":999}");
    desk_event_free(&got[0]);
    desk_event_free(&got[1]);
    for (int i = 0; i < 2 * DESK_EVENTS; i++)
        desk_event_post(d, "warning", false, strdup("{}"));
    int n = desk_events_after(d, 1001, got, DESK_EVENTS + 1);
    assert_int_equal(n, DESK_EVENTS);
    assert_int_equal(got[n - 1].serial, desk_last_event(d));
    assert_true(got[0].serial > 1002); /* the reader sees the gap */
    for (int i = 0; i < n; i++)
        desk_event_free(&got[i]);
    desk_free(d);
}

static void *campaign_side(void *arg) {
    struct desk *d = arg;
    struct pollfd p = {.fd = desk_campaign_fd(d), .events = POLLIN};
    for (int done = 0; done < 2000;) {
        poll(&p, 1, -1);
        desk_campaign_clear(d);
        struct desk_order order;
        while (desk_take_order(d, &order)) {
            desk_publish(d, strdup("{\"now_us\":1}"));
            desk_event_post(d, "step", true, strdup("{}"));
            desk_finish(d, order.ticket, 0, "", NULL);
            done++;
        }
    }
    return NULL;
}

static void every_ticket_gets_one_outcome_across_threads(void **state) {
    (void)state;
    struct desk *d = make();
    pthread_t thread;
    assert_int_equal(pthread_create(&thread, NULL, campaign_side, d), 0);
    struct desk_order order = {.command = COMMAND_CONTINUE};
    struct pollfd p = {.fd = desk_control_fd(d), .events = POLLIN};
    int posted = 0, taken = 0;
    int64_t last = 0;
    while (taken < 2000) {
        while (posted < 2000 && desk_post(d, &order, NULL, NULL) == 0)
            posted++;
        poll(&p, 1, -1);
        desk_control_clear(d);
        struct desk_outcome o;
        while (desk_take_outcome(d, &o)) {
            assert_int_equal(o.ticket, ++last);
            taken++;
        }
        desk_snapshot_put(desk_snapshot_get(d));
    }
    pthread_join(thread, NULL);
    desk_free(d);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_order_crosses_with_its_texts),
        cmocka_unit_test(a_full_desk_refuses_until_an_outcome_is_taken),
        cmocka_unit_test(a_snapshot_outlives_its_successor),
        cmocka_unit_test(events_coalesce_and_say_what_was_missed),
        cmocka_unit_test(every_ticket_gets_one_outcome_across_threads),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
