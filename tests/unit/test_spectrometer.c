/* The spectrometer driver against a scripted link: what it sends, byte for byte, and what it makes of a unit
 * that misbehaves. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <string.h>

#include "drivers/spectrometer.h"
#include "proto/units.h"
#include "tests/support/fake_usb.h"

static struct fake_usb f;
static struct spectrometer *s;
static struct err e;
static struct frame frames[8];

static int open_it(void) {
    err_clear(&e);
    s = NULL;
    return spectrometer_open(&s, f.model, &f.link, &f.bench, NULL, &e);
}

static void opened(const char *model) {
    fake_usb_init(&f, model, true);
    int rc = open_it();
    if (rc)
        print_error("%s\n", e.text);
    assert_int_equal(rc, 0);
    f.log[0] = '\0';
}

static int acquire(int n) {
    err_clear(&e);
    return spectrometer_acquire(s, n, f.clock.now_us, frames, NULL, &e);
}

static void opening_sends_what_the_sheet_asks_for(void **state) {
    static const struct {
        const char *model;
        bool high_speed;
        const char *drain, *request;
    } WAY[] = {
        {"usb2000plus", true, "82<4608 81<512", "82<4608 01>09"},
        {"usb2000plus", false, "82<4160 81<512", "82<4160 01>09"},
        {"usb4000", true, "82<6144 86<2048 81<512", "86<2048 82<6144 01>09"},
        {"usb4000", false, "82<7744 81<512", "82<7744 01>09"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof WAY / sizeof WAY[0]; i++) {
        char expected[2048], *at = expected;
        at += sprintf(at,
                      "%s 81<512 01>fe 01>01 01>0a0000 81<512 01>fe 01>0210270000 81<512 01>fe %s 01>030000 "
                      "81<512 01>fe",
                      WAY[i].drain, WAY[i].request);
        static const int SLOT[] = {0, 1, 2, 3, 4, 6, 7, 8, 9, 10, 11, 12, 13, 14, 17};
        for (int k = 0; k < 15; k++)
            at += sprintf(at, " 81<512 01>05%02x", SLOT[k]);
        fake_usb_init(&f, WAY[i].model, WAY[i].high_speed);
        assert_int_equal(open_it(), 0);
        assert_string_equal(f.log, expected);
        assert_true(f.clock.now_us < 500000);
        assert_string_equal(spectrometer_calibration(s)->serial, "USB2+F01234");
        spectrometer_close(s);
    }
}

static void settings_are_sent_and_read_back(void **state) {
    (void)state;
    opened("usb2000plus");
    assert_int_equal(spectrometer_set_exposure(s, 123456, NULL, &e), 0);
    assert_string_equal(f.log, "01>0244e20100 81<512 01>fe"); /* 123460: steps of 10 us */
    f.log[0] = '\0';
    assert_int_equal(spectrometer_set_exposure(s, 123458, NULL, &e), 0);
    assert_int_equal(spectrometer_set_lamp(s, false, NULL, &e), 0);
    assert_string_equal(f.log, ""); /* nothing changed, nothing sent */
    assert_int_equal(spectrometer_set_lamp(s, true, NULL, &e), 0);
    assert_string_equal(f.log, "01>030100 81<512 01>fe");
    double celsius;
    assert_int_equal(spectrometer_temperature(s, &celsius, &e), 0);
    assert_float_equal(celsius, 6400 * 0.003906, 1e-9);
    assert_int_equal(spectrometer_set_exposure(s, 999, NULL, &e), -ERR_RANGE);
    assert_int_equal(spectrometer_set_exposure(s, 65535001, NULL, &e), -ERR_RANGE);
    err_clear(&e);
    f.ignores_exposure = true;
    assert_int_equal(spectrometer_set_exposure(s, 50000, NULL, &e), -ERR_DEVICE);
    assert_non_null(strstr(e.text, "refused"));
    assert_int_equal(acquire(1), -ERR_DEVICE); /* no frame of an unknown integration time */
    f.ignores_exposure = false;
    assert_int_equal(acquire(1), 0);
    assert_int_equal(frames[0].exposure_us, 50000);
    spectrometer_close(s);
}

static void steps_of_the_integration_time(void **state) {
    (void)state;
    assert_int_equal(spectrometer_round_exposure(3804), 3800);
    assert_int_equal(spectrometer_round_exposure(3805), 3810);
    assert_int_equal(spectrometer_round_exposure(655000), 655000);
    assert_int_equal(spectrometer_round_exposure(655501), 656000);
    assert_int_equal(spectrometer_round_exposure(65535000), 65535000);
}

