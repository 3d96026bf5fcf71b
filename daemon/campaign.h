/*
 * campaign.h — runs a plan: move, settle, expose, reduce, store; reads like the experiment.
 *
 * One thread, one wait (bench_wait). One code path each for pause, resume, abort, in every state; the table
 * states x commands is data (campaign_table) and printed into docs/protocol.md.
 *
 * States     idle preparing running pausing paused held aborting parking done aborted failed interrupted
 * (design 4). Fates of a failure: retry (link), repeat the point, hold (a person or a condition), abort.
 * Checked    tests/unit/test_campaign_table.c, tests/scenario/, tests/crash/
 */
#ifndef DAEMON_CAMPAIGN_H
#define DAEMON_CAMPAIGN_H

#include "daemon/config.h"
#include "daemon/job.h"
#include "daemon/plan.h"
#include "drivers/bench.h"
#include "drivers/spectrometer.h"
#include "drivers/stage.h"

enum campaign_state {
    CAMPAIGN_IDLE,
    CAMPAIGN_PREPARING,
    CAMPAIGN_RUNNING,
    CAMPAIGN_PAUSING,
    CAMPAIGN_PAUSED,
    CAMPAIGN_HELD,
    CAMPAIGN_ABORTING,
    CAMPAIGN_PARKING,
    CAMPAIGN_DONE,
    CAMPAIGN_ABORTED,
    CAMPAIGN_FAILED,
    CAMPAIGN_INTERRUPTED,
    CAMPAIGN_STATES
};

enum campaign_command {
    COMMAND_RUN,
    COMMAND_PAUSE,
    COMMAND_PAUSE_NOW,
    COMMAND_RESUME,
    COMMAND_CONTINUE, /* a person has done what the hold asked for */
    COMMAND_ABORT,
    COMMAND_INTERRUPT, /* SIGTERM */
    COMMAND_MANUAL,    /* move, home, spectrum, commission by hand */
    COMMANDS
};

/* Whether a command is taken in a state, and if not, why, in one sentence for the person. */
struct campaign_rule {
    bool allowed;
    enum campaign_state next; /* where it leads, where allowed */
    const char *why;
};
extern const struct campaign_rule campaign_table[CAMPAIGN_STATES][COMMANDS];
const char *campaign_state_name(enum campaign_state state);
const char *campaign_command_name(enum campaign_command command);

#endif
