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

#include "fit/render/scene_keys.h"
#include "proto/file.h"
#include "tests/support/render_scene.h"

#define DOCUMENT "docs/scene-file.md"

#define GOOD                                                                                                 \
    "materials: [{name: m, uniform: 0.5}]\n"                                                                 \
    "shapes: [sphere: {material: m, radius_mm: 20}]\n"                                                       \
    "camera: {orthographic: {height_mm: 50}}\n"

static void a_series_has_a_picture_for_each_angle(void **state) {
    (void)state;
    struct scene *scene =
        scene_of(GOOD "lights:\n"
                      "  - beam: {theta_deg: {from: -60, to: 60, step: 40}, azimuth_deg: 90}\n"
                      "  - beam: {theta_deg: 0, weight: 3, spd: A}\n"
                      "  - beam: {theta_deg: [1, 2, 3, 4], spd: A}\n");
    assert_int_equal(scene->n_pictures, 4);
    assert_int_equal(scene->n_spds, 2);
    assert_true(scene->light[0].share == 0.2 && scene->light[1].share == 0.6);
    scene_aim(scene, 3);
    assert_true(fabs(scene->light[0].direction.y - sin(M_PI / 3)) < 1e-15);
    assert_true(fabs(scene->light[0].direction.x) < 1e-15);
    scene_free(scene);
}

/* A light of weight 0 is known by its place, and its file not even looked for. */
static void the_map_of_a_dark_environment_is_not_opened(void **state) {
    (void)state;
    struct scene *scene = scene_of(GOOD "lights:\n"
                                        "  - beam: {theta_deg: 20}\n"
                                        "  - environment: {image: nowhere.exr, weight: 0}\n");
    assert_true(scene->light[1].kind == LIGHT_ENVIRONMENT && scene->light[1].share == 0);
    assert_null(scene->light[1].environment.radiance);
    scene_free(scene);
}

static void every_mistake_has_its_place(void **state) {
    (void)state;
    static const struct {
        const char *text, *words;
        int line, column;
    } cases[] = {
        {"materials: [{name: m, uniform: 0.5}]\nshapes:\n  - sphere: {material: x, radius_mm: 20}\n"
         "camera: {orthographic: {height_mm: 50}}\n",
         "no material 'x'", 3, 14},
        {GOOD "lights:\n  - beam: {theta_deg: 20, spd: D66}\n", "no light 'D66'", 5, 27},
        {GOOD "lights:\n  - beam: {theta_deg: 20, spd: none.csv}\n", "none.csv", 0, 0},
        {GOOD "lights:\n  - beam: {theta_deg: 20, spd: 300 K}\n", "no daylight", 5, 27},
        {GOOD "lights:\n  - beam: {theta_deg: 20, weight: 0}\n", "nothing to see", 4, 1},
        {GOOD "lights:\n  - beam: {theta_deg: [1, 2]}\n  - beam: {theta_deg: [1, 2, 3]}\n", "as many at each",
         6, 12},
        {GOOD "lights:\n  - {}\n", "0 kinds", 5, 5},
        {GOOD "image: {bits: 9}\n", "8 or 16 bits", 4, 9},
        {GOOD "image: {width: 0}\n", "", 4, 16},
        {GOOD "lights:\n  - lamp: {theta_deg: 20}\n", "lamp", 5, 5},
        {GOOD "lights:\n  - sphere: {radius_mm: 5}\n", "holds the scene's origin", 5, 5},
        {GOOD "lights:\n  - rectangle: {width_mm: 5, height_mm: 5}\n", "faces nowhere", 5, 5},
        {GOOD
         "lights:\n  - rectangle: {at_mm: [0, 0, 9], look_at_mm: [0, 0, 20], width_mm: 5, height_mm: 5}\n",
         "turns its back", 5, 5},
        {GOOD "lights:\n  - environment: {image: none.exr}\n", "none.exr", 5, 5},
        {GOOD "lights:\n  - environment: {image: sky.jpg}\n", ".exr or .png", 5, 5},
        {GOOD "lights:\n  - sphere: {at_mm: [0, 0, 50], radius_mm: 5, spd: D66}\n", "no light 'D66'", 5, 0},
        {"materials:\n  - {name: m}\ncamera: {orthographic: {height_mm: 50}}\n", "needs a session", 2, 6},
        {"materials:\n  - {name: m, session: none.gonio}\ncamera: {orthographic: {height_mm: 50}}\n",
         "none.gonio", 2, 15},
        {"materials:\n  - {name: m, uniform: 1}\n  - {name: m, uniform: 1}\n"
         "camera: {orthographic: {height_mm: 50}}\n",
         "already", 3, 6},
        {"camera: {orthographic: {height_mm: 50, from: [0, 1, 0]}}\n", "along `up`", 1, 1},
        {"camera: {perspective: {position_mm: [0, 0, 0]}}\n", "looks nowhere", 1, 1},
        {"camera: {}\n", "0 kinds", 1, 1},
        {"name: nothing\n", "camera", 1, 1},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct err_list errors = {0};
        char sentence[1024] = "nothing";
        struct scene *scene =
            scene_read_text("s.yaml", cases[i].text, strlen(cases[i].text), NULL, 0, &errors);
        if (errors.n)
            err_format(&errors.item[0], sentence, sizeof sentence);
        bool placed = errors.n == 1 &&
                      (!cases[i].line || (errors.item[0].line == cases[i].line &&
                                          (!cases[i].column || errors.item[0].column == cases[i].column)));
        if (scene || !placed || !strstr(sentence, cases[i].words))
            fail_msg("case %zu: %zu errors, the first '%s'; expected %d:%d %s", i, errors.n, sentence,
                     cases[i].line, cases[i].column, cases[i].words);
        err_list_free(&errors);
    }
}

