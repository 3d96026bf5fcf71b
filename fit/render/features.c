#include "fit/render/features.h"

#include <stdarg.h>

#include "fit/render/mesh.h"
#include "proto/units.h"

static const char *const names[FEATURES] = {
    [FEATURE_LIGHTS] = "lights without power",
    [FEATURE_SPECULAR] = "specular",
    [FEATURE_LOBE_TAIL] = "tail of the lobe",
    [FEATURE_SIGMA] = "diffuse roughness",
    [FEATURE_RELATIVES] = "heavy tail, second lobe, transmission",
    [FEATURE_EACH_DIRECTION] = "half vectors of each sample",
    [FEATURE_SHADOW_RAYS] = "shadow rays",
    [FEATURE_WAVELENGTHS] = "sums over wavelengths",
    [FEATURE_INTERREFLECTION] = "interreflection",
    [FEATURE_RANDOM] = "random samples",
    [FEATURE_FACETS] = "facet sampling",
    [FEATURE_MESHES] = "Embree",
    [FEATURE_EACH_PICTURE] = "camera rays of each picture",
};

const char *feature_name(enum feature feature) {
    return names[feature];
}

static void decide(struct features *f, enum feature feature, bool kept, double bound, const char *format, ...)
    __attribute__((format(printf, 5, 6)));

static void decide(struct features *f, enum feature feature, bool kept, double bound, const char *format,
                   ...) {
    struct feature_line *line = &f->line[feature];
    va_list arguments;
    line->kept = kept;
    line->bound = kept ? 0 : bound;
    va_start(arguments, format);
    vsnprintf(line->reason, sizeof line->reason, format, arguments);
    va_end(arguments);
}

static int lights_with_extent(const struct scene *scene) {
    int n = 0;
    for (int i = 0; i < scene->n_lights; i++) {
        n += light_has_extent(&scene->light[i]) && scene->light[i].share > 0;
    }
    return n;
}

static bool parallel(const struct scene *scene) {
    return scene->camera.kind == CAMERA_ORTHOGRAPHIC && lights_with_extent(scene) == 0;
}

static void decide_lights(const struct scene *scene, struct features *f) {
    int dark = 0;
    for (int i = 0; i < scene->n_lights; i++) {
        dark += scene->light[i].share == 0;
    }
    decide(f, FEATURE_LIGHTS, dark == 0, 0, dark ? "%d of weight 0" : "all %d shine",
           dark ? dark : scene->n_lights);
}

/* cos_i G / (cos_i cos_r) <= 2 / cos^2 theta_Q (reflectance.h: the merged visibility), so the lobe of this paint in
 * this light is nowhere above this. */
static double lobe_peak(const struct scene *scene, const struct paint *paint, const struct light *light) {
    double height = paint->shade.beta_prime + paint->shade.beta_prime_2;
    if (height == 0 || light->share == 0) {
        return 0;
    }
    if (!parallel(scene)) {
        return INFINITY; /* some direction may graze */
    }
    struct shade_half half =
        shade_half(&paint->shade, light->direction, vec3_scale(scene->camera.forward, -1));
    double peak = light->share * height * half.fresnel * 2 / half.cos2_q;
    return half.cos2_q > 0 ? peak : INFINITY;
}

static double highest_peak(const struct scene *scene) {
    double highest = 0;
    for (int p = 0; p < scene->n_paints; p++) {
        double sum = 0;
        for (int i = 0; i < scene->n_lights; i++) {
            sum += lobe_peak(scene, &scene->paint[p], &scene->light[i]);
        }
        highest = fmax(highest, sum);
    }
    return highest;
}

/* phi^2 at which D of the paint, over its height at 0, has fallen below `part`. */
static double end_of_lobe(const struct shade_paint *p, double part) {
    double first =
        p->tail > 0 ? expm1(-p->tail * log(part)) / (p->tail * p->tail_strength) : -log(part) / p->exponent;
    return p->beta_prime_2 > 0 ? fmax(first, -log(part) / p->exponent_2) : first;
}

double features_lobe_cut(const struct scene *scene, const struct paint *paint, const struct light *light) {
    double peak = lobe_peak(scene, paint, light), tolerance = FEATURES_TOLERANCE / scene->n_lights;
    if (peak <= tolerance) {
        return INFINITY;
    }
    double phi = sqrt(end_of_lobe(&paint->shade, tolerance / peak));
    struct vec3 h = vec3_sub(light->direction, scene->camera.forward);
    return phi < M_PI ? cos(phi) * vec3_length(h) : -INFINITY;
}

