/* Devices that fail in mid-campaign: each failure has one of the four fates, a person is told where one is needed, and
 * nothing is lost. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "proto/file.h"
#include "proto/units.h"
#include "tests/support/judgement.h"
#include "tests/support/lab.h"

#define VIEWS "{from: -60, to: 60, step: 15}"
#define N_POINTS 8 /* of 9 views one has the source in front of the sensor */

#define FRAMES 0x82 /* endpoint, spectrometer-ocean.md 2 */

/* ---- a bench whose cables can be pulled ---- */

struct broken { /* between the campaign and the simulated bench */
    struct wiring real;
    struct lab *lab;
    int from_step;              /* the failure begins when so many steps are done */
    int64_t begun_us, lasts_us; /* 0 = not yet */
    int mute_unit;              /* 0 = none */
    bool bus_cut;
    bool usb_gone;
    int bad_frames; /* so many are refused */
    struct usb_link usb;
    struct modbus_link modbus;
};

static struct broken bench;

static bool is_broken(void) {
    int64_t now_us = clock_now_us(&bench.lab->clock);
    if (bench.begun_us == 0 && campaign_steps_done(bench.lab->campaign) >= bench.from_step)
        bench.begun_us = now_us;
    return bench.begun_us && now_us - bench.begun_us < bench.lasts_us;
}

static int transact(void *self, struct modbus_request *rq, struct err *e) {
    (void)self;
    if ((bench.bus_cut || rq->unit == bench.mute_unit) && is_broken())
        return err_set(e, ERR_TIMEOUT, "unit %d does not answer", rq->unit);
    return modbus_link_transact(&bench.modbus, rq, e);
}

static void state_of(void *self, struct modbus_link_state *state) {
    (void)self;
    modbus_link_state(&bench.modbus, state);
}

static void close_modbus(void *self) {
    (void)self;
    modbus_link_close(&bench.modbus);
}

static int open_modbus(void *self, const struct modbus_link_config *link, struct modbus_link *out,
                       struct err *e) {
    static const struct modbus_link_ops ops = {
        .transact = transact, .state = state_of, .close = close_modbus};
    int result = bench.real.modbus(self, link, &bench.modbus, e);
    *out = bench.modbus;
    out->ops = &ops;
    return result;
}

static int submit(void *self, struct usb_transfer *t, struct err *e) {
    (void)self;
    if (bench.usb_gone && is_broken())
        return err_set(e, ERR_LINK, "the spectrometer has gone from the bus");
    if (t->endpoint == FRAMES && bench.bad_frames > 0 && is_broken()) {
        bench.bad_frames--;
        return err_set(e, ERR_IO, "the transfer was refused");
    }
    return bench.usb.ops->submit(bench.usb.self, t, e);
}

static void reap(void *self) {
    (void)self;
    bench.usb.ops->reap(bench.usb.self);
}

static void cancel(void *self, struct usb_transfer *t) {
    (void)self;
    bench.usb.ops->cancel(bench.usb.self, t);
}

static int clear_halt(void *self, uint8_t endpoint, struct err *e) {
    (void)self;
    return bench.usb.ops->clear_halt(bench.usb.self, endpoint, e);
}

static int reset(void *self, struct err *e) {
    (void)self;
    return bench.usb.ops->reset(bench.usb.self, e);
}

static int64_t usb_due_us(void *self) {
    (void)self;
    return bench.usb.ops->due_us(bench.usb.self);
}

static int usb_descriptors(void *self, struct pollfd *fd, int max) {
    (void)self;
    return bench.usb.ops->descriptors ? bench.usb.ops->descriptors(bench.usb.self, fd, max) : 0;
}

static void close_usb(void *self) {
    (void)self;
    bench.usb.ops->close(bench.usb.self);
}

static int open_usb(void *self, const char *target, const struct spectrometer_model *model,
                    const char *serial, struct usb_link *out, struct err *e) {
    static const struct usb_link_ops ops = {
        .submit = submit,
        .reap = reap,
        .cancel = cancel,
        .clear_halt = clear_halt,
        .reset = reset,
        .due_us = usb_due_us,
        .descriptors = usb_descriptors,
        .close = close_usb,
    };
    if (bench.usb_gone && is_broken())
        return err_set(e, ERR_LINK, "no spectrometer on the bus");
    int result = bench.real.usb(self, target, model, serial, &bench.usb, e);
    *out = bench.usb;
    out->ops = &ops;
    return result;
}

/* ---- a run on it ---- */

static int set_up(void **state) {
    memset(&bench, 0, sizeof bench);
    return lab_set_up(state);
}

