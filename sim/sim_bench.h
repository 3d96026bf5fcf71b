/*
 * sim_bench.h — the simulated bench put together: one truth, its drives and its spectrometer, one clock.
 *
 * For the files that serve it, in process (sim_modbus.c, sim_usb.c) and on wires (goniosim).
 * Checked    through sim.h
 */
#ifndef SIM_SIM_BENCH_H
#define SIM_SIM_BENCH_H

#include "sim/ocean.h"
#include "sim/sim.h"
#include "sim/truth.h"

struct sim_bench {
    struct sim_config config;
    struct clock *clock;
    struct truth truth;
    struct az_unit unit[SIM_AXES];
    int n_units;
    struct ocean ocean;
};

/* One frame's PDU of the bus: feeds every drive's watchdog, then asks the one addressed. 0: nobody answers.
 */
size_t sim_bench_bus(struct sim_bench *bench, int64_t now_us, int unit, const uint8_t *pdu, size_t size,
                     uint8_t reply[AZ_PDU_MAX]);
/* Drives do by themselves what is due (watchdogs); before anything looks at the bench. */
void sim_bench_update(struct sim_bench *bench, int64_t now_us);

#endif