static void decide_relatives(const struct scene *scene, struct features *f) {
    int n = 0;
    for (int i = 0; i < scene->n_paints; i++) {
        const struct shade_paint *p = &scene->paint[i].shade;
        n += p->tail > 0 || p->beta_prime_2 > 0 || p->n_d > 1;
    }
    decide(f, FEATURE_RELATIVES, n > 0, 0, "%d of %d materials", n, scene->n_paints);
}

static bool beyond_one_bounce(const struct features *f) {
    return f->line[FEATURE_INTERREFLECTION].kept;
}

static bool has_lobe(const struct scene *scene) {
    bool any = false;
    for (int i = 0; i < scene->n_paints; i++) {
        any = any || scene->paint[i].shade.beta_prime > 0 || scene->paint[i].shade.beta_prime_2 > 0;
    }
    return any;
}

static void decide_lobe(const struct scene *scene, struct features *f) {
    double peak = highest_peak(scene);
    bool between = beyond_one_bounce(f) && has_lobe(scene); /* light comes from everywhere */
    if (peak <= FEATURES_TOLERANCE && !between) {
        decide(f, FEATURE_SPECULAR, false, peak, "nowhere above %.2g", peak);
        decide(f, FEATURE_LOBE_TAIL, false, 0, "no lobe");
        return;
    }
    decide(f, FEATURE_SPECULAR, true, 0, isfinite(peak) ? "up to %.3g" : "no bound on it at grazing exit",
           peak);
    if (isfinite(peak)) {
        decide(f, FEATURE_LOBE_TAIL, false, FEATURES_TOLERANCE, "where under %g", FEATURES_TOLERANCE);
    } else {
        decide(f, FEATURE_LOBE_TAIL, true, 0, "no bound on the lobe at grazing exit");
    }
}

/* The largest that the diffuse part sends anywhere from anywhere: all of it, or what Oren and Nayar add. */
static double diffuse_peak(const struct paint *p, bool all) {
    double s = 1; /* also where this S is less: planes outlive it (recolour) */
    for (int k = 0; k < BANDS; k++) {
        s = fmax(s, p->s[k]);
    }
    /* |direct| and |1 - cos(dphi) u^2| / 2 are at most 1, |side| at most 2 (shade.h). */
    double through = p->shade.inverse_t0 * p->shade.inverse_t0; /* T is at most 1 */
    double flat = all ? 1 : 1 - p->shade.c1;                    /* c1 is at most 1 */
    return through * (s * (flat + p->shade.direct + 2 * p->shade.side) + 2 * s * s * p->shade.inter);
}

static void decide_sigma(const struct scene *scene, struct features *f) {
    double largest = 0;
    for (int i = 0; i < scene->n_paints; i++) {
        largest = fmax(largest, diffuse_peak(&scene->paint[i], false));
    }
    if (largest <= (beyond_one_bounce(f) ? 0 : FEATURES_TOLERANCE)) {
        decide(f, FEATURE_SIGMA, false, largest, "nowhere above %.2g", largest);
    } else {
        decide(f, FEATURE_SIGMA, true, 0, "up to %.3g", largest);
    }
}

static void decide_shadows(const struct scene *scene, struct features *f) {
    bool convex = true;
    for (int i = 0; i < scene->n_shapes; i++) {
        convex = convex && shape_is_convex(&scene->shape[i]);
    }
    if (scene->n_shapes <= 1 && convex) {
        decide(f, FEATURE_SHADOW_RAYS, false, 0, "%d convex shape", scene->n_shapes);
    } else {
        decide(f, FEATURE_SHADOW_RAYS, true, 0, "%d shapes%s", scene->n_shapes,
               convex ? "" : ", not all convex");
    }
}

/* At most so much of what a point of the shape sees, cosines counted, is a surface: the other shapes by the spheres around
 * them, its own other parts. */
