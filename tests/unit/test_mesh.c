#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fit/render/mesh.h"
#include "tests/support/mesh_file.h"

typedef int reader(const char *file, const char *text, size_t size, struct mesh *mesh,
                   struct err_list *errors);

static struct mesh read_text(reader *read, const char *text) {
    struct mesh mesh;
    struct err_list errors = {0};
    char sentence[1024];
    if (read("x", text, strlen(text), &mesh, &errors))
        fail_msg("%s", err_format(&errors.item[0], sentence, sizeof sentence));
    return mesh;
}

static double area(const struct mesh *m) {
    double sum = 0;
    for (size_t i = 0; i < m->n_triangles; i++) {
        const struct mesh_corner *c = m->triangle[i].corner;
        struct vec3 a = m->vertex[c[0].vertex];
        sum += vec3_length(
                   vec3_cross(vec3_sub(m->vertex[c[1].vertex], a), vec3_sub(m->vertex[c[2].vertex], a))) /
               2;
    }
    return sum;
}

/* Every form of a corner, counting forward and back, in one line and over two; what has no part in a surface. */
static void obj_as_it_may_be_written(void **state) {
    (void)state;
    struct mesh m =
        read_text(mesh_read_obj, "# comment \\\n\nmtllib x.mtl\no thing\n"
                                 "v 0 0 0\nv 1 0 0 1\r\nv 1 1e0 0 0.5 0.5 0.5\n  v\t0 +1 .0\n"
                                 "vt 0 0\nvn 0 0 2\ng a b\ns off\nl 1 2\np 1\n"
                                 "f 1 2 3\n"
                                 "usemtl red\nf 1/1 3/1 4/1\nusemtl blue\nf -4//-1 -3//1 -2//-1 -1//1\n"
                                 "usemtl red\nf 1/1/1 2/1/1 \\\n3/1/1\n"
                                 "v 0 0 1\nf -1 1 2");
    assert_int_equal(m.n_vertices, 5);
    assert_int_equal(m.n_triangles, 6);
    assert_int_equal(m.n_materials, 2);
    static const int material[] = {-1, 0, 1, 1, 0, 0};
    for (int i = 0; i < 6; i++)
        assert_int_equal(m.triangle[i].material, material[i]);
    assert_string_equal(m.material[1].name, "blue");
    assert_int_equal(m.material[1].line, 18);
    assert_int_equal(m.triangle[2].corner[0].vertex, 0);
    assert_int_equal(m.triangle[2].corner[0].normal, 0);
    assert_true(m.triangle[0].corner[0].normal == MESH_NO_NORMAL);
    assert_int_equal(m.triangle[5].corner[0].vertex, 4);
    assert_true(m.normal[0].z == 1);
    assert_true(m.low.z == 0 && m.high.z == 1);
    mesh_free(&m);
}

/* A star, a comb and a spiral: the triangles cover the polygon once, and none is turned over. */
static void polygons_with_dents_are_covered_once(void **state) {
    static const struct {
        const char *text;
        double area;
    } cases[] = {
        {"v 0 0 0\nv 1 1 0\nv 0 3 0\nv -1 1 0\nf 1 2 3 4\n", 3},
        {"v 0 0 1\nv 4 0 1\nv 4 3 1\nv 3 3 1\nv 3 1 1\nv 2 1 1\nv 2 3 1\nv 1 3 1\nv 1 1 1\nv 0 1 1\n"
         "f 1 2 3 4 5 6 7 8 9 10\n",
         8},
        {"v 0 0 0\nv 0 5 0\nv 0 5 5\nv 0 0 5\nv 0 0 1\nv 0 4 1\nv 0 4 4\nv 0 2 4\nv 0 2 3\nv 0 3 3\nv 0 3 2\n"
         "v 0 1 2\nv 0 1 4.5\nv 0 4.5 4.5\nv 0 4.5 0.5\nv 0 0 0.5\nf 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 "
         "16\n",
         -1},
        {"v 0 0 0\nv 1 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nf 1 2 3 4 5\n", 4}, /* three corners in a line */
    };
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct mesh m = read_text(mesh_read_obj, cases[i].text);
        struct vec3 sum = {0, 0, 0}, first = mesh_facet(&m, 0);
        for (size_t k = 0; k < m.n_vertices; k++)
            sum = vec3_add(sum, vec3_cross(m.vertex[k], m.vertex[(k + 1) % m.n_vertices]));
        double expected = cases[i].area < 0 ? vec3_length(sum) / 2 : cases[i].area;
        for (uint32_t k = 0; k < m.n_triangles; k++)
            assert_true(vec3_dot(mesh_facet(&m, k), sum) > 0 && vec3_dot(mesh_facet(&m, k), first) > 0.999);
        if (!(fabs(area(&m) - expected) < 1e-12))
            fail_msg("polygon %zu: area %g, expected %g", i, area(&m), expected);
        mesh_free(&m);
    }
}

