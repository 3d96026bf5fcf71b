#include "fit/render/planes_file.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/render/exr.h"

#define TEXT_NAME "goniod"
#define NOISE_NAME "noise.varY"
#define LAYERS_MAX 16

struct layers { /* of planes to be written: extras by layer of their pixel */
    const struct planes *planes;
    int n;       /* layers in all, with layer 0 */
    size_t next; /* the first extra of the row to come */
    char (*channel)[EXR_NAME_MAX];
};

/* Paints beyond the first in the pixel of most paints. */
static int count_layers(const struct planes *p) {
    int most = 0, here = 0;
    for (size_t i = 0; i < p->n_extra; i++) {
        bool same = i > 0 && p->extra[i].pixel == p->extra[i - 1].pixel;
        here = same ? here + (p->extra[i].paint != p->extra[i - 1].paint) : 1;
        most = here > most ? here : most;
    }
    return 1 + most;
}

static int channels_of_layers(const struct planes *p, int layers) {
    return layers * (1 + 3 * p->n_sets);
}

static int channels_without_noise(const struct planes *p, int layers) {
    return channels_of_layers(p, layers) + (planes_have_indirect(p) ? p->n_sets * BANDS : 0);
}

static int channels_of(const struct planes *p, int layers) {
    return channels_without_noise(p, layers) + (p->noise != NULL);
}

static void name_indirect(int set, int band, char name[EXR_NAME_MAX]) {
    snprintf(name, EXR_NAME_MAX, "light%d.indirect.%dnm", set, band_nm(band));
}

static void name_channels(struct layers *l) {
    for (int layer = 0, i = 0; layer < l->n; layer++) {
        snprintf(l->channel[i++], EXR_NAME_MAX, "layer%d.paint", layer);
        for (int j = 0; j < 3 * l->planes->n_sets; j++) {
            snprintf(l->channel[i++], EXR_NAME_MAX, "layer%d.light%d.%c", layer, j / 3, "abc"[j % 3]);
        }
    }
    int first = channels_of_layers(l->planes, l->n);
    int last = channels_without_noise(l->planes, l->n);
    for (int i = first; i < last; i++) {
        name_indirect((i - first) / BANDS, (i - first) % BANDS, l->channel[i]);
    }
    if (l->planes->noise) {
        snprintf(l->channel[last], EXR_NAME_MAX, NOISE_NAME);
    }
}

static void fill_first(const struct planes *p, size_t at, int width, float *const *row) {
    for (int x = 0; x < width; x++) {
        row[0][x] = p->paint[at + (size_t)x];
    }
    for (int j = 0; j < p->n_sets; j++) {
        const double *plane[3] = {p->set[j].a, p->set[j].b, p->set[j].c};
        for (int k = 0; k < 3; k++) {
            for (int x = 0; x < width; x++) {
                row[1 + 3 * j + k][x] = plane[k] ? (float)plane[k][at + (size_t)x] : 0;
            }
        }
    }
}

static void fill_indirect(const struct planes *p, size_t at, int width, float *const *row) {
    for (int j = 0; j < p->n_sets; j++) {
        for (int i = 0; i < width * BANDS; i++) {
            row[j * BANDS + i % BANDS][i / BANDS] = p->set[j].indirect[at * BANDS + (size_t)i];
        }
    }
}

