#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <fcntl.h>
#include <string.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <unistd.h>

#include "drivers/modbus_link.h"
#include "tests/support/kept.h"
#include "tests/support/modbus_peer.h"

#define RESPONSE_MS 300  /* where a lost reply is the matter */
#define PATIENT_MS 20000 /* where none is: the peer is a thread that a busy machine may keep waiting */
#define FAIR_MS 2000     /* where both are */
#define GAP_MS 3
/* A stale reply is told by the right one behind it: the peer, a thread, must get from one to the other in that time. */
#define WIDE_GAP_MS 50
#define QUARANTINE_MS 450

static struct modbus_peer peer;
static struct modbus_link bus;
static struct clock clock_;
static struct err err;
static int response_ms, gap_ms;

static int set_up(void **state) {
    (void)state;
    response_ms = PATIENT_MS;
    gap_ms = GAP_MS;
    return 0;
}

static int try_open(const char *target, char parity) {
    struct modbus_link_config c = {.target = target,
                                   .baud = 115200,
                                   .parity = parity,
                                   .data_bits = 8,
                                   .stop_bits = 1,
                                   .response_ms = response_ms,
                                   .gap_ms = gap_ms,
                                   .quarantine_ms = QUARANTINE_MS};
    clock_init_real(&clock_);
    err_clear(&err);
    return modbus_link_open(&bus, &c, &clock_, &err);
}

static void start(bool tcp, const struct peer_act *act, int n_act) {
    modbus_peer_start(&peer, tcp, act, n_act);
    if (try_open(peer.target, 'N'))
        fail_msg("%s", err.text);
}

static void stop(void) {
    modbus_link_close(&bus);
    modbus_peer_stop(&peer);
}

static int read_regs(struct modbus_request *rq, int addr, int count) {
    *rq = (struct modbus_request){.unit = 1, .function = 3, .addr = addr, .count = count};
    err_clear(&err);
    return modbus_link_transact(&bus, rq, &err);
}

static int64_t wait_until_ready(void) {
    struct modbus_link_state state;
    modbus_link_state(&bus, &state);
    while (clock_stamp(&clock_) < state.ready_us)
        clock_gap(&clock_, 5000);
    return state.ready_us;
}

static void registers_are_read_and_written(void **state) {
    (void)state;
    static const struct peer_act OK[] = {{0, 0}};
    for (int tcp = 0; tcp < 2; tcp++) {
        start(tcp, OK, 1);
        struct modbus_request rq;
        assert_int_equal(read_regs(&rq, 100, 5), 0);
        for (int i = 0; i < 5; i++)
            assert_int_equal(rq.regs[i], 100 + i);
        struct modbus_request w = {.unit = 1, .function = 16, .addr = 200, .count = 2, .regs = {7, 8}};
        assert_int_equal(modbus_link_transact(&bus, &w, &err), 0);
        w = (struct modbus_request){.unit = 1, .function = 6, .addr = 202, .count = 1, .regs = {9}};
        assert_int_equal(modbus_link_transact(&bus, &w, &err), 0);
        assert_int_equal(read_regs(&rq, 199, 5), 0);
        static const uint16_t WANT[] = {199, 7, 8, 9, 203};
        assert_memory_equal(rq.regs, WANT, sizeof WANT);
        struct modbus_link_state s;
        modbus_link_state(&bus, &s);
        assert_true(s.connected && s.failures == 0 && s.last_reply_us > 0);
        stop();
    }
}

