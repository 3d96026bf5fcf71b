/*
 * simulate.h — `goniod --simulate`: the in-process bench and the virtual clock under the real drivers.
 *
 * The only file of the daemon that includes sim/. The bench takes its axes, optics and spectrometer from the config
 * (links sim:modbus and sim:usb), the truth of a sample from the job: its paint, support and water_percent, or what
 * a bench file, simulate_mount_instead or _measured say. Mounting is done as the job says, at once: the simulated person does what
 * the hold asked for.
 *
 * Bench file goniosim.yaml, by goniosim's own reader: what stands at the sample's place of the holder (paint, parameters
 *            with a spectrum, measured surface) and what is wrong with the bench. What goniod.yaml states too (model,
 *            spots, warm-up, axes with their zeros, places) is taken from there.
 * Seed       draws of the bench; a resumed session sets the visit counts, so that noise goes on where it stood.
 * Errors     -ERR_INPUT names the nearest known paint; -ERR_INPUT a config the simulated bench cannot be.
 * Checked    tests/scenario/test_campaign.c, test_simulate_bench.c, test_measured_surface.c,
 *            tests/replay/test_replay_physics.c
 */
#ifndef DAEMON_SIMULATE_H
#define DAEMON_SIMULATE_H

#include <stdint.h>

#include "daemon/config.h"
#include "daemon/instruments.h"
#include "daemon/simulate_surface.h"
#include "drivers/clock.h"

struct simulate;
struct measured; /* sim/measured.h */

struct simulate_bench; /* a bench file */

int simulate_bench_read(struct simulate_bench **bench, const char *path, struct err_list *errors);
void simulate_bench_free(struct simulate_bench *bench);
uint64_t simulate_bench_seed(const struct simulate_bench *bench);
const char *simulate_bench_text(const struct simulate_bench *bench); /* as read; NULL of NULL */

struct simulate_options {
    const struct simulate_bench *file; /* outlives the bench; NULL: the built-in one */
    uint64_t seed;
    bool quiet; /* no noise, no drift, no draws: for exact tests */
    bool no_drift;
    double bend; /* of the detector, unknown to its EEPROM (sim.h) */
    bool
        nominal; /* zeros and P as the config states them, the diffuser as its certificate: no draws of those */
};

int simulate_new(struct simulate **simulate, const struct simulate_options *options,
                 const struct config *config, struct clock *clock, struct err *e);
void simulate_free(struct simulate *simulate);
void simulate_wiring(struct simulate *simulate, struct wiring *wiring);
/* From the next mounting on, the sample of that name is this surface instead of its paint. */
int simulate_mount_instead(struct simulate *simulate, const char *sample,
                           const struct simulate_surface *surface, struct err *e);
/* The same with a measured surface, which outlives the bench; its sessions have no truth in parameters. */
int simulate_mount_measured(struct simulate *simulate, const char *sample, const struct measured *surface,
                            struct err *e);

#endif
