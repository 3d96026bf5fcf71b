#include "fit/render/spread.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/render/ciede2000.h"
#include "fit/render/crew.h"
#include "fit/render/spread_path.h"
#include "fit/render/spread_slope.h"
#include "fit/render/white.h"

struct entry { /* one paint in one set of a pixel */
    int paint, set;
    double abc[3], slope[MATERIAL_PARAMETERS][3];
};

struct work { /* one picture, shared by all threads */
    const struct scene *scene;
    struct scene first; /* the same, of one bounce: what a, b, c hold */
    const struct joint *const *joint;
    const struct render_options *options;
    struct spread *spread;
    struct spread_paint paint[SCENE_PAINTS];
    double (*change)[SPREAD_DRAWS][MATERIAL_PARAMETERS]; /* [paint]: of the shared parameters */
    struct planes planes, slope[MATERIAL_PARAMETERS];
    bool moved[MATERIAL_PARAMETERS]; /* slope[] holds something */
    bool several;                    /* light comes over other surfaces: then path holds something */
    struct spread_path path;
    double white[3];
};

struct bench { /* of one row */
    struct entry entry[SCENE_PAINTS * PLANES_SETS];
    int n;
    double change[3][JOINT_ROWS];     /* of X, Y, Z by the columns of a paint's factor */
    double over[3];                   /* X, Y, Z of what comes over other surfaces */
    double indirect[SPREAD_DRAWS][3]; /* how that changes in each draw */
    float de[SPREAD_DRAWS];
};

static void take_extra(const struct planes *p, size_t i, double abc[3]) {
    memcpy(abc, (double[]){p->extra[i].abc.a, p->extra[i].abc.b, p->extra[i].abc.c}, 3 * sizeof *abc);
}

static void take_first(const struct planes *p, int set, size_t i, double abc[3]) {
    memcpy(abc, (double[]){p->set[set].a[i], p->set[set].b[i], p->set[set].c[i]}, 3 * sizeof *abc);
}

/* *extra: the first extra of this pixel or a later one. */
static void gather(const struct work *w, size_t pixel, size_t *extra, struct bench *b) {
    const struct planes *p = &w->planes;
    b->n = 0;
    for (int j = 0; j < p->n_sets && p->paint[pixel] >= 0; j++) {
        struct entry *x = &b->entry[b->n++];
        *x = (struct entry){.paint = p->paint[pixel], .set = j};
        take_first(p, j, pixel, x->abc);
        for (int m = 0; m < MATERIAL_PARAMETERS; m++) {
            if (w->moved[m]) {
                take_first(&w->slope[m], j, pixel, x->slope[m]);
            }
        }
    }
    for (; *extra < p->n_extra && p->extra[*extra].pixel == pixel; ++*extra) {
        struct entry *x = &b->entry[b->n++];
        *x = (struct entry){.paint = p->extra[*extra].paint, .set = p->extra[*extra].set};
        take_extra(p, *extra, x->abc);
        for (int m = 0; m < MATERIAL_PARAMETERS; m++) {
            if (w->moved[m]) {
                take_extra(&w->slope[m], *extra, x->slope[m]);
            }
        }
    }
}

/* Adds J L of one entry: what the columns of its paint's factor change in X, Y, Z. */
static void add_change(const struct work *w, const struct entry *x, struct bench *b) {
    const struct spread_paint *p = &w->paint[x->paint];
    const double kind[SPREAD_KINDS] = {x->abc[0], x->abc[1], x->slope[MATERIAL_BETA_PRIME][2]};
    for (int i = 0; i < SPREAD_KINDS * 3; i++) {
        const double *basis = p->basis + (size_t)(x->set * SPREAD_KINDS * 3 + i) * (size_t)p->rank;
        for (int r = 0; r < p->rank && kind[i / 3] != 0; r++) {
            b->change[i % 3][r] += kind[i / 3] * basis[r];
        }
    }
    for (int m = 0; m < MATERIAL_PARAMETERS; m++) {
        const double *row = p->shared + (size_t)m * (size_t)p->rank;
        double xyz[3];
        if (!p->moves[m]) {
            continue;
        }
        colour_apply(&p->best[x->set], x->slope[m], xyz);
        for (int i = 0; i < 3; i++) {
            for (int r = 0; r < p->rank; r++) {
                b->change[i][r] += xyz[i] * row[r];
            }
        }
    }
}

