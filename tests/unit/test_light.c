#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fit/render/exr.h"
#include "fit/render/light.h"
#include "fit/render/sampler.h"

static struct light rectangle(double x, double y, double z, double width, double height) {
    struct light light = {.kind = LIGHT_RECTANGLE,
                          .weight = 1,
                          .at_mm = {x, y, z},
                          .rectangle = {.width_mm = width, .height_mm = height, .up = {0, 1, 0}}};
    struct err e = {0};
    if (light_prepare(&light, ".", &e))
        fail_msg("%s", e.text);
    return light;
}

static struct light sphere(double x, double y, double z, double radius) {
    struct light light = {.kind = LIGHT_SPHERE, .weight = 1, .at_mm = {x, y, z}, .radius_mm = radius};
    struct err e = {0};
    if (light_prepare(&light, ".", &e))
        fail_msg("%s", e.text);
    return light;
}

/* A map of 16 x 8 that no two cells share. */
static void fill(void *arg, int y, float *const *row) {
    double flat = *(double *)arg;
    for (int x = 0; x < 16; x++)
        row[0][x] = (float)(flat > 0 ? flat : (x % 5) * 0.5 + (y == 2 && x == 11 ? 40 : 0.1 * y));
}

static char map_file[64];

static void write_map(double flat) {
    static const char channel[1][EXR_NAME_MAX] = {"Y"};
    struct exr_form form = {
        .width = 16, .height = 8, .n_channels = 1, .channel = channel, .fill = fill, .arg = &flat};
    snprintf(map_file, sizeof map_file, "/tmp/test_light-%d.exr", (int)getpid());
    assert_int_equal(exr_save(map_file, &form, NULL), 0);
}

static struct light environment(double turn_deg) {
    struct light light = {
        .kind = LIGHT_ENVIRONMENT, .weight = 1, .environment = {.turn_deg = {10, turn_deg, 0}}};
    struct err e = {0};
    write_map(0);
    snprintf(light.environment.image, sizeof light.environment.image, "%s", map_file);
    if (light_prepare(&light, ".", &e))
        fail_msg("%s", e.text);
    unlink(map_file);
    return light;
}

enum { KINDS = 7 };

static struct light light_of(int kind) {
    switch (kind) {
    case 0:
        return rectangle(0, 0, 100, 60, 40);
    case 1:
        return rectangle(30, -80, 50, 5, 200);
    case 2:
        return rectangle(0, 0, 5000, 20, 20); /* small: by area */
    case 3:
        return sphere(10, 20, 60, 15);
    case 4:
        return sphere(0, 3, 21, 20.9); /* fills nearly half of what is seen */
    case 5:
        return environment(0);
    default:
        return environment(130);
    }
}

static const struct vec3 places[] = {{0, 0, 0}, {12, -7, 3}, {-40, 25, 9}};

/* What is drawn is what a ray meets there: same density, radiance and distance. */
static void what_is_drawn_is_met(void **state) {
    (void)state;
    for (int kind = 0; kind < KINDS; kind++) {
        struct light light = light_of(kind);
        int borders = 0;
        for (uint32_t i = 0; i < 3000; i++) {
            struct sampler s;
            struct light_sample drawn, met;
            double u[2];
            sampler_start(&s, 1, (uint32_t)kind, i);
            sampler_2d(&s, u);
            if (!light_sample(&light, places[i % 3], u, &drawn))
                continue;
            assert_true(fabs(vec3_length(drawn.l) - 1) < 1e-12 && drawn.density > 0 && drawn.radiance > 0);
            double radiance = light_radiance(&light, places[i % 3], drawn.l, &met);
            if (radiance != drawn.radiance) { /* rounded over a border, of the light or of a cell */
                borders++;
                continue;
            }
            assert_true(fabs(met.density / drawn.density - 1) < 1e-9);
            assert_true(isinf(drawn.distance_mm) ||
                        fabs(met.distance_mm - drawn.distance_mm) < 1e-6 * drawn.distance_mm);
        }
        assert_true(borders < 5);
        light_free(&light);
    }
}