static void open_lab(struct lab_fixture *f, const char *config) {
    lab_open(&f->lab, f->dir, &lab_seed1, config);
    bench.real = f->lab.wiring;
    bench.lab = &f->lab;
    f->lab.wiring.modbus = open_modbus;
    f->lab.wiring.usb = open_usb;
}

static void run_and_judge(struct lab_fixture *f, const char *mode) {
    struct judgement j = {0};
    char name[192], *text = lab_job_text("failing", "[20]", VIEWS, mode);
    lab_job(&f->lab, text);
    free(text);
    lab_run(&f->lab);
    if (f->lab.ended != CAMPAIGN_DONE) {
        const struct desk_snapshot *s = desk_snapshot_get(f->lab.desk);
        fail_msg("ended %s: %s", campaign_state_name(f->lab.ended), s->json);
    }
    assert_true(lab_session(&f->lab, 0, name));
    lab_verify(&f->lab, name);
    struct session *s = lab_open_session(&f->lab, name);
    judge_green(s, "acrylic board", 0, &j);
    session_close(s, NULL);
    print_message("# %d points, %d left provisional, in %.0f s, %d holds; worst pull %.2f\n", j.n,
                  j.provisional, clock_now_us(&f->lab.clock) / 1e6, f->lab.n_holds, j.worst);
    for (int i = 0; i < f->lab.n_holds && i < LAB_HOLDS; i++)
        print_message("#   asked: %s\n", f->lab.hold[i]);
    assert_int_equal(j.n, N_POINTS);
    assert_true(j.worst < 5);
}

struct events {
    int holds, repeats;
    char hold[256], ended_by[32];
};

static int note_event(void *arg, int64_t us, const char *kind, const char *json) {
    struct events *n = arg;
    (void)us;
    n->repeats += !strcmp(kind, "repeat");
    if (!strcmp(kind, "hold")) {
        n->holds++;
        snprintf(n->hold, sizeof n->hold, "%s", json);
    }
    return 0;
}

static int note_bracket(void *arg, const struct bracket *b) {
    struct events *n = arg;
    if (strcmp(b->ended_by, "reference") != 0)
        snprintf(n->ended_by, sizeof n->ended_by, "%s", b->ended_by);
    return 0;
}

static struct events events_of(struct lab_fixture *f) {
    struct events n = {0};
    char name[192];
    assert_true(lab_session(&f->lab, 0, name));
    struct session *s = lab_open_session(&f->lab, name);
    assert_int_equal(session_each_event(s, note_event, &n, NULL), 0);
    assert_int_equal(session_each_bracket(s, note_bracket, &n, NULL), 0);
    session_close(s, NULL);
    return n;
}

/* ---- tests ---- */

static void a_short_silence_of_a_unit_is_ridden_out(void **state) {
    struct lab_fixture *f = *state;
    open_lab(f, NULL);
    bench.mute_unit = 2;
    bench.from_step = 4;
    bench.lasts_us = 3 * US_PER_S;
    run_and_judge(f, "fixed");
}

static void a_unit_that_stays_silent_holds_until_it_answers(void **state) {
    struct lab_fixture *f = *state;
    open_lab(f, NULL);
    bench.mute_unit = 2;
    bench.from_step = 4;
    bench.lasts_us = 5 * US_PER_MIN;
    run_and_judge(f, "fixed");
    struct events n = events_of(f);
    assert_true(n.holds >= 1);
    assert_int_equal(n.holds, 1); /* it lasts, and is said once */
    assert_non_null(strstr(n.hold, "sample"));
    assert_string_equal(n.ended_by, "");
}

static void a_silence_longer_than_a_bracket_ends_it(void **state) {
    struct lab_fixture *f = *state;
    open_lab(f, NULL);
    bench.mute_unit = 1;
    bench.from_step = 6;
    bench.lasts_us = 20 * US_PER_MIN;
    run_and_judge(f, "every_geometry");
    assert_string_equal(events_of(f).ended_by, "hold");
}

static void a_spectrometer_that_was_unplugged_is_opened_again(void **state) {
    struct lab_fixture *f = *state;
    open_lab(f, NULL);
    bench.usb_gone = true;
    bench.from_step = 5;
    bench.lasts_us = 2 * US_PER_MIN;
    run_and_judge(f, "fixed");
    struct events n = events_of(f);
    assert_true(n.repeats >= 1);
    assert_true(n.holds >= 1);
    assert_non_null(strstr(n.hold, "spectrometer"));
}

static void readings_with_bad_frames_are_taken_again(void **state) {
    struct lab_fixture *f = *state;
    open_lab(f, NULL);
    bench.bad_frames = 8;
    bench.from_step = 4;
    bench.lasts_us = 10 * US_PER_MIN;
    f->lab.helpful = true;
    run_and_judge(f, "fixed");
    assert_true(events_of(f).repeats >= 1);
    assert_int_equal(f->lab.n_holds, 0);
}

