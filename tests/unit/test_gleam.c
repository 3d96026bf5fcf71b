#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>

#include "fit/render/gleam.h"
#include "fit/render/intersect.h"
#include "fit/render/sampler.h"
#include "tests/support/render_scene.h"

#define SIDES                                                                                                \
    "materials:\n  - {name: m, uniform: 0.3, sigma: 0.2, gamma: 0.2, beta_prime: 15.7, n: 1.7}\n"            \
    "  - {name: k, uniform: 0.3, sigma: 0.3, gamma: 0.1, beta_prime: 7.6, n: 1.7}\n"                         \
    "  - {name: q, uniform: 0.3, model: heavy-tail, gamma: 0.15, beta_prime: 9, n: 1.5, tail: 0.4}\n"        \
    "shapes: [fold: {materials: [%s], width_mm: 20, length_mm: 30, angle_deg: %d}]\n"                        \
    "lights: [beam: {theta_deg: 20, azimuth_deg: 150}]\ncamera: {orthographic: {height_mm: 20}}\n"           \
    "image: {width: 16, height: 16, grid: 1}\n"

struct place { /* of one pixel: what is drawn there */
    struct hit hit;
    struct gleam_surface near;
    struct gleam_view view;
};

struct fold {
    struct scene *scene;
    struct energy energy[3];
    struct aim aim;
    struct glints glints;
};

static void fold_make(struct fold *f, const char *materials, int angle_deg) {
    f->scene = scene_of(SIDES, materials, angle_deg);
    for (int p = 0; p < 3; p++)
        energy_make(&f->energy[p], &f->scene->paint[p], ENERGY_SCALE);
    aim_make(&f->aim, f->scene);
    glint_make(&f->glints, f->scene, &f->aim, f->energy);
}

static void place_at(const struct fold *f, int pixel, struct place *p) {
    struct ray ray = camera_ray(&f->scene->camera, pixel % 16 + 0.37, pixel / 16 + 0.61);
    struct aim_view seen;
    struct glint_view glints;
    assert_true(intersect_nearest(f->scene, &ray, &p->hit));
    p->near = (struct gleam_surface){&f->scene->paint[p->hit.paint].drawn, p->hit.normal,
                                     vec3_scale(ray.direction, -1), &f->energy[p->hit.paint]};
    aim_from(&f->aim, &p->hit, &seen);
    glint_from(&f->glints, &seen, &glints);
    gleam_from(&glints, &seen, &p->near, p->hit.position, &p->view);
}

/* Over all directions a gleam's density holds 1, and what is drawn follows it, however its target cuts it. */
static void the_density_is_that_of_the_draw(void **state) {
    (void)state;
    static const char *const materials[] = {"m, m", "m, k", "q, m"};
    enum { N = 1 << 15 };
    double least_kept = 1;
    int places = 0;
    for (int s = 0; s < 3; s++) {
        struct fold f;
        fold_make(&f, materials[s], 80 + 20 * s);
        for (int pixel = 17; pixel < 256; pixel += 37) {
            struct place p;
            double whole = 0, moment[3] = {0}, drawn[3] = {0};
            place_at(&f, pixel, &p);
            if (p.view.n == 0)
                continue;
            places++;
            least_kept = fmin(least_kept, p.view.gleam[0].kept);
            for (uint32_t n = 0; n < N; n++) {
                struct sampler sampler;
                double u[2];
                sampler_start(&sampler, 7, (uint32_t)pixel, n);
                sampler_2d(&sampler, u);
                double z = 2 * u[0] - 1, r = sqrt(1 - z * z);
                struct vec3 even = {r * cos(2 * M_PI * u[1]), r * sin(2 * M_PI * u[1]), z};
                double density = 4 * M_PI * gleam_density(&p.view, even) / N;
                whole += density;
                moment[0] += density * even.x * even.x;
                moment[1] += density * even.y;
                moment[2] += density * even.z;
                sampler_2d(&sampler, u);
                struct vec3 l = gleam_sample(&p.view, u);
                assert_true(fabs(vec3_length(l) - 1) < 1e-12 && gleam_density(&p.view, l) > 0);
                drawn[0] += l.x * l.x / N;
                drawn[1] += l.y / N;
                drawn[2] += l.z / N;
            }
            for (int i = 0; i < 3; i++)
                if (!(fabs(whole - 1) < 0.01 && fabs(drawn[i] - moment[i]) < 0.01))
                    fail_msg("scene %d, pixel %d: density holds %g, moment %d %g drawn, %g by density", s,
                             pixel, whole, i, drawn[i], moment[i]);
        }
        scene_free(f.scene);
    }
    assert_true(places > 15 && least_kept < 0.9);
}

