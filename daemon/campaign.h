/*
 * campaign.h — runs plans: move, settle, expose, reduce, store; reads like the experiment.
 *
 * One thread, one wait (bench_wait). It takes commands from the desk while it waits, obeys campaign_table,
 * and publishes on the desk. Fates of a failure, always one of: retry (the link does), repeat the step, hold
 * (a person or a condition), abort.
 *
 * Files      campaign.c the run of a plan; _queue.c jobs and commands; _prepare.c; _expose.c one set of
 * scans; _store.c reduce, write, fit; _bracket.c the order of steps; _hold.c pause and hold; _end.c;
 * _resume.c Errors     campaign_serve returns 0 after an interrupt; what a campaign itself met is in its
 * session and status. Checked    tests/unit/test_campaign_table.c, tests/scenario/test_campaign.c,
 * tests/crash/
 */
#ifndef DAEMON_CAMPAIGN_H
#define DAEMON_CAMPAIGN_H

#include "daemon/campaign_table.h"
#include "daemon/config.h"
#include "daemon/desk.h"
#include "drivers/bench.h"

#endif