/* Without a word on the bus every drive's watchdog ends in an alarm, which only a person may have reset. */
static void an_alarm_waits_for_a_person_and_is_reset_once(void **state) {
    struct lab_fixture *f = *state;
    open_lab(f, NULL);
    f->lab.helpful = true;
    bench.bus_cut = true;
    bench.from_step = 4;
    bench.lasts_us = 4 * US_PER_S;
    run_and_judge(f, "fixed");
    struct events n = events_of(f);
    assert_true(n.holds >= 1);
    assert_non_null(strstr(n.hold, "alarm"));
}

/* The reading that is taken out of the plan's order, to open a new bracket, is led round the zone. */
static void a_bracket_opened_anew_keeps_out_of_the_zones(void **state) {
    struct lab_fixture *f = *state;
    char *config = NULL;
    assert_true(asprintf(&config, "%skeep_out:\n  - {source_deg: [46, 60], sample_deg: [5, 12]}\n",
                         config_builtin_text()) > 0);
    open_lab(f, config);
    bench.usb_gone = true;
    bench.from_step = 6;
    bench.lasts_us = 20 * US_PER_MIN;
    run_and_judge(f, "fixed");
    assert_string_equal(events_of(f).ended_by, "hold");
    free(config);
}

static void write_program(const char *path, const char *text) {
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fputs(text, f);
    fclose(f);
    assert_int_equal(chmod(path, 0700), 0);
}

/* One program keeps what it is told, one sleeps for long, one dies, one is not there. */
static void notified_programs_are_told_and_never_waited_for(void **state) {
    struct lab_fixture *f = *state;
    char *config = NULL, keeper[160], sleeper[160], dying[160], text[400], *told = NULL;
    size_t size;
    snprintf(keeper, sizeof keeper, "%s/keeper", f->dir);
    snprintf(sleeper, sizeof sleeper, "%s/sleeper", f->dir);
    snprintf(dying, sizeof dying, "%s/dying", f->dir);
    snprintf(text, sizeof text, "#!/bin/sh\ncat >> %s.json\necho >> %s.json\n", keeper, keeper);
    write_program(keeper, text);
    snprintf(text, sizeof text, "#!/bin/sh\necho $$ >> %s.pids\nexec sleep 600 >/dev/null 2>&1\n", sleeper);
    write_program(sleeper, text);
    write_program(dying, "#!/bin/sh\nkill -9 $$\n");
    assert_true(asprintf(&config, "%snotify: [%s, %s, %s, /nowhere/program]\n", config_builtin_text(),
                         sleeper, dying, keeper) > 0);
    time_t begun = time(NULL);
    open_lab(f, config);
    bench.mute_unit = 2;
    bench.from_step = 4;
    bench.lasts_us = 5 * US_PER_MIN;
    run_and_judge(f, "fixed");
    assert_true(time(NULL) - begun < 500); /* one sleeper waited for takes longer */
    snprintf(text, sizeof text, "%s.json", keeper);
    begun = time(NULL);
    while (file_read(text, 100000, &told, &size, NULL) != 0 || !strstr(told, "\"event\":\"done\"")) {
        if (time(NULL) - begun > 60)
            fail_msg("%s", told ? told : "nothing was told");
        free(told);
        told = NULL;
        usleep(20000);
    }
    assert_non_null(strstr(told, "\"event\":\"hold\""));
    assert_non_null(strstr(told, "axis sample (unit 2 on "));
    assert_non_null(strstr(told, "goniod tries again every 10 s"));
    snprintf(text, sizeof text, "kill $(cat %s.pids)", sleeper);
    assert_int_equal(system(text), 0);
    free(told);
    free(config);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_short_silence_of_a_unit_is_ridden_out, set_up, lab_tear_down),
        cmocka_unit_test_setup_teardown(a_unit_that_stays_silent_holds_until_it_answers, set_up,
                                        lab_tear_down),
        cmocka_unit_test_setup_teardown(a_silence_longer_than_a_bracket_ends_it, set_up, lab_tear_down),
        cmocka_unit_test_setup_teardown(a_spectrometer_that_was_unplugged_is_opened_again, set_up,
                                        lab_tear_down),
        cmocka_unit_test_setup_teardown(readings_with_bad_frames_are_taken_again, set_up, lab_tear_down),
        cmocka_unit_test_setup_teardown(an_alarm_waits_for_a_person_and_is_reset_once, set_up, lab_tear_down),
        cmocka_unit_test_setup_teardown(a_bracket_opened_anew_keeps_out_of_the_zones, set_up, lab_tear_down),
        cmocka_unit_test_setup_teardown(notified_programs_are_told_and_never_waited_for, set_up,
                                        lab_tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
