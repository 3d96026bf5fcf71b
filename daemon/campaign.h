/*
 * campaign.h — runs plans: move, settle, expose, reduce, store; reads like the experiment.
 *
 * One thread, one wait (bench_wait). It takes orders from the desk while it waits, obeys campaign_table, and
 * publishes on the desk. Fates of a failure, always one of: retry (the link does), repeat the step, hold (a person
 * or a condition), abort.
 *
 * Files      campaign.c the run of a plan; _queue orders and jobs; _prepare devices and sessions; _bracket the order
 *            of readings; _expose one set of scans; _store reduce and write; _fit estimates; _hold pause and hold;
 *            _end park, abort, interrupt; _resume; _status what is published; _notify; _manual work by hand.
 * Sessions   JOB_SAMPLE_YYYYMMDDThhmmssZ.gonio in sessions_dir, one a sample; nothing is ever overwritten.
 * Errors     campaign_new: -ERR_INPUT with every mistake of config against profiles. campaign_serve returns 0 after
 *            an interrupt; what a campaign met is in its session and in the status.
 * Checked    tests/unit/test_campaign_table.c, tests/scenario/test_campaign.c, tests/crash/
 */
#ifndef DAEMON_CAMPAIGN_H
#define DAEMON_CAMPAIGN_H

#include "daemon/campaign_table.h"
#include "daemon/config.h"
#include "daemon/desk.h"
#include "daemon/instruments.h"
#include "drivers/bench.h"

struct json_t;

struct campaign_setup { /* all outlive the campaign */
    const struct config *config;
    const char *config_text;
    const char *bench_text; /* of the file with the truth of a simulated bench; NULL: no such file */
    const char *sessions_dir, *state_dir;
    struct desk *desk;
    struct bench *bench;
    const struct wiring *wiring;
    uint64_t seed;          /* of the simulated bench; written down */
    const char *goniofit;   /* NULL: found beside goniod */
    bool without_estimates; /* points only: nothing is asked of goniofit */
};

struct campaign;

int campaign_new(struct campaign **campaign, const struct campaign_setup *setup, struct err_list *errors);
void campaign_free(struct campaign *campaign);
/* Serves orders and runs jobs until COMMAND_INTERRUPT has been obeyed. */
int campaign_serve(struct campaign *campaign);

/* Reads and plans a job without touching a device: plan_to_json with "forecast" (plan_forecast.h) and with "text"
 * for people, or NULL with all mistakes. Any thread. */
struct json_t *campaign_check(void *campaign, const struct desk_run *run, struct err_list *errors);

/* For scripts of a test, inside bench_wait: where the run stands. */
enum campaign_state campaign_state(const struct campaign *campaign);
int campaign_steps_done(const struct campaign *campaign);
int campaign_jobs_ended(const struct campaign *campaign);

#endif
