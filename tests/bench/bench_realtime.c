/* A campaign in real time over goniosim's wires, against the sum over its sets of what each needs: motion by the drive's
 * profile, settle time, two polls, scans and required discards, read-out. The sum is formed here from the session's
 * rows and the sheets' figures alone; goniod's own estimate has no part in it. Meanwhile 50 clients ask for the status. */
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "proto/rpc.h"
#include "proto/session.h"
#include "proto/units.h"
#include "tests/support/laboratory.h"

#define SPEED_DEG_S 20.0 /* om-az as goniod orders it */
#define ACCEL_DEG_S2 40.0
#define SETTLE_S 0.1
#define POLL_S 0.05
#define DISCARDS 2 /* USB2000+, spectrometer-ocean.md 4 */
#define READOUT_S 870e-6
#define RATIO 1.10
#define CLIENTS 50
#define ASK_MS 250 /* between two questions of one client, as gonioctl run --wait asks */
#define ANSWERS 4000
#define STATUS_US 1000

/* ---- the sum ---- */

struct sum {
    double motion_s, settle_s, light_s;
    int sets, moves;
    double at_deg[3];
    int64_t first_us, last_us;
};

static double travel_s(double deg) {
    double ramps = SPEED_DEG_S * SPEED_DEG_S / ACCEL_DEG_S2;
    return deg >= ramps ? deg / SPEED_DEG_S + SPEED_DEG_S / ACCEL_DEG_S2 : 2 * sqrt(deg / ACCEL_DEG_S2);
}

static int add_set(void *arg, const struct exposure *x) {
    struct sum *s = arg;
    const int32_t at[] = {x->source_udeg, x->sample_udeg, x->holder_udeg};
    double longest = 0;
    for (int a = 0; a < 3; a++) {
        longest = fmax(longest, fabs(deg_from_udeg(at[a]) - s->at_deg[a]));
        s->at_deg[a] = deg_from_udeg(at[a]);
    }
    if (longest > 0.05) {
        s->motion_s += travel_s(longest);
        s->settle_s += SETTLE_S + 2 * POLL_S;
        s->moves++;
    }
    s->light_s += (x->n_scans + DISCARDS) * (x->exposure_us * 1e-6 + READOUT_S);
    s->sets++;
    return 0;
}

static int note_event(void *arg, int64_t us, const char *kind, const char *json) {
    struct sum *s = arg;
    if (!strcmp(kind, "state") && strstr(json, "\"to\":\"running\"") && s->first_us == 0)
        s->first_us = us;
    if (!strcmp(kind, "end"))
        s->last_us = us;
    return 0;
}

/* ---- the clients ---- */

static atomic_bool over;
static int64_t answer_us[CLIENTS * ANSWERS];
static atomic_int n_answers;

static void *ask(void *arg) {
    struct rpc_client *client;
    struct err e = {0};
    real_sleep_ms((int)(intptr_t)arg * ASK_MS / CLIENTS);
    if (rpc_connect(&client, NULL, &e) < 0)
        return NULL;
    while (!atomic_load(&over)) {
        json_t *status = NULL;
        int64_t begun_us = real_us();
        if (rpc_call(client, "status", NULL, 5000, &status, NULL, &e) < 0)
            break;
        int64_t took_us = real_us() - begun_us;
        json_decref(status);
        int i = atomic_fetch_add(&n_answers, 1);
        if (i < CLIENTS * ANSWERS)
            answer_us[i] = took_us;
        real_sleep_ms(ASK_MS);
    }
    rpc_close(client);
    return NULL;
}

static int by_size(const void *a, const void *b) {
    int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

static void report_status(void) {
    int n = atomic_load(&n_answers);
    if (n > CLIENTS * ANSWERS)
        n = CLIENTS * ANSWERS;
    qsort(answer_us, (size_t)n, sizeof *answer_us, by_size);
    if (n == 0)
        return;
    double p99_us = (double)answer_us[n * 99 / 100];
    printf("| `status` p99, %d clients during that campaign | at most 1 ms | %.2f ms (p50 %.2f ms, worst "
           "%.1f ms, "
           "%d answers) | %s |\n",
           CLIENTS, p99_us * 1e-3, (double)answer_us[n / 2] * 1e-3, (double)answer_us[n - 1] * 1e-3, n,
           p99_us <= STATUS_US ? "met" : "missed");
}

/* ---- the campaign ---- */

static void report_sum(const char *path) {
    struct sum s = {0};
    struct session *session;
    if (session_open(&session, path, true, NULL) < 0)
        return;
    session_each_exposure(session, add_set, &s, NULL);
    session_each_event(session, note_event, &s, NULL);
    session_close(session, NULL);
    double took_s = (double)(s.last_us - s.first_us) * 1e-6, sum_s = s.motion_s + s.settle_s + s.light_s;
    printf("| real time over the sum of the steps | at most %.2f | %.3f (%.1f s over %.1f s: %d sets of 3 x "
           "100 ms, %d "
           "moves; motion %.1f, settle and polls %.1f, light %.1f s) | %s |\n",
           RATIO, took_s / sum_s, took_s, sum_s, s.sets, s.moves, s.motion_s, s.settle_s, s.light_s,
           took_s <= RATIO * sum_s ? "met" : "missed");
}

int main(void) {
    static struct laboratory lab;
    const struct laboratory_choice choice = {0};
    pthread_t thread[CLIENTS];
    struct said said;
    char job[96], path[256], name[160];
    laboratory_open(&lab, &choice);
    laboratory_job(
        &lab,
        "theta_i_deg: [30], theta_v_deg: [-75, -70, -65, -60, -55, -50, -45, -40, -20, -15, -10, -5, 0, 5, "
        "10]",
        "fixed", "target: 0.8, min_ms: 100, max_ms: 100, average: 3");
    laboratory_goniod_start(&lab);
    snprintf(job, sizeof job, "%s/job.yaml", lab.dir);
    for (intptr_t i = 0; i < CLIENTS; i++)
        pthread_create(&thread[i], NULL, ask, (void *)i);
    laboratory_ctl(&lab, &said, NULL, "run", "--wait", job, NULL);
    atomic_store(&over, true);
    for (int i = 0; i < CLIENTS; i++)
        pthread_join(thread[i], NULL);
    int status = said.status;
    if (status == 0) {
        laboratory_session_path(&lab, said.out, path, name);
        report_sum(path);
        report_status();
    } else {
        fprintf(stderr, "%s\n", said.err);
    }
    said_free(&said);
    laboratory_close(&lab);
    return status != 0;
}
