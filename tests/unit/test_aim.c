#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>

#include "fit/render/glint.h"
#include "fit/render/intersect.h"
#include "fit/render/sampler.h"
#include "proto/units.h"
#include "tests/support/render_scene.h"

static const char *const scenes[] = {
    "  - fold: {material: m, width_mm: 20, length_mm: 30, angle_deg: 50}\n",
    "  - fold: {material: m, width_mm: 20, length_mm: 30, angle_deg: 130, turn_deg: [20, 30, 40]}\n",
    "  - sphere: {material: m, radius_mm: 8, at_mm: [-9, 0, 0]}\n"
    "  - sphere: {material: m, radius_mm: 6, at_mm: [7, 3, 2]}\n",
    "  - rectangle: {material: m, width_mm: 60, height_mm: 50}\n"
    "  - cylinder: {material: m, radius_mm: 5, length_mm: 20, at_mm: [3, 2, 14], turn_deg: [10, 20, 30]}\n"
    "  - rectangle: {material: m, width_mm: 10, height_mm: 70, at_mm: [-20, 0, 1], turn_deg: [0, 80, 0]}\n",
};

static struct scene *scene_number(size_t i) {
    return scene_of("materials: [{name: m, uniform: 1, model: lambert}]\nshapes:\n%s"
                    "lights: [beam: {theta_deg: 20}]\ncamera: {orthographic: {height_mm: 60}}\n"
                    "image: {width: 16, height: 16, grid: 1}\n",
                    scenes[i]);
}

/* A direction of the half space over the hit, even in the disc under it. */
static struct vec3 direction(const struct hit *hit, uint32_t n, double *cosine) {
    struct sampler sampler;
    struct vec3 s, t;
    double u[2];
    sampler_start(&sampler, 5, 0, n);
    sampler_2d(&sampler, u);
    vec3_frame(hit->normal, &s, &t);
    *cosine = sqrt(1 - u[0]);
    struct vec3 across = vec3_add(vec3_scale(s, cos(2 * M_PI * u[1])), vec3_scale(t, sin(2 * M_PI * u[1])));
    return vec3_add(vec3_scale(across, sqrt(u[0])), vec3_scale(hit->normal, *cosine));
}

/* From one hit: what is met lies in a sector, the density holds 1 in all, and what is drawn follows it. */
static void check_hit(const struct scene *scene, const struct aim *aim, const struct hit *hit, int *seen) {
    enum { N = 4096 };
    struct aim_view view;
    double whole = 0, moment = 0, drawn = 0;
    aim_from(aim, hit, &view);
    for (uint32_t n = 0; n < N; n++) {
        struct hit other;
        double cosine, density;
        struct vec3 l = direction(hit, n, &cosine);
        struct ray ray = intersect_leave(scene, hit, l);
        density = view.n_sectors > 0 ? aim_density(&view, l) : 0;
        if (intersect_nearest(scene, &ray, &other) && vec3_dot(other.normal, l) < 0) {
            if (!(density > 0))
                fail_msg("shape %d sees shape %d along %g %g %g and does not aim at it", hit->shape,
                         other.shape, l.x, l.y, l.z);
            ++*seen;
        }
        whole += density * M_PI / cosine / N;
        moment += density * M_PI / cosine * l.x * l.x / N;
    }
    if (view.n_sectors == 0)
        return;
    for (uint32_t n = 0; n < N; n++) {
        struct sampler sampler;
        double u[2];
        sampler_start(&sampler, 6, 0, n);
        sampler_2d(&sampler, u);
        struct vec3 l = aim_sample(&view, u);
        assert_true(fabs(vec3_length(l) - 1) < 1e-12 && aim_density(&view, l) > 0);
        drawn += l.x * l.x / N;
    }
    /* 4096 evenly spread points find an area to about 1 % of the disc. */
    double part = view.area / M_PI;
    if (!(fabs(whole - 1) < 0.02 / part + 0.02 && fabs(drawn - moment) < 0.02 / part + 0.02))
        fail_msg("density holds %g, second moment %g drawn and %g by density, sectors of %g", whole, drawn,
                 moment, part);
}

