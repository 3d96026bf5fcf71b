#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/render/embree.h"
#include "fit/render/mesh.h"
#include "fit/render/place.h"
#include "fit/render/scene_keys.h"
#include "fit/render/sha256.h"
#include "fit/render/shape.h"

#define ROUNDING 1e-5 /* of the mesh's size: ten times what floats may misplace a ray by */

struct shape_mesh_parts { /* what is read and built */
    struct mesh mesh;
    struct embree *tree;
    struct vec3 centre; /* of its box; floats count from there */
    double radius_mm, reach_mm;
};

struct search { /* of the triangle that a ray meets */
    const struct mesh *mesh;
    struct ray ray; /* in the mesh's own coordinates */
    double far_mm;
    struct mesh_cut cut;
    uint32_t triangle;
    bool found;
};

static bool nearer(void *arg, uint32_t triangle) {
    struct search *s = arg;
    struct mesh_cut cut;
    if (!mesh_cut(s->mesh, triangle, &s->ray, s->far_mm, &cut)) {
        return false;
    }
    s->cut = cut;
    s->far_mm = cut.t_mm;
    s->triangle = triangle;
    s->found = true;
    return true;
}

/* The part of the ray inside the sphere around the mesh, so that floats suffice however far away it begins; false:
 * it passes by. */
static bool near_part(const struct shape_mesh_parts *p, const struct search *s, struct embree_ray *part) {
    struct vec3 from = vec3_sub(s->ray.origin, p->centre), d = s->ray.direction;
    double along = -vec3_dot(from, d), room = ROUNDING * p->radius_mm;
    struct vec3 closest = vec3_add(from, vec3_scale(d, along));
    double first = fmax(s->ray.near_mm, along - p->radius_mm) - room,
           last = fmin(s->far_mm, along + p->radius_mm) + room;
    if (!(vec3_length(closest) <= p->radius_mm + room && first < last)) {
        return false;
    }
    struct vec3 begin = vec3_add(closest, vec3_scale(d, first - along));
    part->origin[0] = (float)begin.x;
    part->origin[1] = (float)begin.y;
    part->origin[2] = (float)begin.z;
    part->direction[0] = (float)d.x;
    part->direction[1] = (float)d.y;
    part->direction[2] = (float)d.z;
    part->length = (float)(last - first);
    return true;
}

static struct search search_of(const struct shape *s, const struct ray *ray, double far_mm) {
    return (struct search){.mesh = &s->mesh.parts->mesh,
                           .ray = {frame_into(&s->frame, vec3_sub(ray->origin, s->frame.at)),
                                   frame_into(&s->frame, ray->direction), ray->near_mm},
                           .far_mm = far_mm};
}

/* From behind a surface is black, whatever its corners say: its own normal then faces away as well. Where only the
 * interpolated normal faces away, the facet's own counts. */
static struct vec3 normal_of(const struct search *s) {
    struct vec3 facet = mesh_facet(s->mesh, s->triangle), normal = mesh_normal(s->mesh, s->triangle, &s->cut);
    bool seen = vec3_dot(facet, s->ray.direction) < 0;
    return seen && vec3_dot(normal, s->ray.direction) < 0 ? normal : facet;
}

bool shape_mesh_hit(const struct shape *s, const struct ray *ray, struct hit *hit) {
    const struct shape_mesh_parts *p = s->mesh.parts;
    struct search search = search_of(s, ray, hit->t_mm);
    struct embree_ray part = {.accept = nearer, .arg = &search};
    if (!near_part(p, &search, &part)) {
        return false;
    }
    embree_nearest(p->tree, &part);
    if (search.found) {
        int material = p->mesh.triangle[search.triangle].material;
        hit->t_mm = search.cut.t_mm;
        hit->position = vec3_add(ray->origin, vec3_scale(ray->direction, search.cut.t_mm));
        hit->normal = frame_out(&s->frame, normal_of(&search));
        hit->paint = s->paint_of[material];
        hit->part = search.triangle;
    }
    return search.found;
}

bool shape_mesh_blocks(const struct shape *s, const struct ray *ray, double far_mm) {
    struct search search = search_of(s, ray, far_mm);
    struct embree_ray part = {.accept = nearer, .arg = &search};
    return near_part(s->mesh.parts, &search, &part) && embree_blocked(s->mesh.parts->tree, &part);
}

