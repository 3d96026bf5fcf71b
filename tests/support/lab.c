#include "tests/support/lab.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <dirent.h>
#include <jansson.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "proto/file.h"
#include "sim/sim.h"

#define TEXT_MAX (1 << 20)

void lab_make_dir(char dir[96]) {
    const char *under = getenv("TMPDIR");
    assert_in_range(snprintf(dir, 96, "%s/goniod-lab-XXXXXX", under ? under : "/tmp"), 1, 95);
    assert_non_null(mkdtemp(dir));
}

void lab_remove_dir(const char *dir) {
    char command[160];
    snprintf(command, sizeof command, "rm -rf '%s'", dir);
    assert_int_equal(system(command), 0);
}

static void take_out(char *text, const char *words) {
    char *at = strstr(text, words);
    assert_non_null(at);
    memset(at, ' ', strlen(words));
}

char *lab_bare_bench_text(void) {
    char *text = strdup(config_builtin_text());
    take_out(text, ", source_width_deg: 1, sensor_width_deg: 1");
    take_out(text, "polarisation: {value: 0, u: 0.02}");
    return text;
}

char *lab_job_text(const char *name, const char *incidences, const char *views, const char *mode) {
    char *text = NULL;
    assert_true(asprintf(&text,
                         "name: %s\n"
                         "samples:\n"
                         "  - {name: hg, holder: sample, paint: Hooker's Green, support: acrylic board,\n"
                         "     size_mm: [120, 80], water_percent: 0}\n"
                         "geometry: {theta_i_deg: %s, theta_v_deg: %s}\n"
                         "mean_nm: [400, 700]\n"
                         "exposure: {target: 0.8, min_ms: 4, max_ms: 5000, average: 4, dark_every_min: 10}\n"
                         "reference: {mode: %s, geometry: {%stheta_v_deg: 0}, holder: reference,\n"
                         "            certificate: ptfe.csv, bracket_min: 15}\n"
                         "fit: {model: composite}\n",
                         name, incidences, views, mode,
                         strcmp(mode, "per_incidence") ? "theta_i_deg: 45, " : "") > 0);
    return text;
}

/* ---- the script ---- */

static void take_outcomes(struct lab *lab) {
    struct desk_outcome o;
    while (desk_take_outcome(lab->desk, &o)) {
        if (o.code && !lab->refused) {
            lab->refused = o.code;
            snprintf(lab->refusal, sizeof lab->refusal, "%s %s", o.text, o.json ? o.json : "");
        }
        free(o.json);
    }
}

static bool is_due(struct lab *lab) {
    take_outcomes(lab);
    if (lab->refused && !lab->over)
        return true;
    const struct lab_line *l = &lab->line[lab->fired];
    enum campaign_state state = campaign_state(lab->campaign);
    lab->helped &= state == CAMPAIGN_HELD;
    if (lab->helpful && state == CAMPAIGN_HELD && lab->bench.frozen)
        return !lab->helped;
    if (lab->fired == lab->n_lines && campaign_jobs_ended(lab->campaign) >= (lab->jobs ? lab->jobs : 1))
        return !lab->over && campaign_state_is_rest(state);
    if (lab->fired == lab->n_lines)
        return false;
    return campaign_steps_done(lab->campaign) >= l->steps &&
           (l->state == CAMPAIGN_STATES || l->state == state);
}

static int64_t due_us(void *self) {
    struct lab *lab = self;
    return is_due(lab) ? clock_now_us(lab->bench.clock) : CLOCK_NEVER;
}

/* Somebody reads what the hold asks for, and does it. */
static void help(struct lab *lab) {
    const struct desk_snapshot *s = desk_snapshot_get(lab->desk);
    json_t *json = json_loads(s->json, 0, NULL);
    desk_snapshot_put(s);
    if (lab->n_holds < LAB_HOLDS)
        snprintf(lab->hold[lab->n_holds], sizeof lab->hold[0], "%s",
                 json_string_value(json_object_get(json, "hold")));
    lab->n_holds++;
    lab->helped = true;
    json_decref(json);
}

static void fire(void *self) {
    struct lab *lab = self;
    struct desk_order order = {.command = COMMAND_INTERRUPT};
    lab->fired_us = clock_now_us(lab->bench.clock);
    bool held = lab->helpful && lab->bench.frozen && campaign_state(lab->campaign) == CAMPAIGN_HELD;
    if (lab->refused || (lab->fired == lab->n_lines && !held)) {
        lab->over = true;
        lab->ended = campaign_state(lab->campaign);
    } else if (held) {
        help(lab);
        order.command = COMMAND_CONTINUE;
    } else if (lab->line[lab->fired].kill) {
        kill(getpid(), SIGKILL);
    } else {
        order.command = lab->line[lab->fired++].command;
        lab->over |= order.command == COMMAND_INTERRUPT;
    }
    assert_int_equal(desk_post(lab->desk, &order, NULL, NULL), 0);
}

void lab_script(struct lab *lab, struct lab_line line) {
    assert_in_range(lab->n_lines, 0, LAB_LINES - 1);
    lab->line[lab->n_lines++] = line;
}

/* ---- the lab ---- */

static void find_goniofit(void) {
    char path[512];
    ssize_t n = readlink("/proc/self/exe", path, sizeof path - 32);
    assert_true(n > 0);
    path[n] = 0;
    for (int i = 0; i < 3; i++) /* build/tests/scenario/test_x: two folders up from the program's own */
        *strrchr(path, '/') = 0;
    strcat(path, "/goniofit");
    setenv("GONIOFIT", path, 0);
}

