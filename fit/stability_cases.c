/* The cases, group by group: one thing is driven to its extremes at a time, the rest stays the 60 % paint. */
#include "fit/stability.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/published.h"

#define COUNT(a) (sizeof(a) / sizeof *(a))
#define CASES_MAX 160

enum { ACRYLIC, ZERO, SIXTY, NINETY }; /* of published[] */

struct list {
    struct stability_case *item;
    size_t n;
};

/* Grid and noise of reflection-model.md 3. */
static struct stability_case *add(struct list *l, const char *group, int set) {
    struct stability_case *c = &l->item[l->n++];
    *c = (struct stability_case){.group = group,
                                 .theta_i_low_deg = 10,
                                 .theta_i_high_deg = 60,
                                 .theta_i_step_deg = 10,
                                 .theta_v_first_deg = -80,
                                 .theta_v_step_deg = 5,
                                 .noise_relative = 0.005,
                                 .noise_absolute = 0.001};
    memcpy(c->value, published[set].value, sizeof c->value);
    return c;
}

/* The views do not meet the mirror directions: a lobe narrower than a step may fall between them. */
static void add_widths(struct list *l) {
    static const double gammas[] = {1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3, 1}, steps[] = {0.25, 1, 2.5, 5, 10};
    for (size_t s = 0; s < COUNT(steps); s++) {
        for (size_t g = 0; g < COUNT(gammas); g++) {
            struct stability_case *c = add(l, "gamma against step", SIXTY);
            snprintf(c->name, sizeof c->name, "gamma %g, step %g deg", gammas[g], steps[s]);
            c->value[MATERIAL_GAMMA] = gammas[g];
            c->theta_v_step_deg = steps[s];
            c->theta_v_first_deg = -80 + steps[s] / 3;
            c->wide = gammas[g] <= 0.01 || gammas[g] >= 1;
        }
    }
}

static void add_parameter(struct list *l, enum material_parameter parameter, const char *what,
                          const double *values, size_t n, double usual_low, double usual_high) {
    for (size_t i = 0; i < n; i++) {
        for (int wide = 0; wide < 2; wide++) {
            bool outside = values[i] <= usual_low || values[i] >= usual_high;
            if (wide && !outside) {
                continue;
            }
            struct stability_case *c = add(l, what, SIXTY);
            snprintf(c->name, sizeof c->name, "%s %g%s", what, values[i], wide ? ", wide bounds" : "");
            c->value[parameter] = values[i];
            c->wide = wide;
        }
    }
}

static void add_parameters(struct list *l) {
    static const double n[] = {1 + 1e-6, 1.001, 1.01, 1.1, 1.3, 2, 3, 5, 10};
    static const double sigma[] = {1e-4, 1e-3, 0.01, 0.05, 0.5, 0.8, 1, 1.2};
    static const double beta_prime[] = {0, 1e-6, 1e-3, 0.1, 100, 1e4, 1e6};
    static const double s[] = {0.001, 0.01, 0.1, 0.5, 1};
    add_parameter(l, MATERIAL_N, "n", n, COUNT(n), 1.3, 3);
    add_parameter(l, MATERIAL_SIGMA, "sigma", sigma, COUNT(sigma), 0.01, 1);
    add_parameter(l, MATERIAL_BETA_PRIME, "beta'", beta_prime, COUNT(beta_prime), -1, INFINITY);
    add_parameter(l, MATERIAL_S, "S", s, COUNT(s), 0, INFINITY);
}

static void add_range(struct list *l, const char *name, int set, double low, double high, double v_first) {
    struct stability_case *c = add(l, "angles", set);
    snprintf(c->name, sizeof c->name, "%s, %s", name, published[set].name);
    c->theta_i_low_deg = low;
    c->theta_i_high_deg = high;
    c->theta_v_first_deg = v_first;
}

static void add_angles(struct list *l) {
    for (int set = 0; set < PUBLISHED_SETS; set++) {
        add_range(l, "incidence to 30 deg", set, 10, 30, -80);
        add_range(l, "incidence 10 deg alone", set, 10, 10, -80);
        add_range(l, "incidence 60 deg alone", set, 60, 60, -80);
    }
    add_range(l, "incidence 0 deg alone", SIXTY, 0, 0, -80);
    add_range(l, "views beyond 50 deg alone", SIXTY, 10, 60, 50);
    add_range(l, "views of 80 deg alone", SIXTY, 10, 60, 80);
    struct stability_case *c = add(l, "angles", SIXTY);
    snprintf(c->name, sizeof c->name, "incidence 88 and 89 deg");
    c->theta_i_low_deg = 88;
    c->theta_i_high_deg = 89;
    c->theta_i_step_deg = 1;
}