static void fill_row(void *arg, int y, float *const *row) {
    struct layers *l = arg;
    const struct planes *p = l->planes;
    int width = p->width, each = 1 + 3 * p->n_sets, layer = 0;
    size_t at = (size_t)y * (size_t)width;
    fill_first(p, at, width, row);
    if (planes_have_indirect(p)) {
        fill_indirect(p, at, width, row + channels_of_layers(p, l->n));
    }
    for (int x = 0; x < width && p->noise; x++) {
        row[channels_without_noise(p, l->n)][x] = (float)p->noise[at + (size_t)x];
    }
    for (int i = each; i < channels_of_layers(p, l->n); i++) {
        for (int x = 0; x < width; x++) {
            row[i][x] = i % each == 0 ? -1 : 0;
        }
    }
    for (; l->next < p->n_extra && p->extra[l->next].pixel < at + (size_t)width; l->next++) {
        const struct planes_extra *x = &p->extra[l->next];
        layer = l->next == 0 || x[-1].pixel != x->pixel ? 1 : layer + (x[-1].paint != x->paint);
        float *const *own = row + layer * each;
        size_t column = x->pixel - at;
        own[0][column] = x->paint;
        own[1 + 3 * x->set][column] = (float)x->abc.a;
        own[2 + 3 * x->set][column] = (float)x->abc.b;
        own[3 + 3 * x->set][column] = (float)x->abc.c;
    }
}

static json_t *numbers(const double *value) {
    json_t *json = json_array();
    for (int k = 0; k < BANDS; k++) {
        json_array_append_new(json, json_real(value[k]));
    }
    return json;
}

static json_t *recolour_json(const struct scene *scene) {
    const struct scene_image *m = &scene->image;
    json_t *paints = json_array(), *lights = json_array(), *spds = json_array();
    for (int i = 0; i < scene->n_paints; i++) {
        json_array_append_new(
            paints, json_pack("{s:s,s:o}", "name", scene->paint[i].name, "s", numbers(scene->paint[i].s)));
    }
    for (int i = 0; i < scene->n_lights; i++) {
        json_array_append_new(
            lights, json_pack("{s:i,s:f}", "spd", scene->light[i].spd, "share", scene->light[i].share));
    }
    for (int i = 0; i < scene->n_spds; i++) {
        const struct spd *spd = &scene->spd[i];
        json_array_append_new(spds, json_pack("{s:s,s:s,s:o}", "name", spd->name, "sha256", spd->sha256,
                                              "power", numbers(spd->power)));
    }
    return json_pack("{s:s,s:o,s:o,s:o,s:{s:i,s:i,s:i,s:i,s:f}}", "scene", scene->file, "paints", paints,
                     "lights", lights, "spds", spds, "image", "bits", m->bits, "observer", m->observer,
                     "space", m->space, "adaptation", m->adaptation, "exposure", m->exposure);
}

int planes_save(const char *path, const struct scene *scene, const struct planes *planes, json_t *origin,
                struct err *e) {
    struct layers layers = {.planes = planes, .n = count_layers(planes)};
    int channels = channels_of(planes, layers.n);
    json_t *whole = json_copy(origin);
    if (layers.n > LAYERS_MAX || channels > EXR_CHANNELS_MAX) {
        json_decref(whole);
        return err_set(e, ERR_RANGE,
                       "%s: a pixel shows %d paints in %d lights; that is more than a file of planes holds",
                       path, layers.n, planes->n_sets);
    }
    layers.channel = malloc((size_t)channels * sizeof *layers.channel);
    json_object_set_new(whole, "recolour", recolour_json(scene));
    char *text = json_dumps(whole, JSON_COMPACT | JSON_REAL_PRECISION(17));
    int status = text && layers.channel ? 0 : err_set(e, ERR_NOMEM, "no memory for %s", path);
    if (!status) {
        name_channels(&layers);
        struct exr_text origin_text = {TEXT_NAME, text};
        struct exr_form form = {.width = planes->width,
                                .height = planes->height,
                                .n_channels = channels,
                                .n_texts = 1,
                                .channel = (const char(*)[EXR_NAME_MAX])layers.channel,
                                .text = &origin_text,
                                .fill = fill_row,
                                .arg = &layers};
        status = exr_save(path, &form, e);
    }
    free(text);
    free(layers.channel);
    json_decref(whole);
    return status;
}

static bool take_numbers(const json_t *json, double *value) {
    bool good = json_array_size(json) == BANDS;
    for (size_t k = 0; k < BANDS && good; k++) {
        value[k] = json_number_value(json_array_get(json, k));
    }
    return good;
}