void lab_open(struct lab *lab, const char *dir, const struct simulate_options *truth,
              const char *config_text) {
    struct err_list errors = {0};
    struct err e = {0};
    const char *text = config_text ? config_text : config_builtin_text();
    memset(lab, 0, sizeof *lab);
    snprintf(lab->dir, sizeof lab->dir, "%s", dir);
    find_goniofit();
    clock_init_virtual(&lab->clock);
    bench_init(&lab->bench, &lab->clock);
    assert_int_equal(config_read_text("bench.yaml", text, strlen(text), &lab->config, &errors), 0);
    if (simulate_new(&lab->simulate, truth, &lab->config, &lab->clock, &e) < 0)
        fail_msg("%s", e.text);
    simulate_wiring(lab->simulate, &lab->wiring);
    assert_int_equal(desk_new(&lab->desk, NULL), 0);
    const struct campaign_setup setup = {.config = &lab->config,
                                         .config_text = text,
                                         .bench_text = simulate_bench_text(truth->file),
                                         .sessions_dir = lab->dir,
                                         .state_dir = lab->dir,
                                         .desk = lab->desk,
                                         .bench = &lab->bench,
                                         .wiring = &lab->wiring,
                                         .seed = truth->seed};
    if (campaign_new(&lab->campaign, &setup, &errors) < 0)
        fail_msg("%s", errors.item[0].text);
    err_list_free(&errors);
    struct bench_service service = {.name = "script", .self = lab, .due_us = due_us, .run = fire};
    assert_int_equal(bench_add(&lab->bench, &service), 0);
}

void lab_close(struct lab *lab) {
    campaign_free(lab->campaign);
    desk_free(lab->desk);
    simulate_free(lab->simulate);
    lab->campaign = NULL;
    lab->desk = NULL;
    lab->simulate = NULL;
}

const struct simulate_options lab_seed1 = {.seed = 1};

int lab_set_up(void **state) {
    static struct lab_fixture f;
    memset(&f, 0, sizeof f);
    lab_make_dir(f.dir);
    *state = &f;
    return 0;
}

int lab_set_up_opened(void **state) {
    lab_set_up(state);
    struct lab_fixture *f = *state;
    lab_open(&f->lab, f->dir, &lab_seed1, NULL);
    return 0;
}

int lab_tear_down(void **state) {
    struct lab_fixture *f = *state;
    lab_close(&f->lab);
    lab_remove_dir(f->dir);
    return 0;
}

void lab_verify(const struct lab *lab, const char *name) {
    struct err_list found = {0};
    char path[320];
    snprintf(path, sizeof path, "%s/%s.gonio", lab->dir, name);
    if (session_verify(path, &found, NULL) < 0)
        fail_msg("%s: %s", name, found.n ? found.item[0].text : "not sound");
    err_list_free(&found);
}

static char *certificate_text(const struct lab *lab, size_t *size) {
    struct sim_config sim;
    struct err e = {0};
    char path[128], *text;
    sim_config_default(&sim);
    snprintf(path, sizeof path, "%s/ptfe.csv", lab->dir);
    assert_int_equal(sim_certificate_write(&sim, path, &e), 0);
    assert_int_equal(file_read(path, TEXT_MAX, &text, size, NULL), 0);
    unlink(path);
    return text;
}

void lab_job(struct lab *lab, const char *yaml) {
    struct desk_order order = {.command = COMMAND_RUN};
    strcpy(order.run.name, "job.yaml");
    order.run.text = strdup(yaml);
    order.run.size = strlen(yaml);
    order.run.n_files = 1;
    strcpy(order.run.file[0].name, "ptfe.csv");
    order.run.file[0].text = certificate_text(lab, &order.run.file[0].size);
    assert_int_equal(desk_post(lab->desk, &order, NULL, NULL), 0);
}

void lab_resume(struct lab *lab, const char *session) {
    struct desk_order order = {.command = COMMAND_RESUME_SESSION};
    snprintf(order.session.name, sizeof order.session.name, "%s", session);
    assert_int_equal(desk_post(lab->desk, &order, NULL, NULL), 0);
}

void lab_run(struct lab *lab) {
    assert_int_equal(campaign_serve(lab->campaign), 0);
    take_outcomes(lab);
    if (lab->refused)
        fail_msg("an order was refused: %s", lab->refusal);
    if (lab->fired < lab->n_lines)
        fail_msg("line %d of the script never fired", lab->fired + 1);
}

void lab_run_refused(struct lab *lab, int code, const char *part) {
    assert_int_equal(campaign_serve(lab->campaign), 0);
    take_outcomes(lab);
    assert_int_equal(lab->refused, code);
    if (!strstr(lab->refusal, part))
        fail_msg("\"%s\" does not say \"%s\"", lab->refusal, part);
}

static int is_session(const struct dirent *d) {
    size_t n = strlen(d->d_name);
    return n > 6 && !strcmp(d->d_name + n - 6, ".gonio");
}

bool lab_session(const struct lab *lab, int n, char name[192]) {
    struct dirent **found;
    int count = scandir(lab->dir, &found, is_session, alphasort);
    assert_true(count >= 0);
    if (n < count)
        snprintf(name, 192, "%.*s", (int)strlen(found[n]->d_name) - 6, found[n]->d_name);
    for (int i = 0; i < count; i++)
        free(found[i]);
    free(found);
    return n < count;
}

struct session *lab_open_session(const struct lab *lab, const char *name) {
    struct session *s;
    struct err e = {0};
    char path[320];
    snprintf(path, sizeof path, "%s/%s.gonio", lab->dir, name);
    if (session_open(&s, path, true, &e) < 0)
        fail_msg("%s", e.text);
    return s;
}
