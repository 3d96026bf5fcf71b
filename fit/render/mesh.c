#include "fit/render/mesh.h"

#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include "fit/render/place.h"
#include "proto/file.h"

#define FLAT 1e-14    /* area over the square of the longest edge, below which doubles know no direction */
#define EDGE_ON 1e-12 /* cosine to the facet below which its plane cannot be cut: what lies behind is seen */

int mesh_complain(struct err_list *errors, const char *file, int line, int column, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    int status = err_list_mistake(errors, file, line, column, format, arguments);
    va_end(arguments);
    return status;
}

/* Room for one more of n things. */
static int grow(void *list, size_t n, size_t *capacity, size_t size) {
    void **items = list;
    if (n >= MESH_COUNT_MAX) {
        return -ERR_RANGE;
    }
    if (n == *capacity) {
        size_t more = n ? 2 * n : 256;
        void *grown = realloc(*items, more * size);
        if (!grown) {
            return -ERR_NOMEM;
        }
        *items = grown;
        *capacity = more;
    }
    return 0;
}

int mesh_add_vertex(struct mesh *mesh, struct vec3 vertex) {
    int status = grow(&mesh->vertex, mesh->n_vertices, &mesh->capacity[0], sizeof vertex);
    if (!status) {
        mesh->vertex[mesh->n_vertices++] = vertex;
    }
    return status;
}

int mesh_add_normal(struct mesh *mesh, struct vec3 normal) {
    int status = grow(&mesh->normal, mesh->n_normals, &mesh->capacity[1], sizeof normal);
    if (!status) {
        mesh->normal[mesh->n_normals++] = vec3_unit(normal);
    }
    return status;
}

static struct vec3 place(const struct mesh *mesh, const struct mesh_corner *corner) {
    return mesh->vertex[corner->vertex];
}

struct flat { /* a polygon laid into a plane */
    int n;
    double x[MESH_CORNERS_MAX], y[MESH_CORNERS_MAX];
    int left[MESH_CORNERS_MAX]; /* corners not yet cut off, in order */
};

/* Seen along the largest component of its normal (Newell's sum), counter-clockwise. */
static void lay_flat(const struct mesh *mesh, int n, const struct mesh_corner *corner, struct flat *f) {
    struct vec3 sum = {0, 0, 0}, first = place(mesh, &corner[0]);
    for (int i = 0; i < n; i++) {
        struct vec3 a = vec3_sub(place(mesh, &corner[i]), first);
        sum = vec3_add(sum, vec3_cross(a, vec3_sub(place(mesh, &corner[(i + 1) % n]), first)));
    }
    double x = fabs(sum.x), y = fabs(sum.y), z = fabs(sum.z);
    f->n = n;
    for (int i = 0; i < n; i++) {
        struct vec3 p = vec3_sub(place(mesh, &corner[i]), first);
        bool along_x = x >= y && x >= z, along_y = !along_x && y >= z;
        f->x[i] = along_x ? p.y : along_y ? p.z : p.x;
        f->y[i] = along_x ? p.z : along_y ? p.x : p.y;
        f->y[i] *= (along_x ? sum.x : along_y ? sum.y : sum.z) < 0 ? -1 : 1;
        f->left[i] = i;
    }
}

static double turn(const struct flat *f, int a, int b, int c) {
    return (f->x[b] - f->x[a]) * (f->y[c] - f->y[a]) - (f->y[b] - f->y[a]) * (f->x[c] - f->x[a]);
}

/* Whether the i-th of the corners left sticks out and no other corner lies in the triangle that it makes. */
static bool is_ear(const struct flat *f, int i) {
    int a = f->left[(i + f->n - 1) % f->n], b = f->left[i], c = f->left[(i + 1) % f->n];
    if (!(turn(f, a, b, c) > 0)) {
        return false;
    }
    for (int k = 0; k < f->n; k++) {
        int p = f->left[k];
        if (p != a && p != b && p != c && turn(f, a, b, p) >= 0 && turn(f, b, c, p) >= 0 &&
            turn(f, c, a, p) >= 0) {
            return false;
        }
    }
    return true;
}

static int add_triangle(struct mesh *mesh, const struct mesh_corner *corner, int a, int b, int c,
                        int material) {
    int status = grow(&mesh->triangle, mesh->n_triangles, &mesh->capacity[2], sizeof *mesh->triangle);
    if (!status) {
        mesh->triangle[mesh->n_triangles++] =
            (struct mesh_triangle){{corner[a], corner[b], corner[c]}, material};
    }
    return status;
}

/* One ear after the other is cut off; a polygon that has none crosses itself, and loses its first corner. */
int mesh_add_polygon(struct mesh *mesh, int n, const struct mesh_corner *corner, int material) {
    struct flat f;
    int status = 0;
    if (n == 3) {
        return add_triangle(mesh, corner, 0, 1, 2, material);
    }
    lay_flat(mesh, n, corner, &f);
    while (f.n >= 3 && !status) {
        int ear = 1; /* its corner 1 first: a convex polygon becomes a fan about corner 0 */
        for (int i = 0; i < f.n; i++) {
            if (is_ear(&f, (1 + i) % f.n)) {
                ear = (1 + i) % f.n;
                break;
            }
        }
        status = add_triangle(mesh, corner, f.left[(ear + f.n - 1) % f.n], f.left[ear],
                              f.left[(ear + 1) % f.n], material);
        memmove(&f.left[ear], &f.left[ear + 1], (size_t)(f.n - ear - 1) * sizeof f.left[0]);
        f.n--;
    }
    return status;
}

