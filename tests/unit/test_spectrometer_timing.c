/* The free-run models of spectrometer-ocean.md 4, played at random against the bounds that the driver states:
 * no bound may lie after the true start of an integration. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <string.h>

#include "drivers/spectrometer_timing.h"
#include "tests/support/seed.h"

#define FRAMES 20000

static uint64_t state;

static int64_t below(int64_t n) { /* xorshift: the sequence of a seed is the same everywhere */
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return (int64_t)(state % (uint64_t)n);
}

struct integration {
    int64_t start_us, end_us;
};

/* A unit that integrates as the sheets say. Times only move forward. */
struct unit {
    const struct spectrometer_model *model;
    bool keeps_one; /* a USB2000+ as seen in the field: a dropped frame stays in a buffer and is sent first */
    int64_t now_us;
    int exposure_us;
    bool pending, full, live, idle;
    int left; /* frames a USB2000+ still takes of its own accord */
    struct integration running, held;
};

static void begin(struct unit *u, bool live) {
    u->running = (struct integration){u->now_us, u->now_us + u->exposure_us};
    u->live = live;
    u->idle = false;
}

/* The end of an integration of a USB4000: kept if the FIFO is empty, else an idle cycle follows. */
static void end_of_cycle(struct unit *u) {
    if (!u->live) {
        begin(u, !u->full && u->pending);
    } else if (u->full) {
        begin(u, false);
    } else {
        u->held = u->running;
        u->full = true;
        begin(u, true);
    }
}

/* Of a USB2000+: sent if asked for, dropped otherwise (or kept), idle after the third. */
static void end_of_three(struct unit *u) {
    if (u->pending || (u->keeps_one && !u->full)) {
        u->held = u->running;
        u->full = true;
        u->left = u->pending ? 2 : u->left - 1;
    } else {
        u->left--;
    }
    if (u->pending || u->left == 0)
        u->idle = true; /* nothing new before it is read, or nothing more to do */
    else
        begin(u, true);
}

static void run_until(struct unit *u, int64_t to_us) {
    while (!u->idle && u->running.end_us <= to_us) {
        u->now_us = u->running.end_us;
        if (u->model->head_bytes)
            end_of_cycle(u);
        else
            end_of_three(u);
    }
    u->now_us = to_us;
}

static void ask(struct unit *u) {
    u->pending = true;
    if (u->idle && !u->full) {
        u->left = 2;
        begin(u, true);
    }
}

/* Lets the unit run until it has sent the frame; returns what was integrated when. */
static struct integration deliver(struct unit *u) {
    while (!u->full)
        run_until(u, u->running.end_us);
    run_until(u, u->now_us + u->model->readout_us + below(3000));
    struct integration sent = u->held;
    u->pending = u->full = false;
    if (!u->model->head_bytes && u->idle && u->left > 0)
        begin(u, true); /* the first has been read: two more of its own accord */
    return sent;
}

static void unit_init(struct unit *u, const char *model, bool keeps_one, int exposure_us) {
    *u = (struct unit){
        .model = spectrometer_model_find(model), .keeps_one = keeps_one, .exposure_us = exposure_us};
    u->idle = !u->model->head_bytes;
    if (!u->idle)
        begin(u, false);
}

static int64_t a_while(const struct unit *u) {
    switch (below(4)) {
    case 0:
        return below(2000);
    case 1:
        return below(u->exposure_us);
    case 2:
        return below(3 * u->exposure_us);
    default:
        return below(10 * u->exposure_us);
    }
}

