#include "fit/render/render.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/render/encode.h"
#include "fit/render/tint.h"
#include "fit/render/white.h"

struct colouring { /* by paint and set: what makes X, Y, Z (or what follows them) of a, b, c */
    const struct scene *scene;
    const struct planes *planes;
    bool by_wavelength;
    struct colour_matrix after;                  /* of X, Y, Z */
    double scale[PLANES_SETS];                   /* 1 / sum E ybar */
    struct colour_matrix (*matrix)[PLANES_SETS]; /* `after` is contained */
    double (*band)[BANDS][3];                    /* [set], of indirect light; `after` is contained */
};

static void free_colouring(struct colouring *c) {
    free(c->matrix);
    free(c->band);
}

/* What each band of the indirect light adds. */
static int make_bands(struct colouring *c, struct err *e) {
    const double(*cmf)[3] = colour_cmf((enum colour_observer)c->scene->image.observer);
    c->band = malloc((size_t)c->planes->n_sets * sizeof *c->band);
    if (!c->band) {
        return err_set(e, ERR_NOMEM, "no memory to colour");
    }
    for (int j = 0; j < c->planes->n_sets; j++) {
        for (int k = 0; k < BANDS; k++) {
            colour_apply(&c->after, cmf[k], c->band[j][k]);
            for (int i = 0; i < 3; i++) {
                c->band[j][k][i] *= c->scale[j] * c->scene->spd[j].power[k];
            }
        }
    }
    return 0;
}

static int make_colouring(struct colouring *c, const struct scene *scene, const struct planes *planes,
                          const struct colour_matrix *after, bool by_wavelength, struct err *e) {
    enum colour_observer observer = (enum colour_observer)scene->image.observer;
    int status = 0;
    *c =
        (struct colouring){.scene = scene, .planes = planes, .by_wavelength = by_wavelength, .after = *after};
    c->matrix = calloc(SCENE_PAINTS, sizeof *c->matrix);
    if (!c->matrix) {
        return err_set(e, ERR_NOMEM, "no memory to colour");
    }
    for (int j = 0; j < scene->n_spds && !status; j++) {
        double xyz[3];
        colour_sum(scene->spd[j].power, observer, xyz);
        c->scale[j] = 1 / xyz[1];
        for (int p = 0; p < scene->n_paints && !status; p++) {
            status = colour_collapse(scene->paint[p].s, scene->spd[j].power, observer, &c->matrix[p][j], e);
            c->matrix[p][j] = colour_multiply(after, &c->matrix[p][j]);
        }
    }
    return status || !planes_have_indirect(planes) ? status : make_bands(c, e);
}

/* The sum that the matrix replaces. */
static void sum_wavelengths(const struct colouring *c, int paint, int set, const double abc[3], double *out) {
    const double *s = c->scene->paint[paint].s, *power = c->scene->spd[set].power;
    double radiance[BANDS], xyz[3];
    for (int k = 0; k < BANDS; k++) {
        radiance[k] = c->scale[set] * power[k] * (abc[0] * s[k] + abc[1] * s[k] * s[k] + abc[2]);
    }
    colour_sum(radiance, (enum colour_observer)c->scene->image.observer, xyz);
    colour_apply(&c->after, xyz, out);
}

static void add_pixel(const struct colouring *c, int paint, int set, const double abc[3], size_t at,
                      double *const out[3]) {
    double part[3];
    if (c->by_wavelength) {
        sum_wavelengths(c, paint, set, abc, part);
    } else {
        colour_apply(&c->matrix[paint][set], abc, part);
    }
    for (int k = 0; k < 3; k++) {
        out[k][at] += part[k];
    }
}

/* Pixels first .. first + n - 1, all of one paint, into out[.][at ...]. */
static void add_run(const struct colouring *c, int paint, size_t first, size_t n, size_t at,
                    double *const out[3]) {
    for (int j = 0; j < c->planes->n_sets; j++) {
        const double *pa = c->planes->set[j].a + first;
        const double *pb = c->planes->set[j].b ? c->planes->set[j].b + first : NULL;
        const double *pc = c->planes->set[j].c ? c->planes->set[j].c + first : NULL;
        if (!c->by_wavelength) {
            tint_add(&c->matrix[paint][j], n, pa, pb, pc,
                     (double *const[]){out[0] + at, out[1] + at, out[2] + at});
            continue;
        }
        for (size_t i = 0; i < n; i++) {
            add_pixel(c, paint, j, (double[]){pa[i], pb ? pb[i] : 0, pc ? pc[i] : 0}, at + i, out);
        }
    }
}

static void add_indirect(const struct colouring *c, size_t first, size_t n, double *const out[3]) {
    for (int j = 0; j < c->planes->n_sets; j++) {
        const float *r = c->planes->set[j].indirect + first * BANDS;
        for (size_t x = 0; x < n; x++, r += BANDS) {
            double sum[3] = {0, 0, 0};
            for (int k = 0; k < BANDS; k++) {
                for (int i = 0; i < 3; i++) {
                    sum[i] += (double)r[k] * c->band[j][k][i];
                }
            }
            for (int i = 0; i < 3; i++) {
                out[i][x] += sum[i];
            }
        }
    }
}

