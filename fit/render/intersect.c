#include "fit/render/intersect.h"

#define LIFT 1e-9 /* a ray that leaves a surface begins this part of the scene's size above it */

struct ray intersect_leave(const struct scene *scene, const struct hit *from, struct vec3 direction) {
    return (struct ray){from->position, direction, LIFT * scene->camera.reach_mm};
}

bool intersect_nearest(const struct scene *scene, const struct ray *ray, struct hit *hit) {
    hit->t_mm = INFINITY;
    hit->shape = -1;
    for (int i = 0; i < scene->n_shapes; i++) {
        if (shape_hit(&scene->shape[i], ray, hit)) {
            hit->shape = i;
        }
    }
    return hit->shape >= 0;
}

bool intersect_blocked(const struct scene *scene, const struct hit *from, struct vec3 l, double far_mm) {
    struct ray ray = intersect_leave(scene, from, l);
    bool blocked = shape_shadows_itself(&scene->shape[from->shape], from, l);
    for (int i = 0; i < scene->n_shapes && !blocked; i++) {
        blocked = shape_blocks(&scene->shape[i], &ray, far_mm);
    }
    return blocked;
}
