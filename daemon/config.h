/*
 * config.h — goniod.yaml: which instruments stand on this bench and who may command them (form: design 10).
 *
 * Read by one table of keys (proto/yaml.h). A key that contradicts another is reported at its own place in the
 * same pass.
 * Errors     -ERR_INPUT with all mistakes in the list, in the order of their places; -ERR_IO no such file
 * Checked    tests/unit/test_config.c
 */
#ifndef DAEMON_CONFIG_H
#define DAEMON_CONFIG_H

#include <stdbool.h>
#include <stdint.h>

#include "proto/err.h"

#define CONFIG_POSITIONS 8
#define CONFIG_NAMES 8
#define CONFIG_ZONES 8

enum config_shutter { SHUTTER_LAMP_LINE, SHUTTER_NONE, SHUTTER_MANUAL };
enum config_polarisation { POLARISATION_UNKNOWN, POLARISATION_DEPOLARISED, POLARISATION_STATED };
enum config_filling { FILLING_VIEW_IN_BEAM, FILLING_BEAM_IN_VIEW };
enum config_axis_kind { CONFIG_AXIS_ABSENT, CONFIG_AXIS_MOTOR, CONFIG_AXIS_MANUAL, CONFIG_AXIS_FIXED };

struct config_position { /* a named position of the holder */
    char name[32];
    double deg;
};

struct config_axis {
    enum config_axis_kind kind;
    char profile[32];
    char link[128];
    int unit;
    double zero_deg;
    int direction;
    bool has_limits;
    double limits_deg[2];
    double blind_deg; /* source only */
    double fixed_deg;
    int baud;                                /* 0 = the profile's */
    char parity;                             /* 0 = the profile's */
    int response_ms;                         /* 0 = the profile's */
    double u_zero_deg;                       /* standard uncertainty of the zero, from alignment */
    double u_repeat_deg, u_transmission_deg; /* 0 = the profile's */
    int n_positions;                         /* holder only */
    struct config_position position[CONFIG_POSITIONS];
};

struct config_zone {
    double source_deg[2], sample_deg[2];
};

struct config {
    char file[256];
    struct {
        char model[24];
        char link[160];
        char serial[32];
        double linearity_u_rel;
    } spectrometer;
    enum config_shutter shutter;
    double lamp_warm_up_min;
    struct {
        double beam_mm, view_mm;
        enum config_filling filling;
        double source_width_deg, sensor_width_deg;
        enum config_polarisation polarisation;
        double polarisation_p, u_polarisation; /* where stated */
    } optics;
    struct config_axis source, sample, holder;
    int n_keep_out;
    struct config_zone keep_out[CONFIG_ZONES];
    int n_watch, n_operate, n_notify;
    char watch[CONFIG_NAMES][32], operate[CONFIG_NAMES][32]; /* groups */
    char notify[CONFIG_NAMES][256];
};

int config_read_file(const char *path, struct config *config, struct err_list *errors);
int config_read_text(const char *file, const char *text, size_t size, struct config *config,
                     struct err_list *errors);
/* NULL where the holder has no position of that name. */
const struct config_position *config_position_find(const struct config_axis *holder, const char *name);
/* The bench of `goniod --simulate` without --config; config_builtin_text is what --check-config prints. */
const char *config_builtin_text(void);
void config_print_reference(void *file); /* FILE * */

#endif
