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

#include "fit/render/intersect.h"
#include "fit/render/mesh.h"
#include "tests/support/mesh_file.h"
#include "tests/support/render_scene.h"

static char folder[] = "/tmp/goniod-mesh-XXXXXX";

#define WHITE "materials: [{name: m, uniform: 1, model: lambert}]\n"
#define PAINT "materials: [{name: m, uniform: 0.5, sigma: 0.3, gamma: 0.2, beta_prime: 7.6, n: 1.7}]\n"
#define VIEW                                                                                                 \
    "lights: [beam: {theta_deg: 40, azimuth_deg: 20}]\n"                                                     \
    "camera: {orthographic: {height_mm: 50}}\n"                                                              \
    "image: {width: 60, height: 60, grid: 1}\n"

static const char *file_of(const char *name) {
    static char path[2][256];
    static int next;
    next = 1 - next;
    snprintf(path[next], sizeof path[next], "%s/%s", folder, name);
    return path[next];
}

static bool is_loaded(void) {
    char line[512];
    bool found = false;
    FILE *maps = fopen("/proc/self/maps", "r");
    assert_non_null(maps);
    while (fgets(line, sizeof line, maps))
        found = found || strstr(line, "libembree");
    fclose(maps);
    return found;
}

static struct planes render(struct scene *scene, const struct render_options *options) {
    struct planes planes;
    struct render_report report;
    planes_of(scene, options, &planes, &report);
    return planes;
}

/* The first test of this program: what is loaded once stays. */
static void embree_is_loaded_by_the_first_mesh(void **state) {
    (void)state;
    struct mesh_source ball = mesh_source_ball(8);
    mesh_file_write(file_of("first.obj"), MESH_FILE_OBJ, &ball, false);
    mesh_source_free(&ball);
    struct scene *scene = scene_of(WHITE "shapes: [sphere: {material: m, radius_mm: 20}]\n" VIEW);
    struct planes planes = render(scene, &(struct render_options){0});
    planes_free(&planes);
    scene_free(scene);
    assert_false(is_loaded());
    scene = scene_of(WHITE "shapes: [mesh: {file: %s, material: m}]\n" VIEW, file_of("first.obj"));
    assert_true(is_loaded());
    scene_free(scene);
}

/* Root mean square of a over the pixels that both show, apart from those whose neighbourhood holds an edge. */
static double apart(const struct planes *p, const struct planes *q) {
    double sum = 0;
    int n = 0;
    for (int y = 2; y < p->height - 2; y++)
        for (int x = 2; x < p->width - 2; x++) {
            bool inside = true;
            for (int k = 0; k < 25; k++) {
                int i = (y + k / 5 - 2) * p->width + x + k % 5 - 2;
                inside = inside && p->paint[i] >= 0 && q->paint[i] >= 0;
            }
            int i = y * p->width + x;
            if (inside) {
                sum += (p->set[0].a[i] - q->set[0].a[i]) * (p->set[0].a[i] - q->set[0].a[i]);
                n++;
            }
        }
    assert_true(n > 400);
    return sqrt(sum / n);
}

/* Twice as many corners each way bring a smoothed mesh four times nearer to the quadric, a flat one twice. */
static void finer_meshes_converge_to_the_quadric(void **state) {
    static const struct {
        struct mesh_source (*source)(int rings);
        const char *quadric;
    } cases[] = {
        {mesh_source_ball, "sphere: {material: m, radius_mm: 20}"},
        {mesh_source_cylinder,
         "cylinder: {material: m, radius_mm: 20, length_mm: 40, turn_deg: [20, 0, 17]}"},
    };
    (void)state;
    for (int i = 0; i < 2; i++)
        for (int smooth = 0; smooth < 2; smooth++) {
            struct scene *scene = scene_of(WHITE "shapes: [%s]\n" VIEW, cases[i].quadric);
            struct planes expected = render(scene, &(struct render_options){0});
            double error[3];
            scene_free(scene);
            for (int k = 0; k < 3; k++) {
                struct mesh_source source = cases[i].source(16 << k);
                mesh_file_write(file_of("x.ply"), MESH_FILE_LITTLE, &source, smooth);
                mesh_source_free(&source);
                scene =
                    scene_of(WHITE "shapes: [mesh: {file: %s, material: m, scale: 20, turn_deg: %s}]\n" VIEW,
                             file_of("x.ply"), i ? "[20, 0, 17]" : "[0, 0, 0]");
                struct planes planes = render(scene, &(struct render_options){0});
                error[k] = apart(&planes, &expected);
                planes_free(&planes);
                scene_free(scene);
            }
            double least = smooth ? 3 : 1.7;
            printf("# %s, %s: %.2g %.2g %.2g\n", i ? "cylinder" : "ball", smooth ? "smooth" : "flat",
                   error[0], error[1], error[2]);
            assert_true(error[0] > least * error[1] && error[1] > least * error[2]);
            planes_free(&expected);
        }
}