static double seen_surfaces(const struct scene *scene, int shape) {
    const struct shape *s = &scene->shape[shape];
    double sum = 0;
    if (s->kind == SHAPE_FOLD) { /* of an endless fold, at its edge */
        sum = (1 + cos(rad_from_deg(s->fold.angle_deg))) / 2;
    } else if (!shape_is_convex(s) && s->kind != SHAPE_RECTANGLE) { /* a relief is seen where its plane is */
        return 1;
    }
    for (int i = 0; i < scene->n_shapes; i++) {
        const struct shape *other = &scene->shape[i];
        double apart = vec3_length(vec3_sub(other->frame.at, s->frame.at)) - shape_reach_mm(s);
        double part = shape_reach_mm(other) / apart;
        sum += i == shape ? 0 : apart > 0 && part < 1 ? part * part : 1;
    }
    return fmin(sum, 1);
}

static void decide_interreflection(const struct scene *scene, struct features *f) {
    double seen = 0, highest = 0;
    for (int i = 0; i < scene->n_shapes; i++) {
        seen = fmax(seen, seen_surfaces(scene, i));
    }
    for (int i = 0; i < scene->n_paints; i++) {
        highest = fmax(highest, diffuse_peak(&scene->paint[i], true));
    }
    /* Light of at most `highest` from `seen` of the half space, and from there again: a geometric series. */
    double again = highest * seen, bound = again < 1 ? highest * again / (1 - again) : INFINITY;
    if (scene->image.bounces <= 1) {
        decide(f, FEATURE_INTERREFLECTION, false, 0, "one bounce");
    } else if (seen == 0) {
        decide(f, FEATURE_INTERREFLECTION, false, 0, "no surface sees another");
    } else if (bound <= FEATURES_TOLERANCE && !has_lobe(scene)) {
        decide(f, FEATURE_INTERREFLECTION, false, bound, "nowhere above %.2g", bound);
    } else {
        decide(f, FEATURE_INTERREFLECTION, true, 0,
               "%d bounces; up to %.2g of what a surface sees is another", scene->image.bounces, seen);
    }
}

static void decide_wavelengths(struct features *f) {
    if (beyond_one_bounce(f)) {
        decide(f, FEATURE_WAVELENGTHS, true, 0, "products of spectra");
    } else {
        decide(f, FEATURE_WAVELENGTHS, false, 1e-12, "one bounce: a 3x3 matrix for each paint and light");
    }
}

static bool shows_in(const struct scene *scene, int shape, int paint) {
    for (int k = 0; k < scene->shape[shape].n_materials; k++) {
        if (scene->shape[shape].paint_of[k] == paint) {
            return true;
        }
    }
    return false;
}

struct features_facets features_facets(const struct scene *scene, int paint, int light) {
    const struct shade_paint *p = &scene->paint[paint].shade;
    const struct light *l = &scene->light[light];
    struct features_facets f = {.size_mm = light_size_mm(l), .distance_mm = INFINITY};
    double exponent = fmax(p->beta_prime > 0 ? p->exponent : 0, p->beta_prime_2 > 0 ? p->exponent_2 : 0);
    f.gamma = exponent > 0 ? sqrt(M_LN2 / exponent) : INFINITY;
    for (int i = 0; i < scene->n_shapes; i++) {
        if (shows_in(scene, i, paint)) {
            struct vec3 middle = {l->at_mm[0], l->at_mm[1], l->at_mm[2]};
            f.distance_mm = fmin(f.distance_mm, shape_distance_mm(&scene->shape[i], middle));
        }
    }
    f.width_mm = 4 * f.gamma * f.distance_mm;
    bool glossy = exponent > 0 && isfinite(f.distance_mm);
    f.drawn = glossy && (l->kind == LIGHT_ENVIRONMENT || f.width_mm < f.size_mm);
    return f;
}

static void decide_random(const struct scene *scene, struct features *f) {
    int extended = lights_with_extent(scene);
    decide(f, FEATURE_RANDOM, extended > 0 || beyond_one_bounce(f), 0, "%d lights with extent%s", extended,
           beyond_one_bounce(f) ? ", several bounces" : "");
}

static void decide_facets(const struct scene *scene, struct features *f) {
    int drawn = 0, all = 0;
    for (int i = 0; i < scene->n_paints * scene->n_lights; i++) {
        const struct light *light = &scene->light[i % scene->n_lights];
        if (light_has_extent(light) && light->share > 0) {
            drawn += features_facets(scene, i / scene->n_lights, i % scene->n_lights).drawn;
            all++;
        }
    }
    if (all == 0) {
        decide(f, FEATURE_FACETS, false, 0, "no light with extent");
    } else {
        decide(f, FEATURE_FACETS, drawn > 0, 0, "lobe narrower than the light for %d of %d", drawn, all);
    }
}