/* The facet itself decides on which side of it the light is, so that none leaks through a smoothed edge. */
bool shape_mesh_shadow(const struct shape *s, const struct hit *hit, struct vec3 l) {
    return !(vec3_dot(mesh_facet(&s->mesh.parts->mesh, hit->part), frame_into(&s->frame, l)) > 0);
}

double shape_mesh_reach(const struct shape *s) {
    return s->mesh.parts ? s->mesh.parts->reach_mm : 0;
}

static void measure(struct shape_mesh_parts *p) {
    const struct mesh *m = &p->mesh;
    p->centre = vec3_scale(vec3_add(m->low, m->high), 0.5);
    p->radius_mm = vec3_length(vec3_sub(m->high, m->low)) / 2;
    p->reach_mm = vec3_length(p->centre) + p->radius_mm;
}

static int scale(struct shape *s, const char *path, struct err *e) {
    struct mesh *m = &s->mesh.parts->mesh;
    double largest = vec3_length(m->low) + vec3_length(m->high);
    if (!(largest * s->mesh.scale <= 2 * SCENE_MM_MAX)) {
        return err_set(e, ERR_INPUT, "%s reaches %g mm from its origin; `scale` makes it smaller", path,
                       largest * s->mesh.scale);
    }
    for (size_t i = 0; i < m->n_vertices; i++) {
        m->vertex[i] = vec3_scale(m->vertex[i], s->mesh.scale);
    }
    m->low = vec3_scale(m->low, s->mesh.scale);
    m->high = vec3_scale(m->high, s->mesh.scale);
    measure(s->mesh.parts);
    return 0;
}

/* `material` paints all of it; otherwise usemtl names the materials. */
static int paint(struct shape *s, const char *path, struct err *e) {
    struct mesh *m = &s->mesh.parts->mesh;
    bool one = s->n_materials == 1;
    for (size_t i = 0; i < m->n_triangles; i++) {
        int *material = &m->triangle[i].material;
        *material = one ? 0 : *material;
        if (*material < 0) {
            return err_set(e, ERR_INPUT, "%s has faces without usemtl; give the mesh a `material`", path);
        }
    }
    for (s->n_materials = one; !one && s->n_materials < m->n_materials; s->n_materials++) {
        snprintf(s->material[s->n_materials], sizeof s->material[0], "%s", m->material[s->n_materials].name);
    }
    return 0;
}

static void tell_vertex(void *arg, size_t i, float v[3]) {
    const struct shape_mesh_parts *p = arg;
    struct vec3 from = vec3_sub(p->mesh.vertex[i], p->centre);
    v[0] = (float)from.x;
    v[1] = (float)from.y;
    v[2] = (float)from.z;
}

static void tell_triangle(void *arg, size_t i, uint32_t corner[3]) {
    const struct shape_mesh_parts *p = arg;
    for (int k = 0; k < 3; k++) {
        corner[k] = p->mesh.triangle[i].corner[k].vertex;
    }
}

int shape_mesh_prepare(struct shape *s, const char *folder, struct err_list *errors, struct err *e) {
    char path[PLACE_MAX];
    s->mesh.parts = calloc(1, sizeof *s->mesh.parts);
    if (!s->mesh.parts) {
        return err_set(e, ERR_NOMEM, "no memory for a mesh");
    }
    struct mesh *m = &s->mesh.parts->mesh;
    place_of(path, folder, s->mesh.file);
    int status = mesh_read(path, m, errors);
    status = status ? status : sha256_of_file(path, s->mesh.sha256, e);
    status = status ? status : scale(s, path, e);
    status = status ? status : paint(s, path, e);
    return status ? status
                  : embree_make(&s->mesh.parts->tree, m->n_vertices, tell_vertex, m->n_triangles,
                                tell_triangle, s->mesh.parts, e);
}

void shape_mesh_free(struct shape *s) {
    if (s->mesh.parts) {
        embree_free(s->mesh.parts->tree);
        mesh_free(&s->mesh.parts->mesh);
        free(s->mesh.parts);
        s->mesh.parts = NULL;
    }
}

const struct mesh *shape_mesh(const struct shape *s) {
    return s->kind == SHAPE_MESH && s->mesh.parts ? &s->mesh.parts->mesh : NULL;
}