/* Of one paint: what comes over other surfaces, in b->change and in every draw. */
static void add_indirect(const struct work *w, int paint, size_t pixel, struct bench *b) {
    const struct spread_paint *p = &w->paint[paint];
    spread_path_change(&w->path, p, paint, pixel, b->change);
    for (int d = 0; d < SPREAD_DRAWS; d++) {
        const double *z = p->normal + (size_t)d * (size_t)p->rank;
        for (int i = 0; i < 3; i++) {
            for (int r = 0; r < p->rank; r++) {
                b->indirect[d][i] += b->change[i][r] * z[r];
            }
        }
    }
}

static bool shows(const struct bench *b, int paint) {
    int i = 0;
    while (i < b->n && b->entry[i].paint != paint) {
        i++;
    }
    return i < b->n;
}

/* Paints know nothing of each other; one that the pixel does not show may still shine on what it shows. */
static void covariance_of(const struct work *w, size_t pixel, struct bench *b, double covariance[3][3]) {
    memset(covariance, 0, 9 * sizeof **covariance);
    memset(b->indirect, 0, sizeof b->indirect);
    for (int paint = 0; paint < w->scene->n_paints; paint++) {
        int rank = w->paint[paint].rank;
        if (rank == 0 || !(w->several || shows(b, paint))) {
            continue;
        }
        memset(b->change, 0, sizeof b->change);
        if (w->several) {
            add_indirect(w, paint, pixel, b);
        }
        for (int i = 0; i < b->n; i++) {
            if (b->entry[i].paint == paint) {
                add_change(w, &b->entry[i], b);
            }
        }
        for (int k = 0; k < 9; k++) {
            for (int r = 0; r < rank; r++) {
                covariance[k / 3][k % 3] += b->change[k / 3][r] * b->change[k % 3][r];
            }
        }
    }
}

/* draw -1: the picture itself. */
static void colour_of(const struct work *w, const struct bench *b, int draw, double xyz[3]) {
    for (int k = 0; k < 3; k++) {
        xyz[k] = b->over[k] + (draw >= 0 ? b->indirect[draw][k] : 0);
    }
    for (int i = 0; i < b->n; i++) {
        const struct entry *x = &b->entry[i];
        const struct spread_paint *p = &w->paint[x->paint];
        double abc[3] = {x->abc[0], x->abc[1], x->abc[2]}, part[3];
        bool drawn = draw >= 0 && p->n > 0;
        size_t at = (size_t)(drawn ? draw : 0) * (size_t)p->sets + (size_t)x->set;
        for (int m = 0; m < MATERIAL_PARAMETERS && drawn; m++) {
            double change = p->moves[m] ? w->change[x->paint][draw][m] : 0;
            for (int k = 0; k < 3 && change != 0; k++) {
                abc[k] += change * x->slope[m][k];
            }
        }
        colour_apply(drawn ? &p->matrix[at] : &p->best[x->set], abc, part);
        for (int k = 0; k < 3; k++) {
            xyz[k] += part[k] + (drawn ? p->per_band[at][k] * x->slope[MATERIAL_BETA_PRIME][2] : 0);
        }
    }
}

