#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fit/dice.h"
#include "fit/render/ciede2000.h"
#include "fit/render/exr.h"
#include "fit/render/spread.h"
#include "fit/render/spread_slope.h"
#include "fit/render/verbs.h"
#include "fit/render/white.h"
#include "proto/session.h"
#include "tests/support/render_scene.h"

#define WIDTH 12
#define HEIGHT 10
#define PIXELS (WIDTH * HEIGHT)
#define SEED 7
/* Two paints, one of them with a lobe, that meet in some pixels; a second light of another spectrum. */
#define SCENE                                                                                                \
    "materials:\n"                                                                                           \
    "  - {name: m, spectrum: green.csv, sigma: 0.3, gamma: 0.2, beta_prime: 7.6, n: 1.7}\n"                  \
    "  - {name: k, uniform: 0.4, sigma: 0.5, model: oren-nayar}\n"                                           \
    "  - {name: sure, uniform: 0.7, model: lambert}\n"                                                       \
    "shapes:\n"                                                                                              \
    "  - cylinder: {material: m, radius_mm: 20, length_mm: 60, turn_deg: [20, 0, 17]}\n"                     \
    "  - sphere: {material: k, radius_mm: 12, at_mm: [15, 5, 25]}\n"                                         \
    "  - sphere: {material: sure, radius_mm: 9, at_mm: [-25, 20, 25]}\n"                                     \
    "lights:\n"                                                                                              \
    "  - beam: {theta_deg: 25, weight: 3, spd: D65}\n"                                                       \
    "  - beam: {theta_deg: 50, azimuth_deg: 200, spd: A}\n"                                                  \
    "camera: {orthographic: {height_mm: 80}}\nimage: {width: 12, height: 10, grid: 2}\n"

static void add_row(struct joint *j, int parameter, int band, double *u, double relative, double value) {
    u[j->n] = relative * value;
    j->row[j->n++] = (struct joint_row){parameter, band};
}

/* Neighbouring bands go together, n against beta', and a common part scales every S at once. */
static struct joint joint_of(const struct paint *paint, bool per_band) {
    struct joint j = {.converged = true, .beta_prime_per_band = per_band};
    double u[JOINT_ROWS];
    strcpy(j.model, paint->estimate.model);
    for (int m = MATERIAL_SIGMA; m < MATERIAL_PARAMETERS; m++)
        if (material_parameter_name(j.model, m) && !(per_band && m == MATERIAL_BETA_PRIME))
            add_row(&j, m, -1, u, .015, paint->estimate.value[m]);
    for (int k = 0; k < BANDS; k++)
        if (isfinite(paint->estimate.s_lambda[k]))
            add_row(&j, MATERIAL_S, k, u, .01, paint->estimate.s_lambda[k]);
    for (int k = 0; k < BANDS && per_band; k++)
        add_row(&j, MATERIAL_BETA_PRIME, k, u, .04, paint->estimate.value[MATERIAL_BETA_PRIME]);
    assert_int_equal(joint_allocate(&j, j.n, NULL), 0);
    for (int a = 0; a < j.n; a++) {
        for (int b = 0; b < j.n; b++) {
            const struct joint_row *p = &j.row[a], *q = &j.row[b];
            bool same = p->parameter == q->parameter, spectra = same && p->band >= 0;
            double correlation = a == b ? 1 : spectra ? .9 * exp(-abs(p->band - q->band) / 8.0) : 0;
            if (p->band < 0 && q->band < 0 &&
                p->parameter + q->parameter == MATERIAL_BETA_PRIME + MATERIAL_N && !same)
                correlation = -.95;
            j.statistical[a * j.n + b] = correlation * u[a] * u[b];
            if (p->parameter == MATERIAL_S && q->parameter == MATERIAL_S)
                j.common[a * j.n + b] = u[a] * u[b];
        }
    }
    return j;
}

static void move(struct scene *scene, int paint, const struct joint_row *row, double change) {
    struct estimate *m = &scene->paint[paint].estimate;
    *(row->band < 0 ? &m->value[row->parameter] : &m->s_lambda[row->band]) += change;
}

static double *rendered_xyz(const struct scene *scene) {
    struct planes planes;
    assert_int_equal(spread_render(scene, &(struct render_options){.threads = 1}, &planes, NULL), 0);
    double *xyz = xyz_of(scene, &planes, false);
    planes_free(&planes);
    return xyz;
}

struct setting {
    struct scene *scene, *moved;
    struct joint joint[2];
    struct spread spread;
};

