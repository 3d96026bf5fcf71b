#include "fit/render/verbs.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "fit/render/colour.h"
#include "fit/render/paint.h"
#include "proto/units.h"

static const char help[] =
    "usage: goniorender stability\n"
    "Shades extreme materials in extreme geometries and counts what is not a number, not finite or\n"
    "negative: a table on stdout. Exit status 0: there is none; 1: there is; 2: bad usage.\n";

static const double gammas[] = {1e-6, 1e-3, .01, 1, 1e3};
static const double betas[] = {0, 1e-12, 1e6, 1e12};
static const double ns[] = {1, 1 + 1e-12, 1.0001, 2.42, 10};
static const double sigmas[] = {0, 1e-8, 1, 1e8};
static const double albedos[] = {0, 1, 1.5};
static const double thetas_deg[] = {0, 1e-9, 30, 60, 89.999, 90, 120, 180};
static const double azimuths_deg[] = {0, 1e-9, 90, 180};
/* Also what is no normal: of length 0, as a triangle without area has, and against the pole of a tangent frame. */
static const struct vec3 normals[] = {{0, 0, 1}, {0, 0, -1}, {1, 0, 0}, {0, 0, 0}};

#define COUNT(list) ((int)(sizeof(list) / sizeof *(list)))

struct tally {
    long shaded, bad, negative_diffuse;
    double highest;
};

static struct vec3 toward(double theta_deg, double phi_deg) {
    double theta = rad_from_deg(theta_deg), phi = rad_from_deg(phi_deg);
    return (struct vec3){sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)};
}

static void judge(const struct paint *p, const struct shade_abc *x, struct tally *t) {
    double s = p->s[0], radiance = fmax(x->a, 0) * s + x->b * s * s + x->c;
    t->shaded++;
    t->negative_diffuse += x->a < 0;
    t->bad +=
        !isfinite(x->a) || !isfinite(x->b) || !isfinite(x->c) || !(radiance >= 0) || x->b < 0 || x->c < 0;
    t->highest = fmax(t->highest, radiance);
}

static void shade_everywhere(const struct paint *p, struct tally *t) {
    for (int i = 0; i < COUNT(thetas_deg) * COUNT(thetas_deg) * COUNT(azimuths_deg) * COUNT(normals); i++) {
        struct vec3 l = toward(thetas_deg[i % 8], 0),
                    v = toward(thetas_deg[i / 8 % 8], azimuths_deg[i / 64 % 4]);
        struct vec3 n = normals[i / 256];
        struct shade_abc x = shade(SHADE_SIGMA | SHADE_SPECULAR | SHADE_RELATIVES, &p->shade, NULL, n, l, v);
        judge(p, &x, t);
        x = shade(SHADE_SIGMA | SHADE_SPECULAR, &p->shade, NULL, n, l, v);
        judge(p, &x, t);
    }
}

static int make_paint(struct paint *p, const double value[MATERIAL_PARAMETERS], struct err *e) {
    *p = (struct paint){.name = "extreme", .estimate = {.model = "composite", .kappa = 1}};
    memcpy(p->estimate.value, value, sizeof p->estimate.value);
    for (int k = 0; k < BANDS; k++) {
        p->estimate.s_lambda[k] = value[MATERIAL_S];
    }
    return paint_prepare(p, e);
}

struct axis {
    const char *name;
    enum material_parameter parameter;
    const double *value;
    int n;
};

static const struct axis axes[] = {{"S", MATERIAL_S, albedos, COUNT(albedos)},
                                   {"sigma", MATERIAL_SIGMA, sigmas, COUNT(sigmas)},
                                   {"gamma", MATERIAL_GAMMA, gammas, COUNT(gammas)},
                                   {"beta_prime", MATERIAL_BETA_PRIME, betas, COUNT(betas)},
                                   {"n", MATERIAL_N, ns, COUNT(ns)}};

/* All combinations in which one axis is held at one of its values. */
static int run_row(const struct axis *held, double at, struct tally *t, struct err *e) {
    int all = COUNT(albedos) * COUNT(sigmas) * COUNT(gammas) * COUNT(betas) * COUNT(ns);
    for (int i = 0; i < all; i++) {
        double value[MATERIAL_PARAMETERS] = {0};
        int rest = i;
        bool first = true;
        for (int k = 0; k < COUNT(axes); k++) {
            value[axes[k].parameter] = axes[k].value[rest % axes[k].n];
            first = first && (&axes[k] != held || rest % axes[k].n == 0);
            rest /= axes[k].n;
        }
        if (!first) {
            continue; /* the held axis would repeat itself */
        }
        value[held->parameter] = at;
        struct paint paint;
        int status = make_paint(&paint, value, e);
        if (status) {
            return status;
        }
        shade_everywhere(&paint, t);
    }
    return 0;
}

/* One line, no power at all, power only outside what an eye sees. */
static long judge_lights(void) {
    long bad = 0;
    double s[BANDS], white[3];
    for (int k = 0; k < BANDS; k++) {
        s[k] = 1.5;
    }
    for (int line = -1; line < BANDS; line++) {
        double power[BANDS] = {0};
        struct colour_matrix m;
        if (line >= 0) {
            power[line] = 1e-30;
        }
        int status = colour_collapse(s, power, COLOUR_2DEG, &m, NULL);
        bad += line < 0 ? status == 0 : status != 0;
        for (int i = 0; i < 9 && line >= 0; i++) {
            bad += !isfinite(m.m[i / 3][i % 3]);
        }
        bad +=
            line >= 0 && (colour_white(power, COLOUR_2DEG, white, NULL) != 0 || fabs(white[1] - 1) > 1e-12);
    }
    return bad;
}

static int print_table(long *bad, struct err *e) {
    printf("| held | at | shaded | not finite or negative | negative diffuse, set to 0 | highest radiance |\n"
           "|---|---|---|---|---|---|\n");
    for (int k = 0; k < COUNT(axes); k++) {
        for (int i = 0; i < axes[k].n; i++) {
            struct tally t = {0};
            int status = run_row(&axes[k], axes[k].value[i], &t, e);
            if (status) {
                return status;
            }
            printf("| %s | %.15g | %ld | %ld | %ld | %.3g |\n", axes[k].name, axes[k].value[i], t.shaded,
                   t.bad, t.negative_diffuse, t.highest);
            *bad += t.bad;
        }
    }
    long lights = judge_lights();
    printf("| light | one line, or none | %d | %ld | | |\n", BANDS + 1, lights);
    *bad += lights;
    return 0;
}

int verb_stability(int argc, char **argv) {
    struct err e = {0};
    long bad = 0;
    if (argc > 1) {
        bool asked = strcmp(argv[1], "--help") == 0;
        fputs(help, asked ? stdout : stderr);
        return asked ? 0 : 2;
    }
    if (print_table(&bad, &e)) {
        return verb_complain("stability", &e);
    }
    return bad > 0;
}