static void add_noise(struct list *l) {
    static const double relative[] = {0, 0.001, 0.01, 0.05, 0.1, 0.2};
    for (int set = ACRYLIC; set <= NINETY; set += NINETY - ACRYLIC) {
        for (size_t i = 0; i < COUNT(relative); i++) {
            struct stability_case *c = add(l, "noise", set);
            snprintf(c->name, sizeof c->name, "noise %g %%, %s", 100 * relative[i], published[set].name);
            c->noise_relative = relative[i];
            c->noise_absolute = relative[i] / 5;
        }
    }
}

static void one_outlier(struct stability_points *p, struct dice *dice) {
    p->beta[(size_t)(dice_uniform(dice) * (double)p->n)] *= 1.5;
}

static void some_outliers(struct stability_points *p, struct dice *dice) {
    for (size_t i = 0; i < p->n / 20; i++) {
        p->beta[(size_t)(dice_uniform(dice) * (double)p->n)] += 0.5 * (dice_uniform(dice) - 0.3);
    }
}

static void huge_outlier(struct stability_points *p, struct dice *dice) {
    p->beta[(size_t)(dice_uniform(dice) * (double)p->n)] = 1e6;
}

static void lost_sweep(struct stability_points *p,
                       struct dice *dice) { /* a lamp that went dark for an incidence */
    (void)dice;
    for (size_t i = 0; i < p->n; i++) {
        p->beta[i] *= p->theta_i_deg[i] == 40 ? 0.1 : 1;
    }
}

static void duplicate(struct stability_points *p, struct dice *dice) {
    (void)dice;
    for (size_t i = p->n / 2; i < p->n;
         i++) { /* n_times 2 put the pair side by side, with noise of their own */
        p->beta[i] = p->beta[i & ~(size_t)1];
        p->u[i] = p->u[i & ~(size_t)1];
    }
}

static void shuffle(struct stability_points *p, struct dice *dice) {
    double *columns[] = {p->theta_i_deg, p->theta_v_deg, p->beta, p->u};
    for (size_t i = p->n; i > 1; i--) {
        size_t j = (size_t)(dice_uniform(dice) * (double)i);
        for (size_t k = 0; k < COUNT(columns); k++) {
            double keep = columns[k][i - 1];
            columns[k][i - 1] = columns[k][j];
            columns[k][j] = keep;
        }
    }
}

static void decades(struct stability_points *p,
                    struct dice *dice) { /* weights over twelve decades, noise as said */
    for (size_t i = 0; i < p->n; i++) {
        double truth = p->beta[i], u = p->u[i] * pow(10, 6 * dice_uniform(dice) - 3);
        p->beta[i] = truth + u * dice_normal(dice);
        p->u[i] = hypot(u, p->u[i]);
    }
}

static void not_a_number(struct stability_points *p, struct dice *dice) {
    (void)dice;
    p->beta[7] = NAN;
}

static void infinite(struct stability_points *p, struct dice *dice) {
    (void)dice;
    p->beta[7] = -INFINITY;
}

static void u_not_a_number(struct stability_points *p, struct dice *dice) {
    (void)dice;
    p->u[7] = NAN;
}

static void u_negative(struct stability_points *p, struct dice *dice) {
    (void)dice;
    p->u[7] = -p->u[7];
}

static void u_infinite(struct stability_points *p, struct dice *dice) {
    (void)dice;
    p->u[7] = INFINITY;
}

static void u_zero(struct stability_points *p, struct dice *dice) {
    (void)dice;
    memset(p->u, 0, p->n * sizeof *p->u);
}

static void angle_not_a_number(struct stability_points *p, struct dice *dice) {
    (void)dice;
    p->theta_v_deg[7] = NAN;
}

static void angle_of_90(struct stability_points *p, struct dice *dice) {
    (void)dice;
    p->theta_i_deg[7] = 90;
}

static void all_zero(struct stability_points *p, struct dice *dice) {
    (void)dice;
    memset(p->beta, 0, p->n * sizeof *p->beta);
}