void features_print_facets(const struct scene *scene, FILE *out) {
    for (int i = 0; i < scene->n_paints * scene->n_lights; i++) {
        int light = i % scene->n_lights, paint = i / scene->n_lights;
        const struct light *l = &scene->light[light];
        struct features_facets f = features_facets(scene, paint, light);
        if (!light_has_extent(l) || l->share == 0 || isinf(f.gamma) || isinf(f.distance_mm)) {
            continue;
        }
        fprintf(out, "gloss:    %s in light %d (%s): drawn by ", scene->paint[paint].name, light + 1,
                light_name(l->kind));
        if (l->kind == LIGHT_ENVIRONMENT) {
            fputs("light and facets, the light is all around\n", out);
        } else {
            fprintf(out, "%s, 4 gamma x %.3g mm = %.3g mm %s its %.3g mm\n",
                    f.drawn ? "light and facets" : "light", f.distance_mm, f.width_mm,
                    f.drawn ? "<" : ">=", f.size_mm);
        }
    }
}

static void decide_meshes(const struct scene *scene, struct features *f) {
    size_t triangles = 0;
    int meshes = 0;
    for (int i = 0; i < scene->n_shapes; i++) {
        const struct mesh *mesh = shape_mesh(&scene->shape[i]);
        triangles += mesh ? mesh->n_triangles : 0;
        meshes += mesh != NULL;
    }
    if (meshes) {
        decide(f, FEATURE_MESHES, true, 0, "%zu triangles in %d mesh%s", triangles, meshes,
               meshes > 1 ? "es" : "");
    } else {
        decide(f, FEATURE_MESHES, false, 0, "no mesh: its library is not loaded");
    }
}

static void decide_pictures(const struct scene *scene, struct features *f) {
    const struct scene_image *image = &scene->image;
    size_t rays = (size_t)image->width * (size_t)image->height * (size_t)(image->grid * image->grid);
    double mib = (double)rays * sizeof(struct hit) / (1 << 20);
    if (scene->n_pictures == 1) {
        decide(f, FEATURE_EACH_PICTURE, true, 0, "one picture");
    } else if (rays * sizeof(struct hit) > FEATURES_HITS_MAX) {
        decide(f, FEATURE_EACH_PICTURE, true, 0, "their hits would take %.0f MiB", mib);
    } else {
        decide(f, FEATURE_EACH_PICTURE, false, 0, "%d pictures from the hits of one, %.3g MiB",
               scene->n_pictures, mib);
    }
}

static void keep_all(struct features *f) {
    for (int i = 0; i < FEATURES; i++) {
        if (i != FEATURE_MESHES) {
            decide(f, (enum feature)i, true, 0, "asked for");
        }
    }
}

void features_find(const struct scene *scene, bool all, struct features *features) {
    decide_meshes(scene, features);
    if (all) {
        keep_all(features);
        return;
    }
    decide_interreflection(scene, features);
    decide_lights(scene, features);
    decide_lobe(scene, features);
    decide_relatives(scene, features);
    decide_sigma(scene, features);
    decide(features, FEATURE_EACH_DIRECTION, !parallel(scene), 0,
           parallel(scene)                 ? "parallel light and camera"
           : lights_with_extent(scene) > 0 ? "light from many directions"
                                           : "perspective camera");
    decide_shadows(scene, features);
    decide_wavelengths(features);
    decide_random(scene, features);
    decide_facets(scene, features);
    decide_pictures(scene, features);
}

double features_bound(const struct features *features) {
    double sum = 0;
    for (int i = 0; i < FEATURES; i++) {
        sum += features->line[i].bound;
    }
    return sum;
}

static void print_those(const struct features *features, bool kept, FILE *out) {
    bool any = false;
    for (int i = 0; i < FEATURES; i++) {
        const struct feature_line *line = &features->line[i];
        if (line->kept == kept) {
            fprintf(out, "%s%s (%s)", any ? ", " : "", names[i], line->reason);
            any = true;
        }
    }
    fputs(any ? "\n" : "nothing\n", out);
}

void features_print(const struct features *features, FILE *out) {
    fputs("left out: ", out);
    print_those(features, false, out);
    fputs("kept:     ", out);
    print_those(features, true, out);
    fprintf(out, "bound:    %.3g of the perfect diffuser's radiance, by all that is left out\n",
            features_bound(features));
}
