/*
 * light.h — what lights a scene: a direction and a spectrum, and how much of the light is this one's.
 *
 * A beam is parallel light from theta_deg off the z axis towards azimuth_deg (0 = +x, right; 90 = +y, up). Several
 * angles make a numbered series of pictures, and every light has as many or one.
 * weight     its illuminance on a surface that faces it, relative to the other lights: together they give the
 *            perfect diffuser at normal incidence Y = 1.
 * Checked    tests/unit/test_scene.c
 */
#ifndef FIT_RENDER_LIGHT_H
#define FIT_RENDER_LIGHT_H

#include <stdbool.h>

#include "fit/render/vec3.h"

#define LIGHT_ANGLES 721 /* -90..90 deg every quarter of a degree */

enum light_kind { LIGHT_BEAM, LIGHT_KINDS };

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
    struct vec3 direction; /* towards the light, of the present picture of the series */
};

void light_aim(struct light *light, int picture);

#endif
