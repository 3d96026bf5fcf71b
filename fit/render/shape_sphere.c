#include "fit/render/shape.h"

bool shape_sphere_hit(const struct shape *s, const struct ray *ray, struct hit *hit) {
    struct vec3 o = vec3_sub(ray->origin, s->frame.at);
    double along = -vec3_dot(o, ray->direction), r = s->sphere.radius_mm;
    /* From the nearest point of the ray to the centre: b^2 - c would cancel for a camera far away. */
    struct vec3 nearest = vec3_add(o, vec3_scale(ray->direction, along));
    double miss = vec3_length(nearest), room = (r - miss) * (r + miss);
    if (!(room >= 0)) {
        return false;
    }
    double half = sqrt(room), t = along - half;
    if (!(t > ray->near_mm && t < hit->t_mm)) {
        return false;
    }
    struct vec3 from_centre = vec3_sub(nearest, vec3_scale(ray->direction, half));
    hit->t_mm = t;
    hit->position = vec3_add(s->frame.at, from_centre);
    hit->normal = vec3_unit(from_centre);
    hit->paint = s->paint_of[0];
    return true;
}