static void what_is_seen_is_aimed_at(void **state) {
    (void)state;
    for (size_t i = 0; i < sizeof scenes / sizeof *scenes; i++) {
        struct scene *scene = scene_number(i);
        struct aim aim;
        int seen = 0;
        aim_make(&aim, scene);
        for (int pixel = 0; pixel < 256; pixel++) {
            struct hit hit;
            struct ray ray = camera_ray(&scene->camera, pixel % 16 + 0.37, pixel / 16 + 0.61);
            if (intersect_nearest(scene, &ray, &hit) && vec3_dot(hit.normal, ray.direction) < 0)
                check_hit(scene, &aim, &hit, &seen);
        }
        assert_true(seen > 1000);
        scene_free(scene);
    }
}

/* Over all directions a glint's density holds 1, what is drawn follows it, and it is strongest where the mirror is. */
static void a_glint_is_where_the_mirror_is(void **state) {
    (void)state;
    enum { N = 1 << 16 };
    struct scene *scene =
        scene_of("materials:\n  - {name: m, uniform: 0.3, gamma: 0.2, beta_prime: 15.7, n: 1.7}\n"
                 "  - {name: k, uniform: 0.3, model: lambert}\n"
                 "shapes: [fold: {materials: [k, m], width_mm: 20, length_mm: 30}]\n"
                 "lights: [beam: {theta_deg: -20}]\ncamera: {orthographic: {height_mm: 60}}\n");
    struct energy energy[2];
    struct aim aim;
    struct glints glints;
    struct aim_view seen;
    struct glint_view view;
    struct hit hit = {.position = {-10, 0, 10}, .normal = {M_SQRT1_2, 0, M_SQRT1_2}, .shape = 0};
    double whole = 0, moment = 0, drawn = 0;
    for (int p = 0; p < 2; p++)
        energy_make(&energy[p], &scene->paint[p], ENERGY_SCALE);
    aim_make(&aim, scene);
    glint_make(&glints, scene, &aim, energy);
    assert_int_equal(glints.n, 1); /* the other side has no lobe */
    aim_from(&aim, &hit, &seen);
    glint_from(&glints, &seen, &view);
    assert_int_equal(view.n, 1);
    for (uint32_t n = 0; n < N; n++) {
        struct sampler sampler;
        double u[2];
        struct vec3 l;
        sampler_start(&sampler, 7, 0, n);
        sampler_2d(&sampler, u);
        double z = 2 * u[0] - 1, r = sqrt(1 - z * z);
        struct vec3 even = {r * cos(2 * M_PI * u[1]), r * sin(2 * M_PI * u[1]), z};
        whole += 4 * M_PI * glint_density(&view, even) / N;
        moment += 4 * M_PI * glint_density(&view, even) * even.x * even.x / N;
        sampler_2d(&sampler, u);
        assert_true(glint_sample(&view, u, &l) && glint_density(&view, l) > 0);
        drawn += l.x * l.x / N;
    }
    if (!(fabs(whole - 1) < 0.01 && fabs(drawn - moment) < 0.01))
        fail_msg("density holds %g, second moment %g drawn and %g by density", whole, drawn, moment);
    /* Light from (-sin 20, 0, cos 20), mirrored at (-1, 0, 1)/sqrt 2, leaves along (-cos 20, 0, sin 20): seen from there. */
    struct vec3 mirror = {cos(rad_from_deg(20)), 0, -sin(rad_from_deg(20))};
    struct vec3 beside = {cos(rad_from_deg(40)), 0, -sin(rad_from_deg(40))};
    assert_true(glint_density(&view, mirror) > glint_density(&view, beside));
    scene_free(scene);
}

static void many_shapes_are_not_aimed_at(void **state) {
    (void)state;
    struct scene *scene = scene_number(0);
    struct aim aim;
    struct hit hit = {.normal = {0, 0, 1}, .shape = 0};
    struct aim_view view;
    for (int i = 1; i < 5; i++)
        scene->shape[i] = scene->shape[0];
    scene->n_shapes = 4;
    aim_make(&aim, scene);
    assert_int_equal(aim.n, AIM_TARGETS);
    scene->n_shapes = 5;
    aim_make(&aim, scene);
    assert_int_equal(aim.n, 0);
    aim_from(&aim, &hit, &view);
    assert_int_equal(view.n_sectors, 0);
    scene->n_shapes = 1;
    scene_free(scene);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_seen_is_aimed_at),
        cmocka_unit_test(a_glint_is_where_the_mirror_is),
        cmocka_unit_test(many_shapes_are_not_aimed_at),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
