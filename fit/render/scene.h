/*
 * scene.h — what a picture shows, as written in a scene file: materials, shapes, lights, camera, image.
 *
 * docs/scene-file.md lists the keys (made from the tables of scene_keys.c). Paths are relative to the scene file.
 *
 * Errors     scene_read: -ERR_INPUT, every mistake of the scene and of the files it names in errors, with
 *            file:line:column; -ERR_IO the scene cannot be read. Nothing needs freeing then.
 * Checked    tests/unit/test_scene.c
 */
#ifndef FIT_RENDER_SCENE_H
#define FIT_RENDER_SCENE_H

#include "fit/render/camera.h"
#include "fit/render/colour.h"
#include "fit/render/light.h"
#include "fit/render/paint.h"
#include "fit/render/shape.h"
#include "fit/render/spd.h"

#define SCENE_PAINTS 64
#define SCENE_SHAPES 64
#define SCENE_LIGHTS 16

struct scene_material { /* as written; becomes paint[same index] */
    char name[64], session[256], spectrum[256], spectrum_sha256[65];
    int model;
    bool has_uniform;
    double uniform, sigma, gamma, beta_prime, n, kappa, tail, n_d, gamma_2, beta_prime_2;
};

struct scene_image {
    int width, height;
    int grid;    /* grid x grid samples a pixel, at the centres of its parts */
    int bounces; /* surfaces that light may have come over: 1, what the lights alone make */
    int energy;  /* enum energy_policy */
    int samples; /* of a light with extent in each pixel, at random */
    int bits;
    int observer, space, adaptation; /* enums of colour.h */
    double exposure;                 /* Y = 1 of the perfect diffuser becomes this in the picture */
};

struct scene {
    char file[256], sha256[65], folder[256], name[64];
    struct scene_image image;
    struct camera camera;
    int n_paints, n_shapes, n_lights, n_spds;
    struct scene_material material[SCENE_PAINTS];
    struct paint paint[SCENE_PAINTS];
    struct shape shape[SCENE_SHAPES];
    struct light light[SCENE_LIGHTS];
    struct spd spd[SCENE_LIGHTS];
    int n_pictures; /* of a series; 1 otherwise */
};

struct scene_session {           /* takes the place of the session of a material, as a command line wishes */
    const char *material, *path; /* path: from where the command runs */
};

/* malloc, for scene_free; NULL and errors when something is wrong. */
struct scene *scene_read(const char *path, const struct scene_session *sessions, int n_sessions,
                         struct err_list *errors);
struct scene *scene_read_text(const char *path, const char *text, size_t size,
                              const struct scene_session *sessions, int n_sessions, struct err_list *errors);
void scene_free(struct scene *scene);
/* Turns the lights to picture 0, 1, ... of the series. */
void scene_aim(struct scene *scene, int picture);

#endif
