/*
 * truth.h — what the spectrometer's fibre sees over a time: lamp, axes, surfaces, geometry, stray light.
 *
 * truth_frame gives the counts of one integration. If lamp and axes stood still all that time it is one state;
 * else the light is averaged over TRUTH_SUBSTEPS moments of the window. Noise of a still frame is keyed by (seed,
 * commanded positions, lamp, exposure time, visit, n-th frame of the visit); that of a blended one by its times.
 * A visit begins with the first still frame in a state other than the last still frame's.
 *
 * Widths     a surface is seen from each direction of the sensor in the light of each of the source, in plane: flux and
 *            spots of optics.h times the surface's value there, summed up. The diffuser hardly changes over a width
 *            (by 1e-5 of its value over 1 deg): its value in the middle is its certified one, and its table's edges are
 *            not the diffuser's.
 * Geometry   theta_v = sample, theta_i = source - sample, true angles; both negated where theta_i < 0. More than
 *            TRUTH_PLACE_DEG away from every holder position nothing stands in the beam.
 * Level      a white surface at 0:0 fills the scale in TRUTH_FULL_SCALE_US with the lamp warm, whatever the spots:
 *            the laboratory sets its attenuator so. Exposures of the paints then span 4 ms .. 5 s.
 * Checked    tests/unit/test_sim_light.c, tests/unit/test_sim_noise.c
 */
#ifndef SIM_TRUTH_H
#define SIM_TRUTH_H

#include "sim/az_registers.h"
#include "sim/detector.h"
#include "sim/lamp.h"
#include "sim/optics.h"
#include "sim/spread.h"
#include "sim/surface.h"

#define TRUTH_SUBSTEPS 16
#define TRUTH_FULL_SCALE_US 130000.0
#define TRUTH_PLACE_DEG 2.0

enum truth_role { TRUTH_SOURCE, TRUTH_SAMPLE, TRUTH_HOLDER, TRUTH_ROLES };

struct truth_axis {
    struct az_unit *unit; /* NULL: turned by hand to manual_deg */
    double zero_deg; /* true, of direction * raw; aligned with the axis reached upwards in its own angle */
    double stated_zero_deg; /* as the config has it */
    int direction;
    double manual_deg;
};

extern const char *const truth_roles[TRUTH_ROLES]; /* "source", "sample", "holder" */

enum truth_kind { TRUTH_NOTHING, TRUTH_DIFFUSER, TRUTH_SURFACE };

struct truth_mount {
    struct sim_position position;
    enum truth_kind kind;
    struct sim_surface surface;
    double spline[BANDS]; /* of s_lambda */
};

/* What the optics make of a surface at a geometry: of a unit of light at 0:0, through of it arrives where beta is 1, and
 * the surface's mean over the directions follows. */
struct truth_sight {
    const struct truth_mount *mount; /* NULL: none yet */
    double theta_i_deg, theta_v_deg, through;
    struct surface_factors factors; /* of a modelled surface */
    double beta[BANDS];             /* of a measured one */
};

struct truth_visit {
    uint64_t state; /* 0 = free */
    int count;
};

struct truth {
    uint64_t key;
    bool quiet;
    struct lamp lamp;
    struct optics optics;
    struct detector detector;
    double stray_light, halo, diffuser_factor, polarisation;
    struct spread source, sensor;
    struct truth_sight sight; /* the last one seen */
    struct truth_axis axis[TRUTH_ROLES];
    struct truth_mount mount[SIM_POSITIONS];
    int n_mounts;
    int held;                            /* mount in the beam where no axis turns the holder */
    double band_at[DETECTOR_PIXELS_MAX]; /* of a pixel, on the band grid */
    double white[DETECTOR_PIXELS_MAX];   /* counts per us of a white surface at 0:0, lamp warm */
    struct truth_visit *visit;           /* hash table, a power of two long */
    size_t visits, visits_capacity;
    uint64_t last_state;
    int last_visit, nth;
};

int truth_init(struct truth *t, const struct sim_config *config, const struct detector_model *model,
               struct err *e);
void truth_free(struct truth *t);
const struct truth_mount *truth_mount_find(const struct truth *t, const char *name);
double truth_axis_deg(const struct truth *t, enum truth_role role, int64_t at_us);
/* -ERR_NOMEM is answered by a frame of dark: there is no one to tell. */
void truth_frame(struct truth *t, int64_t from_us, int64_t to_us, uint32_t exposure_us, uint16_t *counts);
uint64_t truth_state(const struct truth *t, const int32_t steps[TRUTH_ROLES], bool lamp,
                     uint32_t exposure_us);
int truth_add_visits(struct truth *t, uint64_t state, int visits); /* returns the earlier count */
int32_t truth_raw_steps(const struct truth *t, enum truth_role role, double user_deg);

#endif
