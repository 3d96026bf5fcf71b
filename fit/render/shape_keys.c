#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "fit/render/scene_keys.h"
#include "fit/render/shape.h"

#define AT_SHAPE(field) offsetof(struct shape, field)

static int read_material(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    struct shape *s = object;
    s->n_materials = 1;
    return yaml_read_string(r, node, s->material[0], sizeof s->material[0]);
}

static bool more_materials(struct yaml_reader *r, const struct yaml_node *node, size_t n) {
    if (n == 0 || n > SHAPE_MATERIALS) {
        yaml_error(r, node, "%zu materials; a shape has 1 to %d", n, SHAPE_MATERIALS);
    }
    return n > 0 && n <= SHAPE_MATERIALS;
}

static int read_materials(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    struct shape *s = object;
    if (!yaml_is_list(node)) {
        yaml_error(r, node, "expected names of materials, as [a, b]");
    } else if (more_materials(r, node, yaml_count(node))) {
        s->n_materials = (int)yaml_count(node);
        for (int i = 0; i < s->n_materials; i++) {
            yaml_read_string(r, yaml_item(node, (size_t)i), s->material[i], sizeof s->material[i]);
        }
    }
    return 0;
}

static int read_mask(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    struct shape *s = object;
    if (!yaml_is_map(node)) {
        yaml_error(r, node, "expected colours and their materials, as {'#ff0000': a, '#00ff00': b}");
        return 0;
    }
    if (!more_materials(r, node, yaml_count(node))) {
        return 0;
    }
    s->n_materials = (int)yaml_count(node);
    for (int i = 0; i < s->n_materials; i++) {
        const char *colour = yaml_item_name(node, (size_t)i);
        char rest;
        if (strlen(colour) != 7 || sscanf(colour, "#%6x%c", &s->rectangle.mask_colour[i], &rest) != 1) {
            yaml_error(r, yaml_item_key(node, (size_t)i), "'%s' is no colour as '#ff8000'", colour);
        }
        yaml_read_string(r, yaml_item(node, (size_t)i), s->material[i], sizeof s->material[i]);
    }
    return 0;
}

#define MATERIAL(needed)                                                                                     \
    {                                                                                                        \
        .name = "material", .type = YAML_CUSTOM, .custom = read_material, .required = needed,                \
        .doc = "the name of a material"                                                                      \
    }
#define PLACE_OF(what) SCENE_VECTOR("at_mm", AT_SHAPE(at_mm), AT_SHAPE(n_at), "[0, 0, 0]", "place of " what)
#define PLACE PLACE_OF("its centre")
#define TURN                                                                                                 \
    SCENE_VECTOR("turn_deg", AT_SHAPE(turn_deg), AT_SHAPE(n_turn), "[0, 0, 0]",                              \
                 "turned about x, then y, then z")

static const struct yaml_key cylinder_keys[] = {
    MATERIAL(true),
    PLACE,
    TURN,
    SCENE_LENGTH("radius_mm", AT_SHAPE(cylinder.radius_mm), true, NULL, "radius"),
    SCENE_LENGTH("length_mm", AT_SHAPE(cylinder.length_mm), true, NULL, "length, along y"),
    {.name = "open",
     .type = YAML_BOOL,
     .offset = AT_SHAPE(cylinder.open),
     .default_text = "false",
     .doc = "without the discs at its ends"},
    {0}};

static const struct yaml_key sphere_keys[] = {
    MATERIAL(true),
    PLACE,
    TURN,
    SCENE_LENGTH("radius_mm", AT_SHAPE(sphere.radius_mm), true, NULL, "radius"),
    {0}};

static const struct yaml_key rectangle_keys[] = {
    MATERIAL(false),
    {.name = "mask",
     .type = YAML_CUSTOM,
     .custom = read_mask,
     .doc = "instead of a material: {'#rrggbb': material, ...}, every colour of mask_image"},
    {.name = "mask_image",
     .type = YAML_STRING,
     .offset = AT_SHAPE(rectangle.mask_file),
     .size = sizeof((struct shape *)0)->rectangle.mask_file,
     .doc = "PNG whose colours say where each material is"},
    PLACE,
    TURN,
    SCENE_LENGTH("width_mm", AT_SHAPE(rectangle.width_mm), true, NULL, "width, along x"),
    SCENE_LENGTH("height_mm", AT_SHAPE(rectangle.height_mm), true, NULL, "height, along y"),
    {.name = "relief",
     .type = YAML_STRING,
     .offset = AT_SHAPE(rectangle.relief_file),
     .size = sizeof((struct shape *)0)->rectangle.relief_file,
     .doc = "PNG of heights, grey, better of 16 bits: turns the normals and casts shadows on itself"},
    {.name = "relief_mm",
     .type = YAML_DOUBLE,
     .offset = AT_SHAPE(rectangle.relief_mm),
     .low = 0,
     .high = SCENE_MM_MAX,
     .default_text = "0",
     .unit = "mm",
     .doc = "height of its white; 0: none, and the picture is not read"},
    {0}};