/* One reply is late and healthy traffic goes on around it: a wrong register must never be handed out. */
static void a_late_reply_never_becomes_a_value(void **state) {
    (void)state;
    static const int LATE_MS[] = {RESPONSE_MS + 90, RESPONSE_MS + QUARANTINE_MS + 240,
                                  1350}; /* within the quarantine, and twice beyond it */
    response_ms = RESPONSE_MS;
    gap_ms = WIDE_GAP_MS;
    for (int k = 0; k < 6; k++) {
        struct peer_act act[400] = {{0, 0}};
        act[0].delay_ms = LATE_MS[k % 3];
        act[17].delay_ms = k < 3 ? LATE_MS[k % 3] : 0;
        start(k >= 3, act, 400);
        int good = 0;
        int64_t begun = clock_stamp(&clock_);
        while (clock_stamp(&clock_) < begun + 2400000 || good <= 5) {
            assert_true(clock_stamp(&clock_) < begun + 60000000);
            struct modbus_request rq;
            int addr = 100 + good % 50, result = read_regs(&rq, addr, 1);
            if (result == 0) {
                assert_int_equal(rq.regs[0], addr);
                good++;
            } else if (result == -ERR_BUSY || result == -ERR_LINK) {
                wait_until_ready();
            }
        }
        stop();
    }
}

static void a_doubled_reply_is_thrown_away(void **state) {
    (void)state;
    static const struct peer_act ACT[] = {{0, 0}, {0, PEER_TWICE}, {0, 0}, {0, 0}};
    start(false, ACT, 4);
    struct modbus_request rq;
    assert_int_equal(read_regs(&rq, 10, 1), 0);
    assert_int_equal(read_regs(&rq, 11, 1), -ERR_IO); /* which of the two is mine is not known */
    assert_int_equal(read_regs(&rq, 12, 1), -ERR_BUSY);
    wait_until_ready();
    assert_int_equal(read_regs(&rq, 13, 1), 0);
    assert_int_equal(rq.regs[0], 13);
    stop();
}

struct failure {
    int flags, rtu, tcp;
};

/* False: a busy machine kept the peer from answering in time, which is another failure. */
static bool failure_is_told(const struct failure *f, bool tcp) {
    struct peer_act act[] = {{0, f->flags}, {0, 0}, {0, 0}};
    response_ms = RESPONSE_MS;
    start(tcp, act, 3);
    struct modbus_request rq;
    int want = tcp ? f->tcp : f->rtu, result = read_regs(&rq, 10, 1);
    bool late = result == -ERR_TIMEOUT && want != -ERR_TIMEOUT;
    assert_true(late || result == want);
    if (want == -ERR_DEVICE && !late)
        assert_int_equal(rq.exception, 4);
    struct modbus_link_state s;
    modbus_link_state(&bus, &s);
    if (want == -ERR_IO || want == -ERR_TIMEOUT) {
        result = read_regs(&rq, 10, 1);
        assert_true(result == (tcp ? -ERR_LINK : -ERR_BUSY) || clock_stamp(&clock_) > s.ready_us);
    }
    wait_until_ready();
    result = read_regs(&rq, 11, 1);
    late |= result == -ERR_TIMEOUT;
    assert_true(late || (result == 0 && rq.regs[0] == 11));
    stop();
    return !late;
}

static void each_failure_has_its_code(void **state) {
    (void)state;
    static const struct failure CASES[] = {
        {PEER_DROP, -ERR_TIMEOUT, -ERR_TIMEOUT},
        {PEER_BAD_CRC, -ERR_IO, 0}, /* on TCP the last byte is data, nothing guards it */
        {PEER_REFUSE, -ERR_DEVICE, -ERR_DEVICE},
        {PEER_OTHER_UNIT, -ERR_IO, 0}, /* on TCP the transaction number decides */
        {PEER_HANG_UP, -ERR_TIMEOUT, -ERR_LINK},
    };
    for (int tcp = 0; tcp < 2; tcp++)
        for (size_t i = 0; i < sizeof CASES / sizeof *CASES; i++)
            for (int tries = 0; !failure_is_told(&CASES[i], tcp);)
                assert_true(++tries < KEPT_TRIES);
}

static void a_timeout_is_bounded(void **state) {
    (void)state;
    static const struct peer_act ACT[] = {{0, PEER_DROP}};
    response_ms = RESPONSE_MS;
    for (int tcp = 0; tcp < 2; tcp++) {
        int64_t took_us;
        int tries = 0;
        do {
            start(tcp, ACT, 1);
            struct modbus_request rq;
            int64_t before = clock_stamp(&clock_);
            assert_int_equal(read_regs(&rq, 10, 1), -ERR_TIMEOUT);
            took_us = clock_stamp(&clock_) - before;
            assert_true(took_us >= RESPONSE_MS * 1000);
            stop();
        } while (!kept(&tries, tcp ? "a timeout over TCP" : "a timeout over RTU", took_us,
                       RESPONSE_MS * 1000 + 50000));
    }
}

