/* The points of a case: its surface seen at its angles, noise, and what spoils them. */
#include "fit/stability.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/reflectance.h"

#define THETA_V_HIGH_DEG 80
#define ROUND_DEG 1e-9 /* of a step added up */

void stability_points_free(struct stability_points *p) {
    free(p->theta_i_deg);
    free(p->theta_v_deg);
    free(p->beta);
    free(p->u);
    *p = (struct stability_points){0};
}

static size_t count(double low, double high, double step) {
    return (size_t)floor((high - low + ROUND_DEG) / step) + 1;
}

static int allocate(struct stability_points *p, size_t n, struct err *e) {
    double **all[] = {&p->theta_i_deg, &p->theta_v_deg, &p->beta, &p->u};
    *p = (struct stability_points){.n = n};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        *all[i] = calloc(n + 1, sizeof(double));
        if (!*all[i]) {
            stability_points_free(p);
            return err_set(e, ERR_NOMEM, "no memory for a case of %zu points", n);
        }
    }
    return 0;
}

static void place(const struct stability_case *c, struct stability_points *p) {
    size_t n_v = count(c->theta_v_first_deg, THETA_V_HIGH_DEG, c->theta_v_step_deg);
    size_t times = c->n_times ? c->n_times : 1;
    for (size_t i = 0; i < p->n; i++) {
        size_t at = i / times;
        p->theta_i_deg[i] = c->theta_i_low_deg + (double)(at / n_v) * c->theta_i_step_deg;
        p->theta_v_deg[i] = c->theta_v_first_deg + (double)(at % n_v) * c->theta_v_step_deg;
    }
}

/* Moves the points to keep to the front: a random choice without repetition (Fisher and Yates). */
static void thin(struct stability_points *p, size_t n_max, struct dice *dice) {
    for (size_t i = 0; i < n_max && i < p->n; i++) {
        size_t j = i + (size_t)(dice_uniform(dice) * (double)(p->n - i));
        double theta_i_deg = p->theta_i_deg[i], theta_v_deg = p->theta_v_deg[i];
        p->theta_i_deg[i] = p->theta_i_deg[j];
        p->theta_v_deg[i] = p->theta_v_deg[j];
        p->theta_i_deg[j] = theta_i_deg;
        p->theta_v_deg[j] = theta_v_deg;
    }
    p->n = n_max < p->n ? n_max : p->n;
}

static int see(const struct stability_case *c, struct stability_points *p, struct dice *dice, struct err *e) {
    const struct reflectance_optics optics = {.kappa = 1, .q = 1};
    for (size_t i = 0; i < p->n; i++) {
        struct reflectance_geometry g;
        int status = reflectance_geometry(&g, p->theta_i_deg[i], p->theta_v_deg[i], e);
        if (status || (status = reflectance_eval(REFLECTANCE_COMPOSITE, 1, &g, c->value, &optics, &p->beta[i],
                                                 NULL, e))) {
            return status;
        }
        p->beta[i] += hypot(c->noise_relative * p->beta[i], c->noise_absolute) * dice_normal(dice);
        p->u[i] = hypot(c->noise_relative * p->beta[i], c->noise_absolute);
    }
    return 0;
}

int stability_points_make(const struct stability_case *c, uint64_t seed, struct stability_points *p,
                          struct err *e) {
    struct dice dice = {.state = seed};
    size_t n = count(c->theta_i_low_deg, c->theta_i_high_deg, c->theta_i_step_deg) *
               count(c->theta_v_first_deg, THETA_V_HIGH_DEG, c->theta_v_step_deg) *
               (c->n_times ? c->n_times : 1);
    for (const char *name = c->name; *name; name++) { /* each case its own numbers */
        dice.state = dice.state * 31 + (unsigned char)*name;
    }
    int status = allocate(p, n, e);
    if (status) {
        return status;
    }
    place(c, p);
    if (c->n_max) {
        thin(p, c->n_max, &dice);
    }
    if ((status = see(c, p, &dice, e))) {
        stability_points_free(p);
    } else if (c->spoil) {
        c->spoil(p, &dice);
    }
    return status;
}
