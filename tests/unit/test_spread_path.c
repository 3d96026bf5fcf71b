#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/render/ciede2000.h"
#include "fit/render/spread.h"
#include "fit/render/spread_slope.h"
#include "fit/render/white.h"
#include "tests/support/render_scene.h"

#define PIXELS 36
#define SEED 11
/* A fold of two strongly coloured paints; each shines on the other. */
#define FOLD                                                                                                 \
    "materials:\n"                                                                                           \
    "  - {name: m, spectrum: green.csv, sigma: 0.3, gamma: 0.2, beta_prime: 3, n: 1.5}\n"                    \
    "  - {name: k, uniform: 0.8, sigma: 0.4, model: oren-nayar}\n"                                           \
    "shapes: [fold: {materials: [m, k], width_mm: 40, length_mm: 50, angle_deg: 70}]\n"                      \
    "lights:\n"                                                                                              \
    "  - beam: {theta_deg: 10, azimuth_deg: 60, weight: 3, spd: D65}\n"                                      \
    "  - beam: {theta_deg: 20, azimuth_deg: 170, spd: A}\n"                                                  \
    "camera: {orthographic: {height_mm: 60, from: [0.1, 0.3, 1], look_at_mm: [0, 2, 16]}}\n"                 \
    "image: {width: 6, height: 6, grid: 1, samples: 16, bounces: %d}\n"
#define BALL                                                                                                 \
    "materials: [{name: m, spectrum: green.csv, sigma: 0.3, gamma: 0.2, beta_prime: 3, n: 1.5}]\n"           \
    "shapes: [sphere: {material: m, radius_mm: 25}]\n"                                                       \
    "lights: [beam: {theta_deg: 20}]\n"                                                                      \
    "camera: {orthographic: {height_mm: 60}}\n"                                                              \
    "image: {width: 6, height: 6, grid: 1, samples: 16, bounces: %d}\n"

/* S was measured in a few bands only. */
static const int measured[] = {0, 18, 37, 55, 80};
#define MEASURED 5

static void add_row(struct joint *j, int parameter, int band, double *u, double size) {
    u[j->n] = size;
    j->row[j->n++] = (struct joint_row){parameter, band};
}

static struct joint joint_of(struct paint *paint) {
    struct joint j = {.converged = true};
    double u[JOINT_ROWS];
    strcpy(j.model, paint->estimate.model);
    for (int k = 0, next = 0; k < BANDS; k++) {
        if (next < MEASURED && k == measured[next])
            add_row(&j, MATERIAL_S, measured[next++], u, .02 * paint->estimate.s_lambda[k]);
        else
            paint->estimate.s_lambda[k] = NAN;
    }
    assert_int_equal(paint_prepare(paint, NULL), 0);
    for (int m = MATERIAL_SIGMA; m < MATERIAL_PARAMETERS; m++)
        if (material_parameter_name(j.model, m))
            add_row(&j, m, -1, u, .015 * paint->estimate.value[m]);
    assert_int_equal(joint_allocate(&j, j.n, NULL), 0);
    for (int i = 0; i < j.n * j.n; i++) {
        int a = i / j.n, b = i % j.n;
        j.statistical[i] = (a == b ? 1 : .6) * u[a] * u[b];
        j.common[i] = j.row[a].parameter == MATERIAL_S && j.row[b].parameter == MATERIAL_S ? u[a] * u[b] : 0;
    }
    return j;
}

struct setting {
    struct scene *scene, *moved;
    int n;
    struct joint joint[2];
    struct spread spread;
};

static void set_up(struct setting *s, const char *text, int bounces) {
    const struct joint *joint[SCENE_PAINTS] = {NULL};
    struct err e = {0};
    s->scene = scene_of(text, bounces);
    s->moved = malloc(sizeof *s->moved);
    s->n = s->scene->n_paints;
    for (int p = 0; p < s->n; p++) {
        s->joint[p] = joint_of(&s->scene->paint[p]);
        joint[p] = &s->joint[p];
    }
    if (spread_make(s->scene, joint, SEED, &(struct render_options){0}, &s->spread, &e))
        fail_msg("%s", e.text);
}

static void tear_down(struct setting *s) {
    spread_free(&s->spread);
    for (int p = 0; p < s->n; p++)
        joint_free(&s->joint[p]);
    scene_free(s->scene);
    free(s->moved);
}