static void a_stop_goes_through_quarantine(void **state) {
    (void)state;
    static const struct peer_act ACT[] = {{0, PEER_DROP}, {0, 0}};
    response_ms = FAIR_MS;
    for (int tcp = 0; tcp < 2; tcp++) {
        start(tcp, ACT, 2);
        struct modbus_request rq;
        assert_int_equal(read_regs(&rq, 10, 1), -ERR_TIMEOUT);
        struct modbus_request w = {
            .unit = 1, .function = 16, .addr = 124, .count = 2, .regs = {0, 32}, .urgent = true};
        assert_int_equal(modbus_link_transact(&bus, &w, &err), 0);
        assert_int_equal(peer.reg[125], 32);
        stop();
    }
}

static void a_server_that_went_is_found_again(void **state) {
    (void)state;
    static const struct peer_act OK[] = {{0, 0}};
    start(true, OK, 1);
    struct modbus_request rq;
    assert_int_equal(read_regs(&rq, 10, 1), 0);
    int listener = peer.listen_fd;
    peer.listen_fd = dup(listener); /* keeps the port while the peer is away */
    shutdown(peer.fd, SHUT_RDWR);
    clock_gap(&clock_, 20000);
    int64_t before = clock_stamp(&clock_);
    assert_true(read_regs(&rq, 10, 1) < 0);
    struct modbus_link_state s;
    modbus_link_state(&bus, &s);
    assert_false(s.connected);
    assert_true(s.ready_us - before > 400000); /* the first step of the back-off */
    int result = read_regs(&rq, 10, 1);
    assert_true(result == -ERR_LINK || clock_stamp(&clock_) > s.ready_us);
    wait_until_ready();
    assert_int_equal(read_regs(&rq, 10, 1), 0);
    close(listener);
    stop();
}

static void a_vanished_adapter_is_a_lost_link(void **state) {
    (void)state;
    static const struct peer_act OK[] = {{0, 0}};
    start(false, OK, 1);
    modbus_peer_stop(&peer);
    struct modbus_request rq;
    assert_int_equal(read_regs(&rq, 10, 1), -ERR_LINK);
    assert_int_equal(read_regs(&rq, 10, 1), -ERR_LINK);
    modbus_link_close(&bus);
}

static void bytes_of_an_earlier_session_are_dropped(void **state) {
    (void)state;
    static const struct peer_act OK[] = {{0, 0}};
    modbus_peer_start(&peer, false, OK, 1);
    int slave = open(peer.target + 4, O_RDWR | O_NOCTTY);
    assert_int_equal(write(peer.fd, "\x01\x03\x02\x00\x07\xf9\x86", 7), 7); /* a whole reply holding 7 */
    assert_int_equal(try_open(peer.target, 'N'), 0);
    struct modbus_request rq;
    assert_int_equal(read_regs(&rq, 10, 1), 0);
    assert_int_equal(rq.regs[0], 10);
    close(slave);
    stop();
}