/* d(L*, a*, b*) / d(X, Y, Z). */
static void lab_slopes(const double xyz[3], const double white[3], double slope[3][3]) {
    double f[3];
    memset(slope, 0, 9 * sizeof **slope);
    for (int i = 0; i < 3; i++) {
        double t = xyz[i] / white[i];
        /* CIE 015: the cube root, below (6/29)^3 its tangent. */
        f[i] = (t > 216.0 / 24389 ? 1 / (3 * cbrt(t) * cbrt(t)) : 841.0 / 108) / white[i];
    }
    slope[0][1] = 116 * f[1];
    slope[1][0] = 500 * f[0];
    slope[1][1] = -500 * f[1];
    slope[2][1] = 200 * f[1];
    slope[2][2] = -200 * f[2];
}

static void turn_covariance(const double slope[3][3], double c[3][3], double out[3][3]) {
    for (int i = 0; i < 9; i++) {
        out[i / 3][i % 3] = 0;
        for (int j = 0; j < 9; j++) {
            out[i / 3][i % 3] += slope[i / 3][j / 3] * c[j / 3][j % 3] * slope[i % 3][j % 3];
        }
    }
}

static int by_size(const void *a, const void *b) {
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

/* The k-th smallest of v[0 .. n - 1] to its place, nothing smaller behind it (Hoare's selection). */
static float select_value(float *v, int n, int k) {
    for (int low = 0, high = n - 1; low < high;) {
        float pivot = v[(low + high) / 2];
        int i = low, j = high;
        while (i <= j) {
            while (v[i] < pivot) {
                i++;
            }
            while (v[j] > pivot) {
                j--;
            }
            if (i <= j) {
                float swapped = v[i];
                v[i++] = v[j];
                v[j--] = swapped;
            }
        }
        low = k > j ? i : low;
        high = k < i ? j : high;
    }
    return v[k];
}

static void put_three(struct spread *s, int first, size_t pixel, const double v[3]) {
    for (int k = 0; k < 3; k++) {
        s->plane[first + k][pixel] = (float)v[k];
    }
}

static void put_covariance(struct spread *s, int first, size_t pixel, double c[3][3]) {
    static const int at[6][2] = {{0, 0}, {0, 1}, {0, 2}, {1, 1}, {1, 2}, {2, 2}};
    for (int k = 0; k < 6; k++) {
        s->plane[first + k][pixel] = (float)c[at[k][0]][at[k][1]];
    }
}

static void spread_pixel(struct work *w, size_t pixel, struct bench *b) {
    struct spread *s = w->spread;
    double xyz[3], lab[3], cov_xyz[3][3], cov_lab[3][3], slope[3][3];
    memset(b->over, 0, sizeof b->over);
    if (w->several) {
        spread_path_colour(&w->path, &w->planes, pixel, b->over);
    }
    colour_of(w, b, -1, xyz);
    colour_lab(xyz, w->white, lab);
    covariance_of(w, pixel, b, cov_xyz);
    lab_slopes(xyz, w->white, slope);
    turn_covariance((const double(*)[3])slope, cov_xyz, cov_lab);
    for (int d = 0; d < SPREAD_DRAWS; d++) {
        double drawn[3], drawn_lab[3];
        colour_of(w, b, d, drawn);
        colour_lab(drawn, w->white, drawn_lab);
        b->de[d] = (float)ciede2000(lab, drawn_lab);
    }
    s->plane[SPREAD_NOISE][pixel] = w->planes.noise ? (float)w->planes.noise[pixel] : 0;
    put_three(s, SPREAD_XYZ, pixel, xyz);
    put_three(s, SPREAD_LAB, pixel, lab);
    put_covariance(s, SPREAD_COV_XYZ, pixel, cov_xyz);
    put_covariance(s, SPREAD_COV_LAB, pixel, cov_lab);
    float upper = select_value(b->de, SPREAD_DRAWS, SPREAD_DRAWS / 2),
          lower = select_value(b->de, SPREAD_DRAWS / 2, SPREAD_DRAWS / 2 - 1);
    s->plane[SPREAD_MEDIAN][pixel] = (lower + upper) / 2;
    s->plane[SPREAD_P95][pixel] = select_value(b->de, SPREAD_DRAWS, SPREAD_DRAWS * 95 / 100);
}

static size_t first_extra(const struct planes *p, size_t pixel) {
    size_t low = 0, high = p->n_extra;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (p->extra[middle].pixel < pixel) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low;
}

static void spread_row(void *work, int y) {
    struct work *w = work;
    struct bench b;
    size_t width = (size_t)w->planes.width, extra = first_extra(&w->planes, (size_t)y * width);
    for (size_t i = (size_t)y * width; i < (size_t)(y + 1) * width; i++) {
        gather(w, i, &extra, &b);
        if (b.n > 0) {
            spread_pixel(w, i, &b);
            continue;
        }
        for (int k = 0; k < SPREAD_PLANES; k++) {
            w->spread->plane[k][i] = NAN; /* sampling comes later */
        }
    }
}

static int spread_rows(struct work *w, struct err *e) {
    return crew_run(w->planes.height, w->options, spread_row, w) == w->planes.height
               ? 0
               : err_set(e, ERR_CANCELLED, "interrupted before the uncertainty was known");
}

static int prepare_paints(struct work *w, uint64_t seed, struct err *e) {
    int status = 0;
    for (int p = 0; p < w->scene->n_paints && !status; p++) {
        status = spread_paint_make(w->scene, p, w->joint[p], seed, &w->paint[p], e);
        for (int i = 0; i < SPREAD_DRAWS * MATERIAL_PARAMETERS && !status; i++) {
            int draw = i / MATERIAL_PARAMETERS, m = i % MATERIAL_PARAMETERS;
            w->change[p][draw][m] = spread_paint_change(&w->paint[p], w->joint[p], draw, m);
        }
    }
    return status;
}

static int prepare_planes(struct work *w, struct err *e) {
    struct render_hits hits = {0}; /* only the paints change */
    struct render_options options = *w->options;
    options.hits = &hits;
    options.steady = w->scene;
    int status = spread_render(w->several ? w->scene : &w->first, &options, &w->planes, e);
    if (!status && w->several) {
        status = spread_path_make(w->scene, w->paint, &options, &w->path, e);
        w->spread->renderings = w->path.renderings;
    }
    for (int m = 0; m < MATERIAL_PARAMETERS && !status; m++) {
        bool moves[SCENE_PAINTS] = {false}, any = false;
        for (int p = 0; p < w->scene->n_paints; p++) {
            moves[p] = w->paint[p].moves[m];
            any = any || moves[p];
        }
        if (any) {
            status = spread_slope(&w->first, moves, m, &options, &w->slope[m], e);
            w->moved[m] = !status;
        }
    }
    render_hits_free(&hits);
    return status;
}

/* The same picture with one more sample each way: how far its own sampling may be off. */
static int find_sampling(struct work *w, struct err *e) {
    size_t n = (size_t)w->planes.width * (size_t)w->planes.height;
    struct scene *finer = malloc(sizeof *finer);
    double *xyz = malloc(3 * n * sizeof *xyz);
    struct planes planes = {0};
    int status = finer && xyz ? 0 : err_set(e, ERR_NOMEM, "no memory for a scene");
    if (!status) {
        memcpy(finer, w->scene, sizeof *finer);
        finer->image.grid++;
        status = spread_render(finer, w->options, &planes, e);
    }
    status = status ? status : render_xyz(finer, &planes, false, xyz, e);
    for (size_t i = 0; i < n && !status; i++) {
        double lab[2][3];
        for (int k = 0; k < 3; k++) {
            lab[0][k] = w->spread->plane[SPREAD_LAB + k][i];
        }
        colour_lab(xyz + 3 * i, w->white, lab[1]);
        w->spread->plane[SPREAD_SAMPLING][i] =
            w->planes.paint[i] < 0 ? NAN : (float)ciede2000(lab[0], lab[1]);
    }
    planes_free(&planes);
    free(finer);
    free(xyz);
    return status;
}

static double quantile(struct spread *s, int plane, double part, float *sorted) {
    size_t n = 0;
    for (size_t i = 0; i < (size_t)s->width * (size_t)s->height; i++) {
        if (!isnan(s->plane[plane][i])) {
            sorted[n++] = s->plane[plane][i];
        }
    }
    qsort(sorted, n, sizeof *sorted, by_size);
    s->n = n;
    return n > 0 ? sorted[(size_t)(part * (double)(n - 1))] : 0;
}

static int summarise(struct spread *s, struct err *e) {
    float *sorted = malloc((size_t)s->width * (size_t)s->height * sizeof *sorted);
    if (!sorted) {
        return err_set(e, ERR_NOMEM, "no memory for the uncertainty");
    }
    s->typical_median = quantile(s, SPREAD_MEDIAN, 0.5, sorted);
    s->typical_p95 = quantile(s, SPREAD_P95, 0.5, sorted);
    s->worst_p95 = quantile(s, SPREAD_P95, 0.95, sorted);
    s->typical_sampling = quantile(s, SPREAD_SAMPLING, 0.5, sorted);
    s->worst_sampling = quantile(s, SPREAD_SAMPLING, 0.95, sorted);
    s->typical_noise = sqrt(quantile(s, SPREAD_NOISE, 0.5, sorted));
    s->worst_noise = sqrt(quantile(s, SPREAD_NOISE, 0.95, sorted));
    free(sorted);
    return 0;
}

static int make_all(struct work *w, uint64_t seed, struct err *e) {
    struct spread *s = w->spread;
    size_t n = (size_t)w->scene->image.width * (size_t)w->scene->image.height;
    int status = white_of(w->scene, w->white, e);
    *s = (struct spread){.width = w->scene->image.width, .height = w->scene->image.height};
    w->change = calloc(SCENE_PAINTS, sizeof *w->change);
    for (int k = 0; k < SPREAD_PLANES && !status; k++) {
        s->plane[k] = malloc(n * sizeof **s->plane);
        status = s->plane[k] && w->change ? 0 : err_set(e, ERR_NOMEM, "no memory for the uncertainty");
    }
    status = status ? status : prepare_paints(w, seed, e);
    status = status ? status : prepare_planes(w, e);
    status = status ? status : spread_rows(w, e);
    status = status ? status : find_sampling(w, e);
    return status ? status : summarise(s, e);
}

int spread_make(const struct scene *scene, const struct joint *const joint[SCENE_PAINTS], uint64_t seed,
                const struct render_options *options, struct spread *spread, struct err *e) {
    struct work *w = calloc(1, sizeof *w);
    struct features features;
    if (!w) {
        return err_set(e, ERR_NOMEM, "no memory for the uncertainty");
    }
    w->scene = scene;
    w->first = *scene;
    w->first.image.bounces = 1;
    features_find(scene, options->all_features, &features);
    w->several = scene->image.bounces > 1 && features.line[FEATURE_INTERREFLECTION].kept;
    w->joint = joint;
    w->options = options;
    w->spread = spread;
    int status = make_all(w, seed, e);
    for (int p = 0; p < scene->n_paints; p++) {
        spread_paint_free(&w->paint[p]);
    }
    for (int m = 0; m < MATERIAL_PARAMETERS; m++) {
        planes_free(&w->slope[m]);
    }
    planes_free(&w->planes);
    spread_path_free(&w->path);
    free(w->change);
    free(w);
    if (status) {
        spread_free(spread);
    }
    return status;
}

void spread_free(struct spread *spread) {
    for (int k = 0; k < SPREAD_PLANES; k++) {
        free(spread->plane[k]);
        spread->plane[k] = NULL;
    }
}
