/*
 * sim.h — the simulated goniometer, in process: a truth, and devices that let it be seen only through their wires.
 *
 * Light: lamp (warm-up, Brownian drift) x geometry (spots, etendue, both filling cases) x surface x spectrometer
 * response + stray light -> electrons -> noise -> counts. Counts are formed from irradiance and etendue; nothing
 * here is shared with the reduction, and the average over the widths of source and sensor not with the fit.
 * Devices: axes behind Modbus registers, an Ocean spectrometer behind bulk endpoints, each coded here from the
 * sheets, never with a driver's codec. Its diffuser, its axis zeros and the polarisation differ from
 * certificate and config by draws from their stated uncertainties.
 *
 * Promises   noise and repeatability are functions of (seed, device, commanded position, holder, lamp, exposure
 *            time, visit, n-th frame of the visit), not of call order. Seed in, same bench out.
 * Checked    tests/unit/test_sim_*.c, tests/scenario/
 */
#ifndef SIM_SIM_H
#define SIM_SIM_H

#include <stdbool.h>
#include <stdint.h>

#include "drivers/clock.h"
#include "drivers/modbus_link.h"
#include "drivers/usb_link.h"
#include "proto/bands.h"
#include "proto/err.h"

#define SIM_AXES 4
#define SIM_POSITIONS 8

enum sim_filling { SIM_VIEW_IN_BEAM, SIM_BEAM_IN_VIEW };
enum sim_eeprom { SIM_EEPROM_GOOD, SIM_EEPROM_BLANK, SIM_EEPROM_CORRUPT };

struct sim_surface {
    char name[48];
    double sigma, gamma, beta_prime, n; /* kappa = 1 */
    double s_lambda[BANDS];
    const void *measured; /* an interpolated .brdf (sim/measured.h), or NULL for the model */
};

struct sim_axis_config {
    char role[16]; /* source, sample, holder */
    int unit;
    int direction;     /* +1 or -1; 0 means +1. User position = direction * raw - zero */
    double zero_deg;   /* what the config says of the zero */
    double u_zero_deg; /* the true zero is drawn from it */
    double u_repeat_deg, lost_motion_deg;
    double speed_deg_s, accel_deg_s2;       /* of a home; a move brings its own */
    int watchdog_ms;                        /* 0 = off */
    bool mute;                              /* the unit answers nothing */
    bool no_coordinates;                    /* home was never set: an absolute move ends in alarm 4Ah */
    double switch_low_deg, switch_high_deg; /* limit switches, raw; equal = none */
};

struct sim_position { /* of the holder, user coordinates */
    char name[32];
    double deg;
};

struct sim_config {
    uint64_t seed;
    char spectrometer[24]; /* usb2000plus | usb4000 */
    char serial[15];       /* as an EEPROM slot holds it */
    int eeprom; /* enum sim_eeprom: blank = never written, corrupt = a digit of a wavelength lost */
    enum sim_filling filling;
    double beam_mm, view_mm;
    double source_width_deg, sensor_width_deg; /* angular, full */
    double polarisation, u_polarisation; /* P that source and sensor prefer; the true one is drawn from it */
    double lamp_drift_rate;              /* relative variance per second */
    double lamp_warm_up_min;
    double stray_light; /* of the spectrometer: share of the mean signal on every pixel */
    double bend;        /* of the detector: relative error at full scale that its EEPROM does not know */
    double halo;        /* of the bench: light past the surface, share of a white one at normal incidence */
    double certificate_u_rel; /* common factor of the diffuser against its certificate */
    bool shutter_by_hand;     /* the lamp line is not wired: sim_bench_shutter lets the light through */
    bool quiet;               /* no noise, no drift, no draws: for exact tests */
    int n_axes;
    struct sim_axis_config axis[SIM_AXES];
    int n_positions; /* "reference" holds the diffuser, "trap" nothing that reflects */
    struct sim_position position[SIM_POSITIONS];
};

struct sim_bench;

void sim_config_default(struct sim_config *config); /* the built-in bench of `goniod --simulate` */
int sim_bench_new(struct sim_bench **bench, const struct sim_config *config, struct clock *clock,
                  struct err *e);
void sim_bench_free(struct sim_bench *bench);
/* What stands in the beam when the holder axis reads this position; the reference diffuser and the trap are
 * built in. */
int sim_bench_mount(struct sim_bench *bench, const char *holder_position, const struct sim_surface *surface,
                    struct err *e);
/* Without a holder axis a person puts a position into the beam; without a sample (or source) axis a person
 * turns it to a user angle. -ERR_INPUT: no such position or role. */
int sim_bench_hold(struct sim_bench *bench, const char *holder_position, struct err *e);
int sim_bench_turn(struct sim_bench *bench, const char *role, double user_deg, struct err *e);
/* A person opens or shuts the shutter of a lamp that burns; also where there is none and light always falls. */
void sim_bench_shutter(struct sim_bench *bench, bool open);
/* Where an axis truly stands now: user coordinates against the true zero, gear and repeatability included.
 * For tests and for the demo's table; nothing of goniod may see it. */
double sim_bench_true_deg(const struct sim_bench *bench, const char *role);
/* Sets how often a resumed session has been in a state, so that noise goes on where it stood. */
void sim_bench_set_visits(struct sim_bench *bench, const char *holder_position, int32_t source_udeg,
                          int32_t sample_udeg, int exposure_us, bool lamp, int visits);

int sim_modbus_link(struct sim_bench *bench, struct modbus_link *link, struct err *e);
int sim_usb_link(struct sim_bench *bench, struct usb_link *link, struct err *e);

/* Published sets of the paper with coloured spectra (sim/paints.c): paint "Hooker's Green", support "acrylic
 * board", water 0. -ERR_INPUT names the nearest known. */
int sim_paint_find(const char *paint, const char *support, int water_percent, struct sim_surface *surface,
                   struct err *e);
/* The certificate CSV of the simulated diffuser, as its calibration laboratory would hand it out. Never over a file
 * that is there: it may be a real diffuser's. */
int sim_certificate_write(const struct sim_config *config, const char *path, struct err *e);
/* The truth, for tests and for the demo's table: radiance factor as defined, without the instrument. */
double sim_surface_beta(const struct sim_surface *surface, double theta_i_deg, double theta_v_deg, int band);

#endif
