/*
 * sim_process.h — goniosim in a process of its own, for tests over real wires.
 *
 * The program is taken from $BUILD (default build). What it prints of its endpoints is parsed and kept.
 */
#ifndef TESTS_SUPPORT_SIM_PROCESS_H
#define TESTS_SUPPORT_SIM_PROCESS_H

#include <stdbool.h>
#include <sys/types.h>

struct sim_process {
    pid_t pid; /* 0: not running */
    char spectrometer[160];
    char modbus[2][96]; /* in the order of the config; "" = no such bus */
};

/* The built-in axes with a watchdog that goes off after 8 s, not 1: goniod polls each drive every 250 ms, but a machine
 * that stands still for seconds, and goniosim's clock does not, is no mistake of goniod's. */
#define SIM_PROCESS_WATCHDOG_MS 8000
#define SIM_PROCESS_PATIENT_AXES                                                                             \
    "axes: [{role: source, unit: 1, watchdog_ms: 8000}, {role: sample, unit: 2, watchdog_ms: 8000},\n"       \
    "       {role: holder, unit: 3, watchdog_ms: 8000}]\n"

bool sim_process_start(struct sim_process *p, const char *yaml);
/* Ends it by this signal and waits. Returns its exit status, or 128 + the signal that ended it. */
int sim_process_stop(struct sim_process *p, int signal);

#endif