static int frames_for(int n) {
    int before = f.frames;
    assert_int_equal(acquire(n), 0);
    return f.frames - before;
}

static void frames_are_thrown_away_after_a_change_only(void **state) {
    (void)state;
    opened("usb2000plus");
    spectrometer_set_exposure(s, 20000, NULL, &e);
    bench_wait(&f.bench, f.clock.now_us + US_PER_S, NULL, NULL, NULL);
    int64_t settled = f.clock.now_us;
    assert_int_equal(frames_for(3), 5);
    assert_true(frames[0].start_us >= settled);
    for (int i = 0; i < 3; i++) {
        assert_true(frames[i].end_us - frames[i].start_us >= 20000);
        assert_true(i == 0 || frames[i].start_us > frames[i - 1].start_us);
        assert_int_equal(frames[i].pixels, 2048);
    }
    int before = f.frames;
    assert_int_equal(spectrometer_acquire(s, 2, settled, frames, NULL, &e), 0);
    assert_int_equal(f.frames - before, 2); /* the same state: none */
    spectrometer_set_lamp(s, true, NULL, &e);
    before = f.frames;
    assert_int_equal(spectrometer_acquire(s, 1, settled, frames, NULL, &e), 0);
    assert_int_equal(f.frames - before, 3);
    assert_true(frames[0].lamp);
    spectrometer_close(s);
    opened("usb4000");
    bench_wait(&f.bench, f.clock.now_us + US_PER_S, NULL, NULL, NULL);
    assert_int_equal(frames_for(3), 4);
    spectrometer_close(s);
}

static void the_future_is_waited_for(void **state) {
    (void)state;
    opened("usb4000");
    int64_t settled = f.clock.now_us + 300000;
    assert_int_equal(spectrometer_acquire(s, 1, settled, frames, NULL, &e), 0);
    assert_true(frames[0].start_us >= settled);
    spectrometer_close(s);
}

static void saturation_is_judged_on_raw_active_pixels(void **state) {
    (void)state;
    opened("usb2000plus");
    f.level = 59999;
    assert_int_equal(acquire(1), 0);
    assert_int_equal(frames[0].saturated_pixels, 0);
    f.level = 60000; /* slot 17; the dark pixels stay below it */
    assert_int_equal(acquire(1), 0);
    assert_int_equal(frames[0].saturated_pixels, 2028);
    assert_int_equal(frames[0].counts[20], 60000);
    spectrometer_close(s);
}

static void a_bad_frame_is_refused_and_the_stream_put_in_step(void **state) {
    static const struct {
        enum fake_fault fault;
        int code;
        const char *says;
    } FAULT[] = {
        {FAKE_SILENT, -ERR_TIMEOUT, "in time"}, {FAKE_SHORT, -ERR_IO, "bytes"},
        {FAKE_NO_SYNC, -ERR_IO, "sync"},        {FAKE_STALL, -ERR_IO, "82"},
        {FAKE_BABBLE, -ERR_IO, "bytes"},        {FAKE_ALL_EQUAL, -ERR_IO, "2409"},
        {FAKE_UNPLUGGED, -ERR_LINK, "gone"},
    };
    static const char *const MODEL[] = {"usb2000plus", "usb4000"};
    (void)state;
    for (size_t i = 0; i < 2 * sizeof FAULT / sizeof FAULT[0]; i++) {
        opened(MODEL[i % 2]);
        spectrometer_set_exposure(s, 50000, NULL, &e);
        spectrometer_set_lamp(s, true, NULL, &e);
        f.fault = FAULT[i / 2].fault;
        f.fault_count = 1;
        int64_t begin = f.clock.now_us;
        assert_int_equal(acquire(2), FAULT[i / 2].code);
        assert_non_null(strstr(e.text, FAULT[i / 2].says));
        assert_true(f.clock.now_us - begin < 2 * US_PER_S);
        if (!f.gone) {
            f.lamp = f.lamp ? f.lamp : 2; /* it has been switched on again by the ladder */
            assert_int_equal(acquire(2), 0);
            assert_int_equal(frames[1].exposure_us, 50000);
            assert_int_equal(f.exposure_us, 50000);
            assert_int_equal(frames[1].counts[500], 20000);
            assert_int_equal(f.lamp, 1);
        }
        spectrometer_close(s);
    }
}

static void a_leftover_sync_byte_shifts_nothing(void **state) {
    (void)state;
    opened("usb2000plus");
    f.fault = FAKE_LEFTOVER;
    f.fault_count = 1;
    assert_int_equal(acquire(1), 0);
    assert_int_equal(frames[0].counts[20], 20000);
    assert_int_equal(frames[0].counts[19], 1000 + 19 % 7);
    spectrometer_close(s);
}