static void play(const char *model, bool keeps_one) {
    struct unit u;
    struct spectrometer_timing t;
    int exposure_us = 100000, worst = 0, thrown = 0;
    int64_t since = 0;
    unit_init(&u, model, keeps_one, exposure_us);
    spectrometer_timing_init(&t, exposure_us, exposure_us, 0);
    for (int i = 0; i < FRAMES; i++) {
        if (below(8) == 0) {
            u.exposure_us = exposure_us = 4000 + (int)below(400000);
            spectrometer_timing_change(&t, exposure_us, u.now_us);
            since = u.now_us;
        }
        if (below(4) == 0) {
            run_until(&u, u.now_us + a_while(&u)); /* a move, or a busy host */
            since = u.now_us;
        } else if (below(3) == 0) {
            run_until(&u, u.now_us + a_while(&u));
        }
        int64_t sent = u.now_us;
        ask(&u);
        struct integration seen = deliver(&u);
        int64_t start = spectrometer_timing_start(&t, u.model);
        assert_true(start <= seen.start_us);
        if (spectrometer_timing_fresh(&t, u.model, since)) {
            assert_true(seen.start_us >= since);
            assert_int_equal(seen.end_us - seen.start_us, exposure_us);
            thrown = 0;
        } else if (++thrown > worst && since <= sent) {
            worst = thrown;
        }
        run_until(&u, u.now_us + below(1500)); /* the host's lateness */
        spectrometer_timing_add(&t, u.model, sent, u.now_us);
    }
    assert_true(worst >= u.model->discards); /* the play did try it */
}

static void no_bound_lies_after_the_true_start(void **s) {
    (void)s;
    play("usb4000", false);
    play("usb2000plus", false);
    play("usb2000plus", true);
}

/* How many frames are thrown away before the first of a set that begins gap_us after the last frame. */
static int thrown_after(const char *model, int64_t gap_us) {
    struct unit u;
    struct spectrometer_timing t;
    unit_init(&u, model, false, 100000);
    spectrometer_timing_init(&t, 100000, 100000, 0);
    int thrown = 0;
    for (int i = 0; i < 10; i++) {
        if (i == 5)
            run_until(&u, u.now_us + gap_us);
        static int64_t since;
        if (i == 5)
            since = u.now_us;
        int64_t sent = u.now_us;
        ask(&u);
        deliver(&u);
        thrown += i >= 5 && !spectrometer_timing_fresh(&t, u.model, since);
        spectrometer_timing_add(&t, u.model, sent, u.now_us);
    }
    return thrown;
}

static void no_more_frames_are_thrown_away_than_must_be(void **s) {
    (void)s;
    assert_int_equal(thrown_after("usb4000", 2000000), 1); /* a move of seconds: the parked frame only */
    assert_in_range(thrown_after("usb4000", 30000), 1, 2);
    assert_int_equal(thrown_after("usb2000plus", 2000000), 2);
    assert_int_equal(thrown_after("usb2000plus", 30000), 2);
}

static void consecutive_frames_are_all_kept(void **s) {
    static const char *const MODEL[] = {"usb4000", "usb2000plus"};
    (void)s;
    for (int m = 0; m < 2; m++) {
        struct spectrometer_timing t;
        const struct spectrometer_model *model = spectrometer_model_find(MODEL[m]);
        spectrometer_timing_init(&t, 50000, 50000, 0);
        int kept = 0;
        for (int64_t now = 1000000, i = 0; i < 20; i++, now += 50000) {
            kept += spectrometer_timing_fresh(&t, model, 1000000);
            spectrometer_timing_add(&t, model, now, now + 50000);
        }
        assert_int_equal(kept, 18);
    }
}

static void nothing_is_fresh_before_a_change_is_verified(void **s) {
    struct spectrometer_timing t;
    const struct spectrometer_model *model = spectrometer_model_find("usb4000");
    (void)s;
    spectrometer_timing_init(&t, 50000, 65000000, 0);
    assert_false(spectrometer_timing_fresh(&t, model, -1000000000));
    for (int i = 0; i < 5; i++)
        spectrometer_timing_add(&t, model, i * 50000, i * 50000 + 50000);
    spectrometer_timing_change(&t, 100000, INT64_MAX);
    assert_false(spectrometer_timing_fresh(&t, model, t.changed_us));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_bound_lies_after_the_true_start),
        cmocka_unit_test(no_more_frames_are_thrown_away_than_must_be),
        cmocka_unit_test(consecutive_frames_are_all_kept),
        cmocka_unit_test(nothing_is_fresh_before_a_change_is_verified),
    };
    state = test_seed(20261122);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
