/*
 * mesh.h — a surface of triangles from an OBJ or PLY file, and the ray through one of them.
 *
 * OBJ   v, vn, f (also v/vt/vn, negative indices counting back), usemtl; lines, points, textures, groups and smoothing
 *       are passed over, free-form surfaces refused.
 * PLY   ascii, binary_little_endian, binary_big_endian 1.0; vertex with x, y, z and perhaps nx, ny, nz; face with a list
 *       vertex_indices or vertex_index; all else is passed over.
 * Polygons become triangles, dents included. A triangle without area is left out and counted. Where corners have
 * normals and these point to the other side than the order of the corners says, the triangle is turned, and counted.
 *
 * Shapes     normal MESH_NO_NORMAL: the triangle is flat; else interpolated between its corners, length 1 at each.
 *            material: index into material[], -1 before any usemtl.
 * Domain     at most MESH_BYTES_MAX bytes, MESH_COUNT_MAX of each kind, MESH_CORNERS_MAX corners of a polygon; coordinates
 *            finite.
 * Errors     mesh_read: -ERR_INPUT, what is wrong in the list with file:line:column (binary: the vertex or face);
 *            -ERR_IO, -ERR_NOMEM likewise. Nothing needs freeing then.
 * Source     Wavefront Advanced Visualizer, appendix B1; Turk, "The PLY Polygon File Format" (1994).
 * Checked    tests/unit/test_mesh.c, tests/fuzz/fuzz_obj.c, fuzz_ply.c
 */
#ifndef FIT_RENDER_MESH_H
#define FIT_RENDER_MESH_H

#include <stdbool.h>
#include <stdint.h>

#include "fit/render/frame.h"
#include "proto/err.h"

#define MESH_BYTES_MAX (1u << 30)
#define MESH_COUNT_MAX (1u << 26)
#define MESH_CORNERS_MAX 256
#define MESH_MATERIALS 64
#define MESH_NO_NORMAL UINT32_MAX

struct mesh_corner {
    uint32_t vertex, normal;
};

struct mesh_triangle {
    struct mesh_corner corner[3];
    int material;
};

struct mesh {
    struct vec3 *vertex, *normal;
    struct mesh_triangle *triangle;
    size_t n_vertices, n_normals, n_triangles, capacity[3];
    size_t no_area, turned;
    int n_materials;
    struct {
        char name[64];
        int line; /* where it is named first */
    } material[MESH_MATERIALS];
    struct vec3 low, high; /* the box around all triangles */
};

struct mesh_cut {      /* of a ray with the plane of a triangle */
    double t_mm, u, v; /* u, v: weights of the second and third corner, inside the triangle */
};

int mesh_read(const char *path, struct mesh *mesh, struct err_list *errors); /* by its ending */
int mesh_read_obj(const char *file, const char *text, size_t size, struct mesh *mesh,
                  struct err_list *errors);
int mesh_read_ply(const char *file, const char *bytes, size_t size, struct mesh *mesh,
                  struct err_list *errors);
void mesh_free(struct mesh *mesh);

/* Whether the ray crosses the triangle's plane between near_mm and far_mm; which triangle is no question here. */
bool mesh_cut(const struct mesh *mesh, uint32_t triangle, const struct ray *ray, double far_mm,
              struct mesh_cut *cut);
struct vec3 mesh_facet(const struct mesh *mesh, uint32_t triangle); /* its normal, of length 1 */
struct vec3 mesh_normal(const struct mesh *mesh, uint32_t triangle, const struct mesh_cut *cut);

/* What the readers build it with; -ERR_NOMEM, -ERR_RANGE too many. */
int mesh_add_vertex(struct mesh *mesh, struct vec3 vertex);
int mesh_add_normal(struct mesh *mesh, struct vec3 normal);
int mesh_add_polygon(struct mesh *mesh, int n, const struct mesh_corner *corner, int material);
int mesh_finish(struct mesh *mesh, struct err *e);
/* A mistake of the file; -ERR_INPUT. */
int mesh_complain(struct err_list *errors, const char *file, int line, int column, const char *format, ...)
    __attribute__((format(printf, 5, 6)));

#endif