static void the_same_surface_is_the_same_picture_from_every_file(void **state) {
    (void)state;
    struct mesh_source source = mesh_source_ball(24);
    struct planes first = {0};
    for (int kind = 0; kind < MESH_FILES; kind++) {
        const char *path = file_of(kind == MESH_FILE_OBJ ? "same.obj" : "same.ply");
        mesh_file_write(path, (enum mesh_file_kind)kind, &source, true);
        struct scene *scene =
            scene_of(PAINT "shapes: [mesh: {file: %s, material: m, scale: 20}]\n" VIEW, path);
        struct planes planes = render(scene, &(struct render_options){.threads = 1 + kind % 2});
        size_t size = (size_t)(planes.width * planes.height) * sizeof(double);
        if (kind == 0)
            first = planes;
        else {
            assert_memory_equal(planes.paint, first.paint, size / sizeof(double) * sizeof *planes.paint);
            assert_memory_equal(planes.set[0].a, first.set[0].a, size);
            assert_memory_equal(planes.set[0].b, first.set[0].b, size);
            assert_memory_equal(planes.set[0].c, first.set[0].c, size);
            planes_free(&planes);
        }
        scene_free(scene);
    }
    planes_free(&first);
    mesh_source_free(&source);
}

/* A plate of many triangles under light that all but grazes it: every pixel has the cosine, none its own shadow. */
static void no_triangle_stands_in_its_neighbours_light(void **state) {
    (void)state;
    FILE *out = fopen(file_of("plate.obj"), "w");
    for (int i = 0; i <= 40; i++)
        for (int k = 0; k <= 40; k++)
            fprintf(out, "v %.17g %.17g %.17g\n", i / 1.7, k / 1.7, 0.3 * i + 0.1 * k);
    for (int i = 0; i < 40; i++)
        for (int k = 1; k <= 40; k++)
            fprintf(out, "f %d %d %d %d\n", i * 41 + k, i * 41 + k + 41, i * 41 + k + 42, i * 41 + k + 1);
    fclose(out);
    struct vec3 normal = vec3_unit((struct vec3){-0.3 * 1.7, -0.1 * 1.7, 1});
    struct scene *scene =
        scene_of(WHITE "shapes: [mesh: {file: %s, material: m, at_mm: [-11.8, -11.8, -8]}]\n"
                       "lights: [beam: {theta_deg: 0}]\n"
                       "camera: {orthographic: {height_mm: 20}}\n"
                       "image: {width: 80, height: 80, grid: 2}\n",
                 file_of("plate.obj"));
    struct vec3 s, t;
    vec3_frame(normal, &s, &t);
    for (int k = 0; k < 6; k++) {
        double height = pow(10, -k);
        struct vec3 side = vec3_add(vec3_scale(s, cos(k)), vec3_scale(t, sin(k)));
        struct vec3 l = vec3_unit(vec3_add(side, vec3_scale(normal, height)));
        scene->light[0].direction = l;
        struct planes planes = render(scene, &(struct render_options){0});
        for (int i = 0; i < 6400; i++) {
            assert_true(planes.paint[i] == 0);
            if (!(fabs(planes.set[0].a[i] - vec3_dot(normal, l)) < 1e-12))
                fail_msg("height %g, pixel %d: %g", height, i, planes.set[0].a[i]);
        }
        planes_free(&planes);
    }
    scene_free(scene);
}

/* A cube whose normals are smoothed over its corners: the interpolated normal of a side may face a light that the
 * side itself does not. */