/* Row y into three planes of width values; *extra: the first extra that belongs to it or a later row. */
static void colour_row(const struct colouring *c, int y, size_t *extra, double *const out[3]) {
    const struct planes *p = c->planes;
    size_t width = (size_t)p->width, first = (size_t)y * width;
    const int16_t *paint = p->paint + first;
    for (int k = 0; k < 3; k++) {
        memset(out[k], 0, width * sizeof *out[k]);
    }
    for (size_t x = 0, end; x < width; x = end) {
        for (end = x + 1; end < width && paint[end] == paint[x]; end++) {
        }
        if (paint[x] >= 0) {
            add_run(c, paint[x], first + x, end - x, x, out);
        }
    }
    if (c->band) {
        add_indirect(c, first, width, out);
    }
    for (; *extra < p->n_extra && p->extra[*extra].pixel < first + width; ++*extra) {
        const struct planes_extra *x = &p->extra[*extra];
        add_pixel(c, x->paint, x->set, (double[]){x->abc.a, x->abc.b, x->abc.c}, x->pixel - first, out);
    }
}

int render_xyz(const struct scene *scene, const struct planes *planes, bool by_wavelength, double *xyz,
               struct err *e) {
    static const struct colour_matrix same = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    size_t width = (size_t)planes->width, extra = 0;
    double *row = malloc(3 * width * sizeof *row);
    struct colouring colouring = {0};
    int status = row ? 0 : err_set(e, ERR_NOMEM, "no memory to colour");
    status = status ? status : make_colouring(&colouring, scene, planes, &same, by_wavelength, e);
    for (int y = 0; y < planes->height && !status; y++) {
        colour_row(&colouring, y, &extra, (double *const[]){row, row + width, row + 2 * width});
        for (size_t i = 0; i < 3 * width; i++) {
            *xyz++ = row[i % 3 * width + i / 3];
        }
    }
    free_colouring(&colouring);
    free(row);
    return status;
}

/* Rounding in the matrices is no colour outside the gamut. */
#define GAMUT_SLACK 1e-9

/* luminance: the row of the inverse that gives Y. */
static void encode_row(struct picture *p, const struct encode *encode, const double luminance[3],
                       const double *const rgb[3], uint16_t *code) {
    for (int x = 0; x < p->width; x++) {
        double r = rgb[0][x], g = rgb[1][x], b = rgb[2][x];
        p->clipped += r > 1 + GAMUT_SLACK || g > 1 + GAMUT_SLACK || b > 1 + GAMUT_SLACK;
        p->out_of_gamut += r < -GAMUT_SLACK || g < -GAMUT_SLACK || b < -GAMUT_SLACK;
        double y = luminance[0] * r + luminance[1] * g + luminance[2] * b;
        p->max_y = y > p->max_y ? y : p->max_y;
        code[3 * x] = encode_code(encode, r);
        code[3 * x + 1] = encode_code(encode, g);
        code[3 * x + 2] = encode_code(encode, b);
    }
}

static void encode_picture(struct picture *p, const struct colouring *colouring, const struct encode *encode,
                           double *row) {
    struct colour_matrix back = colour_inverse(&colouring->after);
    size_t width = (size_t)p->width, extra = 0;
    double *const plane[3] = {row, row + width, row + 2 * width};
    for (int y = 0; y < p->height; y++) {
        colour_row(colouring, y, &extra, plane);
        encode_row(p, encode, back.m[1], (const double *const[]){plane[0], plane[1], plane[2]},
                   p->rgb + 3 * (size_t)y * width);
    }
}

int render_picture(const struct scene *scene, const struct planes *planes, bool by_wavelength,
                   struct picture *picture, struct err *e) {
    size_t width = (size_t)planes->width, n = 3 * width * (size_t)planes->height;
    struct encode encode = {0};
    struct colouring colouring = {0};
    double *row = malloc(3 * width * sizeof *row);
    *picture = (struct picture){.width = planes->width,
                                .height = planes->height,
                                .bits = scene->image.bits,
                                .space = (enum colour_space)scene->image.space,
                                .rgb = malloc(n * sizeof *picture->rgb)};
    int status = row && picture->rgb ? 0 : err_set(e, ERR_NOMEM, "no memory for the picture");
    status = status ? status : white_of(scene, picture->white, e);
    status = status ? status : encode_make(&encode, colour_curve(picture->space), picture->bits, e);
    if (!status) {
        struct colour_matrix display = white_display(scene, picture->space, picture->white);
        status = make_colouring(&colouring, scene, planes, &display, by_wavelength, e);
    }
    if (!status) {
        encode_picture(picture, &colouring, &encode, row);
    } else {
        picture_free(picture);
    }
    free_colouring(&colouring);
    encode_free(&encode);
    free(row);
    return status;
}

void picture_free(struct picture *picture) {
    free(picture->rgb);
    picture->rgb = NULL;
}