/* What goes by both lobes along l. */
static double gloss(const struct gleam_surface *near, const struct gleam_surface *far, struct vec3 l) {
    const unsigned features = SHADE_SIGMA | SHADE_SPECULAR | SHADE_RELATIVES;
    struct vec3 back = vec3_scale(l, -1);
    return shade(features, near->drawn, NULL, near->normal, l, near->way).c *
           shade(features, far->drawn, NULL, far->normal, far->way, back).c;
}

/* Against a grid of directions around it; Fresnel and shadowing are met by one step along their slope. */
static void the_middle_is_where_both_lobes_are_brightest(void **state) {
    (void)state;
    struct fold f;
    fold_make(&f, "m, m", 90);
    for (int pixel = 17; pixel < 256; pixel += 37) {
        struct place p;
        struct gleam gleam;
        place_at(&f, pixel, &p);
        for (int i = 0; i < f.glints.n; i++) {
            const struct glint *g = &f.glints.glint[i];
            struct gleam_surface far = {g->drawn, g->normal, g->l, g->energy};
            if (vec3_dot(far.normal, p.near.normal) > 0.5 || !gleam_make(&p.near, &far, &gleam))
                continue;
            double middle = gloss(&p.near, &far, gleam.middle), most = 0;
            for (int k = 0; k < 41 * 41; k++) {
                struct vec3 x = vec3_scale(gleam.axis[0], (k % 41 - 20) / 10.0),
                            y = vec3_scale(gleam.axis[1], (k / 41 - 20) / 10.0);
                most = fmax(most, gloss(&p.near, &far, vec3_unit(vec3_add(gleam.middle, vec3_add(x, y)))));
            }
            assert_true(most > 0);
            if (!(middle > 0.8 * most))
                fail_msg("pixel %d: %g in the middle, %g at most", pixel, middle, most);
        }
    }
    scene_free(f.scene);
}

/* A surface without a lobe has none; nor do lobes that meet behind one of the surfaces. */
static void without_two_lobes_there_is_none(void **state) {
    (void)state;
    struct scene *scene =
        scene_of("materials:\n  - {name: m, uniform: 0.3, gamma: 0.2, beta_prime: 15.7, n: 1.7}\n"
                 "  - {name: k, uniform: 0.3, model: lambert}\n"
                 "shapes: [fold: {materials: [k, m], width_mm: 20, length_mm: 30}]\n"
                 "lights: [beam: {theta_deg: -20}]\ncamera: {orthographic: {height_mm: 20}}\n"
                 "image: {width: 16, height: 16, grid: 1}\n");
    struct fold f = {.scene = scene};
    for (int p = 0; p < 2; p++)
        energy_make(&f.energy[p], &scene->paint[p], ENERGY_SCALE);
    aim_make(&f.aim, scene);
    glint_make(&f.glints, scene, &f.aim, f.energy);
    for (int pixel = 16; pixel < 32; pixel++) {
        struct place p;
        place_at(&f, pixel, &p);
        assert_true(p.view.part.gleams == 0 && gleam_density(&p.view, p.hit.normal) == 0);
    }
    struct gleam gleam;
    struct gleam_surface near = {&scene->paint[1].drawn, {0, 0, 1}, {0, 0, 1}, &f.energy[1]},
                         far = {&scene->paint[1].drawn, {0, 0, 1}, {0, 0, 1}, &f.energy[1]};
    assert_false(gleam_make(&near, &far, &gleam)); /* it would have to lie before one and behind the other */
    scene_free(scene);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_density_is_that_of_the_draw),
        cmocka_unit_test(the_middle_is_where_both_lobes_are_brightest),
        cmocka_unit_test(without_two_lobes_there_is_none),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
