#include "fit/render/spread_path.h"

#include <stdlib.h>
#include <string.h>

#include "fit/render/spread_slope.h"

/* A difference quotient good to 1e-6 of the slope, in which the rounding of single precision is 1e-4 of the value. */
#define STEP 1e-3

struct pair { /* a paint moved up and down, and how far apart these are */
    struct planes up, down;
    double apart;
};

static int render_pair(const struct scene *scene, int paint, int parameter,
                       const struct render_options *options, struct pair *pair, struct err *e) {
    struct scene *moved = malloc(sizeof *moved);
    double high = 0, low = 0;
    int status = moved ? 0 : err_set(e, ERR_NOMEM, "no memory for a scene");
    *pair = (struct pair){0};
    for (int side = 0; side < 2 && !status; side++) {
        memcpy(moved, scene, sizeof *moved); /* it borrows what the shapes own */
        status = spread_move(moved, scene, paint, parameter, side ? -STEP : STEP, side ? &low : &high, e);
        status = status ? status : spread_render(moved, options, side ? &pair->down : &pair->up, e);
    }
    pair->apart = high - low;
    free(moved);
    return status;
}

static void free_pair(struct pair *pair) {
    planes_free(&pair->up);
    planes_free(&pair->down);
}

static float *take_bands(const struct pair *pair) {
    int sets = pair->up.n_sets;
    size_t n = (size_t)pair->up.width * (size_t)pair->up.height;
    float *slope = malloc(n * (size_t)sets * BANDS * sizeof *slope);
    for (size_t i = 0; i < n * (size_t)sets && slope; i++) {
        size_t from = i / (size_t)sets * BANDS, set = i % (size_t)sets;
        const float *up = pair->up.set[set].indirect + from, *down = pair->down.set[set].indirect + from;
        for (int k = 0; k < BANDS; k++) {
            slope[i * BANDS + (size_t)k] = (float)(((double)up[k] - (double)down[k]) / pair->apart);
        }
    }
    return slope;
}

void spread_path_colour(const struct spread_path *path, const struct planes *planes, size_t pixel,
                        double xyz[3]) {
    for (int j = 0; j < path->sets; j++) {
        const float *r = planes->set[j].indirect + pixel * BANDS;
        for (int k = 0; k < BANDS; k++) {
            for (int i = 0; i < 3; i++) {
                xyz[i] += (double)r[k] * path->weight[j][k][i];
            }
        }
    }
}

static float *take_colours(const struct spread_path *path, const struct pair *pair) {
    size_t n = (size_t)pair->up.width * (size_t)pair->up.height;
    float *slope = malloc(3 * n * sizeof *slope);
    for (size_t i = 0; i < n && slope; i++) {
        double up[3] = {0, 0, 0}, down[3] = {0, 0, 0};
        spread_path_colour(path, &pair->up, i, up);
        spread_path_colour(path, &pair->down, i, down);
        for (int k = 0; k < 3; k++) {
            slope[3 * i + (size_t)k] = (float)((up[k] - down[k]) / pair->apart);
        }
    }
    return slope;
}

static int take_parameter(const struct scene *scene, int paint, int parameter, const struct spread_paint *p,
                          const struct render_options *options, struct spread_path *path, struct err *e) {
    struct pair pair;
    int status = render_pair(scene, paint, parameter, options, &pair, e);
    bool by_band = parameter == MATERIAL_S || (parameter == MATERIAL_BETA_PRIME && p->beta_prime_by_band);
    if (!status && by_band) {
        int kind = parameter == MATERIAL_S ? 0 : 1;
        path->band[paint][kind] = take_bands(&pair);
        status = path->band[paint][kind] ? 0 : err_set(e, ERR_NOMEM, "no memory for slopes by bands");
    } else if (!status) {
        path->shared[paint][parameter] = take_colours(path, &pair);
        status = path->shared[paint][parameter] ? 0 : err_set(e, ERR_NOMEM, "no memory for slopes");
    }
    path->renderings += 2;
    free_pair(&pair);
    return status;
}

static void fill_weights(const struct scene *scene, struct spread_path *path) {
    enum colour_observer observer = (enum colour_observer)scene->image.observer;
    for (int j = 0; j < scene->n_spds; j++) {
        double power[BANDS];
        colour_scale_power(scene->spd[j].power, observer, power);
        for (int k = 0; k < BANDS; k++) {
            for (int i = 0; i < 3; i++) {
                path->weight[j][k][i] = power[k] * colour_cmf(observer)[k][i];
            }
        }
    }
}

int spread_path_make(const struct scene *scene, const struct spread_paint paint[SCENE_PAINTS],
                     const struct render_options *options, struct spread_path *path, struct err *e) {
    int status = 0;
    *path = (struct spread_path){.sets = scene->n_spds};
    fill_weights(scene, path);
    for (int i = 0; i < scene->n_paints * MATERIAL_PARAMETERS && !status; i++) {
        int p = i / MATERIAL_PARAMETERS, m = i % MATERIAL_PARAMETERS;
        if (paint[p].rank > 0 && (m == MATERIAL_S || paint[p].moves[m])) {
            status = take_parameter(scene, p, m, &paint[p], options, path, e);
        }
    }
    if (status) {
        spread_path_free(path);
    }
    return status;
}

void spread_path_free(struct spread_path *path) {
    for (int p = 0; p < SCENE_PAINTS; p++) {
        for (int k = 0; k < SPREAD_BAND_KINDS; k++) {
            free(path->band[p][k]);
            path->band[p][k] = NULL;
        }
        for (int m = 0; m < MATERIAL_PARAMETERS; m++) {
            free(path->shared[p][m]);
            path->shared[p][m] = NULL;
        }
    }
}

static void add_bands(const struct spread_path *path, const struct spread_paint *p, const float *slope,
                      const double *rows, double change[3][JOINT_ROWS]) {
    for (int k = 0; k < BANDS; k++) {
        double xyz[3] = {0, 0, 0};
        for (int j = 0; j < path->sets; j++) {
            for (int i = 0; i < 3; i++) {
                xyz[i] += (double)slope[j * BANDS + k] * path->weight[j][k][i];
            }
        }
        for (int i = 0; i < 3 && (xyz[0] != 0 || xyz[1] != 0 || xyz[2] != 0); i++) {
            for (int r = 0; r < p->rank; r++) {
                change[i][r] += xyz[i] * rows[k * p->rank + r];
            }
        }
    }
}

void spread_path_change(const struct spread_path *path, const struct spread_paint *p, int paint, size_t pixel,
                        double change[3][JOINT_ROWS]) {
    size_t bands = (size_t)path->sets * BANDS, each = (size_t)BANDS * (size_t)p->rank;
    for (int k = 0; k < SPREAD_BAND_KINDS; k++) {
        if (path->band[paint][k]) {
            add_bands(path, p, path->band[paint][k] + pixel * bands, p->band + (size_t)k * each, change);
        }
    }
    for (int m = 0; m < MATERIAL_PARAMETERS; m++) {
        const float *slope = path->shared[paint][m] ? path->shared[paint][m] + 3 * pixel : NULL;
        const double *row = p->shared + (size_t)m * (size_t)p->rank;
        for (int i = 0; i < 3 * p->rank && slope; i++) {
            change[i / p->rank][i % p->rank] += (double)slope[i / p->rank] * row[i % p->rank];
        }
    }
}
