/* The links below the spectrometer, against a redirection host in a thread; libusb where no USB is. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "drivers/usb_link.h"
#include "proto/units.h"
#include "tests/support/kept.h"
#include "tests/support/redir_host.h"

#define VID 0x2457
#define PID 0x101e
#define PATIENCE_US (60 * US_PER_S) /* with the host, a thread that a busy machine may keep waiting */

struct rig {
    struct clock clock;
    struct bench bench;
    struct usb_link link;
    struct redir_host *host;
    struct err e;
    char socket[108];
};

static void host_start(struct rig *r, const char *where, enum redir_host_manner manner) {
    memset(r, 0, sizeof *r);
    snprintf(r->socket, sizeof r->socket, "unix:/tmp/goniod-test-usb-%d.sock", (int)getpid());
    r->host = redir_host_start(where ? where : r->socket, VID, PID, manner);
    assert_non_null(r->host);
    clock_init_real(&r->clock);
    bench_init(&r->bench, &r->clock);
}

static void connected(struct rig *r, const char *where) {
    host_start(r, where, REDIR_HOST_PROPER);
    int rc = usb_link_open(&r->link, redir_host_target(r->host), VID, PID, NULL, &r->clock, &r->e);
    if (rc)
        print_error("%s\n", r->e.text);
    assert_int_equal(rc, 0);
    assert_int_equal(usb_link_serve(&r->link, &r->bench, &r->e), 0);
}

static void finish(struct rig *r) {
    usb_link_close(&r->link, &r->bench);
    if (r->host)
        redir_host_stop(r->host);
}

static int order(struct rig *r, const char *bytes, size_t n) {
    struct usb_transfer t = {.endpoint = 0x01, .data = (uint8_t *)bytes, .length = n};
    int rc = usb_link_transfer(&r->link, &r->bench, &t, clock_stamp(&r->clock) + PATIENCE_US, NULL, &r->e);
    return rc ? rc : t.status;
}

static void queue(struct rig *r, struct usb_transfer *t, uint8_t endpoint, uint8_t *data, size_t length) {
    *t = (struct usb_transfer){.endpoint = endpoint, .data = data, .length = length};
    assert_int_equal(r->link.ops->submit(r->link.self, t, &r->e), 0);
    assert_true(t->pending);
}

static bool home(void *arg) {
    return !((struct usb_transfer *)arg)->pending;
}

static void await(struct rig *r, struct usb_transfer *t) {
    assert_int_equal(bench_wait(&r->bench, clock_stamp(&r->clock) + PATIENCE_US, home, t, NULL), BENCH_DONE);
}

static void reads_are_held_by_endpoint(void **state) {
    static const char *const WHERE[] = {NULL, "tcp:"};
    (void)state;
    for (int way = 0; way < 2; way++) {
        struct rig r;
        connected(&r, WHERE[way]);
        assert_int_equal(r.link.info.vid, VID);
        assert_int_equal(usb_link_max_packet(&r.link, 0x82), 512);
        assert_int_equal(usb_link_max_packet(&r.link, 0x01), 64);
        assert_true(usb_link_has(&r.link, 0x86));
        assert_false(usb_link_has(&r.link, 0x84));
        static uint8_t spectrum[4608];
        uint8_t reply[64];
        struct usb_transfer big, small;
        queue(&r, &big, 0x82, spectrum, sizeof spectrum);
        queue(&r, &small, 0x81, reply, sizeof reply);
        assert_int_equal(order(&r, "R", 1), 0);
        await(&r, &small);
        assert_int_equal(small.actual, 3);
        assert_memory_equal(reply, "ok!", 3);
        assert_true(big.pending);
        assert_int_equal(order(&r, "D\x01\x10", 3), 0); /* 4097 bytes */
        await(&r, &big);
        assert_int_equal(big.status, 0);
        assert_int_equal(big.actual, 4097);
        for (int i = 0; i < 4097; i++)
            assert_int_equal(spectrum[i], i % 251);
        assert_true(big.submitted_us <= small.completed_us && small.completed_us <= big.completed_us);
        finish(&r);
    }
}

static void stall_and_babble_are_told_apart(void **state) {
    (void)state;
    struct rig r;
    connected(&r, NULL);
    uint8_t data[512];
    struct usb_transfer t;
    queue(&r, &t, 0x82, data, sizeof data);
    assert_int_equal(order(&r, "S", 1), 0);
    await(&r, &t);
    assert_int_equal(t.status, -EPIPE);
    queue(&r, &t, 0x82, data, sizeof data);
    assert_int_equal(order(&r, "B", 1), 0);
    await(&r, &t);
    assert_int_equal(t.status, -EOVERFLOW);
    assert_int_equal(r.link.ops->clear_halt(r.link.self, 0x82, &r.e), 0);
    assert_int_equal(r.link.ops->reset(r.link.self, &r.e), 0);
    assert_int_equal(order(&r, "-", 1), 0); /* the stream is in order: both have been seen by now */
    assert_int_equal(redir_host_cleared(r.host), 1);
    assert_int_equal(redir_host_resets(r.host), 1);
    finish(&r);
}

