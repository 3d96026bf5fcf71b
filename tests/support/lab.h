/*
 * lab.h — a whole goniod in a test: simulated bench, virtual clock, desk and campaign, with a script of commands.
 *
 * A script line posts its command when as many steps are done and, if asked, the campaign is in the state named; lines
 * fire in order, and lab_run fails the test when one never fired. After the last campaign has ended (nothing queued)
 * the lab interrupts goniod, so that lab_run returns.
 */
#ifndef TESTS_SUPPORT_LAB_H
#define TESTS_SUPPORT_LAB_H

#include <stdbool.h>
#include <stdint.h>

#include "daemon/campaign.h"
#include "daemon/simulate.h"
#include "proto/session.h"

#define LAB_LINES 16
#define LAB_HOLDS 64

struct lab_line {
    int steps;                 /* done, at least */
    enum campaign_state state; /* CAMPAIGN_STATES = any */
    enum campaign_command command;
    bool kill; /* instead of the command: ends the process at once, as kill -9 would */
};

struct lab {
    struct clock clock;
    struct bench bench;
    struct config config;
    struct simulate *simulate;
    struct wiring wiring;
    struct desk *desk;
    struct campaign *campaign;
    char dir[96];
    struct lab_line line[LAB_LINES];
    int n_lines, fired;
    int64_t fired_us;          /* when the last line fired */
    enum campaign_state ended; /* how the last campaign ended */
    int refused;               /* code of the first order that was refused, with its sentence */
    char refusal[2048];
    int jobs;     /* how many campaigns must have ended before the lab is over; 0 = 1 */
    bool helpful; /* somebody does what each hold asks for, and says continue */
    bool helped;  /* with the hold at hand */
    int n_holds;  /* what was asked of them so far */
    char hold[LAB_HOLDS][256];
    bool over;
};

/* config_text NULL: the built-in bench. dir must exist. */
void lab_open(struct lab *lab, const char *dir, const struct simulate_options *truth,
              const char *config_text);
void lab_close(struct lab *lab);
/* Queues a job with the certificate of the bench. */
void lab_job(struct lab *lab, const char *yaml);
void lab_resume(struct lab *lab, const char *session);
void lab_script(struct lab *lab, struct lab_line line);
void lab_run(struct lab *lab); /* fails the test when an order was refused */
void lab_run_refused(struct lab *lab, int code, const char *part); /* expects that, with these words */
/* The name of the n-th session in the folder, by name, without its ending; false: there are fewer. */
bool lab_session(const struct lab *lab, int n, char name[192]);
struct session *lab_open_session(const struct lab *lab, const char *name);
void lab_verify(const struct lab *lab, const char *name); /* fails the test with the first thing found */
/* Makes a folder under TMPDIR, else /tmp; removes one. */
void lab_make_dir(char dir[96]);
void lab_remove_dir(const char *dir);

/* The fixture of a test: a folder of its own, and one lab after another in it. */
struct lab_fixture {
    char dir[96];
    struct lab lab;
};
int lab_set_up(void **state);        /* *state: the folder alone */
int lab_set_up_opened(void **state); /* and the built-in bench with seed 1 */
int lab_tear_down(void **state);     /* closes the lab where it is open */
extern const struct simulate_options lab_seed1;

/* The built-in bench without angular widths and polarisation, for values held against a surface at their angles. */
char *lab_bare_bench_text(void);
/* A job of one sample; views: text of theta_v_deg; mode: of the reference. malloc'd. */
char *lab_job_text(const char *name, const char *incidences, const char *views, const char *mode);

#endif
