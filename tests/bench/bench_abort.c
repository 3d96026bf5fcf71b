/* Abort in the middle of a 10 s exposure, seen on the wire between goniod and the drives; and whether a 10 s exposure, a
 * hold and a disk that stalls for 5 s ever leave the drives without a frame for their watchdog time of 1 s. */
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "proto/rpc.h"
#include "proto/session.h"
#include "tests/support/laboratory.h"
#include "tests/support/tap.h"

#define EXPOSURE "target: 0.8, min_ms: 10000, max_ms: 10000, average: 1"
#define IN_EXPOSURE_MS 8000 /* after the start: the axes have arrived, the first frame is under way */
#define UNITS 3
#define MUTE_UNIT 2
#define ROUNDS 3
#define ANSWERING_US 250000
#define MUTE_US (200000 + 350000) /* response time of om-az + 350 ms */
#define STALL_MS 5000
#define WATCHDOG_US 1000000

static struct laboratory lab;
static struct tap *tap;

static void open_lab(const struct laboratory_choice *choice) {
    laboratory_open(&lab, choice);
    tap = tap_open(lab.modbus, lab.modbus);
    laboratory_write_config(&lab);
    laboratory_job(&lab, "pairs: [[20, 10]]", "fixed", EXPOSURE);
    laboratory_goniod_start(&lab);
}

static void close_lab(void) {
    laboratory_close(&lab);
    tap_close(tap);
}

/* One connection that stands already: what is timed is goniod, not the start of a program. */
static int64_t order_abort(void) {
    struct rpc_client *client;
    struct err e = {0};
    if (rpc_connect(&client, lab.socket, &e) < 0)
        return -1;
    int64_t ordered_us = tap_now_us(tap);
    int rc = rpc_call(client, "abort", NULL, 10000, NULL, NULL, &e);
    rpc_close(client);
    return rc < 0 ? -1 : ordered_us;
}

static int64_t abort_once(int mute) {
    const struct laboratory_choice choice = {0};
    char job[96];
    struct said said;
    int64_t worst_us = 0;
    open_lab(&choice);
    snprintf(job, sizeof job, "%s/job.yaml", lab.dir);
    laboratory_ctl(&lab, &said, NULL, "run", job, NULL);
    said_free(&said);
    real_sleep_ms(IN_EXPOSURE_MS);
    tap_mute(tap, mute);
    int64_t ordered_us = order_abort();
    real_sleep_ms(1500);
    for (int unit = 1; unit <= UNITS; unit++) {
        int64_t stop_us = tap_stop_us(tap, unit, ordered_us);
        int64_t took_us = ordered_us < 0 || stop_us < 0 ? INT64_C(999000000) : stop_us - ordered_us;
        worst_us = took_us > worst_us ? took_us : worst_us;
    }
    tap_mute(tap, TAP_NOBODY);
    close_lab();
    return worst_us;
}

static void report_abort(int mute, const char *what) {
    int64_t worst_us = 0;
    for (int i = 0; i < ROUNDS; i++) {
        int64_t took_us = abort_once(mute);
        worst_us = took_us > worst_us ? took_us : worst_us;
    }
    printf("| abort in a 10 s exposure, %s: stop orders of %d axes on the wire | within %d ms | %.1f ms "
           "(worst of %d "
           "aborts) | %s |\n",
           what, UNITS, (mute ? MUTE_US : ANSWERING_US) / 1000, (double)worst_us * 1e-3, ROUNDS,
           worst_us <= (mute ? MUTE_US : ANSWERING_US) ? "met" : "missed");
}

struct trouble {
    int alarms, exposures;
};

static int note_event(void *arg, int64_t us, const char *kind, const char *json) {
    struct trouble *t = arg;
    (void)us;
    t->alarms += !strcmp(kind, "repeat") || strstr(json, "alarm") != NULL;
    return 0;
}

static int note_exposure(void *arg, const struct exposure *x) {
    ((struct trouble *)arg)->exposures += x->exposure_us == 10000000;
    return 0;
}

/* A person at the holder is awaited twice; each wait lasts longer than the watchdog. */
static void report_waits(void) {
    const struct laboratory_choice choice = {.manual_holder = true, .stall_ms = STALL_MS};
    struct trouble t = {0};
    struct program run;
    struct said said;
    struct session *s;
    char job[96], path[256], name[160];
    open_lab(&choice);
    snprintf(job, sizeof job, "%s/job.yaml", lab.dir);
    const char *const words[] = {"gonioctl", "run", "--wait", job, NULL};
    laboratory_ctl_begin(&lab, &run, words);
    laboratory_await(&lab, "\"state\":\"held\"", 60000);
    int64_t from_us = tap_now_us(tap);
    real_sleep_ms(3000);
    laboratory_expect(&lab, 0, "", NULL, "continue", NULL);
    bool stalled = laboratory_stall(&lab, 60000);
    while (program_runs(&run) && tap_now_us(tap) < from_us + 400 * INT64_C(1000000)) {
        real_sleep_ms(2000);
        laboratory_ctl(&lab, &said, NULL, "continue", NULL); /* refused where nothing is held */
        said_free(&said);
    }
    program_wait(&run, 1000, &said);
    int64_t silence_us = tap_silence_us(tap, from_us, tap_now_us(tap));
    bool good = said.status == 0 && stalled;
    if (good) {
        laboratory_session_path(&lab, said.out, path, name);
        if (session_open(&s, path, true, NULL) == 0) {
            session_each_event(s, note_event, &t, NULL);
            session_each_exposure(s, note_exposure, &t, NULL);
            session_close(s, NULL);
        }
    } else {
        fprintf(stderr, "%s\n", said.err);
    }
    said_free(&said);
    close_lab();
    printf("| %d exposures of 10 s, holds, a %d s stall of the disk; watchdog 1 s | no alarm | %s, longest "
           "silence on "
           "the bus %.0f ms | %s |\n",
           t.exposures, STALL_MS / 1000,
           !good      ? "it did not end well"
           : t.alarms ? "an alarm"
                      : "no alarm",
           (double)silence_us * 1e-3, good && !t.alarms && silence_us < WATCHDOG_US ? "met" : "missed");
}

int main(void) {
    report_abort(TAP_NOBODY, "answering links");
    report_abort(TAP_EVERYBODY, "a bus gone mute");
    report_abort(MUTE_UNIT, "one unit mute, its neighbours on the bus answer");
    report_waits();
    return 0;
}
