#include "tests/support/mesh_file.h"

#include <endian.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static struct mesh_source room(size_t vertices, size_t triangles) {
    struct mesh_source s = {.vertex = calloc(vertices, sizeof *s.vertex),
                            .normal = calloc(vertices, sizeof *s.normal),
                            .corner = calloc(triangles, sizeof *s.corner)};
    assert_true(s.vertex && s.normal && s.corner);
    return s;
}

static void add(struct mesh_source *s, unsigned a, unsigned b, unsigned c) {
    unsigned *corner = s->corner[s->n_triangles++];
    corner[0] = a;
    corner[1] = b;
    corner[2] = c;
}

static void point(struct mesh_source *s, struct vec3 at, struct vec3 normal) {
    s->vertex[s->n_vertices] = at;
    s->normal[s->n_vertices++] = normal;
}

/* Two triangles between each pair of neighbours in rows of n corners that close on themselves; outward. */
static void bands(struct mesh_source *s, unsigned first, int rows, int n) {
    for (int i = 0; i + 1 < rows; i++)
        for (int k = 0; k < n; k++) {
            unsigned a = first + (unsigned)(i * n + k), b = first + (unsigned)(i * n + (k + 1) % n),
                     c = a + (unsigned)n, d = b + (unsigned)n;
            add(s, a, c, b);
            add(s, b, c, d);
        }
}

static struct vec3 around(int k, int n, double y, double r) {
    double phi = 2 * M_PI * k / n;
    return (struct vec3){r * sin(phi), y, r * cos(phi)};
}

struct mesh_source mesh_source_ball(int rings) {
    int n = 2 * rings;
    struct mesh_source s = room((size_t)(rings * n), 2 * (size_t)(rings * n));
    for (int i = 1; i < rings; i++)
        for (int k = 0; k < n; k++) {
            struct vec3 p = around(k, n, cos(M_PI * i / rings), sin(M_PI * i / rings));
            point(&s, p, p);
        }
    bands(&s, 0, rings - 1, n);
    unsigned top = (unsigned)s.n_vertices, last = top - (unsigned)n;
    point(&s, (struct vec3){0, 1, 0}, (struct vec3){0, 1, 0});
    point(&s, (struct vec3){0, -1, 0}, (struct vec3){0, -1, 0});
    for (int k = 0; k < n; k++) {
        add(&s, top, (unsigned)k, (unsigned)((k + 1) % n));
        add(&s, top + 1, last + (unsigned)((k + 1) % n), last + (unsigned)k);
    }
    return s;
}

struct mesh_source mesh_source_cylinder(int rings) {
    int n = 2 * rings;
    struct mesh_source s = room((size_t)((rings + 4) * n), 2 * (size_t)((rings + 4) * n));
    for (int i = 0; i < rings; i++)
        for (int k = 0; k < n; k++)
            point(&s, around(k, n, 1 - 2.0 * i / (rings - 1), 1), around(k, n, 0, 1));
    bands(&s, 0, rings, n);
    for (int end = 1; end >= -1; end -= 2) {
        unsigned middle = (unsigned)s.n_vertices;
        struct vec3 normal = {0, end, 0};
        point(&s, normal, normal);
        for (int k = 0; k < n; k++)
            point(&s, around(k, n, end, 1), normal);
        for (unsigned k = 0; k < (unsigned)n; k++) {
            unsigned a = middle + 1 + k, b = middle + 1 + (k + 1) % (unsigned)n;
            add(&s, middle, end > 0 ? a : b, end > 0 ? b : a);
        }
    }
    return s;
}

void mesh_source_free(struct mesh_source *source) {
    free(source->vertex);
    free(source->normal);
    free(source->corner);
}

static void write_obj(FILE *out, const struct mesh_source *s, bool normals) {
    for (size_t i = 0; i < s->n_vertices; i++)
        fprintf(out, "v %.17g %.17g %.17g\n", (float)s->vertex[i].x, (float)s->vertex[i].y,
                (float)s->vertex[i].z);
    for (size_t i = 0; i < s->n_vertices && normals; i++)
        fprintf(out, "vn %.17g %.17g %.17g\n", (float)s->normal[i].x, (float)s->normal[i].y,
                (float)s->normal[i].z);
    for (size_t i = 0; i < s->n_triangles; i++) {
        fputs("f", out);
        for (int k = 0; k < 3; k++) {
            unsigned v = s->corner[i][k] + 1;
            normals ? fprintf(out, " %u//%u", v, v) : fprintf(out, " %u", v);
        }
        fputs("\n", out);
    }
}

static void put_float(FILE *out, enum mesh_file_kind kind, double value) {
    float single = (float)value;
    uint32_t bits;
    memcpy(&bits, &single, sizeof bits);
    bits = kind == MESH_FILE_BIG ? htobe32(bits) : htole32(bits);
    if (kind == MESH_FILE_ASCII)
        fprintf(out, "%.17g ", single);
    else
        fwrite(&bits, sizeof bits, 1, out);
}

static void put_index(FILE *out, enum mesh_file_kind kind, unsigned value) {
    uint32_t bits = kind == MESH_FILE_BIG ? htobe32(value) : htole32(value);
    if (kind == MESH_FILE_ASCII)
        fprintf(out, "%u ", value);
    else
        fwrite(&bits, sizeof bits, 1, out);
}

static void put_vector(FILE *out, enum mesh_file_kind kind, struct vec3 v) {
    put_float(out, kind, v.x);
    put_float(out, kind, v.y);
    put_float(out, kind, v.z);
}

static void write_ply(FILE *out, enum mesh_file_kind kind, const struct mesh_source *s, bool normals) {
    static const char *const formats[] = {[MESH_FILE_ASCII] = "ascii",
                                          [MESH_FILE_LITTLE] = "binary_little_endian",
                                          [MESH_FILE_BIG] = "binary_big_endian"};
    fprintf(out, "ply\nformat %s 1.0\ncomment generated\nelement vertex %zu\n", formats[kind], s->n_vertices);
    fputs("property float x\nproperty float y\nproperty float z\n", out);
    if (normals)
        fputs("property float nx\nproperty float ny\nproperty float nz\n", out);
    fprintf(out, "element face %zu\nproperty list uchar uint vertex_indices\nend_header\n", s->n_triangles);
    for (size_t i = 0; i < s->n_vertices; i++) {
        put_vector(out, kind, s->vertex[i]);
        if (normals)
            put_vector(out, kind, s->normal[i]);
        if (kind == MESH_FILE_ASCII)
            fputs("\n", out);
    }
    for (size_t i = 0; i < s->n_triangles; i++) {
        fputs(kind == MESH_FILE_ASCII ? "3 " : "\3", out);
        for (int k = 0; k < 3; k++)
            put_index(out, kind, s->corner[i][k]);
        if (kind == MESH_FILE_ASCII)
            fputs("\n", out);
    }
}

void mesh_file_write(const char *path, enum mesh_file_kind kind, const struct mesh_source *source,
                     bool normals) {
    FILE *out = fopen(path, "wb");
    assert_non_null(out);
    if (kind == MESH_FILE_OBJ)
        write_obj(out, source, normals);
    else
        write_ply(out, kind, source, normals);
    assert_int_equal(fclose(out), 0);
}