static void the_last_rung_is_a_reset_then_a_person(void **state) {
    (void)state;
    opened("usb2000plus");
    f.fault = FAKE_SHORT;
    f.fault_count = -1;
    f.reset_mends = true;
    assert_int_equal(acquire(1), -ERR_IO);
    assert_non_null(strstr(f.log, "halt 82 halt 86 halt 81"));
    assert_non_null(strstr(f.log, "reset"));
    assert_int_equal(acquire(1), 0);
    f.fault = FAKE_NO_SYNC;
    f.fault_count = -1;
    f.reset_mends = false;
    assert_int_equal(acquire(1), -ERR_DEVICE);
    assert_non_null(strstr(e.text, "switch it off and on"));
    assert_non_null(strstr(e.text, "sync byte"));
    f.fault_count = 0;
    assert_int_equal(acquire(1), 0); /* somebody did */
    spectrometer_close(s);
}

static void a_stalled_reply_is_freed_and_the_setting_ordered_again(void **state) {
    (void)state;
    opened("usb2000plus");
    f.halted = 0x81;
    assert_int_equal(spectrometer_set_exposure(s, 30000, NULL, &e), 0);
    assert_non_null(strstr(f.log, "halt 81"));
    assert_int_equal(f.exposure_us, 30000);
    f.halted = 0x81;
    assert_int_equal(spectrometer_set_lamp(s, true, NULL, &e), 0);
    assert_int_equal(acquire(1), 0);
    assert_int_equal(frames[0].exposure_us, 30000);
    assert_true(frames[0].lamp && f.lamp);
    f.ignores_status = true;
    assert_int_equal(spectrometer_set_exposure(s, 50000, NULL, &e),
                     -ERR_DEVICE); /* the whole ladder, in vain */
    assert_non_null(strstr(e.text, "switch it off and on"));
    assert_int_equal(acquire(1), -ERR_DEVICE);
    f.ignores_status = false;
    assert_int_equal(acquire(1), 0);
    assert_int_equal(frames[0].exposure_us, 50000);
    spectrometer_close(s);
}

static void a_frame_of_an_earlier_session_is_waited_for(void **state) {
    (void)state;
    fake_usb_init(&f, "usb4000", true);
    f.exposure_us = 3000000;
    f.acquisition = 0x02;
    fake_usb_send_frame(&f, 2500000); /* asked for by a process that is dead */
    f.frames = 0;
    assert_int_equal(open_it(), 0);
    assert_true(f.clock.now_us > 2500000 && f.clock.now_us < 4000000);
    f.level = 30000;
    assert_int_equal(acquire(1), 0);
    assert_int_equal(frames[0].counts[100], 30000);
    spectrometer_close(s);
}

static void rubbish_in_the_endpoints_is_read_away(void **state) {
    static const uint8_t rubbish[700] = {1, 2, 3};
    (void)state;
    fake_usb_init(&f, "usb2000plus", true);
    fake_usb_send(&f, 0x82, rubbish, 512, 0);
    fake_usb_send(&f, 0x82, (uint8_t[]){0x69}, 1, 0);
    fake_usb_send(&f, 0x81, rubbish, 17, 0);
    assert_int_equal(open_it(), 0);
    fake_usb_send(&f, 0x81, rubbish, 17, 0); /* and a reply that nobody asked for */
    assert_int_equal(spectrometer_set_exposure(s, 30000, NULL, &e), 0);
    assert_int_equal(acquire(1), 0);
    spectrometer_close(s);
}

static void what_cannot_be_opened_says_why(void **state) {
    (void)state;
    fake_usb_init(&f, "usb2000plus", true);
    memset(f.slot, 0xff, sizeof f.slot);
    assert_int_equal(open_it(), -ERR_DEVICE);
    assert_non_null(strstr(e.text, "EEPROM"));
    fake_usb_init(&f, "usb2000plus", true);
    f.ignores_status = true;
    assert_int_equal(open_it(), -ERR_DEVICE);
    assert_non_null(strstr(e.text, "reply"));
    fake_usb_init(&f, "usb4000", true);
    f.link.info.max_packet[16 + 6] = 0;
    assert_int_equal(open_it(), -ERR_DEVICE);
    assert_non_null(strstr(e.text, "86"));
    fake_usb_init(&f, "usb4000", true);
    f.link.info.max_packet[16 + 2] = 65535; /* what a redirection host says is not to be trusted */
    assert_int_equal(open_it(), -ERR_DEVICE);
    assert_non_null(strstr(e.text, "65535"));
    fake_usb_init(&f, "usb2000plus", true);
    const struct spectrometer_model other = {.title = "X", .pixels = 1024, .max_exposure_us = 1000000};
    assert_int_equal(spectrometer_open(&s, &other, &f.link, &f.bench, NULL, &e), -ERR_DEVICE);
    assert_null(s);
}

