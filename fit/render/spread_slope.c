#include "fit/render/spread_slope.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define STEP 1e-4 /* of the parameter: a difference quotient good to 1e-8 of the slope */

int spread_render(const struct scene *scene, const struct render_options *options, struct planes *planes,
                  struct err *e) {
    struct render_options own = *options;
    struct render_report report = {0};
    /* Neither is a matter of tolerance. */
    own.keep = ~(1u << FEATURE_RANDOM | 1u << FEATURE_EACH_PICTURE);
    return render_whole(scene, &own, planes, &report, e);
}

int spread_move(struct scene *moved, const struct scene *scene, int paint, int parameter, double relative,
                double *value, struct err *e) {
    struct paint *p = &moved->paint[paint];
    double *at = &p->estimate.value[parameter], best = *at;
    int status = 0;
    if (parameter == MATERIAL_S) {
        for (int k = 0; k < BANDS; k++) {
            p->s[k] += relative;
        }
        *value = relative;
        return 0;
    }
    *at += relative * (best != 0 ? fabs(best) : 1);
    if (paint_prepare(p, NULL) != 0) {
        *at = best; /* beyond a bound: one-sided */
        status = paint_prepare(p, e);
    }
    p->drawn = scene->paint[paint].drawn; /* the same directions up and down: no noise in the difference */
    *value = *at;
    return status;
}

/* The parameter of each paint moved up or down; value[paint]: where it stands then. */
static int render_moved(const struct scene *scene, const bool *moves, int parameter, double relative,
                        const struct render_options *options, struct planes *planes, double *value,
                        struct err *e) {
    struct scene *moved = malloc(sizeof *moved);
    int status = 0;
    if (!moved) {
        return err_set(e, ERR_NOMEM, "no memory for a scene");
    }
    memcpy(moved, scene, sizeof *moved); /* it borrows what the shapes own */
    for (int p = 0; p < scene->n_paints && !status; p++) {
        value[p] = scene->paint[p].estimate.value[parameter];
        if (moves[p]) {
            status = spread_move(moved, scene, p, parameter, relative, &value[p], e);
        }
    }
    status = status ? status : spread_render(moved, options, planes, e);
    free(moved);
    return status;
}

static void divide(struct planes *up, const struct planes *down, const bool *moves, const double *high,
                   const double *low) {
    size_t n = (size_t)up->width * (size_t)up->height;
    for (size_t i = 0; i < n; i++) {
        int p = up->paint[i];
        double scale = p >= 0 && moves[p] ? 1 / (high[p] - low[p]) : 0;
        for (int j = 0; j < up->n_sets; j++) {
            up->set[j].a[i] = scale * (up->set[j].a[i] - down->set[j].a[i]);
            up->set[j].b[i] = scale * (up->set[j].b[i] - down->set[j].b[i]);
            up->set[j].c[i] = scale * (up->set[j].c[i] - down->set[j].c[i]);
        }
    }
    for (size_t i = 0; i < up->n_extra; i++) {
        int p = up->extra[i].paint;
        double scale = moves[p] ? 1 / (high[p] - low[p]) : 0;
        struct shade_abc *x = &up->extra[i].abc;
        const struct shade_abc *y = &down->extra[i].abc;
        *x = (struct shade_abc){scale * (x->a - y->a), scale * (x->b - y->b), scale * (x->c - y->c)};
    }
}

int spread_slope(const struct scene *scene, const bool moves[SCENE_PAINTS], int parameter,
                 const struct render_options *options, struct planes *slope, struct err *e) {
    double high[SCENE_PAINTS], low[SCENE_PAINTS];
    struct planes down;
    int status = render_moved(scene, moves, parameter, STEP, options, slope, high, e);
    if (status) {
        return status;
    }
    status = render_moved(scene, moves, parameter, -STEP, options, &down, low, e);
    if (status) {
        planes_free(slope);
        return status;
    }
    divide(slope, &down, moves, high, low);
    planes_free(&down);
    return 0;
}