static void take_text(char *out, size_t size, const json_t *json, const char *key) {
    const char *text = json_string_value(json_object_get(json, key));
    snprintf(out, size, "%s", text ? text : "");
}

static bool take_lists(struct scene *scene, const json_t *json) {
    const json_t *paints = json_object_get(json, "paints"), *spds = json_object_get(json, "spds");
    const json_t *lights = json_object_get(json, "lights");
    size_t n_paints = json_array_size(paints), n_spds = json_array_size(spds),
           n_lights = json_array_size(lights);
    bool good = n_paints <= SCENE_PAINTS && n_spds <= SCENE_LIGHTS && n_lights <= SCENE_LIGHTS;
    for (size_t i = 0; i < n_paints && good; i++) {
        const json_t *one = json_array_get(paints, i);
        take_text(scene->paint[i].name, sizeof scene->paint[i].name, one, "name");
        good = take_numbers(json_object_get(one, "s"), scene->paint[i].s);
        scene->n_paints++;
    }
    for (size_t i = 0; i < n_spds && good; i++) {
        const json_t *one = json_array_get(spds, i);
        take_text(scene->spd[i].name, sizeof scene->spd[i].name, one, "name");
        take_text(scene->spd[i].sha256, sizeof scene->spd[i].sha256, one, "sha256");
        good = take_numbers(json_object_get(one, "power"), scene->spd[i].power);
        scene->n_spds++;
    }
    for (size_t i = 0; i < n_lights && good; i++) {
        const json_t *one = json_array_get(lights, i);
        struct light *light = &scene->light[scene->n_lights++];
        light->spd = (int)json_integer_value(json_object_get(one, "spd"));
        light->share = json_number_value(json_object_get(one, "share"));
        good = light->spd >= 0 && light->spd < scene->n_spds;
        if (good) {
            memcpy(light->spd_name, scene->spd[light->spd].name, sizeof light->spd_name);
        }
    }
    return good;
}

static bool take_image(struct scene *scene, json_t *json) {
    struct scene_image *m = &scene->image;
    const char *file = "";
    bool good = json_unpack(json, "{s:s,s:{s:i,s:i,s:i,s:i,s:F}}", "scene", &file, "image", "bits", &m->bits,
                            "observer", &m->observer, "space", &m->space, "adaptation", &m->adaptation,
                            "exposure", &m->exposure) == 0;
    snprintf(scene->file, sizeof scene->file, "%s", file);
    snprintf(scene->folder, sizeof scene->folder, ".");
    scene->n_pictures = 1;
    return good && (m->bits == 8 || m->bits == 16) && m->observer >= 0 && m->observer < COLOUR_OBSERVERS &&
           m->space >= 0 && m->space < COLOUR_SPACES && m->adaptation >= 0 &&
           m->adaptation < COLOUR_ADAPTATIONS;
}

struct stored { /* the channels of a file, by what they hold */
    int n;      /* layers */
    const float *paint[LAYERS_MAX], *abc[LAYERS_MAX][PLANES_SETS][3];
};

static bool find_channels(const struct exr_image *image, int sets, struct stored *stored) {
    bool whole = true;
    for (stored->n = 0; stored->n < LAYERS_MAX; stored->n++) {
        char name[EXR_NAME_MAX];
        snprintf(name, sizeof name, "layer%d.paint", stored->n);
        if (!(stored->paint[stored->n] = exr_plane(image, name))) {
            break;
        }
        for (int j = 0; j < 3 * sets; j++) {
            snprintf(name, sizeof name, "layer%d.light%d.%c", stored->n, j / 3, "abc"[j % 3]);
            stored->abc[stored->n][j / 3][j % 3] = exr_plane(image, name);
            whole = whole && stored->abc[stored->n][j / 3][j % 3];
        }
    }
    return whole && stored->n > 0;
}