/* Over all directions, by midpoints on the sphere that know nothing of the light. */
static void densities_integrate_to_one(void **state) {
    (void)state;
    for (int kind = 0; kind < KINDS; kind++) {
        struct light light = light_of(kind);
        struct light_sample unused;
        double sum = 0;
        if (kind == 2)
            continue; /* smaller than the steps of this sum */
        enum { N = 1000 };
        for (int i = 0; i < N; i++)
            for (int k = 0; k < 2 * N; k++) {
                double z = 1 - (2 * i + 1.0) / N, azimuth = (k + 0.5) * M_PI / N, r = sqrt(1 - z * z);
                struct vec3 l = {r * cos(azimuth), r * sin(azimuth), z};
                if (light_radiance(&light, places[1], l, &unused) > 0)
                    sum += unused.density * 4 * M_PI / (2.0 * N * N);
            }
        if (!(fabs(sum - 1) < 3e-3))
            fail_msg("light %d: %.6g", kind, sum);
        light_free(&light);
    }
}

static double density_of(const struct light *light, struct vec3 from, struct vec3 l) {
    struct light_sample sample;
    return light_radiance(light, from, l, &sample) > 0 ? sample.density : 0;
}

/* Directions drawn fall where the density says: sums over eight octants and by the cosine to an axis. */
static void draws_follow_the_density(void **state) {
    (void)state;
    for (int kind = 0; kind < KINDS; kind++) {
        struct light light = light_of(kind);
        enum { N = 1 << 14, M = 700 };
        struct vec3 drawn = {0, 0, 0}, expected = {0, 0, 0};
        for (uint32_t i = 0; i < N; i++) {
            struct sampler s;
            struct light_sample x;
            double u[2];
            sampler_start(&s, 2, (uint32_t)kind, i);
            sampler_2d(&s, u);
            if (light_sample(&light, places[2], u, &x))
                drawn = vec3_add(drawn, vec3_scale(x.l, 1.0 / N));
        }
        for (int i = 0; i < M; i++)
            for (int k = 0; k < 2 * M; k++) {
                double z = 1 - (2 * i + 1.0) / M, azimuth = (k + 0.5) * M_PI / M, r = sqrt(1 - z * z);
                struct vec3 l = {r * cos(azimuth), r * sin(azimuth), z};
                expected = vec3_add(
                    expected, vec3_scale(l, density_of(&light, places[2], l) * 4 * M_PI / (2.0 * M * M)));
            }
        if (kind != 2 && !(vec3_length(vec3_sub(drawn, expected)) < 6e-3))
            fail_msg("light %d: %g %g %g, expected %g %g %g", kind, drawn.x, drawn.y, drawn.z, expected.x,
                     expected.y, expected.z);
        light_free(&light);
    }
}

/* Y = 1 / pi of the integral of radiance cos: of the perfect diffuser at the origin, for n. */
static double y_at_origin(const struct light *light, struct vec3 n) {
    double sum = 0;
    enum { N = 1 << 16 };
    for (uint32_t i = 0; i < N; i++) {
        struct sampler s;
        struct light_sample x;
        double u[2];
        sampler_start(&s, 3, 0, i);
        sampler_2d(&s, u);
        if (light_sample(light, (struct vec3){0, 0, 0}, u, &x))
            sum += x.radiance / x.density * fmax(vec3_dot(x.l, n), 0) / M_PI / N;
    }
    return sum;
}

static void the_perfect_diffuser_facing_a_light_has_y_1(void **state) {
    (void)state;
    for (int kind = 0; kind < 5; kind++) {
        struct light light = light_of(kind);
        double y =
            y_at_origin(&light, vec3_unit((struct vec3){light.at_mm[0], light.at_mm[1], light.at_mm[2]}));
        if (!(fabs(y - 1) < (kind == 1 ? 0.01 : 2e-4))) /* the long one is faced best a little aside */
            fail_msg("light %d: Y = %.7g", kind, y);
    }
    struct light light = environment(40);
    double mean = 0;
    for (int i = 0; i < 6; i++)
        mean += y_at_origin(&light,
                            (struct vec3){(i == 0) - (i == 1), (i == 2) - (i == 3), (i == 4) - (i == 5)}) /
                6;
    assert_true(fabs(mean - 1) < 0.2); /* six of all the ways to face */
    light_free(&light);
}