static void what_has_no_area_is_counted(void **state) {
    (void)state;
    struct mesh m = read_text(mesh_read_obj, "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 2 0 0\nvn 0 0 -1\n"
                                             "f 1 2 3\nf 1 2 4\nf 1 1 2\nf 3 3 3\nf 1//1 2//1 3//1\n");
    assert_int_equal(m.n_triangles, 2);
    assert_int_equal(m.no_area, 3);
    assert_int_equal(m.turned, 1);
    assert_true(mesh_facet(&m, 0).z == 1 && mesh_facet(&m, 1).z == -1);
    mesh_free(&m);
}

#define HEAD "ply\nformat ascii 1.0\n"
#define VERTEX "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
#define FACE "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
#define THREE "0 0 0\n1 0 0\n0 1 0\n"

/* Elements and properties that a mesh has no use for, names of types of both kinds, comments. */
static void ply_as_it_may_be_written(void **state) {
    (void)state;
    struct mesh m =
        read_text(mesh_read_ply,
                  "ply\r\ncomment made by hand\nformat ascii 1.0\nobj_info none\n"
                  "element camera 1\nproperty list uint8 float32 pose\n"
                  "element vertex 4\nproperty uchar red\nproperty float64 x\nproperty double y\nproperty "
                  "float z\nproperty list uchar int seen_by\n"
                  "element face 1\nproperty int16 flags\nproperty list uint8 uint32 vertex_index\n"
                  "element edge 1\nproperty int a\nend_header\n"
                  "3 0.5 0.5 0.5\n255 0 0 0 0\n255 1 0 0 1 7\n255 1 1 0 0\n255 0 1 0 0\n-1 4 0 1 2 3\n9\n");
    assert_int_equal(m.n_vertices, 4);
    assert_int_equal(m.n_triangles, 2);
    assert_true(area(&m) == 1);
    assert_int_equal(m.n_normals, 0);
    mesh_free(&m);
}

static void every_format_gives_the_same_mesh(void **state) {
    (void)state;
    char path[] = "/tmp/goniod-mesh-XXXXXX.ply", text[] = "/tmp/goniod-mesh-XXXXXX.obj";
    struct mesh_source ball = mesh_source_ball(9);
    struct err_list errors = {0};
    struct mesh first, m;
    close(mkstemps(path, 4));
    close(mkstemps(text, 4));
    mesh_file_write(text, MESH_FILE_OBJ, &ball, true);
    assert_int_equal(mesh_read(text, &first, &errors), 0);
    for (int kind = MESH_FILE_ASCII; kind < MESH_FILES; kind++) {
        mesh_file_write(path, (enum mesh_file_kind)kind, &ball, true);
        assert_int_equal(mesh_read(path, &m, &errors), 0);
        assert_int_equal(m.n_vertices, first.n_vertices);
        assert_int_equal(m.n_triangles, first.n_triangles);
        assert_memory_equal(m.vertex, first.vertex, m.n_vertices * sizeof *m.vertex);
        assert_memory_equal(m.normal, first.normal, m.n_normals * sizeof *m.normal);
        for (size_t i = 0; i < m.n_triangles; i++)
            assert_memory_equal(m.triangle[i].corner, first.triangle[i].corner, sizeof m.triangle[i].corner);
        assert_int_equal(m.turned, 0);
        mesh_free(&m);
    }
    assert_true(fabs(area(&first) / (4 * M_PI) - 1) < 0.05);
    mesh_free(&first);
    mesh_source_free(&ball);
    unlink(path);
    unlink(text);
}

struct mistake {
    const char *text, *words;
    int line, column;
};

static void judge(reader *read, const struct mistake *cases, size_t n) {
    for (size_t i = 0; i < n; i++) {
        struct err_list errors = {0};
        struct mesh mesh;
        char sentence[1024] = "nothing";
        int status = read("x", cases[i].text, strlen(cases[i].text), &mesh, &errors);
        if (errors.n)
            err_format(&errors.item[0], sentence, sizeof sentence);
        if (status == 0 || errors.n != 1 || errors.item[0].line != cases[i].line ||
            errors.item[0].column != cases[i].column || !strstr(sentence, cases[i].words))
            fail_msg("case %zu: %d, %zu errors, the first '%s'; expected %d:%d %s", i, status, errors.n,
                     sentence, cases[i].line, cases[i].column, cases[i].words);
        err_list_free(&errors);
    }
}