static int take_pixel(struct planes *p, const struct stored *stored, size_t i, int n_paints, struct err *e) {
    int status = 0;
    for (int layer = 0; layer < stored->n && !status; layer++) {
        float paint = stored->paint[layer][i];
        for (int j = 0; j < p->n_sets && paint >= 0 && paint < (float)n_paints && !status; j++) {
            const float *const *abc = stored->abc[layer][j];
            struct planes_extra x = {
                (uint32_t)i, (int16_t)paint, (int16_t)j, {abc[0][i], abc[1][i], abc[2][i]}};
            if (layer > 0) {
                status = planes_add_extra(p, &x, 1, e);
                continue;
            }
            p->paint[i] = x.paint;
            p->set[j].a[i] = x.abc.a;
            p->set[j].b[i] = x.abc.b;
            p->set[j].c[i] = x.abc.c;
        }
    }
    return status;
}

/* Nothing, or all of it. */
static int take_indirect(const char *path, const struct exr_image *image, struct planes *p, struct err *e) {
    char name[EXR_NAME_MAX];
    name_indirect(0, 0, name);
    if (p->n_sets == 0 || !exr_plane(image, name)) {
        return 0;
    }
    int status = planes_add_indirect(p, e);
    size_t n = (size_t)p->width * (size_t)p->height;
    for (int i = 0; i < p->n_sets * BANDS && !status; i++) {
        name_indirect(i / BANDS, i % BANDS, name);
        const float *plane = exr_plane(image, name);
        if (!plane) {
            return err_set(e, ERR_INPUT, "%s lacks the channel %s", path, name);
        }
        for (size_t pixel = 0; pixel < n; pixel++) {
            p->set[i / BANDS].indirect[pixel * BANDS + (size_t)(i % BANDS)] = plane[pixel];
        }
    }
    return status;
}

static int take_noise(const struct exr_image *image, struct planes *p, struct err *e) {
    const float *noise = exr_plane(image, NOISE_NAME);
    int status = noise ? planes_add_noise(p, e) : 0;
    for (size_t i = 0; i < (size_t)p->width * (size_t)p->height && noise && !status; i++) {
        p->noise[i] = noise[i];
    }
    return status;
}

static int take_planes(const char *path, const struct exr_image *image, const struct scene *scene,
                       struct planes *planes, struct err *e) {
    struct stored stored;
    if (!find_channels(image, scene->n_spds, &stored)) {
        return err_set(e, ERR_INPUT, "%s lacks channels that its text promises", path);
    }
    int status = planes_make(planes, image->width, image->height, scene->n_spds, true, true, e);
    size_t n = (size_t)image->width * (size_t)image->height;
    for (size_t i = 0; i < n && !status; i++) {
        status = take_pixel(planes, &stored, i, scene->n_paints, e);
    }
    status = status ? status : take_noise(image, planes, e);
    return status ? status : take_indirect(path, image, planes, e);
}

int planes_load(const char *path, struct scene **scene, struct planes *planes, json_t **origin,
                struct err *e) {
    struct exr_image image;
    int status = exr_load(path, TEXT_NAME, &image, e);
    if (status) {
        return status;
    }
    *origin = image.text ? json_loads(image.text, 0, NULL) : NULL;
    json_t *recolour = json_object_get(*origin, "recolour");
    *scene = calloc(1, sizeof **scene);
    *planes = (struct planes){0};
    if (!*scene) {
        status = err_set(e, ERR_NOMEM, "no memory for a scene");
    } else if (!recolour || !take_image(*scene, recolour) || !take_lists(*scene, recolour)) {
        status =
            err_set(e, ERR_INPUT, "%s holds no planes of goniorender; write them with render --planes", path);
    } else {
        (*scene)->image.width = image.width;
        (*scene)->image.height = image.height;
        status = take_planes(path, &image, *scene, planes, e);
    }
    if (status) {
        planes_free(planes);
        scene_free(*scene);
        json_decref(*origin);
        *scene = NULL;
        *origin = NULL;
    } else {
        json_object_del(*origin, "recolour");
    }
    exr_free(&image);
    return status;
}