/* Middle column at -z, +x to its right, first row at +y: where the panorama of a camera that looks along -z has it. */
static void an_environment_stands_as_a_panorama(void **state) {
    (void)state;
    struct light light = environment(0);
    struct light_sample s;
    light.environment.frame = frame_make((double[]){0, 0, 0}, (double[]){0, 0, 0});
    double azimuth = 2 * M_PI * (11.5 / 16 - 0.5), polar = M_PI * 2.5 / 8; /* the bright cell */
    struct vec3 l = {sin(polar) * sin(azimuth), cos(polar), -sin(polar) * cos(azimuth)};
    assert_true(l.x > 0 && l.y > 0);
    double bright = light_radiance(&light, places[0], l, &s);
    for (int i = 0; i < 4; i++) {
        l = (struct vec3){(i == 0) - (i == 1), 0.1, (i == 2) - (i == 3)};
        assert_true(light_radiance(&light, places[0], vec3_unit(l), &s) < bright / 10);
    }
    light.environment.frame =
        frame_make((double[]){0, 0, 0}, (double[]){0, 90, 0}); /* about +y: +x goes to -z */
    l = (struct vec3){-sin(polar) * cos(azimuth), cos(polar), -sin(polar) * sin(azimuth)};
    assert_true(light_radiance(&light, places[0], l, &s) == bright);
    light_free(&light);
}

static void lights_shine_to_one_side(void **state) {
    (void)state;
    struct light flat = rectangle(0, 0, 100, 60, 40), ball = sphere(0, 0, 100, 10);
    struct light_sample s;
    double u[2] = {0.3, 0.6};
    assert_false(light_sample(&flat, (struct vec3){0, 0, 120}, u, &s));
    assert_true(light_radiance(&flat, (struct vec3){0, 0, 120}, (struct vec3){0, 0, -1}, &s) == 0);
    assert_true(light_radiance(&flat, places[0], (struct vec3){0, 0, -1}, &s) == 0);
    assert_true(light_radiance(&flat, places[0], (struct vec3){0, 0, 1}, &s) > 0 && s.distance_mm == 100);
    assert_false(light_sample(&ball, (struct vec3){0, 0, 95}, u, &s)); /* inside */
    assert_true(light_radiance(&ball, (struct vec3){0, 0, 95}, (struct vec3){0, 0, 1}, &s) == 0);
    assert_true(light_radiance(&ball, places[0], (struct vec3){0, 0, 1}, &s) > 0 && s.distance_mm == 90);
}

static void what_is_no_light_says_why(void **state) {
    (void)state;
    struct err e = {0};
    struct light back = {
        .kind = LIGHT_RECTANGLE,
        .weight = 1,
        .at_mm = {0, 0, 100},
        .rectangle = {.width_mm = 1, .height_mm = 1, .up = {0, 1, 0}, .look_at_mm = {0, 0, 200}}};
    assert_int_equal(light_prepare(&back, ".", &e), -ERR_INPUT);
    assert_non_null(strstr(e.text, "back to the scene's origin"));
    struct light around = {.kind = LIGHT_SPHERE, .weight = 1, .at_mm = {1, 0, 0}, .radius_mm = 2};
    e = (struct err){0};
    assert_int_equal(light_prepare(&around, ".", &e), -ERR_INPUT);
    assert_non_null(strstr(e.text, "holds the scene's origin"));
    struct light dark = {.kind = LIGHT_ENVIRONMENT, .weight = 1, .environment = {.image = "none.exr"}};
    e = (struct err){0};
    assert_int_equal(light_prepare(&dark, "/nowhere", &e), -ERR_IO);
    dark.weight = 0; /* then it is not opened */
    assert_int_equal(light_prepare(&dark, "/nowhere", NULL), 0);
    struct light_sample s;
    assert_false(light_sample(&dark, places[0], (double[]){0.5, 0.5}, &s));
    snprintf(dark.environment.image, sizeof dark.environment.image, "sky.jpg");
    dark.weight = 1;
    e = (struct err){0};
    assert_int_equal(light_prepare(&dark, "/nowhere", &e), -ERR_INPUT);
    assert_non_null(strstr(e.text, ".exr or .png"));
    write_map(1e-30);
    snprintf(dark.environment.image, sizeof dark.environment.image, "%s", map_file);
    assert_int_equal(light_prepare(&dark, ".", NULL), 0); /* however dim */
    light_free(&dark);
    write_map(INFINITY);
    e = (struct err){0};
    assert_int_equal(light_prepare(&dark, ".", &e), -ERR_INPUT);
    assert_non_null(strstr(e.text, "column 0, row 0"));
    light_free(&dark);
    unlink(map_file);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_drawn_is_met),
        cmocka_unit_test(densities_integrate_to_one),
        cmocka_unit_test(draws_follow_the_density),
        cmocka_unit_test(the_perfect_diffuser_facing_a_light_has_y_1),
        cmocka_unit_test(an_environment_stands_as_a_panorama),
        cmocka_unit_test(lights_shine_to_one_side),
        cmocka_unit_test(what_is_no_light_says_why),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
