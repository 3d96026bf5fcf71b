#include "fit/render/white.h"

int white_of(const struct scene *scene, double white[3], struct err *e) {
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

struct colour_matrix white_display(const struct scene *scene, enum colour_space space,
                                   const double white[3]) {
    double target[3];
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
