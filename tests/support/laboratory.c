#include "tests/support/laboratory.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "daemon/config.h"
#include "daemon/drives.h"
#include "proto/file.h"
#include "sim/sim.h"

#define CTL_MS 600000 /* far beyond what a busy machine needs */
#define START_MS 60000
#define BRIDGE_WORDS 4

static void put(const char *dir, const char *name, const char *text) {
    char path[160];
    snprintf(path, sizeof path, "%s/%s", dir, name);
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fputs(text, f);
    assert_int_equal(fclose(f), 0);
}

/* ---- goniosim ---- */

static void sim_text(struct laboratory *l, const char *bus, const char *listen) {
    snprintf(l->sim_yaml, sizeof l->sim_yaml,
             "seed: 1\n"
             "modbus: [\"%s\"]\n"
             "lamp: {warm_up_min: 0}\n" SIM_PROCESS_PATIENT_AXES "spectrometer: {model: %s, listen: \"%s\"}\n"
             "holder:\n"
             "  - {name: sample, deg: 0, paint: " LABORATORY_SAMPLE_PAINT
             ", support: " LABORATORY_SAMPLE_SUPPORT "}\n"
             "  - {name: reference, deg: 15}\n"
             "  - {name: trap, deg: 30}\n",
             bus, l->choice.model ? l->choice.model : "usb2000plus", listen);
}

/* The port that goniosim has taken, for the next one. */
static void fix_endpoints(struct laboratory *l) {
    char bus[128], listen[128];
    const char *port = strrchr(l->sim.modbus[0], ':'), *usb = strrchr(l->sim.spectrometer, ':');
    if (l->choice.rtu)
        snprintf(bus, sizeof bus, "rtu:%s/bus", l->dir);
    else
        snprintf(bus, sizeof bus, "tcp%.20s", port);
    if (l->choice.usb_tcp)
        snprintf(listen, sizeof listen, "tcp%.20s", usb);
    else
        snprintf(listen, sizeof listen, "unix:%s/usb.sock", l->dir);
    sim_text(l, bus, listen);
}

static void sim_start(struct laboratory *l) {
    char bus[128], listen[128];
    snprintf(bus, sizeof bus, l->choice.rtu ? "rtu:%s/bus" : "tcp:0", l->dir);
    snprintf(listen, sizeof listen, l->choice.usb_tcp ? "tcp:0" : "unix:%s/usb.sock", l->dir);
    sim_text(l, bus, listen);
    assert_true(sim_process_start(&l->sim, l->sim_yaml));
    fix_endpoints(l);
    if (l->choice.rtu)
        snprintf(l->modbus, sizeof l->modbus, "rtu:%s/bus", l->dir);
    else
        snprintf(l->modbus, sizeof l->modbus, "%s", l->sim.modbus[0]);
    snprintf(l->spectrometer, sizeof l->spectrometer, "%s", l->sim.spectrometer);
}

void laboratory_sim_restart(struct laboratory *l) {
    assert_true(sim_process_start(&l->sim, l->sim_yaml));
}

/* ---- config and job ---- */

static void write_certificate(const struct laboratory *l) {
    struct sim_config config;
    struct err e = {0};
    char path[160];
    sim_config_default(&config);
    snprintf(path, sizeof path, "%s/ptfe.csv", l->dir);
    if (sim_certificate_write(&config, path, &e) < 0)
        fail_msg("%s", e.text);
}

/* What `gonioctl commission` would have recorded. */
static void declare_commissioned(const struct laboratory *l) {
    struct err_list errors = {0};
    struct err e = {0};
    struct profile profile;
    struct config config;
    char *text = NULL;
    size_t size = 0;
    if (file_read(l->config, 1 << 16, &text, &size, &e) < 0 ||
        config_read_text(l->config, text, size, &config, &errors) < 0 ||
        profile_load("om-az", &profile, &errors) < 0)
        fail_msg("%s", e.code ? e.text : errors.item[0].text);
    const struct config_axis *const axis[] = {&config.source, &config.sample, &config.holder};
    struct drive_record record = {.position_valid = true, .commissioned = true};
    for (int a = 0; a < 3; a++)
        if (axis[a]->kind == CONFIG_AXIS_MOTOR)
            assert_int_equal(drives_record(l->sessions, axis[a], &profile, &record, &e), 0);
    free(text);
}

