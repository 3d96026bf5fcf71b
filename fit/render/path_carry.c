#include "fit/render/path.h"

/* Every band by itself: loops that the compiler turns into vectors. */
static void scatter_bands(const struct shade_abc *x, const double *s, double *carried) {
    const double a = x->a, b = x->b, c = x->c;
    for (int k = 0; k < BANDS; k++) {
        carried[k] *= (b * s[k] + a) * s[k] + c;
    }
}

static void add_bands(const struct shade_abc *x, const double *restrict s, const double *restrict carried,
                      double *restrict spectrum) {
    const double a = x->a, b = x->b, c = x->c;
    for (int k = 0; k < BANDS; k++) {
        spectrum[k] += carried[k] * ((b * s[k] + a) * s[k] + c);
    }
}

void path_carry(const struct path *path, const struct scene *scene, double part, double (*spectrum)[BANDS]) {
    double carried[BANDS];
    for (int k = 0; k < BANDS; k++) {
        carried[k] = part;
    }
    for (int i = 0; i < path->n; i++) {
        const struct path_step *step = &path->step[i];
        scatter_bands(&step->scatter, scene->paint[step->from].s, carried);
        for (int j = 0; j < scene->n_spds; j++) {
            if (step->light[j].a > 0 || step->light[j].c > 0) {
                add_bands(&step->light[j], scene->paint[step->to].s, carried, spectrum[j]);
            }
        }
    }
}