static void a_deadline_takes_the_read_back(void **state) {
    (void)state;
    struct rig r;
    connected(&r, NULL);
    uint8_t data[512];
    struct usb_transfer t = {.endpoint = 0x82, .data = data, .length = sizeof data};
    int64_t begin, took_us;
    int tries = 0;
    do {
        begin = clock_stamp(&r.clock);
        err_clear(&r.e);
        assert_int_equal(usb_link_transfer(&r.link, &r.bench, &t, begin + 50000, NULL, &r.e), -ERR_TIMEOUT);
        took_us = clock_stamp(&r.clock) - begin;
        assert_true(took_us >= 50000);
        assert_false(t.pending);
        assert_int_equal(t.status, -ECANCELED);
    } while (!kept(&tries, "a deadline of 50 ms", took_us, 100000));
    struct cancel cancel = {true};
    err_clear(&r.e);
    assert_int_equal(usb_link_transfer(&r.link, &r.bench, &t, begin + US_PER_S, &cancel, &r.e),
                     -ERR_CANCELLED);
    assert_int_equal(order(&r, "D\x05\x00", 3), 0); /* the link still works, and the cancelled read is dead */
    err_clear(&r.e);
    assert_int_equal(
        usb_link_transfer(&r.link, &r.bench, &t, clock_stamp(&r.clock) + PATIENCE_US, NULL, &r.e), 0);
    assert_int_equal(t.actual, 5);
    finish(&r);
}

/* How long it took. */
static int64_t lose_device(const char *way) {
    struct rig r;
    connected(&r, NULL);
    uint8_t data[512], reply[64];
    struct usb_transfer a, b;
    queue(&r, &a, 0x82, data, sizeof data);
    queue(&r, &b, 0x81, reply, sizeof reply);
    int64_t begin = clock_stamp(&r.clock);
    order(&r, way, 1);
    await(&r, &a);
    await(&r, &b);
    int64_t took_us = clock_stamp(&r.clock) - begin;
    assert_int_equal(a.status, -ENODEV);
    assert_int_equal(b.status, -ENODEV);
    err_clear(&r.e);
    assert_int_equal(r.link.ops->submit(r.link.self, &a, &r.e), -ERR_LINK);
    assert_false(a.pending);
    finish(&r);
    return took_us;
}

static void a_lost_device_completes_everything_at_once(void **state) {
    (void)state;
    for (int way = 0, tries = 0; way < 2; way += kept(&tries, "a loss", lose_device(way ? "X" : "K"), 200000))
        ;
}

static int64_t recall_from_hung_host(void) {
    struct rig r;
    connected(&r, NULL);
    uint8_t data[512];
    struct usb_transfer t, *one = &t, out = {.endpoint = 0x01, .data = (uint8_t *)"H", .length = 1};
    queue(&r, &t, 0x82, data, sizeof data);
    /* not even this order is answered */
    usb_link_transfer(&r.link, &r.bench, &out, clock_stamp(&r.clock) + US_PER_S, NULL, &r.e);
    int64_t begin = clock_stamp(&r.clock);
    usb_link_recall(&r.link, &r.bench, &one, 1);
    int64_t took_us = clock_stamp(&r.clock) - begin;
    assert_false(t.pending);
    assert_int_equal(t.status, -ECANCELED);
    finish(&r);
    return took_us;
}

static void a_hung_host_cannot_keep_a_transfer(void **state) {
    (void)state;
    for (int tries = 0; !kept(&tries, "a recall", recall_from_hung_host(), USB_LINK_CANCEL_MS * US_PER_MS);)
        ;
}

static int try_open(struct rig *r, enum redir_host_manner manner, uint16_t pid) {
    host_start(r, NULL, manner);
    int rc = usb_link_open(&r->link, redir_host_target(r->host), VID, pid, NULL, &r->clock, &r->e);
    assert_true(rc == 0 || strlen(r->e.text) > 20);
    finish(r);
    return rc;
}

static void what_stands_in_the_way_is_named(void **state) {
    (void)state;
    struct rig r;
    assert_int_equal(try_open(&r, REDIR_HOST_PROPER, 0x1022), -ERR_DEVICE);
    assert_non_null(strstr(r.e.text, "2457:101e, expected 2457:1022"));
    assert_int_equal(try_open(&r, REDIR_HOST_HANGS_UP, PID), -ERR_BUSY);
    assert_int_equal(try_open(&r, REDIR_HOST_NO_DEVICE, PID), -ERR_DEVICE);
    assert_int_equal(try_open(&r, REDIR_HOST_SILENT, PID), -ERR_LINK);
    static const struct {
        const char *target;
        int code;
    } BAD[] = {
        {"usbredir:unix:/nonexistent/x.sock", -ERR_LINK},
        {"usbredir:tcp:127.0.0.1:1", -ERR_LINK},
        {"usbredir:tcp:127.0.0.1", -ERR_INPUT},
        {"usbredir:pigeon:1", -ERR_INPUT},
        {"serial", -ERR_INPUT},
    };
    for (size_t i = 0; i < sizeof BAD / sizeof BAD[0]; i++) {
        err_clear(&r.e);
        assert_int_equal(usb_link_open(&r.link, BAD[i].target, VID, PID, NULL, &r.clock, &r.e), BAD[i].code);
        assert_null(r.link.ops);
    }
}

static void an_absent_device_is_said_to_be_absent(void **state) {
    (void)state;
    struct clock clock;
    struct usb_link link;
    struct err e = {0};
    clock_init_real(&clock);
    /* A product number that no spectrometer has, so that the test holds on a machine with instruments. */
    assert_int_equal(usb_link_open(&link, "usb", 0x2457, 0xfffe, NULL, &clock, &e), -ERR_DEVICE);
    assert_non_null(strstr(e.text, "2457:fffe"));
    struct usb_found found[8];
    assert_in_range(usb_link_list(found, 8, &e), 0, 8);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(reads_are_held_by_endpoint),
        cmocka_unit_test(stall_and_babble_are_told_apart),
        cmocka_unit_test(a_deadline_takes_the_read_back),
        cmocka_unit_test(a_lost_device_completes_everything_at_once),
        cmocka_unit_test(a_hung_host_cannot_keep_a_transfer),
        cmocka_unit_test(what_stands_in_the_way_is_named),
        cmocka_unit_test(an_absent_device_is_said_to_be_absent),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