static void set_up(struct setting *s) {
    struct err e = {0};
    s->scene = scene_of("%s", SCENE);
    s->moved = malloc(sizeof *s->moved);
    for (int p = 0; p < 2; p++)
        s->joint[p] = joint_of(&s->scene->paint[p], false);
    const struct joint *joint[SCENE_PAINTS] = {&s->joint[0], &s->joint[1]};
    if (spread_make(s->scene, joint, SEED, &(struct render_options){0}, &s->spread, &e))
        fail_msg("%s", e.text);
}

static void tear_down(struct setting *s) {
    spread_free(&s->spread);
    joint_free(&s->joint[0]);
    joint_free(&s->joint[1]);
    scene_free(s->scene);
    free(s->moved);
}

/* Every row moved in turn and the scene rendered anew gives J; J C J^T by plain sums. */
static void the_covariance_is_that_of_the_rendered_jacobian(void **state) {
    (void)state;
    struct setting s;
    static double cov[PIXELS][3][3];
    set_up(&s);
    memset(cov, 0, sizeof cov);
    for (int p = 0; p < 2; p++) {
        const struct joint *j = &s.joint[p];
        double *slope[JOINT_ROWS];
        for (int i = 0; i < j->n; i++) {
            double *side[2], step = 1e-4 * sqrt(j->statistical[i * j->n + i]);
            for (int k = 0; k < 2; k++) {
                memcpy(s.moved, s.scene, sizeof *s.moved);
                move(s.moved, p, &j->row[i], k ? -step : step);
                assert_int_equal(paint_prepare(&s.moved->paint[p], NULL), 0);
                side[k] = rendered_xyz(s.moved);
            }
            slope[i] = side[0];
            for (int x = 0; x < 3 * PIXELS; x++)
                slope[i][x] = (side[0][x] - side[1][x]) / (2 * step);
            free(side[1]);
        }
        for (int a = 0; a < j->n * j->n; a++) {
            double c = j->statistical[a] + j->common[a];
            for (int x = 0; x < 9 * PIXELS && c != 0; x++)
                cov[x / 9][x % 9 / 3][x % 3] +=
                    c * slope[a / j->n][x / 9 * 3 + x % 9 / 3] * slope[a % j->n][x / 9 * 3 + x % 3];
        }
        for (int i = 0; i < j->n; i++)
            free(slope[i]);
    }
    static const int at[6][2] = {{0, 0}, {0, 1}, {0, 2}, {1, 1}, {1, 2}, {2, 2}};
    int lit = 0;
    for (int i = 0; i < PIXELS; i++) {
        double trace = cov[i][0][0] + cov[i][1][1] + cov[i][2][2];
        lit += trace > 1e-6;
        for (int k = 0; k < 6 && !isnan(s.spread.plane[SPREAD_XYZ][i]); k++)
            assert_true(fabs(s.spread.plane[SPREAD_COV_XYZ + k][i] - cov[i][at[k][0]][at[k][1]]) <=
                        1e-5 * trace);
    }
    assert_true(lit > 20);
    tear_down(&s);
}