struct trigger { /* raises the token at a time, as an abort would */
    struct cancel cancel;
    int64_t at_us;
};

static int64_t trigger_due(void *self) {
    struct trigger *t = self;
    return atomic_load(&t->cancel.raised) ? CLOCK_NEVER : t->at_us;
}

static void trigger_run(void *self) {
    atomic_store(&((struct trigger *)self)->cancel.raised, true);
}

static void an_abort_leaves_at_once_and_the_frame_is_taken_in_later(void **state) {
    (void)state;
    opened("usb2000plus");
    assert_int_equal(spectrometer_set_exposure(s, 10000000, NULL, &e), 0);
    struct trigger t = {.at_us = f.clock.now_us + 4000000};
    bench_add(&f.bench, &(struct bench_service){
                            .name = "abort", .self = &t, .due_us = trigger_due, .run = trigger_run});
    int64_t begin = f.clock.now_us;
    assert_int_equal(spectrometer_acquire(s, 1, begin, frames, &t.cancel, &e), -ERR_CANCELLED);
    assert_int_equal(f.clock.now_us, t.at_us);
    err_clear(&e);
    assert_int_equal(spectrometer_set_lamp(s, true, NULL, &e), 0); /* while the frame is under way */
    assert_int_equal(f.clock.now_us, t.at_us);
    assert_int_equal(spectrometer_drain(s, &e), 0);
    assert_int_equal(f.clock.now_us, begin + 10000000 + 870);
    assert_int_equal(spectrometer_drain(s, &e), 0); /* nothing is under way */
    int64_t settled = f.clock.now_us;
    assert_int_equal(acquire(1), 0);
    assert_true(frames[0].start_us >= settled && frames[0].lamp);
    spectrometer_close(s);
}

static void a_frame_under_way_at_a_pause_is_not_counted(void **state) {
    (void)state;
    opened("usb4000");
    assert_int_equal(spectrometer_set_exposure(s, 1000000, NULL, &e), 0);
    struct trigger t = {.at_us = f.clock.now_us + 200000};
    bench_add(&f.bench, &(struct bench_service){
                            .name = "pause", .self = &t, .due_us = trigger_due, .run = trigger_run});
    assert_int_equal(spectrometer_acquire(s, 1, f.clock.now_us, frames, &t.cancel, &e), -ERR_CANCELLED);
    int64_t moved = f.clock.now_us;
    int before = f.frames;
    assert_int_equal(acquire(1), 0);
    assert_true(frames[0].start_us >= moved);
    assert_true(f.frames - before >= 2);
    spectrometer_close(s);
}

static void models_are_a_table(void **state) {
    (void)state;
    int n;
    const struct spectrometer_model *all = spectrometer_models(&n);
    assert_int_equal(n, 2);
    for (int i = 0; i < n; i++) {
        assert_ptr_equal(spectrometer_model_find(all[i].name), &all[i]);
        assert_true(all[i].dark_last < all[i].active_first && all[i].active_last < all[i].pixels);
        assert_true(all[i].discards == 1 || all[i].discards == 2);
    }
    assert_null(spectrometer_model_find("usb9000"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(opening_sends_what_the_sheet_asks_for),
        cmocka_unit_test(settings_are_sent_and_read_back),
        cmocka_unit_test(steps_of_the_integration_time),
        cmocka_unit_test(frames_are_thrown_away_after_a_change_only),
        cmocka_unit_test(the_future_is_waited_for),
        cmocka_unit_test(saturation_is_judged_on_raw_active_pixels),
        cmocka_unit_test(a_bad_frame_is_refused_and_the_stream_put_in_step),
        cmocka_unit_test(a_leftover_sync_byte_shifts_nothing),
        cmocka_unit_test(the_last_rung_is_a_reset_then_a_person),
        cmocka_unit_test(a_stalled_reply_is_freed_and_the_setting_ordered_again),
        cmocka_unit_test(a_frame_of_an_earlier_session_is_waited_for),
        cmocka_unit_test(rubbish_in_the_endpoints_is_read_away),
        cmocka_unit_test(what_cannot_be_opened_says_why),
        cmocka_unit_test(an_abort_leaves_at_once_and_the_frame_is_taken_in_later),
        cmocka_unit_test(a_frame_under_way_at_a_pause_is_not_counted),
        cmocka_unit_test(models_are_a_table),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
