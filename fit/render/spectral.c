#include "fit/render/spectral.h"

#include <stdio.h>
#include <string.h>

#include "fit/render/exr.h"
#include "fit/render/white.h"

#define CHANNELS (BANDS + 3)

struct spectral { /* what is written */
    const struct scene *scene;
    const struct planes *planes;
    size_t next;                      /* the first extra of the row to come */
    double power[PLANES_SETS][BANDS]; /* of each set, scaled: sum of power times ybar is 1 */
    struct colour_matrix rgb;         /* of XYZ */
};

void spectral_channel(int band, char *name, size_t size) {
    /* Whole nanometres, so that no locale has a say in the comma. */
    snprintf(name, size, "S0.%d,000000nm", band_nm(band));
}

static void add_radiance(const struct spectral *s, int paint, int set, const struct shade_abc *abc,
                         double radiance[BANDS]) {
    const double *albedo = s->scene->paint[paint].s;
    for (int k = 0; k < BANDS; k++) {
        radiance[k] += s->power[set][k] * (abc->a * albedo[k] + abc->b * albedo[k] * albedo[k] + abc->c);
    }
}

static void radiance_of(struct spectral *s, size_t pixel, double radiance[BANDS]) {
    const struct planes *p = s->planes;
    memset(radiance, 0, BANDS * sizeof *radiance);
    for (int j = 0; j < p->n_sets && p->paint[pixel] >= 0; j++) {
        struct shade_abc abc = {p->set[j].a[pixel], p->set[j].b ? p->set[j].b[pixel] : 0,
                                p->set[j].c ? p->set[j].c[pixel] : 0};
        add_radiance(s, p->paint[pixel], j, &abc, radiance);
        const float *indirect = p->set[j].indirect ? p->set[j].indirect + pixel * BANDS : NULL;
        for (int k = 0; k < BANDS && indirect; k++) {
            radiance[k] += s->power[j][k] * (double)indirect[k];
        }
    }
    for (; s->next < p->n_extra && p->extra[s->next].pixel == pixel; s->next++) {
        const struct planes_extra *x = &p->extra[s->next];
        add_radiance(s, x->paint, x->set, &x->abc, radiance);
    }
}

static void fill_row(void *arg, int y, float *const *row) {
    struct spectral *s = arg;
    for (int x = 0; x < s->planes->width; x++) {
        double radiance[BANDS], xyz[3], rgb[3];
        radiance_of(s, (size_t)y * (size_t)s->planes->width + (size_t)x, radiance);
        for (int k = 0; k < BANDS; k++) {
            row[k][x] = (float)radiance[k];
        }
        colour_sum(radiance, (enum colour_observer)s->scene->image.observer, xyz);
        colour_apply(&s->rgb, xyz, rgb);
        for (int i = 0; i < 3; i++) {
            row[BANDS + i][x] = (float)rgb[i];
        }
    }
}

int spectral_save(const char *path, const struct scene *scene, const struct planes *planes,
                  const char *origin_json, struct err *e) {
    struct spectral s = {.scene = scene, .planes = planes};
    char channel[CHANNELS][EXR_NAME_MAX] = {0};
    const struct exr_text text[] = {
        {"spectralLayoutVersion", "1.0"},
        {"emissiveUnits", "W.m^-2.sr^-1"}, /* the only unit that readers take; see comments */
        {"comments",
         "relative radiance: the sum over the bands of S0 times ybar is Y; the perfect diffuser at "
         "normal incidence has Y = 1"},
        {"goniod", origin_json}};
    double white[3];
    int status = white_of(scene, white, e);
    if (status) {
        return status;
    }
    s.rgb = white_display(scene, COLOUR_SRGB, white);
    for (int j = 0; j < scene->n_spds; j++) {
        colour_scale_power(scene->spd[j].power, (enum colour_observer)scene->image.observer, s.power[j]);
    }
    for (int k = 0; k < BANDS; k++) {
        spectral_channel(k, channel[k], EXR_NAME_MAX);
    }
    for (int i = 0; i < 3; i++) {
        channel[BANDS + i][0] = "RGB"[i];
    }
    struct exr_form form = {.width = planes->width,
                            .height = planes->height,
                            .n_channels = CHANNELS,
                            .n_texts = sizeof text / sizeof *text,
                            .channel = (const char(*)[EXR_NAME_MAX])channel,
                            .text = text,
                            .fill = fill_row,
                            .arg = &s};
    return exr_save(path, &form, e);
}