static int by_size(const void *a, const void *b) {
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

/* The draws of the paints, each rendered anew without any linearisation. */
static void the_differences_are_those_of_rendered_draws(void **state) {
    (void)state;
    struct setting s;
    struct spread_paint paint[2];
    static float de[PIXELS][SPREAD_DRAWS];
    double white[3];
    set_up(&s);
    assert_int_equal(white_of(s.scene, white, NULL), 0);
    double *best = rendered_xyz(s.scene);
    for (int p = 0; p < 2; p++)
        assert_int_equal(spread_paint_make(s.scene, p, &s.joint[p], SEED, &paint[p], NULL), 0);
    for (int d = 0; d < SPREAD_DRAWS; d++) {
        memcpy(s.moved, s.scene, sizeof *s.moved);
        for (int p = 0; p < 2; p++) {
            for (int i = 0; i < paint[p].n; i++)
                move(s.moved, p, &s.joint[p].row[i], paint[p].draw[d * paint[p].n + i]);
            assert_int_equal(paint_prepare(&s.moved->paint[p], NULL), 0);
        }
        double *xyz = rendered_xyz(s.moved);
        for (int i = 0; i < PIXELS; i++) {
            double lab[2][3];
            colour_lab(best + 3 * i, white, lab[0]);
            colour_lab(xyz + 3 * i, white, lab[1]);
            de[i][d] = (float)ciede2000(lab[0], lab[1]);
        }
        free(xyz);
    }
    int shown = 0;
    for (int i = 0; i < PIXELS; i++) {
        if (isnan(s.spread.plane[SPREAD_XYZ][i]))
            continue;
        qsort(de[i], SPREAD_DRAWS, sizeof de[i][0], by_size);
        double median = (de[i][127] + de[i][128]) / 2, p95 = de[i][243];
        double got_median = s.spread.plane[SPREAD_MEDIAN][i], got_p95 = s.spread.plane[SPREAD_P95][i];
        if (fabs(got_median - median) > .03 * median + .003 || fabs(got_p95 - p95) > .03 * p95 + .003)
            fail_msg("pixel %d: median %g and 95 %% %g, rendered %g and %g", i, got_median, got_p95, median,
                     p95);
        assert_true(fabs(s.spread.plane[SPREAD_XYZ + 1][i] - best[3 * i + 1]) < 1e-6);
        shown += p95 > .1;
    }
    assert_true(shown > 20);
    free(best);
    spread_paint_free(&paint[0]);
    spread_paint_free(&paint[1]);
    tear_down(&s);
}

/* cov_lab by the differences of colour_lab itself; the paint that is exactly known has none. */
static void lab_follows_xyz(void **state) {
    (void)state;
    struct setting s;
    struct planes planes;
    double white[3];
    int sure = 0;
    set_up(&s);
    assert_int_equal(white_of(s.scene, white, NULL), 0);
    assert_int_equal(spread_render(s.scene, &(struct render_options){0}, &planes, NULL), 0);
    for (int i = 0; i < PIXELS; i++) {
        float *const *plane = s.spread.plane;
        if (isnan(plane[SPREAD_XYZ][i]))
            continue;
        double slope[3], variance = 0;
        for (int k = 0; k < 3; k++) {
            double high[3], low[3], lab[2][3], step = 1e-6;
            for (int c = 0; c < 3; c++)
                high[c] = low[c] = plane[SPREAD_XYZ + c][i];
            high[k] += step;
            low[k] -= step;
            colour_lab(high, white, lab[0]);
            colour_lab(low, white, lab[1]);
            slope[k] = (lab[0][1] - lab[1][1]) / (2 * step); /* of a* */
        }
        static const int at[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
        for (int k = 0; k < 9; k++)
            variance += slope[k / 3] * slope[k % 3] * plane[SPREAD_COV_XYZ + at[k / 3][k % 3]][i];
        assert_true(fabs(variance - plane[SPREAD_COV_LAB + 3][i]) <= 2e-3 * variance + 1e-6);
        if (planes.paint[i] == 2 && planes.n_extra == 0)
            assert_true(plane[SPREAD_P95][i] == 0);
        sure += planes.paint[i] == 2 && plane[SPREAD_P95][i] == 0;
    }
    assert_true(sure > 0);
    planes_free(&planes);
    tear_down(&s);
}

/* beta' by bands, all bands moving as one, is the shared beta' moving. */
static void beta_prime_by_bands(void **state) {
    (void)state;
    struct scene *scene = scene_of("%s", SCENE);
    struct joint shared = joint_of(&scene->paint[0], false), bands = joint_of(&scene->paint[0], true);
    struct spread spread[2];
    for (int i = 0; i < 2; i++) {
        struct joint *j = i ? &bands : &shared;
        for (int a = 0; a < j->n * j->n; a++) {
            bool lobe = j->row[a / j->n].parameter == MATERIAL_BETA_PRIME &&
                        j->row[a % j->n].parameter == MATERIAL_BETA_PRIME;
            j->common[a] = 0;
            j->statistical[a] = lobe ? .25 : 0;
        }
        const struct joint *joint[SCENE_PAINTS] = {j};
        assert_int_equal(spread_make(scene, joint, SEED, &(struct render_options){0}, &spread[i], NULL), 0);
    }
    double largest = 0;
    for (int i = 0; i < PIXELS; i++) {
        if (isnan(spread[0].plane[SPREAD_XYZ][i]))
            continue;
        largest = fmax(largest, spread[0].plane[SPREAD_P95][i]);
        for (int k = SPREAD_COV_XYZ; k < SPREAD_LAB; k++)
            assert_true(fabs(spread[0].plane[k][i] - spread[1].plane[k][i]) < 1e-9);
        assert_true(fabs(spread[0].plane[SPREAD_P95][i] - spread[1].plane[SPREAD_P95][i]) < 1e-3);
    }
    assert_true(largest > .1);
    spread_free(&spread[0]);
    spread_free(&spread[1]);
    joint_free(&shared);
    joint_free(&bands);
    scene_free(scene);
}

static void a_factor_gives_its_matrix_back(void **state) {
    (void)state;
    enum { N = 9, RANK = 4 };
    double root[N][RANK], c[N * N], l[N * N];
    struct dice dice = {11};
    for (int i = 0; i < N * RANK; i++)
        root[i / RANK][i % RANK] = pow(10, i / RANK - 4) * dice_normal(&dice); /* units far apart */
    for (int i = 0; i < N * N; i++) {
        c[i] = 0;
        for (int k = 0; k < RANK; k++)
            c[i] += root[i / N][k] * root[i % N][k];
    }
    assert_int_equal(spread_factor(N, c, l), RANK);
    for (int i = 0; i < N * N; i++) {
        double sum = 0;
        for (int k = 0; k < N; k++)
            sum += l[i / N * N + k] * l[i % N * N + k];
        assert_true(fabs(sum - c[i]) < 1e-10 * sqrt(c[i / N * (N + 1)] * c[i % N * (N + 1)]));
    }
    memset(c, 0, sizeof c);
    assert_int_equal(spread_factor(N, c, l), 0);
}

static void any_number_of_threads_gives_the_same_file(void **state) {
    (void)state;
    struct setting s;
    struct spread again;
    struct exr_image image;
    char path[] = "/tmp/goniod-spread-XXXXXX.exr";
    close(mkstemps(path, 4));
    set_up(&s);
    const struct joint *joint[SCENE_PAINTS] = {&s.joint[0], &s.joint[1]};
    assert_int_equal(spread_make(s.scene, joint, SEED, &(struct render_options){.threads = 3}, &again, NULL),
                     0);
    for (int k = 0; k < SPREAD_PLANES; k++)
        assert_memory_equal(again.plane[k], s.spread.plane[k], PIXELS * sizeof(float));
    assert_true(s.spread.worst_sampling > 0 && s.spread.worst_p95 >= s.spread.typical_p95);
    assert_int_equal(spread_save(path, &s.spread, "{\"x\":1}", NULL), 0);
    assert_int_equal(exr_load(path, "goniod", &image, NULL), 0);
    assert_string_equal(image.text, "{\"x\":1}");
    assert_memory_equal(exr_plane(&image, "dE00.p95"), s.spread.plane[SPREAD_P95], PIXELS * sizeof(float));
    assert_memory_equal(exr_plane(&image, "covLab.bb"), s.spread.plane[SPREAD_COV_LAB + 5],
                        PIXELS * sizeof(float));
    exr_free(&image);
    spread_free(&again);
    unlink(path);
    /* A joint fit of another model says nothing of this paint. */
    strcpy(s.joint[0].model, "eq1");
    assert_int_equal(spread_make(s.scene, joint, SEED, &(struct render_options){0}, &again, NULL),
                     -ERR_STATE);
    tear_down(&s);
}

/* As render --uncertainty does it: the covariance comes from the session; without one a paint is exactly known. */
static void a_session_lends_its_joint_fit(void **state) {
    (void)state;
    struct scene *scene = scene_of("%s", SCENE);
    struct joint joint = joint_of(&scene->paint[0], false);
    struct session *session;
    struct err e = {0};
    char path[] = "/tmp/goniod-paint-XXXXXX", file[] = "/tmp/goniod-spread-XXXXXX.exr";
    close(mkstemp(path));
    close(mkstemps(file, 4));
    unlink(path);
    assert_int_equal(session_create(&session, path, &e), 0);
    scene->paint[0].estimate.converged = scene->paint[0].estimate.has_spectrum = true;
    assert_int_equal(session_add_estimate(session, 1, 0, &scene->paint[0].estimate, &e), 0);
    assert_int_equal(session_add_joint(session, &joint, &e), 0);
    assert_int_equal(session_close(session, &e), 0);
    if (paint_from_session(&scene->paint[0], path, &e))
        fail_msg("%s", e.text);
    json_t *origin = json_object();
    if (verb_uncertainty(file, scene, &(struct render_options){0}, origin, &e))
        fail_msg("%s", e.text);
    const json_t *said = json_object_get(origin, "uncertainty");
    assert_true(json_number_value(json_object_get(said, "median_of_p95")) > .1);
    assert_int_equal(json_array_size(json_object_get(said, "exactly_known")), 2);
    json_decref(origin);
    joint_free(&joint);
    scene_free(scene);
    unlink(path);
    unlink(file);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_factor_gives_its_matrix_back),
        cmocka_unit_test(the_covariance_is_that_of_the_rendered_jacobian),
        cmocka_unit_test(the_differences_are_those_of_rendered_draws),
        cmocka_unit_test(lab_follows_xyz),
        cmocka_unit_test(beta_prime_by_bands),
        cmocka_unit_test(any_number_of_threads_gives_the_same_file),
        cmocka_unit_test(a_session_lends_its_joint_fit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