static void all_mistakes_are_told_at_once(void **state) {
    (void)state;
    struct err_list errors = {0};
    const char *text = GOOD "lights:\n  - beam: {theta_deg: 20, spd: X}\n  - beam: {theta_deg: 20, spd: Y}\n"
                            "image: {bits: 10}\n";
    assert_null(scene_read_text("s.yaml", text, strlen(text), NULL, 0, &errors));
    assert_int_equal(errors.n, 3);
    assert_true(errors.item[0].line < errors.item[1].line && errors.item[1].line < errors.item[2].line);
    err_list_free(&errors);
}

static void a_session_of_the_command_line_must_meet_a_material(void **state) {
    (void)state;
    struct err_list errors = {0};
    struct scene_session wish = {"m", "other.gonio"};
    assert_null(scene_read_text("s.yaml", GOOD, strlen(GOOD), &wish, 1, &errors));
    assert_int_equal(errors.n, 1);
    assert_non_null(strstr(errors.item[0].text, "--session names the material m"));
    err_list_free(&errors);
}

static void write_document(FILE *out) {
    fputs("# Scene file of goniorender\n\n"
          "Every key, as the program prints them (`goniorender --scene-reference`). Examples are in\n"
          "[examples/scenes](examples/scenes). Lengths are millimetres; x points to the right, y up, z "
          "towards the\n"
          "camera. Every mistake of a scene file and of the files it names is told at once, with line and "
          "column.\n\n",
          out);
    yaml_print_reference(out, "scene.yaml", scene_keys);
}

static void the_document_is_what_the_tables_say(void **state) {
    (void)state;
    char *printed, *text;
    size_t printed_size, size;
    FILE *out = open_memstream(&printed, &printed_size);
    write_document(out);
    fclose(out);
    assert_int_equal(file_read(DOCUMENT, 1 << 20, &text, &size, NULL), 0);
    if (strcmp(printed, text) != 0)
        fail_msg("%s is out of date: build/tests/unit/test_scene --write", DOCUMENT);
    free(printed);
    free(text);
}

int main(int argc, char **argv) {
    if (argc > 1 && strcmp(argv[1], "--write") == 0) {
        FILE *out = fopen(DOCUMENT, "w");
        write_document(out);
        return fclose(out) != 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_series_has_a_picture_for_each_angle),
        cmocka_unit_test(the_map_of_a_dark_environment_is_not_opened),
        cmocka_unit_test(every_mistake_has_its_place),
        cmocka_unit_test(all_mistakes_are_told_at_once),
        cmocka_unit_test(a_session_of_the_command_line_must_meet_a_material),
        cmocka_unit_test(the_document_is_what_the_tables_say),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
