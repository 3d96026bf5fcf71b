/*
 * campaign_table.h — states x commands as data: what a campaign may be told in each state, and where it leads.
 *
 * One table decides for the socket, for signals and for tests; docs/protocol.md prints it. States are those
 * of design 4. `done`, `aborted`, `failed`, `interrupted` say how the last campaign ended and otherwise
 * behave like `idle`.
 * Checked    tests/unit/test_campaign_table.c walks it whole; tests/scenario/test_campaign.c obeys it.
 */
#ifndef DAEMON_CAMPAIGN_TABLE_H
#define DAEMON_CAMPAIGN_TABLE_H

#include <stdbool.h>

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
    COMMAND_RUN,            /* queue a job */
    COMMAND_PAUSE,          /* after the current exposure set */
    COMMAND_PAUSE_NOW,      /* drops the current exposure set and stops the axes */
    COMMAND_RESUME,         /* the paused campaign */
    COMMAND_RESUME_SESSION, /* a session that was interrupted, failed or killed */
    COMMAND_CONTINUE, /* a person has done what the hold asked for; after an abort: go on with the queue */
    COMMAND_ABORT,
    COMMAND_INTERRUPT, /* SIGTERM: as abort, but the session can be resumed; goniod ends */
    COMMAND_MANUAL,    /* move, home, spectrum, ... by hand */
    COMMAND_STOP,      /* every axis stops now; a campaign is then paused */
    COMMANDS
};

struct campaign_rule {
    bool allowed;
    enum campaign_state next; /* where it leads, where allowed */
    const char *why;          /* where not: the sentence for the person */
};

extern const struct campaign_rule campaign_table[CAMPAIGN_STATES][COMMANDS];

const char *campaign_state_name(enum campaign_state state);       /* "preparing" */
const char *campaign_command_name(enum campaign_command command); /* "pause --now" */
/* No campaign holds the bench: idle, or the last one has ended. */
bool campaign_state_is_rest(enum campaign_state state);

#endif
