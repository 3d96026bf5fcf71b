#include "fit/render/render.h"

#include <math.h>
#include <stdlib.h>

#include "fit/render/encode.h"

/* The whole white: each light as much of it as its share. */
static int white_of(const struct scene *scene, double white[3], struct err *e) {
    white[0] = white[1] = white[2] = 0;
    for (int i = 0; i < scene->n_lights; i++) {
        double own[3];
        int status = colour_white(scene->spd[scene->light[i].spd].power,
                                  (enum colour_observer)scene->image.observer, own, e);
        if (status) {
            return status;
        }
        for (int k = 0; k < 3; k++) {
            white[k] += scene->light[i].share * own[k];
        }
    }
    return 0;
}

struct colouring { /* by paint and set: what makes X, Y, Z of a, b, c */
    const struct scene *scene;
    bool by_wavelength;
    double scale[PLANES_SETS]; /* 1 / sum E ybar */
    struct colour_matrix (*matrix)[PLANES_SETS];
};

static int make_colouring(const struct scene *scene, struct colouring *colouring, struct err *e) {
    int status = 0;
    for (int j = 0; j < scene->n_spds; j++) {
        double xyz[3];
        colour_sum(scene->spd[j].power, (enum colour_observer)scene->image.observer, xyz);
        colouring->scale[j] = 1 / xyz[1];
    }
    colouring->matrix = malloc((size_t)SCENE_PAINTS * sizeof *colouring->matrix);
    if (!colouring->matrix) {
        return err_set(e, ERR_NOMEM, "no memory to colour");
    }
    for (int p = 0; p < scene->n_paints && !status; p++) {
        for (int j = 0; j < scene->n_spds && !status; j++) {
            status =
                colour_collapse(scene->paint[p].s, scene->spd[j].power,
                                (enum colour_observer)scene->image.observer, &colouring->matrix[p][j], e);
        }
    }
    if (status) {
        free(colouring->matrix);
    }
    return status;
}

static void sum_wavelengths(const struct colouring *c, int paint, int set, const double abc[3], double *xyz) {
    const double *s = c->scene->paint[paint].s, *power = c->scene->spd[set].power;
    double radiance[BANDS];
    for (int k = 0; k < BANDS; k++) {
        radiance[k] = c->scale[set] * power[k] * (abc[0] * s[k] + abc[1] * s[k] * s[k] + abc[2]);
    }
    colour_sum(radiance, (enum colour_observer)c->scene->image.observer, xyz);
}

static void add_colour(const struct colouring *c, int paint, int set, const double abc[3], double *xyz) {
    double part[3];
    if (c->by_wavelength) {
        sum_wavelengths(c, paint, set, abc, part);
    } else {
        colour_apply(&c->matrix[paint][set], abc, part);
    }
    xyz[0] += part[0];
    xyz[1] += part[1];
    xyz[2] += part[2];
}

int render_xyz(const struct scene *scene, const struct planes *planes, bool by_wavelength, double *xyz,
               struct err *e) {
    struct colouring colouring = {.scene = scene, .by_wavelength = by_wavelength};
    size_t n = (size_t)planes->width * (size_t)planes->height;
    int status = make_colouring(scene, &colouring, e);
    if (status) {
        return status;
    }
    for (size_t i = 0; i < n; i++) {
        xyz[3 * i] = xyz[3 * i + 1] = xyz[3 * i + 2] = 0;
        for (int j = 0; j < planes->n_sets && planes->paint[i] >= 0; j++) {
            double abc[3] = {planes->set[j].a[i], planes->set[j].b ? planes->set[j].b[i] : 0,
                             planes->set[j].c ? planes->set[j].c[i] : 0};
            add_colour(&colouring, planes->paint[i], j, abc, xyz + 3 * i);
        }
    }
    for (size_t i = 0; i < planes->n_extra; i++) {
        const struct planes_extra *x = &planes->extra[i];
        add_colour(&colouring, x->paint, x->set, (double[]){x->abc.a, x->abc.b, x->abc.c},
                   xyz + 3 * (size_t)x->pixel);
    }
    free(colouring.matrix);
    return 0;
}

/* From XYZ under the scene's lights to linear RGB of the picture's space, exposed. */
static struct colour_matrix display_of(const struct scene *scene, const double white[3]) {
    double target[3];
    enum colour_space space = (enum colour_space)scene->image.space;
    colour_space_white(space, target);
    /* Without any light there is no white to adapt from. */
    struct colour_matrix adapt = colour_adapt(
        white[1] > 0 ? (enum colour_adaptation)scene->image.adaptation : COLOUR_NONE, white, target);
    struct colour_matrix rgb = colour_from_xyz(space);
    rgb = colour_multiply(&rgb, &adapt);
    for (int i = 0; i < 9; i++) {
        rgb.m[i / 3][i % 3] *= scene->image.exposure;
    }
    return rgb;
}

/* Rounding in the matrices is no colour outside the gamut. */
#define GAMUT_SLACK 1e-9

static void encode_pixel(struct picture *p, const struct encode *encode, const double rgb[3],
                         uint16_t *code) {
    bool above = false, below = false;
    for (int k = 0; k < 3; k++) {
        above = above || rgb[k] > 1 + GAMUT_SLACK;
        below = below || rgb[k] < -GAMUT_SLACK;
        code[k] = encode_code(encode, rgb[k]);
    }
    p->clipped += above;
    p->out_of_gamut += below;
}

static void encode_picture(struct picture *p, const struct encode *encode,
                           const struct colour_matrix *display, const double *xyz) {
    size_t n = (size_t)p->width * (size_t)p->height;
    for (size_t i = 0; i < n; i++) {
        double rgb[3];
        colour_apply(display, xyz + 3 * i, rgb);
        p->max_y = fmax(p->max_y, xyz[3 * i + 1]);
        encode_pixel(p, encode, rgb, p->rgb + 3 * i);
    }
}

int render_picture(const struct scene *scene, const struct planes *planes, bool by_wavelength,
                   struct picture *picture, struct err *e) {
    size_t n = 3 * (size_t)planes->width * (size_t)planes->height;
    struct encode encode = {0};
    double *xyz = malloc(n * sizeof *xyz);
    *picture = (struct picture){.width = planes->width,
                                .height = planes->height,
                                .bits = scene->image.bits,
                                .space = (enum colour_space)scene->image.space,
                                .rgb = malloc(n * sizeof *picture->rgb)};
    int status = xyz && picture->rgb ? 0 : err_set(e, ERR_NOMEM, "no memory for the picture");
    status = status ? status : white_of(scene, picture->white, e);
    status = status ? status : render_xyz(scene, planes, by_wavelength, xyz, e);
    status = status ? status : encode_make(&encode, colour_curve(picture->space), picture->bits, e);
    if (!status) {
        struct colour_matrix display = display_of(scene, picture->white);
        encode_picture(picture, &encode, &display, xyz);
        encode_free(&encode);
    } else {
        picture_free(picture);
    }
    free(xyz);
    return status;
}

void picture_free(struct picture *picture) {
    free(picture->rgb);
    picture->rgb = NULL;
}
