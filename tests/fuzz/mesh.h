/*
 * mesh.h — what holds of each reader of meshes, whatever it is given.
 */
#ifndef TESTS_FUZZ_MESH_H
#define TESTS_FUZZ_MESH_H

#include <stdlib.h>

#include "fit/render/mesh.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

typedef int mesh_reader(const char *file, const char *text, size_t size, struct mesh *m,
                        struct err_list *errors);

/* What is accepted has triangles with an area inside its box, of corners and materials that there are; what is not has
 * a sentence. */
static inline int judge_mesh(mesh_reader *reader, const uint8_t *data, size_t size) {
    struct mesh m;
    struct err_list errors = {0};
    int rc = reader("f", (const char *)data, size, &m, &errors);
    if ((rc == 0) != (errors.n == 0) || (rc == 0 && m.n_triangles == 0))
        abort();
    for (uint32_t i = 0; rc == 0 && i < m.n_triangles; i++) {
        const struct mesh_triangle *t = &m.triangle[i];
        if (t->material < -1 || t->material >= m.n_materials || !(vec3_length(mesh_facet(&m, i)) > 0))
            abort();
        for (int k = 0; k < 3; k++) {
            const struct mesh_corner *c = &t->corner[k];
            if (c->vertex >= m.n_vertices || (c->normal != MESH_NO_NORMAL && c->normal >= m.n_normals) ||
                !(m.vertex[c->vertex].x >= m.low.x && m.vertex[c->vertex].x <= m.high.x))
                abort();
        }
    }
    if (rc == 0)
        mesh_free(&m);
    err_list_free(&errors);
    return 0;
}

#endif
