#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <unistd.h>

#include "fit/render/planes_file.h"
#include "fit/render/spread.h"
#include "fit/render/spread_slope.h"
#include "fit/render/trace.h"
#include "tests/support/render_scene.h"

#define FLOOR "shapes: [rectangle: {material: m, width_mm: 80, height_mm: 80}]\n"

struct total { /* over the pixels of a picture */
    double y, variance, largest;
};

static struct total total_of(const struct scene *scene, const struct render_options *options,
                             struct render_report *report) {
    struct planes planes;
    struct total total = {0};
    planes_of(scene, options, &planes, report);
    double *xyz = xyz_of(scene, &planes, false);
    for (int i = 0; i < planes.width * planes.height; i++) {
        total.y += xyz[3 * i + 1];
        total.variance += planes.noise[i];
        total.largest = fmax(total.largest, xyz[3 * i + 1]);
    }
    free(xyz);
    planes_free(&planes);
    return total;
}

/* height_mm: of what is seen of the floor, around the panel's mirror image. */
static struct scene *under(int panel_mm, double gamma, double beta_prime, int height_mm, int samples) {
    return scene_of(
        "materials: [{name: m, uniform: 0.2, sigma: 0.3, gamma: %g, beta_prime: %g, n: 1.5}]\n" FLOOR
        "lights: [rectangle: {at_mm: [0, 10, 60], width_mm: %d, height_mm: %d, look_at_mm: [0, 10, 0]}]\n"
        "camera: {orthographic: {look_at_mm: [0, 10, 0], height_mm: %d}}\n"
        "image: {width: 30, height: 30, grid: 1, samples: %d}\n",
        gamma, beta_prime, panel_mm, panel_mm, height_mm, samples);
}

static struct scene *under_a_panel(double gamma, double beta_prime, int height_mm, int samples) {
    return under(6, gamma, beta_prime, height_mm, samples);
}

/* Two estimators of one mean: for a rough paint facets are not needed, but may be drawn. */
static void facets_and_light_agree(void **state) {
    (void)state;
    struct scene *scene = under(40, 0.2, 15.7, 80, 256); /* as bright to either */
    struct render_report lean, kept;
    struct total by_light = total_of(scene, &(struct render_options){0}, &lean);
    struct total by_both = total_of(scene, &(struct render_options){.keep = 1u << FEATURE_FACETS}, &kept);
    assert_true(!lean.features.line[FEATURE_FACETS].kept && kept.features.line[FEATURE_FACETS].kept);
    assert_true(by_light.variance > 0 && by_both.variance > 0 && by_light.y != by_both.y);
    double apart = by_light.y - by_both.y, deviation = sqrt(by_light.variance + by_both.variance);
    if (!(fabs(apart) < 5 * deviation && deviation < 5e-4 * by_light.y))
        fail_msg("%g and %g, +- %g", by_light.y, by_both.y, deviation);
    scene_free(scene);
}

/* gamma 0.001: the panel's mirror image. By light alone a few samples carry all of it. */
static void narrow_lobes_make_no_fireflies(void **state) {
    (void)state;
    struct scene *scene = under_a_panel(0.001, 315000, 12, 64);
    struct render_report report;
    struct total split = total_of(scene, &(struct render_options){0}, &report);
    assert_true(report.features.line[FEATURE_FACETS].kept);
    assert_int_equal(report.counts.drawn, 64 * report.counts.hits);
    assert_int_equal(report.counts.fireflies, 0);
    assert_true(sqrt(split.variance) < 0.01 * split.y);

    struct trace_y *y = calloc(1, sizeof *y);
    struct trace trace = {
        .scene = scene, .shade_features = SHADE_SIGMA | SHADE_SPECULAR, .repeats = 64, .y = y};
    struct planes planes;
    struct render_counts counts;
    for (int k = 0; k < 3; k++)
        y->abc[0][0][k] = (double[]){0.2, 0.04, 1}[k];
    assert_int_equal(planes_make(&planes, 30, 30, 1, true, true, NULL), 0);
    assert_int_equal(trace_run(&trace, trace_area, &(struct render_options){0}, &planes, &counts, NULL), 0);
    if (!(counts.fireflies > 5 && counts.fireflies < 1000))
        fail_msg("%llu fireflies by light alone", (unsigned long long)counts.fireflies);
    planes_free(&planes);
    free(y);
    scene_free(scene);
}