static void light_does_not_leak_through_smoothed_edges(void **state) {
    (void)state;
    static const char cube[] =
        "v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\n"
        "vn -1 -1 -1\nvn 1 -1 -1\nvn 1 1 -1\nvn -1 1 -1\nvn -1 -1 1\nvn 1 -1 1\nvn 1 1 1\n"
        "vn -1 1 1\n"
        "f 5//5 6//6 7//7 8//8\nf 4//4 3//3 2//2 1//1\nf 1//1 2//2 6//6 5//5\n"
        "f 3//3 4//4 8//8 7//7\nf 2//2 3//3 7//7 6//6\nf 1//1 5//5 8//8 4//4\n";
    FILE *out = fopen(file_of("cube.obj"), "w");
    fputs(cube, out);
    fclose(out);
    struct scene *scene = scene_of(WHITE "shapes: [mesh: {file: %s, material: m, scale: 10}]\n"
                                         "lights: [beam: {theta_deg: 100}]\n"
                                         "camera: {orthographic: {height_mm: 50}}\n"
                                         "image: {width: 50, height: 50, grid: 1}\n",
                                   file_of("cube.obj"));
    struct planes planes = render(scene, &(struct render_options){0});
    int seen = 0;
    for (int i = 0; i < 2500; i++) {
        seen += planes.paint[i] == 0;
        assert_true(planes.paint[i] < 0 || planes.set[0].a[i] == 0);
    }
    assert_int_equal(seen, 400);
    planes_free(&planes);
    scene_aim(scene, 0);
    scene->light[0].direction = (struct vec3){0, 0, 1};
    planes = render(scene, &(struct render_options){0});
    assert_true(planes.set[0].a[25 * 50 + 25] > 0.99);
    planes_free(&planes);
    scene_free(scene);
}

/* A mesh far from where its file has its origin, seen by a camera still farther away. */
static void far_away_is_as_exact_as_near(void **state) {
    (void)state;
    struct mesh_source ball = mesh_source_ball(24);
    mesh_file_write(file_of("near.ply"), MESH_FILE_LITTLE, &ball, true);
    struct scene *near =
        scene_of(WHITE "shapes: [mesh: {file: %s, material: m, scale: 20}]\n" VIEW, file_of("near.ply"));
    struct scene *far =
        scene_of(WHITE "shapes: [mesh: {file: %s, material: m, scale: 20, at_mm: [3e4, -2e5, 1e5]}]\n"
                       "lights: [beam: {theta_deg: 40, azimuth_deg: 20}]\n"
                       "camera: {orthographic: {height_mm: 50, look_at_mm: [3e4, -2e5, -5e5]}}\n"
                       "image: {width: 60, height: 60, grid: 1}\n",
                 file_of("near.ply"));
    struct planes p = render(near, &(struct render_options){0}), q = render(far, &(struct render_options){0});
    for (int i = 0; i < 3600; i++) {
        assert_int_equal(p.paint[i], q.paint[i]);
        assert_true(p.paint[i] < 0 || fabs(p.set[0].a[i] - q.set[0].a[i]) < 1e-6);
    }
    planes_free(&p);
    planes_free(&q);
    scene_free(near);
    scene_free(far);
    mesh_source_free(&ball);
}

/* Every ray from inside a closed mesh meets it, along edges and through corners as well; from outside none that aims at
 * a corner slips through. */