void laboratory_write_config(struct laboratory *l) {
    char text[2048], end[160];
    bool manual = l->choice.manual_holder;
    const char *bus = l->choice.modbus ? l->choice.modbus : l->modbus;
    snprintf(end, sizeof end, "link: \"%s\"%s", bus, l->choice.rtu ? ", parity: N" : "");
    snprintf(
        text, sizeof text,
        "spectrometer: {model: %s, link: \"%s\"}\n"
        "shutter: lamp-line\n"
        "lamp: {warm_up_min: 0}\n"
        "optics: {beam_mm: 20, view_mm: 3, filling: view-in-beam}\n"
        "axes:\n"
        "  source: {profile: om-az, %s, unit: 1, limits_deg: [-70, 150], blind_deg: 8, u_zero_deg: 0.01}\n"
        "  sample: {profile: om-az, %s, unit: 2, limits_deg: [-85, 85], u_zero_deg: 0.01}\n"
        "holder: %s%s%s\n",
        l->choice.model ? l->choice.model : "usb2000plus",
        l->choice.spectrometer ? l->choice.spectrometer : l->spectrometer, end, end,
        manual ? "manual" : "{profile: om-az, ", manual ? "" : end,
        manual ? "" : ", unit: 3, limits_deg: [-10, 90], positions: {sample: 0, reference: 15, trap: 30}}");
    put(l->dir, "goniod.yaml", text);
    if (!l->choice.not_commissioned)
        declare_commissioned(l);
}

void laboratory_job(struct laboratory *l, const char *geometry, const char *mode, const char *exposure) {
    char text[2048];
    snprintf(text, sizeof text,
             "name: wire\n"
             "samples:\n"
             "  - {name: hg, holder: sample, paint: " LABORATORY_SAMPLE_PAINT
             ", support: " LABORATORY_SAMPLE_SUPPORT ", size_mm: [120, 80]}\n"
             "geometry: {%s}\n"
             "exposure: {%s, dark_every_min: 10}\n"
             "reference: {mode: %s, geometry: {theta_i_deg: 30, theta_v_deg: 0}, holder: reference,\n"
             "            certificate: ptfe.csv, bracket_min: 15}\n",
             geometry, exposure, mode);
    put(l->dir, "job.yaml", text);
}

void laboratory_open(struct laboratory *l, const struct laboratory_choice *choice) {
    memset(l, 0, sizeof *l);
    l->choice = *choice;
    strcpy(l->dir, "/tmp/goniod-wire-XXXXXX");
    assert_non_null(mkdtemp(l->dir));
    snprintf(l->socket, sizeof l->socket, "%s/goniod.sock", l->dir);
    snprintf(l->sessions, sizeof l->sessions, "%s", l->dir);
    snprintf(l->config, sizeof l->config, "%s/goniod.yaml", l->dir);
    sim_start(l);
    write_certificate(l);
    laboratory_write_config(l);
}

/* ---- goniod ---- */

/* The preloaded library and its orders reach goniod by its environment. */
static void set_stall(const struct laboratory *l) {
    const char *build = getenv("BUILD");
    char library[256], file[96], ms[16];
    snprintf(library, sizeof library, "%s/tests/preload/stall.so", build ? build : "build");
    snprintf(file, sizeof file, "%s/stall", l->dir);
    snprintf(ms, sizeof ms, "%d", l->choice.stall_ms);
    setenv("STALL_FILE", file, 1);
    setenv("STALL_MS", ms, 1);
    setenv("LD_PRELOAD", library, 1);
}

bool laboratory_stall(struct laboratory *l, int limit_ms) {
    char file[96];
    put(l->dir, "stall", "");
    snprintf(file, sizeof file, "%s/stall", l->dir);
    for (int64_t until_us = real_us() + limit_ms * INT64_C(1000); real_us() < until_us; real_sleep_ms(10))
        if (access(file, F_OK) < 0)
            return true;
    return false;
}

