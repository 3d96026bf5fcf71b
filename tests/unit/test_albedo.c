#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "fit/render/albedo.h"

static struct paint paint_of(const char *model, const double *value, double s) {
    struct paint p = {.name = "test"};
    struct err e = {0};
    snprintf(p.estimate.model, sizeof p.estimate.model, "%s", model);
    memcpy(p.estimate.value, value, 7 * sizeof *value);
    p.estimate.kappa = 1;
    for (int k = 0; k < BANDS; k++)
        p.estimate.s_lambda[k] = s;
    if (paint_prepare(&p, &e))
        fail_msg("%s", e.text);
    return p;
}

/* Published sets; specular albedo by 200,000 facets (0, 60, 75, 85 deg), diffuse and interreflection at 0 deg. */
static const struct {
    double value[7], specular[4], diffuse, inter;
} sets[] = {
    {{1, .35, .05, 126, 1.40}, {.050, .132, .414, .901}, .865, .083},
    {{1, .2, .2, 15.7, 1.70}, {.235, .389, .692, 1.28}, .946, .040},
    {{1, .3, .07, 7.6, 1.70}, {.014, .026, .058, .106}, .893, .070},
    {{1, .5, .08, 1.6, 2.42}, {.010, .012, .018, .029}, .785, .112},
};

static void the_published_sets_return_what_is_known(void **state) {
    (void)state;
    static const double angles_deg[] = {0, 60, 75, 85};
    for (size_t i = 0; i < sizeof sets / sizeof *sets; i++) {
        struct paint p = paint_of("composite", sets[i].value, 1);
        for (int k = 0; k < 4; k++) {
            struct albedo x = albedo_at(&p, angles_deg[k]);
            if (!(fabs(x.specular - sets[i].specular[k]) < 6e-4 + 4e-3 * x.specular))
                fail_msg("set %zu at %g deg: %g, known %g", i, angles_deg[k], x.specular,
                         sets[i].specular[k]);
        }
        struct albedo x = albedo_at(&p, 0);
        assert_true(fabs(x.diffuse - sets[i].diffuse) < 1e-3 && fabs(x.inter - sets[i].inter) < 1e-3);
    }
}

static void lambert_returns_s(void **state) {
    (void)state;
    struct paint p = paint_of("lambert", (double[7]){1}, .7);
    struct albedo x = albedo_at(&p, 40);
    double highest;
    assert_true(fabs(x.diffuse - 1) < 1e-12 && x.inter == 0 && x.specular == 0);
    assert_true(albedo_above_one_deg(&p, &highest) == -1 && fabs(highest - .7) < 1e-12);
}

/* Of a bright paint: the driest set from the normal on, the wettest never. */
static void too_much_is_told_from_its_angle(void **state) {
    (void)state;
    double highest;
    struct paint dry = paint_of("composite", sets[1].value, .9),
                 wet = paint_of("composite", sets[3].value, .9);
    assert_true(albedo_above_one_deg(&dry, &highest) == 0 && highest > 2);
    assert_true(albedo_above_one_deg(&wet, &highest) == -1 && highest < 1);
    struct paint board = paint_of("composite", sets[0].value, .9);
    double from_deg = albedo_above_one_deg(&board, &highest);
    assert_true(from_deg > 60 && from_deg <= 70);
}

static void a_narrow_lobe_beside_a_wide_one_is_counted(void **state) {
    (void)state;
    const double both[7] = {1, .3, .01, 100, 1.5, .3, 1}, wide[7] = {1, .3, .3, 1, 1.5},
                 narrow[7] = {1, .3, .01, 100, 1.5};
    struct paint p = paint_of("two-lobe", both, 1), a = paint_of("composite", wide, 1),
                 b = paint_of("composite", narrow, 1);
    double sum = albedo_at(&a, 30).specular + albedo_at(&b, 30).specular;
    assert_true(fabs(albedo_at(&p, 30).specular - sum) < 1e-3 * sum);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_published_sets_return_what_is_known),
        cmocka_unit_test(lambert_returns_s),
        cmocka_unit_test(too_much_is_told_from_its_angle),
        cmocka_unit_test(a_narrow_lobe_beside_a_wide_one_is_counted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
