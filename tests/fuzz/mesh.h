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

static inline bool is_between(struct vec3 low, struct vec3 v, struct vec3 high) {
    return v.x >= low.x && v.x <= high.x && v.y >= low.y && v.y <= high.y && v.z >= low.z && v.z <= high.z;
}

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
                !is_between(m.low, m.vertex[c->vertex], m.high))
                abort();
        }
    }
    if (rc == 0)
        mesh_free(&m);
    err_list_free(&errors);
    return 0;
}

#endif
