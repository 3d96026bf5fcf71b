/*
 * aim.h — directions drawn at the other surfaces of a scene, where light that came over them comes from.
 *
 * From most points of most scenes a direction drawn by its cosine alone meets nothing. Each shape is aimed at by its
 * outline: flat shapes and each side of a fold as rectangles, others by the sphere around them. Seen from a point, an
 * outline lies between two azimuths and two angles to the normal there: a sector of the unit disc under the half space,
 * from which directions are drawn by their cosine,
 *     density = cos theta * number of sectors that hold the direction / sum of their areas
 * share: how often that is worth while; less from a shape that may see itself, which its own sphere does not show.
 * A scene of more than AIM_TARGETS outlines is not aimed at: asking each would cost more than it is worth.
 *
 * Promises   the density is that of the draw, for any direction above the surface.
 * Checked    tests/unit/test_aim.c; test_path.c: means with and without
 */
#ifndef FIT_RENDER_AIM_H
#define FIT_RENDER_AIM_H

#include "fit/render/scene.h"

#define AIM_TARGETS 8

struct aim_target {
    struct vec3 middle, u, v; /* u, v: half the sides of a rectangle; its front is u times v */
    double radius_mm;         /* of the sphere around it */
    int shape, paint;         /* -1: of several paints */
    bool flat;
};

struct aim {
    int n;
    struct aim_target target[AIM_TARGETS];
    bool hollow[SCENE_SHAPES];
    double lift_mm; /* nearer to its plane than this a rectangle is not seen */
};

struct aim_sector {
    double azimuth, half, cos_half; /* its middle and half its width */
    struct vec3 along;              /* the middle's direction on the surface */
    double low, high;               /* of sin^2 theta */
    double area;
};

struct aim_view { /* from one point */
    struct vec3 n, s, t;
    int n_sectors;
    struct aim_sector sector[AIM_TARGETS];
    int target[AIM_TARGETS]; /* of each sector */
    double area, share;
};

void aim_make(struct aim *aim, const struct scene *scene);
/* n_sectors and share 0: nothing is seen. */
void aim_from(const struct aim *aim, const struct hit *hit, struct aim_view *view);
/* u: two independent numbers in (0, 1); the view must hold a sector. */
struct vec3 aim_sample(const struct aim_view *view, const double u[2]);
double aim_density(const struct aim_view *view, struct vec3 l);

#endif