/* Twice its area along its normal; 0 where it has no area to speak of. */
static struct vec3 area_of(const struct mesh *mesh, const struct mesh_triangle *t) {
    struct vec3 a = place(mesh, &t->corner[0]), ab = vec3_sub(place(mesh, &t->corner[1]), a),
                ac = vec3_sub(place(mesh, &t->corner[2]), a), bc = vec3_sub(ac, ab),
                area = vec3_cross(ab, ac);
    double longest = fmax(vec3_dot(ab, ab), fmax(vec3_dot(ac, ac), vec3_dot(bc, bc)));
    return vec3_length(area) > FLAT * longest ? area : (struct vec3){0, 0, 0};
}

struct vec3 mesh_facet(const struct mesh *mesh, uint32_t triangle) {
    return vec3_unit(area_of(mesh, &mesh->triangle[triangle]));
}

static void turn_to_normals(struct mesh *mesh, struct mesh_triangle *t, struct vec3 area) {
    double agree = 0;
    for (int k = 0; k < 3; k++) {
        agree +=
            t->corner[k].normal == MESH_NO_NORMAL ? 0 : vec3_dot(area, mesh->normal[t->corner[k].normal]);
    }
    if (agree < 0) {
        struct mesh_corner second = t->corner[1];
        t->corner[1] = t->corner[2];
        t->corner[2] = second;
        mesh->turned++;
    }
}

static void widen(struct mesh *mesh, struct vec3 p) {
    mesh->low = (struct vec3){fmin(mesh->low.x, p.x), fmin(mesh->low.y, p.y), fmin(mesh->low.z, p.z)};
    mesh->high = (struct vec3){fmax(mesh->high.x, p.x), fmax(mesh->high.y, p.y), fmax(mesh->high.z, p.z)};
}

int mesh_finish(struct mesh *mesh, struct err *e) {
    size_t kept = 0;
    mesh->low = (struct vec3){INFINITY, INFINITY, INFINITY};
    mesh->high = vec3_scale(mesh->low, -1);
    for (size_t i = 0; i < mesh->n_triangles; i++) {
        struct mesh_triangle *t = &mesh->triangle[kept];
        *t = mesh->triangle[i];
        struct vec3 area = area_of(mesh, t);
        if (vec3_length(area) > 0) {
            turn_to_normals(mesh, t, area);
            for (int k = 0; k < 3; k++) {
                widen(mesh, place(mesh, &t->corner[k]));
            }
            kept++;
        }
    }
    mesh->no_area = mesh->n_triangles - kept;
    mesh->n_triangles = kept;
    return kept ? 0
                : err_set(e, ERR_INPUT, "it has no triangle with an area (%zu without); a mesh needs one",
                          mesh->no_area);
}

bool mesh_cut(const struct mesh *mesh, uint32_t triangle, const struct ray *ray, double far_mm,
              struct mesh_cut *cut) {
    const struct mesh_triangle *t = &mesh->triangle[triangle];
    struct vec3 a = place(mesh, &t->corner[0]), ab = vec3_sub(place(mesh, &t->corner[1]), a),
                ac = vec3_sub(place(mesh, &t->corner[2]), a), area = vec3_cross(ab, ac),
                from = vec3_sub(ray->origin, a);
    double against = vec3_dot(area, ray->direction);
    if (!(fabs(against) > EDGE_ON * vec3_length(area))) {
        return false;
    }
    struct vec3 side = vec3_cross(from, ray->direction);
    cut->t_mm = -vec3_dot(area, from) / against;
    cut->u = fmin(fmax(-vec3_dot(ac, side) / against, 0), 1);
    cut->v = fmin(fmax(vec3_dot(ab, side) / against, 0), 1 - cut->u);
    return cut->t_mm > ray->near_mm && cut->t_mm < far_mm;
}

struct vec3 mesh_normal(const struct mesh *mesh, uint32_t triangle, const struct mesh_cut *cut) {
    const struct mesh_triangle *t = &mesh->triangle[triangle];
    double weight[3] = {1 - cut->u - cut->v, cut->u, cut->v};
    struct vec3 sum = {0, 0, 0};
    for (int k = 0; k < 3; k++) {
        if (t->corner[k].normal == MESH_NO_NORMAL) {
            return mesh_facet(mesh, triangle);
        }
        sum = vec3_add(sum, vec3_scale(mesh->normal[t->corner[k].normal], weight[k]));
    }
    return vec3_unit(sum);
}

void mesh_free(struct mesh *mesh) {
    free(mesh->vertex);
    free(mesh->normal);
    free(mesh->triangle);
    *mesh = (struct mesh){0};
}

int mesh_read(const char *path, struct mesh *mesh, struct err_list *errors) {
    bool obj = place_ends(path, ".obj");
    char *bytes = NULL;
    size_t size = 0;
    struct err e = {0};
    if (!obj && !place_ends(path, ".ply")) {
        return mesh_complain(errors, path, 0, 0, "meshes are read from .obj and .ply files");
    }
    int status = file_read(path, MESH_BYTES_MAX, &bytes, &size, &e);
    if (status) {
        err_list_add(errors, &e);
        return status;
    }
    status = (obj ? mesh_read_obj : mesh_read_ply)(path, bytes, size, mesh, errors);
    free(bytes);
    return status;
}
