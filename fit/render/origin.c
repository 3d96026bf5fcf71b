#include "fit/render/origin.h"

#include <math.h>

#include "fit/render/scene_keys.h"

double origin_held_share(const struct scene *scene, const struct paint *paint) {
    double worst = 0;
    for (int j = 0; j < scene->n_spds; j++) {
        worst = fmax(worst, paint_held_share(paint, scene->spd[j].power,
                                             colour_cmf((enum colour_observer)scene->image.observer)));
    }
    return worst;
}

static json_t *parameters_of(const struct estimate *m, bool uncertainty) {
    json_t *json = json_object();
    for (int i = 0; i < MATERIAL_PARAMETERS; i++) {
        const char *name = material_parameter_name(m->model, i);
        double u = sqrt(m->statistical[i][i] + m->common[i][i]);
        double value = uncertainty ? u : m->value[i];
        if (name && isfinite(value)) {
            json_object_set_new(json, name, json_real(value));
        }
    }
    return json;
}

static json_t *held_bands(const struct paint *paint) {
    json_t *json = json_array();
    for (int k = 0; k < BANDS; k++) {
        if (paint->held[k]) {
            json_array_append_new(json, json_integer(band_nm(k)));
        }
    }
    return json;
}

static json_t *file_json(const char *name, const char *sha256) {
    return json_pack("{s:s,s:s}", "file", name, "sha256", sha256);
}

static void add_file(json_t *json, const char *key, const char *name, const char *sha256) {
    if (sha256[0]) {
        json_object_set_new(json, key, file_json(name, sha256));
    }
}

static json_t *material_json(const struct scene *scene, const struct paint *paint) {
    const struct scene_material *written = &scene->material[paint - scene->paint];
    json_t *json =
        json_pack("{s:s,s:s,s:s,s:o,s:f,s:o,s:f}", "name", paint->name, "source", paint->source, "model",
                  paint->estimate.model, "parameters", parameters_of(&paint->estimate, false), "kappa",
                  paint->estimate.kappa, "held_bands_nm", held_bands(paint), "held_share",
                  origin_held_share(scene, paint));
    if (paint->sha256[0]) {
        json_object_set_new(json, "sha256", json_string(paint->sha256));
        json_object_set_new(json, "u", parameters_of(&paint->estimate, true));
    }
    add_file(json, "spectrum", written->spectrum, written->spectrum_sha256);
    return json;
}

static json_t *shape_json(const struct shape *shape) {
    const struct shape_rectangle *r = &shape->rectangle;
    json_t *json = json_pack("{s:s}", "kind", shape_name(shape->kind));
    add_file(json, "mask", r->mask_file, r->mask_sha256);
    add_file(json, "relief", r->relief_file, r->relief_sha256);
    add_file(json, "mesh", shape->mesh.file, shape->mesh.sha256);
    return json;
}

/* Its spectrum, and the file it is from. */
static void set_spd(json_t *json, const struct scene *scene, const struct light *light) {
    const struct spd *spd = &scene->spd[light->spd];
    json_object_set_new(json, "spd", json_string(light->spd_name));
    json_object_del(json, "spd_sha256");
    if (spd->sha256[0]) {
        json_object_set_new(json, "spd_sha256", json_string(spd->sha256));
    }
}

static json_t *light_json(const struct scene *scene, const struct light *light) {
    json_t *json = json_pack("{s:s,s:f}", "kind", light_name(light->kind), "share", light->share);
    set_spd(json, scene, light);
    if (light->kind == LIGHT_BEAM) {
        json_object_set_new(json, "direction",
                            json_pack("[f,f,f]", light->direction.x, light->direction.y, light->direction.z));
    } else if (light->kind == LIGHT_ENVIRONMENT) {
        json_object_set_new(json, "image", json_string(light->environment.image));
        json_object_set_new(json, "sha256", json_string(light->environment.sha256));
    } else {
        json_object_set_new(json, "at_mm",
                            json_pack("[f,f,f]", light->at_mm[0], light->at_mm[1], light->at_mm[2]));
        json_object_set_new(json, "size_mm", json_real(light_size_mm(light)));
    }
    return json;
}

static json_t *features_json(const struct features *features, bool kept) {
    json_t *json = json_object();
    for (int i = 0; i < FEATURES; i++) {
        if (features->line[i].kept == kept) {
            json_object_set_new(json, feature_name((enum feature)i), json_string(features->line[i].reason));
        }
    }
    return json;
}