static void every_mistake_of_an_obj_has_its_place(void **state) {
    static const struct mistake cases[] = {
        {"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nv 1 2\n", "'' stands where a number", 5, 6},
        {"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nvn 1 nan 2\n", "'nan' stands where a number", 5, 6},
        {"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "vertex '4' is none of the 3 above", 4, 7},
        {"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -4\n", "vertex '-4' is none", 4, 7},
        {"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "vertex '0' is none", 4, 3},
        {"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 \\\n2.5 3\n", "vertex '2.5' is none", 4, 7},
        {"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1//1 2//1 3//1\n", "normal '1' is none of the 0", 4, 3},
        {"v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3\n", "2 of the 3 corners", 5, 1},
        {"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n", "a face of 2 corners", 4, 1},
        {"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nusemtl\n", "needs the name", 5, 7},
        {"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\ncurv2 1\n", "'curv2' is not read", 5, 1},
        {"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "no triangle with an area (1 without)", 0, 0},
        {"", "no triangle with an area", 0, 0},
    };
    (void)state;
    judge(mesh_read_obj, cases, sizeof cases / sizeof *cases);
}

static void every_mistake_of_a_ply_has_its_place(void **state) {
    static const struct mistake cases[] = {
        {"", "does not begin with `ply`", 1, 0},
        {"plyx\n", "does not begin with `ply`", 1, 0},
        {"ply\nformat ascii 1.0\n", "no end_header", 3, 0},
        {"ply\nformat binary 1.0\nend_header\n", "expected `format ascii 1.0`", 2, 0},
        {"ply\nformat ascii 2.0\nend_header\n", "expected `format ascii 1.0`", 2, 0},
        {"ply\n" VERTEX FACE THREE "3 0 1 2\n", "no line `format", 8, 0},
        {HEAD "end_header\n", "needs an element vertex", 3, 0},
        {HEAD VERTEX "end_header\n", "needs an element face", 7, 0},
        {HEAD "element vertex\n", "expected `element NAME COUNT`", 3, 0},
        {HEAD "element vertex 99999999999\n", "expected `element NAME COUNT`", 3, 0},
        {HEAD "property float x\n", "after an element", 3, 0},
        {HEAD VERTEX "element vertex 1\nproperty float q\n" FACE "end_header\n", "two elements vertex", 11,
         0},
        {HEAD VERTEX "property real w\n", "'real' is no type", 7, 0},
        {HEAD VERTEX "property list float int w\n", "whole numbers, not float", 7, 0},
        {HEAD VERTEX "element face 1\nproperty list uchar float vertex_indices\n", "whole numbers, not float",
         8, 0},
        {HEAD VERTEX "what is this\n", "not 'what'", 7, 0},
        {HEAD VERTEX "property float w h\n", "expected `property", 7, 0},
        {HEAD VERTEX "element x 1\n" FACE, "the element x has no property", 10, 0},
        {HEAD VERTEX "property float x\n" FACE, "once each", 10, 0},
        {HEAD VERTEX FACE THREE "3 0 1 3\n", "vertex 3 is none of 0 .. 2", 13, 0},
        {HEAD VERTEX FACE THREE "3 0 1 -1\n", "vertex -1 is none of 0 .. 2", 13, 0},
        {HEAD VERTEX FACE THREE "3 0 1 1.5\n", "'1.5' stands where a whole number", 13, 0},
        {HEAD VERTEX FACE THREE "2 0 1\n", "a face of 2 corners", 13, 0},
        {HEAD VERTEX FACE THREE "-3 0 1\n", "a list of -3 values", 13, 0},
        {HEAD VERTEX FACE "0 0 0\n1 0 zero\n", "'zero' stands where a number", 11, 0},
        {HEAD VERTEX FACE "0 0 0\n1 0\n", "the file ends in vertex 2 of 3", 12, 0},
        {HEAD VERTEX FACE THREE "3 0 1\n", "the file ends in face 1 of 1", 14, 0},
        {"ply\nformat binary_little_endian 1.0\n" VERTEX FACE "123456789abc",
         "vertex 1, counted from 0: the file ends", 0, 0},
    };
    (void)state;
    judge(mesh_read_ply, cases, sizeof cases / sizeof *cases);
}

static void other_files_are_refused(void **state) {
    (void)state;
    static const char *const paths[] = {"docs/examples/scenes/cylinder.yaml", "/nonexistent.obj", "/.ply"};
    for (int i = 0; i < 3; i++) {
        struct err_list errors = {0};
        struct mesh mesh;
        assert_int_not_equal(mesh_read(paths[i], &mesh, &errors), 0);
        assert_int_equal(errors.n, 1);
        err_list_free(&errors);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(obj_as_it_may_be_written),
        cmocka_unit_test(polygons_with_dents_are_covered_once),
        cmocka_unit_test(what_has_no_area_is_counted),
        cmocka_unit_test(ply_as_it_may_be_written),
        cmocka_unit_test(every_format_gives_the_same_mesh),
        cmocka_unit_test(every_mistake_of_an_obj_has_its_place),
        cmocka_unit_test(every_mistake_of_a_ply_has_its_place),
        cmocka_unit_test(other_files_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
