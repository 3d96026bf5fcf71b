#include "daemon/campaign_table.h"

/* Rows of states that share their answers are written once. */
#define TAKE(state)                                                                                          \
    { .allowed = true, .next = (state) }
#define REFUSE(sentence)                                                                                     \
    { .why = (sentence) }

#define NO_CAMPAIGN "no campaign is running: start one with `gonioctl run`"
#define NOT_HELD "nothing waits for a person: `continue` answers a hold"
#define BUSY "a campaign holds the bench: wait until it has ended, or `gonioctl abort` it"
#define ENDING "the campaign is ending: wait until it has ended"
#define NOT_PAUSED "the campaign is not paused: there is nothing to resume"

#define RESTING(state)                                                                                       \
    [state] = {                                                                                              \
        [COMMAND_RUN] = TAKE(CAMPAIGN_PREPARING),                                                            \
        [COMMAND_PAUSE] = REFUSE(NO_CAMPAIGN),                                                               \
        [COMMAND_PAUSE_NOW] = REFUSE(NO_CAMPAIGN),                                                           \
        [COMMAND_RESUME] = REFUSE("no campaign is paused: name the session that is to go on"),               \
        [COMMAND_RESUME_SESSION] = TAKE(CAMPAIGN_PREPARING),                                                 \
        [COMMAND_CONTINUE] =                                                                                 \
            TAKE(CAMPAIGN_PREPARING),  /* the queue, which waits after an abort or a failure */              \
        [COMMAND_ABORT] = TAKE(state), /* ends a movement made by hand */                                    \
        [COMMAND_INTERRUPT] = TAKE(CAMPAIGN_INTERRUPTED),                                                    \
        [COMMAND_MANUAL] = TAKE(state),                                                                      \
        [COMMAND_STOP] = TAKE(state),                                                                        \
    }

#define ENDING_ROW(state)                                                                                    \
    [state] = {                                                                                              \
        [COMMAND_RUN] = TAKE(state), /* it queues */                                                         \
        [COMMAND_PAUSE] = REFUSE(ENDING),                                                                    \
        [COMMAND_PAUSE_NOW] = REFUSE(ENDING),                                                                \
        [COMMAND_RESUME] = REFUSE(ENDING),                                                                   \
        [COMMAND_RESUME_SESSION] = REFUSE(ENDING),                                                           \
        [COMMAND_CONTINUE] = REFUSE(ENDING),                                                                 \
        [COMMAND_ABORT] = TAKE(CAMPAIGN_ABORTING),                                                           \
        [COMMAND_INTERRUPT] = TAKE(CAMPAIGN_ABORTING),                                                       \
        [COMMAND_MANUAL] = REFUSE(ENDING),                                                                   \
        [COMMAND_STOP] = TAKE(CAMPAIGN_ABORTING),                                                            \
    }

/* A campaign under way: the same answers but for pause, resume and continue. */
#define UNDER_WAY(state, stop_leads_to, pause_rule, now_rule, resume_rule, continue_rule)                    \
    [state] = {                                                                                              \
        [COMMAND_RUN] = TAKE(state), /* it queues */                                                         \
        [COMMAND_PAUSE] = pause_rule,                                                                        \
        [COMMAND_PAUSE_NOW] = now_rule,                                                                      \
        [COMMAND_RESUME] = resume_rule,                                                                      \
        [COMMAND_RESUME_SESSION] = REFUSE(BUSY),                                                             \
        [COMMAND_CONTINUE] = continue_rule,                                                                  \
        [COMMAND_ABORT] = TAKE(CAMPAIGN_ABORTING),                                                           \
        [COMMAND_INTERRUPT] = TAKE(CAMPAIGN_ABORTING),                                                       \
        [COMMAND_MANUAL] = REFUSE(BUSY),                                                                     \
        [COMMAND_STOP] = TAKE(stop_leads_to),                                                                \
    }