static const struct yaml_key board_keys[] = {
    {.name = "materials",
     .type = YAML_CUSTOM,
     .custom = read_materials,
     .required = true,
     .doc = "of the patches, by rows from the top left"},
    PLACE,
    TURN,
    {.name = "columns",
     .type = YAML_INT,
     .offset = AT_SHAPE(board.columns),
     .low = 1,
     .high = SHAPE_MATERIALS,
     .required = true,
     .doc = "patches in a row"},
    SCENE_LENGTH("patch_mm", AT_SHAPE(board.patch_mm), true, NULL, "side of a patch"),
    {.name = "gap_mm",
     .type = YAML_DOUBLE,
     .offset = AT_SHAPE(board.gap_mm),
     .low = 0,
     .high = SCENE_MM_MAX,
     .default_text = "2",
     .unit = "mm",
     .doc = "between patches"},
    {0}};

static const struct yaml_key fold_keys[] = {
    MATERIAL(false),
    {.name = "materials",
     .type = YAML_CUSTOM,
     .custom = read_materials,
     .doc = "instead of a material: those of the left and of the right side, as [a, b]"},
    PLACE_OF("the middle of its edge"),
    TURN,
    SCENE_LENGTH("width_mm", AT_SHAPE(fold.width_mm), true, NULL, "of each side, from the edge"),
    SCENE_LENGTH("length_mm", AT_SHAPE(fold.length_mm), true, NULL, "of the edge, along y"),
    {.name = "angle_deg",
     .type = YAML_DOUBLE,
     .offset = AT_SHAPE(fold.angle_deg),
     .low = 1,
     .high = 180,
     .default_text = "90",
     .unit = "deg",
     .doc = "between the sides; opens towards +z"},
    {0}};

static const struct yaml_key mesh_keys[] = {
    {.name = "file",
     .type = YAML_STRING,
     .offset = AT_SHAPE(mesh.file),
     .size = sizeof((struct shape *)0)->mesh.file,
     .required = true,
     .doc = "NAME.obj or NAME.ply; needs Embree 3 (Debian's libembree3-3)"},
    {.name = "material",
     .type = YAML_CUSTOM,
     .custom = read_material,
     .doc = "the name of a material for all of it; without it usemtl of the OBJ file names materials of the "
            "scene"},
    {.name = "scale",
     .type = YAML_DOUBLE,
     .offset = AT_SHAPE(mesh.scale),
     .low = 1e-9,
     .high = 1e9,
     .default_text = "1",
     .unit = "mm",
     .doc = "length of a unit of the file"},
    SCENE_VECTOR("at_mm", AT_SHAPE(at_mm), AT_SHAPE(n_at), "[0, 0, 0]", "place of the origin of the file"),
    TURN,
    {0}};

#define SHAPE(key, kind, table, text)                                                                        \
    {                                                                                                        \
        .name = key, .type = YAML_MAP, .offset = 0, .keys = table,                                           \
        .set_offset = AT_SHAPE(given) + (kind) * sizeof(bool) + 1, .doc = text                               \
    }

const struct yaml_key scene_shape_keys[] = {
    SHAPE("cylinder", SHAPE_CYLINDER, cylinder_keys, "a painted cylinder, upright without a turn"),
    SHAPE("sphere", SHAPE_SPHERE, sphere_keys, "a painted sphere"),
    SHAPE("rectangle", SHAPE_RECTANGLE, rectangle_keys, "a painting, seen from its front"),
    SHAPE("board", SHAPE_BOARD, board_keys, "a board of swatches"),
    SHAPE("fold", SHAPE_FOLD, fold_keys, "two rectangles that meet at an angle and shine on each other"),
    SHAPE("mesh", SHAPE_MESH, mesh_keys, "triangles of a file, seen from their front"),
    {0}};
