#include "fit/render/shape.h"

#include "proto/units.h"

int shape_fold_prepare(struct shape *s, const char *folder, struct err_list *errors, struct err *e) {
    double half = rad_from_deg(s->fold.angle_deg) / 2;
    (void)folder;
    (void)errors;
    (void)e;
    s->fold.sine = sin(half);
    s->fold.cosine = cos(half);
    return 0;
}

/* Side -1 left, 1 right, is hit before *t: its distance and normal, which points into the opening. */
static bool meet(const struct shape_fold *f, int side, struct vec3 o, struct vec3 d, double near_mm,
                 double *t, struct vec3 *normal) {
    struct vec3 u = {side * f->sine, 0, f->cosine}, n = {-side * f->cosine, 0, f->sine};
    double toward = vec3_dot(d, n);
    if (toward == 0) {
        return false;
    }
    double at = -vec3_dot(o, n) / toward;
    struct vec3 p = vec3_add(o, vec3_scale(d, at));
    double from_edge = vec3_dot(p, u);
    if (!(at > near_mm && at < *t && from_edge >= 0 && from_edge <= f->width_mm &&
          fabs(p.y) <= f->length_mm / 2)) {
        return false;
    }
    *t = at;
    *normal = n;
    return true;
}

bool shape_fold_hit(const struct shape *s, const struct ray *ray, struct hit *hit) {
    struct vec3 o = frame_into(&s->frame, vec3_sub(ray->origin, s->frame.at)), normal;
    struct vec3 d = frame_into(&s->frame, ray->direction);
    int paint = -1;
    for (int side = -1; side <= 1; side += 2) {
        if (meet(&s->fold, side, o, d, ray->near_mm, &hit->t_mm, &normal)) {
            paint = s->paint_of[side > 0 && s->n_materials > 1];
        }
    }
    if (paint < 0) {
        return false;
    }
    hit->position = vec3_add(ray->origin, vec3_scale(ray->direction, hit->t_mm));
    hit->normal = frame_out(&s->frame, normal);
    hit->paint = paint;
    return true;
}