/* By the paths of the scene as it is. */
static double *rendered_xyz(const struct setting *s) {
    struct planes planes;
    struct render_options options = {.threads = 1, .steady = s->scene};
    assert_int_equal(spread_render(s->moved, &options, &planes, NULL), 0);
    double *xyz = xyz_of(s->moved, &planes, false);
    planes_free(&planes);
    return xyz;
}

static void move(struct setting *s, int paint, const struct joint_row *row, double change) {
    struct paint *p = &s->moved->paint[paint];
    *(row->band < 0 ? &p->estimate.value[row->parameter] : &p->estimate.s_lambda[row->band]) += change;
    assert_int_equal(paint_prepare(p, NULL), 0);
    p->drawn = s->scene->paint[paint].drawn;
}

/* d X, Y, Z of all pixels by a row. */
static double *slope_of(struct setting *s, int paint, int row) {
    const struct joint *j = &s->joint[paint];
    double step = .1 * sqrt(j->statistical[row * j->n + row]), *side[2];
    for (int k = 0; k < 2; k++) {
        memcpy(s->moved, s->scene, sizeof *s->moved);
        move(s, paint, &j->row[row], k ? -step : step);
        side[k] = rendered_xyz(s);
    }
    for (int x = 0; x < 3 * PIXELS; x++)
        side[0][x] = (side[0][x] - side[1][x]) / (2 * step);
    free(side[1]);
    return side[0];
}

/* Every row moved in turn and the fold rendered anew gives J; J C J^T by plain sums. */
static void the_covariance_is_that_of_the_rendered_jacobian(void **state) {
    (void)state;
    static const int at[6][2] = {{0, 0}, {0, 1}, {0, 2}, {1, 1}, {1, 2}, {2, 2}};
    static double cov[PIXELS][3][3];
    struct setting s;
    int lit = 0;
    memset(cov, 0, sizeof cov);
    set_up(&s, FOLD, 5);
    for (int p = 0; p < s.n; p++) {
        const struct joint *j = &s.joint[p];
        double *slope[JOINT_ROWS];
        for (int i = 0; i < j->n; i++)
            slope[i] = slope_of(&s, p, i);
        for (int i = 0; i < j->n * j->n; i++)
            for (int x = 0; x < 9 * PIXELS; x++)
                cov[x / 9][x % 9 / 3][x % 3] += (j->statistical[i] + j->common[i]) *
                                                slope[i / j->n][x / 9 * 3 + x % 9 / 3] *
                                                slope[i % j->n][x / 9 * 3 + x % 3];
        for (int i = 0; i < j->n; i++)
            free(slope[i]);
    }
    for (int i = 0; i < PIXELS; i++) {
        double trace = cov[i][0][0] + cov[i][1][1] + cov[i][2][2];
        bool shown = !isnan(s.spread.plane[SPREAD_XYZ][i]);
        lit += shown && trace > 1e-6;
        for (int k = 0; k < 6 && shown; k++) {
            double own = s.spread.plane[SPREAD_COV_XYZ + k][i], wanted = cov[i][at[k][0]][at[k][1]];
            if (!(fabs(own - wanted) <= 2e-3 * trace))
                fail_msg("pixel %d, covariance %d: %g, rendered %g", i, k, own, wanted);
        }
    }
    assert_true(lit > 15);
    tear_down(&s);
}

/* Without other surfaces there is one bounce, whatever was asked for. */
static void a_convex_shape_has_the_covariance_of_one_bounce(void **state) {
    (void)state;
    struct setting one, many;
    set_up(&one, BALL, 1);
    set_up(&many, BALL, 4);
    assert_int_equal(many.spread.renderings, 0);
    for (int k = 0; k <= SPREAD_P95; k++)
        for (int i = 0; i < PIXELS; i++) {
            float a = one.spread.plane[k][i], b = many.spread.plane[k][i];
            assert_true(isnan(a) ? isnan(b) : a == b);
        }
    tear_down(&one);
    tear_down(&many);
}

/* Light between the walls makes their colours less sure, in the other wall's pixels too. */
static void an_unknown_wall_shines_on_a_known_one(void **state) {
    (void)state;
    struct setting s;
    set_up(&s, FOLD, 5);
    const struct joint *joint[SCENE_PAINTS] = {&s.joint[0], NULL};
    struct planes planes;
    struct spread alone;
    int touched = 0;
    assert_int_equal(spread_make(s.scene, joint, SEED, &(struct render_options){0}, &alone, NULL), 0);
    assert_int_equal(spread_render(s.scene, &(struct render_options){0}, &planes, NULL), 0);
    for (int i = 0; i < PIXELS; i++)
        if (planes.paint[i] == 1) {
            touched += alone.plane[SPREAD_COV_XYZ + 3][i] > 1e-8;
            assert_true(alone.plane[SPREAD_COV_XYZ + 3][i] <= s.spread.plane[SPREAD_COV_XYZ + 3][i]);
        }
    assert_true(touched > 5);
    planes_free(&planes);
    spread_free(&alone);
    tear_down(&s);
}