static void add_scene(json_t *json, const struct scene *scene) {
    json_t *materials = json_array(), *shapes = json_array(), *lights = json_array();
    for (int i = 0; i < scene->n_paints; i++) {
        json_array_append_new(materials, material_json(scene, &scene->paint[i]));
    }
    for (int i = 0; i < scene->n_shapes; i++) {
        json_array_append_new(shapes, shape_json(&scene->shape[i]));
    }
    for (int i = 0; i < scene->n_lights; i++) {
        json_array_append_new(lights, light_json(scene, &scene->light[i]));
    }
    json_object_set_new(json, "materials", materials);
    json_object_set_new(json, "shapes", shapes);
    json_object_set_new(json, "lights", lights);
    json_object_set_new(json, "grid", json_integer(scene->image.grid));
    json_object_set_new(json, "bounces", json_integer(scene->image.bounces));
    json_object_set_new(json, "energy", json_string(scene_energies[scene->image.energy]));
}

static void add_colours(json_t *json, const struct scene *scene, const struct picture *p) {
    json_object_set_new(json, "observer",
                        json_string(colour_observer_name((enum colour_observer)scene->image.observer)));
    json_object_set_new(json, "space", json_string(colour_space_name((enum colour_space)scene->image.space)));
    json_object_set_new(json, "adaptation",
                        json_string(colour_adaptation_name((enum colour_adaptation)scene->image.adaptation)));
    json_object_set_new(json, "exposure", json_real(scene->image.exposure));
    json_object_set_new(json, "clipped", json_integer((json_int_t)p->clipped));
    json_object_set_new(json, "out_of_gamut", json_integer((json_int_t)p->out_of_gamut));
    json_object_set_new(json, "max_y", json_real(p->max_y));
    json_object_set_new(json, "white", json_pack("[f,f,f]", p->white[0], p->white[1], p->white[2]));
}

static void add_work(json_t *json, const struct render_report *r) {
    json_t *counts = json_pack(
        "{s:I,s:I,s:I,s:I,s:I,s:I,s:I,s:I,s:i}", "camera_rays", (json_int_t)r->counts.camera_rays, "hits",
        (json_int_t)r->counts.hits, "shadow_rays", (json_int_t)r->counts.shadow_rays, "negative_diffuse",
        (json_int_t)r->counts.negative_diffuse, "indirect_rays", (json_int_t)r->counts.indirect_rays,
        "indirect_hits", (json_int_t)r->counts.indirect_hits, "drawn", (json_int_t)r->counts.drawn,
        "fireflies", (json_int_t)r->counts.fireflies, "rows_done", r->counts.rows_done);
    json_object_set_new(json, "left_out", features_json(&r->features, false));
    json_object_set_new(json, "kept", features_json(&r->features, true));
    json_object_set_new(json, "bound", json_real(features_bound(&r->features)));
    json_object_set_new(json, "counts", counts);
    json_object_set_new(json, "noise_y", json_real(r->noise_y));
}

json_t *origin_make(const struct scene *scene, const struct render_report *report,
                    const struct picture *picture, const char *command) {
    json_t *json =
        json_pack("{s:s,s:s,s:s,s:s,s:s}", "program", "goniorender " GONIOD_VERSION, "command", command,
                  "scene", scene->file, "scene_sha256", scene->sha256, "name", scene->name);
    if (json) {
        add_scene(json, scene);
        add_work(json, report);
        add_colours(json, scene, picture);
    }
    return json;
}

json_t *origin_recoloured(const struct scene *scene, json_t *rendered, const struct picture *picture,
                          const char *command) {
    json_t *json = json_deep_copy(rendered);
    for (int i = 0; i < scene->n_lights; i++) {
        set_spd(json_array_get(json_object_get(json, "lights"), (size_t)i), scene, &scene->light[i]);
    }
    for (int i = 0; i < scene->n_paints; i++) {
        if (scene->paint[i].sha256[0]) { /* planes know none: this one is a session's */
            json_object_set_new(json_array_get(json_object_get(json, "materials"), (size_t)i), "spectrum_of",
                                material_json(scene, &scene->paint[i]));
        }
    }
    json_object_set_new(json, "program", json_string("goniorender " GONIOD_VERSION));
    json_object_set_new(json, "command", json_string(command));
    json_object_set(json, "rendered", rendered);
    add_colours(json, scene, picture);
    return json;
}