static void all_negative(struct stability_points *p, struct dice *dice) {
    (void)dice;
    for (size_t i = 0; i < p->n; i++) {
        p->beta[i] = -p->beta[i];
    }
}

static void some_zero(struct stability_points *p, struct dice *dice) { /* what krylon_blue.brdf has */
    (void)dice;
    for (size_t i = 0; i < p->n; i++) {
        p->beta[i] = p->beta[i] < 0.12 ? 0 : p->beta[i];
    }
}

static void all_equal(struct stability_points *p, struct dice *dice) {
    (void)dice;
    for (size_t i = 0; i < p->n; i++) {
        p->beta[i] = 0.2;
    }
}

static void add_spoilt(struct list *l) {
    static const struct {
        const char *group, *name;
        void (*spoil)(struct stability_points *p, struct dice *dice);
        size_t n_times;
    } rows[] = {{"outliers", "one point 1.5 times too high", one_outlier, 0},
                {"outliers", "a point in twenty off by up to 0.35", some_outliers, 0},
                {"outliers", "one point of 1e6", huge_outlier, 0},
                {"outliers", "one incidence at a tenth of the light", lost_sweep, 0},
                {"order", "every point twice", NULL, 2},
                {"order", "half of the points copied", duplicate, 2},
                {"order", "shuffled", shuffle, 0},
                {"weights", "weights over twelve decades", decades, 0},
                {"weights", "u of zero", u_zero, 0},
                {"values", "one is not a number", not_a_number, 0},
                {"values", "one is infinite", infinite, 0},
                {"values", "one u is not a number", u_not_a_number, 0},
                {"values", "one u is negative", u_negative, 0},
                {"values", "one u is infinite", u_infinite, 0},
                {"values", "one angle is not a number", angle_not_a_number, 0},
                {"values", "one angle is 90 deg", angle_of_90, 0},
                {"values", "all are zero", all_zero, 0},
                {"values", "all are negative", all_negative, 0},
                {"values", "the dark ones are zero", some_zero, 0},
                {"values", "all are equal", all_equal, 0}};
    for (size_t i = 0; i < COUNT(rows); i++) {
        struct stability_case *c = add(l, rows[i].group, SIXTY);
        snprintf(c->name, sizeof c->name, "%s", rows[i].name);
        if (rows[i].spoil == all_zero || rows[i].spoil == all_negative || rows[i].spoil == all_equal) {
            c->replaced = true; /* by no surface, or by that of Lambert */
            c->truth[MATERIAL_S] = rows[i].spoil == all_equal ? 0.2 : 0;
        }
        c->spoil = rows[i].spoil;
        c->n_times = rows[i].n_times;
    }
}

static void add_counts(struct list *l, bool large) {
    static const size_t few[] = {1, 4, 5, 6, 7, 8, 10, 20};
    for (size_t i = 0; i < COUNT(few); i++) {
        struct stability_case *c = add(l, "points", SIXTY);
        snprintf(c->name, sizeof c->name, "%zu points", few[i]);
        c->n_max = few[i];
    }
    struct stability_case *c = add(l, "points", SIXTY);
    snprintf(c->name, sizeof c->name, "five geometries, 40 times each");
    c->theta_i_low_deg = c->theta_i_high_deg = 40;
    c->theta_v_first_deg = 0;
    c->theta_v_step_deg = 20;
    c->n_times = 40;
    c = add(l, "points", SIXTY);
    snprintf(c->name, sizeof c->name, "%d points", large ? 1000098 : 10098);
    c->n_times = large ? 5051 : 51;
}

int stability_cases(bool large, struct stability_case **cases, size_t *n, struct err *e) {
    struct list l = {.item = calloc(CASES_MAX, sizeof *l.item)};
    if (!l.item) {
        return err_set(e, ERR_NOMEM, "no memory for the cases");
    }
    add_widths(&l);
    add_parameters(&l);
    add_angles(&l);
    add_noise(&l);
    add_spoilt(&l);
    add_counts(&l, large);
    for (size_t i = 0; i < l.n; i++) {
        if (!l.item[i].replaced) {
            memcpy(l.item[i].truth, l.item[i].value, sizeof l.item[i].truth);
        }
    }
    *cases = l.item;
    *n = l.n;
    return 0;
}
