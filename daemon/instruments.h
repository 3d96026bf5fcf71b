/*
 * instruments.h — the instruments of one bench as config names them: opened when a plan uses them, closed after.
 *
 * A wiring says where links come from: the real ones, or the simulated bench (simulate.h); nothing above it
 * can tell which. Axes with the same link share one bus; every bus is wrapped in the recorder, so that each
 * exchange reaches the sessions. Profiles and the spectrometer's model are read once at the start, without
 * touching a device.
 *
 * Position   an axis whose profile has no validity bit is trusted as far as `units` records: what commissioning
 *            or home found for that unit, kept in STATE/drives.json with date and hash of the profile; alarm and
 *            another profile revoke it (stage-modbus.md 5.3).
 * Errors     -ERR_DEVICE, -ERR_LINK, -ERR_BUSY, -ERR_PERMISSION as the drivers say, naming the instrument.
 * Checked    tests/scenario/test_campaign.c
 */
#ifndef DAEMON_INSTRUMENTS_H
#define DAEMON_INSTRUMENTS_H

#include "daemon/config.h"
#include "daemon/job.h"
#include "daemon/plan.h"
#include "drivers/bench.h"
#include "drivers/modbus_link.h"
#include "drivers/spectrometer.h"
#include "drivers/stage.h"
#include "drivers/usb_link.h"
#include "proto/profile.h"

struct exposure;

struct wiring {
    void *self;
    bool simulated; /* its units need no commissioning and are never recorded */
    int (*modbus)(void *self, const struct modbus_link_config *link, struct modbus_link *out, struct err *e);
    int (*usb)(void *self, const char *target, const struct spectrometer_model *model, const char *serial,
               struct usb_link *out, struct err *e);
    /* What a person does at a bench without the motor for it; the simulated bench does it here, when the campaign has
     * been told that it is done. NULL = nothing to do. */
    /* Whether there is such a sample, asked when a job is planned; NULL = whatever a person mounts. */
    int (*known)(void *self, const struct job_sample *sample, struct err *e);
    int (*mount)(void *self, const struct job_sample *sample, struct err *e); /* at its holder position */
    int (*in_beam)(void *self, const char *holder_position, struct err *e);
    int (*turned)(void *self, const char *axis, double deg, struct err *e);
    void (*shutter)(void *self, bool open);
    /* What a simulated sample truly is (simulate_surface.h), for its session; NULL = not known. */
    struct json_t *(*truth)(void *self, const struct job_sample *sample, const int mean_nm[2]);
    /* A session that is resumed holds this exposure: the simulated bench goes on behind it. NULL = nothing to
     * do. */
    void (*seen_before)(void *self, const struct job_sample *sample, const struct exposure *x);
};

void wiring_real(struct wiring *wiring, struct clock *clock);

/* Every exchange on a bus; link is its name in the config. */
typedef void instruments_seen(void *arg, const char *link, int64_t sent_us, int64_t done_us,
                              const struct modbus_request *sent, const struct modbus_request *reply,
                              int result);

struct instruments {
    struct bench *bench;
    const struct config *config;
    const struct wiring *wiring;
    char state_dir[256];                 /* where drives.json lies */
    struct profile *profile[STAGE_AXES]; /* NULL = not a motor */
    const struct spectrometer_model *model;
    struct instruments_bus {
        struct instruments *owner;
        struct modbus_link link;
        char target[128];
    } bus[STAGE_AXES];
    int n_buses;
    struct stage stage;
    struct usb_link usb;
    bool usb_open;
    struct spectrometer *spectrometer; /* NULL = closed */
    instruments_seen *seen;            /* or NULL */
    void *seen_arg;
};

const struct config_axis *instruments_axis(const struct config *config, enum stage_axis which);
/* Repeatability of a move: the config's, else the profile's (NULL: the axis is no motor), else 0. */
double instruments_u_repeat_deg(const struct config *config, enum stage_axis which,
                                const struct profile *profile);
const char *stage_axis_name(enum stage_axis which); /* "source" */
int stage_axis_find(const char *name);              /* -1 = no such axis */

int instruments_load(struct instruments *i, struct bench *bench, const struct config *config,
                     const struct wiring *wiring, const char *state_dir, struct err_list *errors);
void instruments_free(struct instruments *i);
void instruments_plan_devices(const struct instruments *i, struct plan_devices *devices);

/* Opens the motors that are used, and the axes a person turns or has fixed: these are no device. */
int instruments_open_stage(struct instruments *i, const bool uses[STAGE_AXES], struct err *e);
int instruments_open_spectrometer(struct instruments *i, const struct cancel *cancel, struct err *e);
void instruments_close_spectrometer(struct instruments *i);
void instruments_close(struct instruments *i);

/* Refuses a unit whose profile nobody has tried on a device, until it has been commissioned. */
int instruments_check_commissioned(const struct instruments *i, enum stage_axis which, struct err *e);
/* What home or commissioning found out about a unit: its position may be trusted, or not any more. */
int instruments_record_drive(struct instruments *i, enum stage_axis which, bool position_valid,
                             bool commissioned, struct err *e);

#endif
