#include "fit/render/scene.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/render/mesh.h"
#include "fit/render/place.h"
#include "fit/render/scene_keys.h"
#include "fit/render/sha256.h"
#include "proto/file.h"
#include "proto/spectrum.h"
#include "proto/yaml.h"

struct check { /* one scene, the places of its keys, and what is wrong */
    struct scene *scene;
    struct yaml_places places;
    struct err_list *errors;
    const struct scene_session *sessions;
    int n_sessions;
};

static void complain(struct check *c, const char *path, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

static void complain(struct check *c, const char *path, const char *format, ...) {
    const struct yaml_place *place = yaml_place_near(&c->places, path);
    va_list arguments;
    va_start(arguments, format);
    err_list_mistake(c->errors, c->scene->file, place ? place->line : 0, place ? place->column : 0, format,
                     arguments);
    va_end(arguments);
}

/* Exactly one kind must be given; its index, or -1. */
static int only_kind(struct check *c, const char *path, const bool *given, int kinds) {
    int found = -1, n = 0;
    for (int i = 0; i < kinds; i++) {
        if (given[i]) {
            found = i;
            n++;
        }
    }
    if (n != 1) {
        complain(c, path, "this has %d kinds; give it one key, its kind", n);
        return -1;
    }
    return found;
}

static int read_spectrum(struct check *c, struct scene_material *m, struct estimate *estimate) {
    struct spectrum spectrum;
    struct err e = {0};
    char path[PLACE_MAX];
    place_of(path, c->scene->folder, m->spectrum);
    int status = spectrum_read_file(path, &spectrum, c->errors);
    for (int k = 0; k < BANDS && !status; k++) {
        estimate->s_lambda[k] = spectrum.value[k];
    }
    if (!status && (status = sha256_of_file(path, m->spectrum_sha256, &e))) {
        err_list_add(c->errors, &e);
    }
    return status;
}

static void material_of_parameters(struct check *c, const char *at, struct scene_material *m,
                                   struct paint *paint) {
    struct estimate *x = &paint->estimate;
    snprintf(paint->source, sizeof paint->source, "parameters");
    snprintf(x->model, sizeof x->model, "%s", scene_models[m->model]);
    x->value[MATERIAL_SIGMA] = m->sigma;
    x->value[MATERIAL_GAMMA] = m->gamma;
    x->value[MATERIAL_BETA_PRIME] = m->beta_prime;
    x->value[MATERIAL_N] = m->n;
    x->value[MATERIAL_EXTRA_1] = strcmp(x->model, "heavy-tail") == 0    ? m->tail
                                 : strcmp(x->model, "transmitted") == 0 ? m->n_d
                                                                        : m->gamma_2;
    x->value[MATERIAL_EXTRA_2] = m->beta_prime_2;
    x->kappa = m->kappa;
    x->converged = x->has_spectrum = true;
    for (int k = 0; k < BANDS; k++) {
        x->s_lambda[k] = m->uniform;
    }
    if (m->has_uniform == (m->spectrum[0] != 0)) {
        complain(c, at, "material %s needs a session, or a spectrum, or `uniform`: one of them", m->name);
    } else if (m->has_uniform || read_spectrum(c, m, x) == 0) {
        struct err e = {0};
        if (paint_prepare(paint, &e)) {
            complain(c, at, "%.400s", e.text);
        }
    }
}

static const char *instead(const struct check *c, const char *material) {
    for (int i = 0; i < c->n_sessions; i++) {
        if (strcmp(c->sessions[i].material, material) == 0) {
            return c->sessions[i].path;
        }
    }
    return NULL;
}

static void material_of_session(struct check *c, int i) {
    const struct scene_material *m = &c->scene->material[i];
    const char *other = instead(c, m->name);
    char at[96], path[PLACE_MAX];
    struct err e = {0};
    snprintf(at, sizeof at, "materials[%d].session", i);
    if (m->spectrum[0] || m->has_uniform) {
        complain(c, at, "material %s has a session and a spectrum; which of them is it?", m->name);
    }
    if (other) {
        snprintf(path, sizeof path, "%s", other);
    } else {
        place_of(path, c->scene->folder, m->session);
    }
    if (paint_from_session(&c->scene->paint[i], path, &e)) {
        complain(c, at, "%.400s", e.text);
    }
}

static void check_material(struct check *c, int i) {
    struct scene_material *m = &c->scene->material[i];
    struct paint *paint = &c->scene->paint[i];
    char at[96];
    snprintf(at, sizeof at, "materials[%d].name", i);
    memcpy(paint->name, m->name, sizeof paint->name);
    for (int k = 0; k < i; k++) {
        if (strcmp(c->scene->material[k].name, m->name) == 0) {
            complain(c, at, "there is a material %s already", m->name);
        }
    }
    if (m->session[0]) {
        material_of_session(c, i);
    } else {
        material_of_parameters(c, at, m, paint);
    }
}

/* A wish that meets no material is a slip of the pen. */
static void check_sessions(struct check *c) {
    for (int i = 0; i < c->n_sessions; i++) {
        bool met = false;
        for (int k = 0; k < c->scene->n_paints; k++) {
            const struct scene_material *m = &c->scene->material[k];
            met = met || (m->session[0] && strcmp(m->name, c->sessions[i].material) == 0);
        }
        if (!met) {
            complain(c, "materials",
                     "--session names the material %s; there is none of that name with a session",
                     c->sessions[i].material);
        }
    }
}

static int find_paint(const struct scene *scene, const char *name) {
    for (int i = 0; i < scene->n_paints; i++) {
        if (strcmp(scene->material[i].name, name) == 0) {
            return i;
        }
    }
    return -1;
}

/* Under which of its keys a shape names its materials. */
static const char *material_place(struct check *c, int i, char *at, size_t size) {
    static const char *const keys[] = {"material", "materials", "mask"};
    const char *kind = shape_name(c->scene->shape[i].kind);
    for (int k = 0; k < 3; k++) {
        snprintf(at, size, "shapes[%d].%s.%s", i, kind, keys[k]);
        if (yaml_place_find(&c->places, at)) {
            return at;
        }
    }
    return at;
}

static bool is_written(const struct check *c, int shape, const char *key) {
    char at[96];
    snprintf(at, sizeof at, "shapes[%d].%s.%s", shape, shape_name(c->scene->shape[shape].kind), key);
    return yaml_place_find(&c->places, at) != NULL;
}

static void check_rectangle(struct check *c, int i) {
    bool material = is_written(c, i, "material"), mask = is_written(c, i, "mask");
    char at[96];
    snprintf(at, sizeof at, "shapes[%d].rectangle", i);
    if (material == mask || mask != is_written(c, i, "mask_image")) {
        complain(c, at,
                 "a rectangle needs a material, or a mask_image with the materials of its colours as `mask`");
    }
    if (is_written(c, i, "relief_mm") && !is_written(c, i, "relief")) {
        complain(c, at, "relief_mm is the height of a relief: name its picture as `relief`");
    }
}

static void check_fold(struct check *c, int i) {
    bool one = is_written(c, i, "material"), two = is_written(c, i, "materials");
    char at[96];
    snprintf(at, sizeof at, "shapes[%d].fold", i);
    if (one == two || c->scene->shape[i].n_materials != (one ? 1 : 2)) {
        complain(c, at, "a fold needs a material, or `materials` of its left and right side: [a, b]");
    }
}

/* A mesh that is painted by its file names its materials there. */
static void check_materials(struct check *c, int i) {
    struct shape *s = &c->scene->shape[i];
    const struct mesh *mesh = is_written(c, i, "material") ? NULL : shape_mesh(s);
    char at[96];
    for (int k = 0; k < s->n_materials; k++) {
        s->paint_of[k] = find_paint(c->scene, s->material[k]);
        if (s->paint_of[k] < 0 && mesh) {
            snprintf(at, sizeof at, "shapes[%d].mesh.file", i);
            complain(c, at,
                     "there is no material '%s' under `materials`, which usemtl names in line %d of %s",
                     s->material[k], mesh->material[k].line, s->mesh.file);
        } else if (s->paint_of[k] < 0) {
            complain(c, material_place(c, i, at, sizeof at), "there is no material '%s' under `materials`",
                     s->material[k]);
        }
    }
}

static void check_shape(struct check *c, int i) {
    struct shape *s = &c->scene->shape[i];
    struct err e = {0};
    char at[96];
    snprintf(at, sizeof at, "shapes[%d]", i);
    int kind = only_kind(c, at, s->given, SHAPE_KINDS);
    if (kind < 0) {
        return;
    }
    s->kind = (enum shape_kind)kind;
    snprintf(at, sizeof at, "shapes[%d].%s", i, shape_name(s->kind));
    if (shape_prepare(s, c->scene->folder, c->errors, &e) && e.code) { /* a mesh may name materials, too */
        complain(c, at, "%.400s", e.text);
    }
    check_materials(c, i);
    if (s->kind == SHAPE_RECTANGLE) {
        check_rectangle(c, i);
    } else if (s->kind == SHAPE_FOLD) {
        check_fold(c, i);
    }
}

static void check_spd(struct check *c, const char *at, struct light *light) {
    struct scene *scene = c->scene;
    struct err e = {0};
    for (light->spd = 0; light->spd < scene->n_spds; light->spd++) {
        if (strcmp(scene->spd[light->spd].name, light->spd_name) == 0) {
            return;
        }
    }
    if (spd_find(&scene->spd[scene->n_spds++], light->spd_name, scene->folder, c->errors, &e) && e.code) {
        complain(c, at, "%.400s", e.text);
    }
}

static void check_light(struct check *c, int i) {
    struct scene *scene = c->scene;
    struct light *light = &scene->light[i];
    struct err e = {0};
    char at[96];
    snprintf(at, sizeof at, "lights[%d]", i);
    int kind = only_kind(c, at, light->given, LIGHT_KINDS);
    if (kind < 0) {
        light->weight = 1; /* that it gives no light is not its mistake */
        return;
    }
    light->kind = (enum light_kind)kind;
    if (light_prepare(light, scene->folder, &e)) {
        snprintf(at, sizeof at, "lights[%d].%s", i, light_name(light->kind));
        complain(c, at, "%.400s", e.text);
    }
    snprintf(at, sizeof at, "lights[%d].%s.spd", i, light_name(light->kind));
    check_spd(c, at, light);
    if (light->n_theta > 1 && scene->n_pictures > 1 && light->n_theta != scene->n_pictures) {
        snprintf(at, sizeof at, "lights[%d].beam.theta_deg", i);
        complain(c, at, "%d angles here and %d at another light; a series needs as many at each, or one",
                 light->n_theta, scene->n_pictures);
    }
    scene->n_pictures = light->n_theta > scene->n_pictures ? light->n_theta : scene->n_pictures;
}

static void share_light(struct check *c) {
    struct scene *scene = c->scene;
    double sum = 0;
    for (int i = 0; i < scene->n_lights; i++) {
        sum += scene->light[i].weight;
    }
    if (scene->n_lights > 0 && !(sum > 0)) {
        complain(c, "lights", "all lights have weight 0; then there is nothing to see");
    }
    for (int i = 0; i < scene->n_lights; i++) {
        scene->light[i].share = scene->light[i].weight / sum;
    }
}

static void check_camera(struct check *c) {
    struct scene *scene = c->scene;
    struct err e = {0};
    double reach = 0;
    int kind = only_kind(c, "camera", scene->camera.given, CAMERA_KINDS);
    for (int i = 0; i < scene->n_shapes && kind >= 0; i++) {
        const struct shape *s = &scene->shape[i];
        double at[3] = {s->frame.at.x - scene->camera.look_at_mm[0],
                        s->frame.at.y - scene->camera.look_at_mm[1],
                        s->frame.at.z - scene->camera.look_at_mm[2]};
        reach = fmax(reach, sqrt(at[0] * at[0] + at[1] * at[1] + at[2] * at[2]) + shape_reach_mm(s));
    }
    scene->camera.kind = (enum camera_kind)(kind < 0 ? 0 : kind);
    if (kind >= 0 && camera_prepare(&scene->camera, scene->image.width, scene->image.height, reach + 1, &e)) {
        complain(c, "camera", "%.400s", e.text);
    }
}

static void check_scene(struct check *c) {
    struct scene *scene = c->scene;
    scene->n_pictures = 1;
    if (scene->image.bits != 8 && scene->image.bits != 16) {
        complain(c, "image.bits", "a channel has 8 or 16 bits, not %d", scene->image.bits);
    }
    for (int i = 0; i < scene->n_paints; i++) {
        check_material(c, i);
    }
    check_sessions(c);
    for (int i = 0; i < scene->n_shapes; i++) {
        check_shape(c, i);
    }
    for (int i = 0; i < scene->n_lights; i++) {
        check_light(c, i);
    }
    share_light(c);
    check_camera(c);
}

static void set_names(struct scene *scene, const char *path) {
    const char *slash = strrchr(path, '/');
    snprintf(scene->file, sizeof scene->file, "%s", path);
    snprintf(scene->folder, sizeof scene->folder, "%.*s", slash ? (int)(slash - path) : 1,
             slash ? path : ".");
    if (slash == path) {
        snprintf(scene->folder, sizeof scene->folder, "/");
    }
}

struct scene *scene_read_text(const char *path, const char *text, size_t size,
                              const struct scene_session *sessions, int n_sessions, struct err_list *errors) {
    struct scene *scene = calloc(1, sizeof *scene);
    struct check check = {.scene = scene, .errors = errors, .sessions = sessions, .n_sessions = n_sessions};
    size_t first = errors->n;
    struct err e = {0};
    if (!scene) {
        err_set(&e, ERR_NOMEM, "no memory for a scene");
        err_list_add(errors, &e);
        return NULL;
    }
    set_names(scene, path);
    sha256_of_bytes(text, size, scene->sha256);
    if (yaml_read_text_places(path, text, size, scene_keys, scene, errors, &check.places) == 0) {
        check_scene(&check);
    }
    yaml_places_free(&check.places);
    if (errors->n > first) {
        yaml_sort_errors(errors, first);
        scene_free(scene);
        return NULL;
    }
    scene_aim(scene, 0);
    return scene;
}

struct scene *scene_read(const char *path, const struct scene_session *sessions, int n_sessions,
                         struct err_list *errors) {
    char *text = NULL;
    size_t size = 0;
    struct err e = {0};
    if (file_read(path, YAML_BYTES_MAX, &text, &size, &e)) {
        err_list_add(errors, &e);
        return NULL;
    }
    struct scene *scene = scene_read_text(path, text, size, sessions, n_sessions, errors);
    free(text);
    return scene;
}

void scene_free(struct scene *scene) {
    for (int i = 0; scene && i < scene->n_shapes; i++) {
        shape_free(&scene->shape[i]);
    }
    for (int i = 0; scene && i < scene->n_lights; i++) {
        light_free(&scene->light[i]);
    }
    free(scene);
}

void scene_aim(struct scene *scene, int picture) {
    for (int i = 0; i < scene->n_lights; i++) {
        light_aim(&scene->light[i], picture);
    }
}