void laboratory_goniod_start(struct laboratory *l) {
    const char *build = getenv("BUILD");
    char goniod[256];
    snprintf(goniod, sizeof goniod, "%s/goniod", build ? build : "build");
    const char *words[] = {"tests/bridge/usb_bridge",
                           l->spectrometer,
                           l->choice.bridged,
                           "--",
                           goniod,
                           "--config",
                           l->config,
                           "--socket",
                           l->socket,
                           "--sessions",
                           l->sessions,
                           l->choice.goniod_option,
                           NULL};
    const char **first = l->choice.bridged ? words : words + BRIDGE_WORDS;
    if (!l->choice.bridged)
        *first = "goniod";
    if (l->choice.stall_ms)
        set_stall(l);
    bool started = program_start(&l->goniod, first, NULL);
    unsetenv("LD_PRELOAD");
    assert_true(started);
    for (int64_t until_us = real_us() + START_MS * 1000; real_us() < until_us; real_sleep_ms(20)) {
        struct said said;
        if (!program_runs(&l->goniod))
            break;
        if (access(l->socket, F_OK) < 0)
            continue;
        laboratory_ctl(l, &said, NULL, "status", NULL);
        bool there = said.status == 0;
        said_free(&said);
        if (there)
            return;
    }
    laboratory_goniod_stop(l, SIGTERM, -2);
    fail_msg("goniod has not begun to answer");
}

void laboratory_goniod_stop(struct laboratory *l, int signal, int expected) {
    struct said said;
    if (!l->goniod.pid)
        return;
    kill(l->goniod.pid, signal);
    program_wait(&l->goniod, START_MS, &said);
    int status = said.status;
    if (status != expected && (status != 0 || expected >= 0))
        print_message("# goniod ended with %d: %s\n", status, said.err);
    said_free(&said);
    if (expected != -2)
        assert_int_equal(status, expected);
}

void laboratory_close(struct laboratory *l) {
    char command[96];
    laboratory_goniod_stop(l, SIGTERM, -2);
    if (l->sim.pid)
        kill(l->sim.pid, SIGCONT);
    sim_process_stop(&l->sim, SIGTERM);
    snprintf(command, sizeof command, "rm -rf '%s'", l->dir);
    assert_int_equal(system(command), 0);
}

/* ---- gonioctl ---- */

static void run_words(struct laboratory *l, struct said *said, const char *input, va_list arguments) {
    const char *words[PROGRAM_WORDS + 1] = {"gonioctl"};
    int n = 1;
    setenv("GONIOD_SOCKET", l->socket, 1);
    setenv("GONIOD_SESSIONS", l->sessions, 1);
    for (const char *w; n < PROGRAM_WORDS && (w = va_arg(arguments, const char *)) != NULL;)
        words[n++] = w;
    program_run(words, input, CTL_MS, said);
}

void laboratory_ctl(struct laboratory *l, struct said *said, const char *input, ...) {
    va_list arguments;
    va_start(arguments, input);
    run_words(l, said, input, arguments);
    va_end(arguments);
}

void laboratory_expect(struct laboratory *l, int status, const char *part, const char *input, ...) {
    struct said said;
    va_list arguments;
    va_start(arguments, input);
    const char *verb = input;
    run_words(l, &said, input, arguments);
    va_end(arguments);
    if (said.status != status || (!strstr(said.out, part) && !strstr(said.err, part)))
        fail_msg("gonioctl ended with %d, not %d and \"%s\":\n%s\n%s (input %s)", said.status, status, part,
                 said.out, said.err, verb ? verb : "none");
    said_free(&said);
}

bool laboratory_ctl_begin(struct laboratory *l, struct program *p, const char *const *words) {
    setenv("GONIOD_SOCKET", l->socket, 1);
    setenv("GONIOD_SESSIONS", l->sessions, 1);
    return program_start(p, words, NULL);
}

void laboratory_await(struct laboratory *l, const char *text, int limit_ms) {
    struct said said = {0};
    for (int64_t until_us = real_us() + limit_ms * INT64_C(1000);;) {
        laboratory_ctl(l, &said, NULL, "status", "--json", NULL);
        if (said.status == 0 && strstr(said.out, text))
            break;
        if (real_us() > until_us)
            fail_msg("no %s within %d ms; status:\n%s\n%s", text, limit_ms, said.out, said.err);
        said_free(&said);
        real_sleep_ms(50);
    }
    said_free(&said);
}

void laboratory_session_path(const struct laboratory *l, const char *said, char path[256], char name[160]) {
    snprintf(name, 160, "%.*s", (int)strcspn(said, "\n"), said);
    snprintf(path, 256, "%s/%s.gonio", l->sessions, name);
    assert_int_equal(access(path, R_OK), 0);
}
