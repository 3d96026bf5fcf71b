/*
 * goniosim_config.h — goniosim.yaml: the bench that goniosim serves, and where.
 *
 * Every key may be left out: the result is the bench of `goniod --simulate` with Hooker's Green on acrylic board,
 * on a free TCP port, a pty and a usbredir port. Files named in it are read here; relative paths are relative to
 * the directory goniosim was started in.
 * Errors     -ERR_INPUT with all mistakes in the list.
 * Checked    tests/unit/test_goniosim_config.c, tests/wire/
 */
#ifndef SIM_GONIOSIM_CONFIG_H
#define SIM_GONIOSIM_CONFIG_H

#include <stdio.h>

#include "sim/measured.h"
#include "sim/sim.h"

#define GONIOSIM_BUSES 4

struct goniosim_place { /* one position of the holder */
    char name[32];
    double deg;
    char paint[64], support[64];
    int water_percent;
    double sigma, gamma, beta_prime, n;
    char spectrum[256]; /* S(lambda), CSV; with the four parameters */
    char brdf[256];
    struct measured *measured;
    bool has_surface;
    struct sim_surface surface;
};

struct goniosim_config {
    struct sim_config bench;
    int seed, n_buses, n_places;
    double reply_delay_ms;
    char bus[GONIOSIM_BUSES][128]; /* tcp:PORT, rtu, rtu:LINK */
    char usb_listen[128];          /* tcp:PORT, unix:PATH, none */
    struct goniosim_place place[SIM_POSITIONS];
};

/* path NULL: the defaults. file: the name used in messages. */
int goniosim_config_read(const char *path, struct goniosim_config *config, struct err_list *errors);
int goniosim_config_read_text(const char *file, const char *text, size_t size, struct goniosim_config *config,
                              struct err_list *errors);
void goniosim_config_free(struct goniosim_config *config);
void goniosim_config_print_reference(FILE *out);

#endif