/* The stated variance is what many more samples show the error to be. */
static void the_stated_noise_is_the_error(void **state) {
    (void)state;
    static const double gammas[] = {0.2, 0.02};
    for (int k = 0; k < 2; k++) {
        struct scene *few = under_a_panel(gammas[k], 0.6 / (gammas[k] * gammas[k]), 16, 8),
                     *many = under_a_panel(gammas[k], 0.6 / (gammas[k] * gammas[k]), 16, 1024);
        struct planes planes[2];
        struct render_report report;
        planes_of(few, &(struct render_options){0}, &planes[0], &report);
        planes_of(many, &(struct render_options){0}, &planes[1], &report);
        double *xyz[2] = {xyz_of(few, &planes[0], false), xyz_of(many, &planes[1], false)};
        double square = 0, stated = 0;
        for (int i = 0; i < 900; i++) {
            square += pow(xyz[0][3 * i + 1] - xyz[1][3 * i + 1], 2);
            stated += planes[0].noise[i];
        }
        if (!(square < 1.4 * stated && stated < 1.4 * square))
            fail_msg("gamma %g: error %g, stated %g", gammas[k], sqrt(square / 900), sqrt(stated / 900));
        for (int i = 0; i < 2; i++) {
            planes_free(&planes[i]);
            free(xyz[i]);
        }
        scene_free(few);
        scene_free(many);
    }
}

static void the_noise_goes_with_the_planes(void **state) {
    (void)state;
    char path[] = "/tmp/test_trace_area-XXXXXX.exr";
    close(mkstemps(path, 4));
    struct scene *scene = under_a_panel(0.05, 126, 40, 16), *read = NULL;
    struct planes planes, back;
    struct render_report report;
    json_t *origin = json_object(), *stored = NULL;
    planes_of(scene, &(struct render_options){0}, &planes, &report);
    assert_true(report.samples == 16 && report.noise_y > 0);
    assert_int_equal(planes_save(path, scene, &planes, origin, NULL), 0);
    assert_int_equal(planes_load(path, &read, &back, &stored, NULL), 0);
    for (int i = 0; i < 900; i++)
        assert_true((float)planes.noise[i] == (float)back.noise[i]);
    unlink(path);
    json_decref(origin);
    json_decref(stored);
    planes_free(&planes);
    planes_free(&back);
    scene_free(scene);
    scene_free(read);
}

/* dc/dgamma of few samples against the difference of two pictures of many: the same directions up and down. */
static void slopes_have_no_noise_of_their_own(void **state) {
    (void)state;
    struct scene *few = under_a_panel(0.02, 1000, 16, 16), *many = under_a_panel(0.02, 1000, 16, 1024);
    struct planes slope, planes;
    struct render_report report;
    double steep = 0, sum = 0;
    assert_int_equal(spread_slope(few, (bool[SCENE_PAINTS]){true}, MATERIAL_GAMMA,
                                  &(struct render_options){0}, &slope, NULL),
                     0);
    for (int k = 0; k < 2; k++) {
        many->paint[0].estimate.value[MATERIAL_GAMMA] = 0.02 * (k ? 1.05 : 0.95);
        assert_int_equal(paint_prepare(&many->paint[0], NULL), 0);
        planes_of(many, &(struct render_options){0}, &planes, &report);
        for (int i = 0; i < 900; i++)
            sum += (k ? 1 : -1) * planes.set[0].c[i] / (0.1 * 0.02);
        planes_free(&planes);
    }
    for (int i = 0; i < 900; i++)
        steep += slope.set[0].c[i];
    if (!(fabs(steep / sum - 1) < 0.03))
        fail_msg("slope %g, differences %g", steep, sum);
    planes_free(&slope);
    scene_free(few);
    scene_free(many);
}

/* As --uncertainty has it: that of the picture with all features, which it is about. */
static void the_uncertainty_holds_the_noise(void **state) {
    (void)state;
    struct scene *scene = under_a_panel(0.05, 126, 40, 16);
    const struct joint *none[SCENE_PAINTS] = {NULL};
    struct planes planes;
    struct render_report report;
    struct spread spread;
    planes_of(scene, &(struct render_options){.all_features = true}, &planes, &report);
    assert_int_equal(spread_make(scene, none, 1, &(struct render_options){0}, &spread, NULL), 0);
    for (int i = 0; i < 900; i++)
        assert_true(spread.plane[SPREAD_NOISE][i] == (float)planes.noise[i]);
    assert_true(spread.worst_noise >= spread.typical_noise && spread.typical_noise > 0);
    spread_free(&spread);
    planes_free(&planes);
    scene_free(scene);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(facets_and_light_agree),
        cmocka_unit_test(narrow_lobes_make_no_fireflies),
        cmocka_unit_test(the_stated_noise_is_the_error),
        cmocka_unit_test(the_noise_goes_with_the_planes),
        cmocka_unit_test(slopes_have_no_noise_of_their_own),
        cmocka_unit_test(the_uncertainty_holds_the_noise),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