const struct campaign_rule campaign_table[CAMPAIGN_STATES][COMMANDS] = {
    RESTING(CAMPAIGN_IDLE),
    RESTING(CAMPAIGN_DONE),
    RESTING(CAMPAIGN_ABORTED),
    RESTING(CAMPAIGN_FAILED),
    ENDING_ROW(CAMPAIGN_ABORTING),
    ENDING_ROW(CAMPAIGN_PARKING),
    UNDER_WAY(CAMPAIGN_PREPARING, CAMPAIGN_PAUSED, TAKE(CAMPAIGN_PAUSING), TAKE(CAMPAIGN_PAUSED),
              REFUSE(NOT_PAUSED), REFUSE(NOT_HELD)),
    UNDER_WAY(CAMPAIGN_RUNNING, CAMPAIGN_PAUSED, TAKE(CAMPAIGN_PAUSING), TAKE(CAMPAIGN_PAUSED),
              REFUSE(NOT_PAUSED), REFUSE(NOT_HELD)),
    UNDER_WAY(CAMPAIGN_PAUSING, CAMPAIGN_PAUSED, TAKE(CAMPAIGN_PAUSING), TAKE(CAMPAIGN_PAUSED),
              TAKE(CAMPAIGN_RUNNING), REFUSE(NOT_HELD)),
    UNDER_WAY(CAMPAIGN_PAUSED, CAMPAIGN_PAUSED, TAKE(CAMPAIGN_PAUSED), TAKE(CAMPAIGN_PAUSED),
              TAKE(CAMPAIGN_RUNNING), REFUSE(NOT_HELD)),
    UNDER_WAY(CAMPAIGN_HELD, CAMPAIGN_HELD, TAKE(CAMPAIGN_HELD), TAKE(CAMPAIGN_HELD),
              REFUSE("the campaign is held, not paused: do what the hold asks for, then `gonioctl continue`"),
              TAKE(CAMPAIGN_RUNNING)),
    [CAMPAIGN_INTERRUPTED] =
        {
            [COMMAND_RUN] = REFUSE("goniod is ending: start it again, then run the job"),
            [COMMAND_PAUSE] = REFUSE(NO_CAMPAIGN),
            [COMMAND_PAUSE_NOW] = REFUSE(NO_CAMPAIGN),
            [COMMAND_RESUME] =
                REFUSE("goniod is ending: start it again, then resume the session by its name"),
            [COMMAND_RESUME_SESSION] = REFUSE("goniod is ending: start it again, then resume the session"),
            [COMMAND_CONTINUE] = REFUSE(NOT_HELD),
            [COMMAND_ABORT] = TAKE(CAMPAIGN_INTERRUPTED),
            [COMMAND_INTERRUPT] = TAKE(CAMPAIGN_INTERRUPTED),
            [COMMAND_MANUAL] = REFUSE("goniod is ending: start it again"),
            [COMMAND_STOP] = TAKE(CAMPAIGN_INTERRUPTED),
        },
};

const char *campaign_state_name(enum campaign_state state) {
    static const char *const name[CAMPAIGN_STATES] = {
        [CAMPAIGN_IDLE] = "idle",         [CAMPAIGN_PREPARING] = "preparing",
        [CAMPAIGN_RUNNING] = "running",   [CAMPAIGN_PAUSING] = "pausing",
        [CAMPAIGN_PAUSED] = "paused",     [CAMPAIGN_HELD] = "held",
        [CAMPAIGN_ABORTING] = "aborting", [CAMPAIGN_PARKING] = "parking",
        [CAMPAIGN_DONE] = "done",         [CAMPAIGN_ABORTED] = "aborted",
        [CAMPAIGN_FAILED] = "failed",     [CAMPAIGN_INTERRUPTED] = "interrupted"};
    return (unsigned)state < CAMPAIGN_STATES ? name[state] : "unknown";
}

const char *campaign_command_name(enum campaign_command command) {
    static const char *const name[COMMANDS] = {[COMMAND_RUN] = "run",
                                               [COMMAND_PAUSE] = "pause",
                                               [COMMAND_PAUSE_NOW] = "pause --now",
                                               [COMMAND_RESUME] = "resume",
                                               [COMMAND_RESUME_SESSION] = "resume S",
                                               [COMMAND_CONTINUE] = "continue",
                                               [COMMAND_ABORT] = "abort",
                                               [COMMAND_INTERRUPT] = "interrupt",
                                               [COMMAND_MANUAL] = "manual",
                                               [COMMAND_STOP] = "stop"};
    return (unsigned)command < COMMANDS ? name[command] : "unknown";
}

bool campaign_state_is_rest(enum campaign_state state) {
    return state == CAMPAIGN_IDLE || state == CAMPAIGN_DONE || state == CAMPAIGN_ABORTED ||
           state == CAMPAIGN_FAILED || state == CAMPAIGN_INTERRUPTED;
}