static int by_size(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Every draw of both paints rendered anew; to first order, of small uncertainties, the differences are the same. */
static void the_differences_are_those_of_rendered_draws(void **state) {
    (void)state;
    static double de[PIXELS][SPREAD_DRAWS];
    struct setting s;
    struct spread_paint p[2];
    double white[3], *best, lab[PIXELS][3];
    set_up(&s, FOLD, 3);
    assert_int_equal(white_of(s.scene, white, NULL), 0);
    for (int k = 0; k < 2; k++)
        assert_int_equal(spread_paint_make(s.scene, k, &s.joint[k], SEED, &p[k], NULL), 0);
    memcpy(s.moved, s.scene, sizeof *s.moved);
    best = rendered_xyz(&s);
    for (int i = 0; i < PIXELS; i++)
        colour_lab(best + 3 * i, white, lab[i]);
    for (int d = 0; d < SPREAD_DRAWS; d++) {
        memcpy(s.moved, s.scene, sizeof *s.moved);
        for (int k = 0; k < 2; k++)
            for (int i = 0; i < s.joint[k].n; i++)
                move(&s, k, &s.joint[k].row[i], p[k].draw[d * s.joint[k].n + i]);
        double *xyz = rendered_xyz(&s), drawn[3];
        for (int i = 0; i < PIXELS; i++) {
            colour_lab(xyz + 3 * i, white, drawn);
            de[i][d] = ciede2000(lab[i], drawn);
        }
        free(xyz);
    }
    for (int i = 0; i < PIXELS; i++) {
        if (isnan(s.spread.plane[SPREAD_XYZ][i]))
            continue;
        qsort(de[i], SPREAD_DRAWS, sizeof **de, by_size);
        double median = (de[i][SPREAD_DRAWS / 2 - 1] + de[i][SPREAD_DRAWS / 2]) / 2,
               p95 = de[i][SPREAD_DRAWS * 95 / 100];
        assert_true(fabs(s.spread.plane[SPREAD_MEDIAN][i] - median) < .05 * median + 1e-3);
        assert_true(fabs(s.spread.plane[SPREAD_P95][i] - p95) < .1 * p95 + 1e-3);
    }
    free(best);
    spread_paint_free(&p[0]);
    spread_paint_free(&p[1]);
    tear_down(&s);
}

/* beta' by bands, all of them moved together, is the shared one. */
static void beta_prime_by_bands_adds_up(void **state) {
    (void)state;
    double trace[2] = {0, 0};
    for (int by_band = 0; by_band < 2; by_band++) {
        const struct joint *joint[SCENE_PAINTS] = {NULL};
        struct joint j = {.converged = true, .beta_prime_per_band = by_band};
        struct scene *scene = scene_of(FOLD, 4);
        struct spread spread;
        strcpy(j.model, scene->paint[0].estimate.model);
        for (int k = 0; k < (by_band ? MEASURED : 1); k++)
            j.row[j.n++] = (struct joint_row){MATERIAL_BETA_PRIME, by_band ? measured[k] : -1};
        assert_int_equal(joint_allocate(&j, j.n, NULL), 0);
        for (int i = 0; i < j.n * j.n; i++)
            j.statistical[i] = .01;
        joint[0] = &j;
        assert_int_equal(spread_make(scene, joint, SEED, &(struct render_options){0}, &spread, NULL), 0);
        for (int i = 0; i < PIXELS; i++)
            trace[by_band] += isnan(spread.plane[SPREAD_XYZ][i]) ? 0 : spread.plane[SPREAD_COV_XYZ + 3][i];
        spread_free(&spread);
        joint_free(&j);
        scene_free(scene);
    }
    assert_true(trace[0] > 0 && fabs(trace[1] / trace[0] - 1) < 1e-3);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_covariance_is_that_of_the_rendered_jacobian),
        cmocka_unit_test(a_convex_shape_has_the_covariance_of_one_bounce),
        cmocka_unit_test(an_unknown_wall_shines_on_a_known_one),
        cmocka_unit_test(the_differences_are_those_of_rendered_draws),
        cmocka_unit_test(beta_prime_by_bands_adds_up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