static void one_program_at_a_time(void **state) {
    (void)state;
    static const struct peer_act OK[] = {{0, 0}};
    modbus_peer_start(&peer, false, OK, 1);
    int other = open(peer.target + 4, O_RDWR | O_NOCTTY);
    assert_int_equal(flock(other, LOCK_EX | LOCK_NB), 0);
    assert_int_equal(try_open(peer.target, 'N'), -ERR_BUSY);
    assert_non_null(strstr(err.text, "in use"));
    close(other);
    assert_int_equal(try_open(peer.target, 'N'), 0);
    other = open(peer.target + 4, O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (geteuid() != 0)
        assert_int_equal(other, -1);
    else
        assert_int_equal(flock(other, LOCK_EX | LOCK_NB), -1);
    if (other >= 0)
        close(other);
    stop();
}

/* A drive behind TCP obeys everyone who connects: the second goniod of a machine has to refuse by itself. */
static void one_goniod_at_a_time_over_tcp(void **state) {
    (void)state;
    static const struct peer_act OK[] = {{0, 0}};
    start(true, OK, 1);
    struct modbus_link first = bus;
    assert_int_equal(try_open(peer.target, 'N'), -ERR_BUSY);
    assert_non_null(strstr(err.text, "in use by another goniod"));
    bus = first;
    modbus_link_close(&bus);
    assert_int_equal(try_open(peer.target, 'N'), 0);
    stop();
}

static void bad_targets_are_refused_in_words(void **state) {
    (void)state;
    assert_int_equal(try_open("usb:1", 'N'), -ERR_INPUT);
    assert_int_equal(try_open("tcp:127.0.0.1", 'N'), -ERR_INPUT);
    assert_int_equal(try_open("rtu:/dev/null", 'X'), -ERR_INPUT);
    assert_int_equal(try_open("rtu:/nonexistent/tty", 'N'), -ERR_LINK);
    assert_non_null(strstr(err.text, "plugged in"));
    assert_int_equal(try_open("tcp:127.0.0.1:1", 'N'), -ERR_LINK);
    struct modbus_link_config c = {.target = "rtu:/dev/null", .baud = 115201, .parity = 'N'};
    err_clear(&err);
    assert_int_equal(modbus_link_open(&bus, &c, &clock_, &err), -ERR_INPUT);
    assert_non_null(strstr(err.text, "115201"));
}

struct seen {
    int n, last_result;
    uint16_t last_value;
};

static void note(void *arg, int64_t sent_us, int64_t done_us, const struct modbus_request *sent,
                 const struct modbus_request *reply, int result) {
    struct seen *s = arg;
    assert_true(done_us >= sent_us);
    assert_int_equal(sent->addr, reply->addr);
    s->n++;
    s->last_result = result;
    s->last_value = reply->regs[0];
}

static void the_recorder_sees_every_exchange(void **state) {
    (void)state;
    static const struct peer_act ACT[] = {{0, 0}, {0, PEER_DROP}};
    response_ms = FAIR_MS;
    start(false, ACT, 2);
    struct seen seen = {0};
    struct modbus_link inner = bus;
    assert_int_equal(modbus_link_record(&bus, &inner, &clock_, note, &seen, &err), 0);
    assert_string_equal(bus.name, inner.name);
    struct modbus_request rq;
    assert_int_equal(read_regs(&rq, 42, 1), 0);
    assert_int_equal(seen.last_value, 42);
    assert_int_equal(read_regs(&rq, 43, 1), -ERR_TIMEOUT);
    assert_int_equal(seen.n, 2);
    assert_int_equal(seen.last_result, -ERR_TIMEOUT);
    stop();
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(registers_are_read_and_written, set_up),
        cmocka_unit_test_setup(a_late_reply_never_becomes_a_value, set_up),
        cmocka_unit_test_setup(a_doubled_reply_is_thrown_away, set_up),
        cmocka_unit_test_setup(each_failure_has_its_code, set_up),
        cmocka_unit_test_setup(a_timeout_is_bounded, set_up),
        cmocka_unit_test_setup(a_stop_goes_through_quarantine, set_up),
        cmocka_unit_test_setup(a_server_that_went_is_found_again, set_up),
        cmocka_unit_test_setup(a_vanished_adapter_is_a_lost_link, set_up),
        cmocka_unit_test_setup(bytes_of_an_earlier_session_are_dropped, set_up),
        cmocka_unit_test_setup(one_program_at_a_time, set_up),
        cmocka_unit_test_setup(one_goniod_at_a_time_over_tcp, set_up),
        cmocka_unit_test_setup(bad_targets_are_refused_in_words, set_up),
        cmocka_unit_test_setup(the_recorder_sees_every_exchange, set_up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
