/*
 * mesh_file.h — generated meshes for tests of the renderer, as files of each kind.
 *
 * A ball of radius 1 and a cylinder (mantle and discs) of radius 1 from y = -1 to 1, from `rings` by 2 `rings` corners.
 */
#ifndef TESTS_SUPPORT_MESH_FILE_H
#define TESTS_SUPPORT_MESH_FILE_H

#include <stdbool.h>
#include <stddef.h>

#include "fit/render/vec3.h"

enum mesh_file_kind { MESH_FILE_OBJ, MESH_FILE_ASCII, MESH_FILE_LITTLE, MESH_FILE_BIG, MESH_FILES };

struct mesh_source {
    size_t n_vertices, n_triangles;
    struct vec3 *vertex, *normal;
    unsigned (*corner)[3];
};

struct mesh_source mesh_source_ball(int rings);
struct mesh_source mesh_source_cylinder(int rings);
void mesh_source_free(struct mesh_source *source);
/* Coordinates are rounded to floats first: the same values in all files. */
void mesh_file_write(const char *path, enum mesh_file_kind kind, const struct mesh_source *source,
                     bool normals);

#endif
