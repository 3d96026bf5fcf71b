/*
 * light.h — what lights a scene: beams, rectangles, spheres, surroundings; a spectrum, and how much light is whose.
 *
 * One struct for every kind, written by the tables of light_keys.c; each kind keeps its own part and its own file
 * light_KIND.c. A beam is parallel light from theta_deg off the z axis towards azimuth_deg (0 = +x, right; 90 = +y,
 * up); several angles make a numbered series of pictures, and every beam has as many or one. The others have extent:
 * their directions are drawn at random, by light_sample for the whole light, and weigh radiance / density.
 *
 * weight     relative to the other lights; share: of the sum of all. radiance is that of share 1, so that the perfect
 *            diffuser at the scene's origin, where it faces the light best, has Y = 1; of an environment: the mean of
 *            Y over all ways to face is 1.
 * Geometry   a rectangle shines to the side of look_at_mm only, a sphere outward. Lights are not seen by the camera and
 *            cast no shadow. density is per solid angle of l, which points from the place to the light.
 * Errors     light_prepare: -ERR_INPUT, -ERR_IO, -ERR_NOMEM. The file of an environment of weight 0 is not opened.
 * Promises   light_sample: any thread, no allocation; false where no light arrives. Its density is that of light_radiance.
 * Checked    tests/unit/test_scene.c, test_light.c
 */
#ifndef FIT_RENDER_LIGHT_H
#define FIT_RENDER_LIGHT_H

#include <stdbool.h>

#include "fit/render/frame.h"
#include "proto/err.h"

#define LIGHT_ANGLES 721 /* -90..90 deg every quarter of a degree */

enum light_kind { LIGHT_BEAM, LIGHT_RECTANGLE, LIGHT_SPHERE, LIGHT_ENVIRONMENT, LIGHT_KINDS };

struct light_rectangle {
    double width_mm, height_mm, look_at_mm[3], up[3];
    int n_look_at, n_up;
    struct vec3 x, y, z; /* of length 1; z: where it shines */
};

struct light_environment {
    char image[256], sha256[65];
    double turn_deg[3];
    int n_turn;
    struct frame frame;
    int columns, rows;
    float *radiance;         /* [rows * columns], from +y down; the middle column is at -z, +x to its right */
    double *row_part, *part; /* cumulative: [rows + 1] of rows, [rows * (columns + 1)] in each row */
};

struct light {
    enum light_kind kind;
    bool given[LIGHT_KINDS];
    char spd_name[256];
    int spd;       /* index into the scene's spds: lights of one spectrum share their planes */
    double weight; /* as written; share: of the sum of all */
    double share;
    double theta_deg[LIGHT_ANGLES];
    int n_theta;
    double azimuth_deg;
    struct vec3 direction; /* towards a beam, of the present picture of the series */
    double at_mm[3];       /* the middle of a rectangle or a sphere */
    int n_at;
    double radius_mm; /* of a sphere */
    double radiance;  /* of a rectangle or a sphere, the same everywhere on it */
    struct light_rectangle rectangle;
    struct light_environment environment;
};

struct light_sample {
    struct vec3 l;
    double distance_mm; /* INFINITY: an environment */
    double density, radiance;
};

const char *light_name(enum light_kind kind);
bool light_has_extent(const struct light *light);
/* folder: where a relative path begins. */
int light_prepare(struct light *light, const char *folder, struct err *e);
void light_free(struct light *light);
void light_aim(struct light *light, int picture);
/* u: two independent numbers in (0, 1). */
bool light_sample(const struct light *light, struct vec3 from, const double u[2],
                  struct light_sample *sample);
/* What a ray from there along l meets of the light: radiance 0 where it misses; else all of *sample but l. */
double light_radiance(const struct light *light, struct vec3 from, struct vec3 l,
                      struct light_sample *sample);
/* Its longest side or diameter; INFINITY: an environment. */
double light_size_mm(const struct light *light);

void light_beam_aim(struct light *light, int picture);
int light_rectangle_prepare(struct light *light, const char *folder, struct err *e);
bool light_rectangle_sample(const struct light *light, struct vec3 from, const double u[2],
                            struct light_sample *sample);
bool light_rectangle_meet(const struct light *light, struct vec3 from, struct vec3 l,
                          struct light_sample *sample);
int light_sphere_prepare(struct light *light, const char *folder, struct err *e);
bool light_sphere_sample(const struct light *light, struct vec3 from, const double u[2],
                         struct light_sample *sample);
bool light_sphere_meet(const struct light *light, struct vec3 from, struct vec3 l,
                       struct light_sample *sample);
int light_environment_prepare(struct light *light, const char *folder, struct err *e);
void light_environment_free(struct light *light);
bool light_environment_sample(const struct light *light, struct vec3 from, const double u[2],
                              struct light_sample *sample);
bool light_environment_meet(const struct light *light, struct vec3 from, struct vec3 l,
                            struct light_sample *sample);

#endif