static void no_ray_slips_between_triangles(void **state) {
    (void)state;
    struct mesh_source ball = mesh_source_ball(24);
    mesh_file_write(file_of("tight.ply"), MESH_FILE_LITTLE, &ball, true);
    struct scene *scene =
        scene_of(WHITE "shapes: [mesh: {file: %s, material: m, scale: 20}]\n" VIEW, file_of("tight.ply"));
    for (size_t i = 0; i < ball.n_triangles; i++)
        for (int k = 0; k < 3; k++) {
            struct vec3 a = ball.vertex[ball.corner[i][k]], b = ball.vertex[ball.corner[i][(k + 1) % 3]];
            for (int j = 0; j < 5; j++) {
                struct vec3 to = vec3_unit(vec3_add(vec3_scale(a, 1 - j / 5.0), vec3_scale(b, j / 5.0)));
                struct ray out = {{0.3, -0.2, 0.1},
                                  vec3_unit(vec3_sub(vec3_scale(to, 20), (struct vec3){0.3, -0.2, 0.1})),
                                  0};
                struct ray in = {vec3_scale(to, 100), vec3_scale(to, -1), 0};
                struct hit hit;
                assert_true(intersect_nearest(scene, &out, &hit));
                assert_true(vec3_dot(hit.normal, out.direction) > 0); /* its back is black */
                assert_true(intersect_nearest(scene, &in, &hit));
                assert_true(vec3_dot(hit.normal, in.direction) < 0);
                assert_true(fabs(vec3_length(hit.position) - 20) < 0.2);
                assert_true(fabs(vec3_length(vec3_sub(hit.position, in.origin)) - hit.t_mm) < 1e-12 * 100);
            }
        }
    scene_free(scene);
    mesh_source_free(&ball);
}

static void materials_by_usemtl(void **state) {
    (void)state;
    static const char text[] = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0\n"
                               "usemtl red\nf 1 2 3 4\nusemtl blue\nf 2 5 6 3\n";
    FILE *out = fopen(file_of("two.obj"), "w");
    fputs(text, out);
    fclose(out);
    struct scene *scene = scene_of("materials: [{name: blue, uniform: 1}, {name: red, uniform: 0.5}]\n"
                                   "shapes: [mesh: {file: %s}]\n"
                                   "lights: [beam: {theta_deg: 0}]\n"
                                   "camera: {orthographic: {height_mm: 1, look_at_mm: [1, 0.5, 0]}}\n"
                                   "image: {width: 2, height: 1, grid: 1}\n",
                                   file_of("two.obj"));
    struct planes planes = render(scene, &(struct render_options){0});
    assert_true(planes.paint[0] == 1 && planes.paint[1] == 0);
    planes_free(&planes);
    scene_free(scene);
}

static void what_is_wrong_with_a_mesh_is_told(void **state) {
    (void)state;
    static const struct {
        const char *mesh, *keys, *words;
        int line;
    } cases[] = {
        {"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 1 1 x\nf 1 2 3\n", "", "'x' stands where a number", 4},
        {"v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n", "", "without usemtl", 2},
        {"v 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl gold\nf 1 2 3\n", "",
         "'gold' under `materials`, which usemtl names in line 4", 2},
        {"v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n", ", material: m, scale: 1e7", "`scale` makes it smaller", 2},
        {"v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n", ", material: k", "no material 'k'", 2},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[1024], sentence[1024] = "nothing";
        struct err_list errors = {0};
        FILE *out = fopen(file_of("wrong.obj"), "w");
        fputs(cases[i].mesh, out);
        fclose(out);
        snprintf(text, sizeof text, WHITE "shapes: [mesh: {file: %s%s}]\n" VIEW, file_of("wrong.obj"),
                 cases[i].keys);
        assert_null(scene_read_text("s.yaml", text, strlen(text), NULL, 0, &errors));
        err_format(&errors.item[0], sentence, sizeof sentence);
        if (errors.n != 1 || errors.item[0].line != cases[i].line || !strstr(sentence, cases[i].words))
            fail_msg("case %zu: %zu errors, the first: %s", i, errors.n, sentence);
        err_list_free(&errors);
    }
}

static int make_folder(void **state) {
    (void)state;
    return mkdtemp(folder) ? 0 : -1;
}

static int remove_folder(void **state) {
    char command[128];
    (void)state;
    snprintf(command, sizeof command, "rm -r %s", folder);
    return system(command);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(embree_is_loaded_by_the_first_mesh),
        cmocka_unit_test(finer_meshes_converge_to_the_quadric),
        cmocka_unit_test(the_same_surface_is_the_same_picture_from_every_file),
        cmocka_unit_test(no_triangle_stands_in_its_neighbours_light),
        cmocka_unit_test(light_does_not_leak_through_smoothed_edges),
        cmocka_unit_test(far_away_is_as_exact_as_near),
        cmocka_unit_test(no_ray_slips_between_triangles),
        cmocka_unit_test(materials_by_usemtl),
        cmocka_unit_test(what_is_wrong_with_a_mesh_is_told),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
