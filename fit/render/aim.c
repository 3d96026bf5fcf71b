#include "fit/render/aim.h"

#include "fit/render/sampler.h"

#define LIFT 1e-6 /* of the scene's size */
/* By error for the same time on folds of the published paints: flat from 0.75 to 0.95. */
#define SHARE 0.9
#define SHARE_HOLLOW 0.5

/* Nothing where there is no room any more: then aim->n says so. */
static void add(struct aim *aim, const struct aim_target *target) {
    if (aim->n < AIM_TARGETS) {
        aim->target[aim->n] = *target;
    }
    aim->n++;
}

static void add_rectangle(struct aim *aim, int shape, int paint, struct vec3 middle, struct vec3 u,
                          struct vec3 v) {
    add(aim, &(struct aim_target){middle, u, v, vec3_length(vec3_add(u, v)), shape, paint, true});
}

static void add_fold(struct aim *aim, int shape, const struct shape *s) {
    struct vec3 y = vec3_scale(s->frame.y, s->fold.length_mm / 2);
    for (int side = -1; side <= 1; side += 2) {
        struct vec3 along = frame_out(&s->frame, (struct vec3){side * s->fold.sine, 0, s->fold.cosine});
        struct vec3 x = vec3_scale(along, s->fold.width_mm / 2), middle = vec3_add(s->frame.at, x);
        int paint = s->paint_of[side > 0 && s->n_materials > 1];
        add_rectangle(aim, shape, paint, middle, side > 0 ? x : y, side > 0 ? y : x);
    }
}

void aim_make(struct aim *aim, const struct scene *scene) {
    aim->n = 0;
    aim->lift_mm = LIFT * scene->camera.reach_mm;
    for (int i = 0; i < scene->n_shapes; i++) {
        const struct shape *s = &scene->shape[i];
        aim->hollow[i] = !shape_is_convex(s) && s->kind != SHAPE_FOLD && s->kind != SHAPE_RECTANGLE;
        if (s->kind == SHAPE_FOLD) {
            add_fold(aim, i, s);
        } else if (s->kind == SHAPE_RECTANGLE) {
            add_rectangle(aim, i, s->n_materials == 1 ? s->paint_of[0] : -1, s->frame.at,
                          vec3_scale(s->frame.x, s->rectangle.width_mm / 2),
                          vec3_scale(s->frame.y, s->rectangle.height_mm / 2));
        } else {
            add(aim, &(struct aim_target){.middle = s->frame.at, .radius_mm = shape_reach_mm(s), .shape = i});
        }
    }
    aim->n = aim->n <= AIM_TARGETS ? aim->n : 0;
}

/* On the axes of the view: z along its normal. */
static struct vec3 seen(const struct aim_view *view, struct vec3 v) {
    return (struct vec3){vec3_dot(v, view->s), vec3_dot(v, view->t), vec3_dot(v, view->n)};
}

/* The corners of a rectangle and where its sides meet the horizon, above it. */
static int outline(const struct aim_target *target, const struct aim_view *view, struct vec3 way,
                   struct vec3 *out) {
    struct vec3 m = seen(view, way), u = seen(view, target->u), v = seen(view, target->v);
    struct vec3 corner[4] = {vec3_add(vec3_sub(m, u), vec3_scale(v, -1)), vec3_sub(vec3_add(m, u), v),
                             vec3_add(vec3_add(m, u), v), vec3_add(vec3_sub(m, u), v)};
    int n = 0;
    for (int i = 0; i < 4; i++) {
        struct vec3 a = corner[i], b = corner[(i + 1) % 4];
        if (a.z >= 0) {
            out[n++] = a;
        }
        if (a.z * b.z < 0) {
            struct vec3 p = vec3_add(a, vec3_scale(vec3_sub(b, a), a.z / (a.z - b.z)));
            out[n++] = (struct vec3){p.x, p.y, 0};
        }
    }
    return n;
}

static double cosine(struct vec3 p) {
    return p.z / vec3_length(p);
}

/* The largest cosine to the normal on the way from a to b. */
static double highest_between(struct vec3 a, struct vec3 b) {
    struct vec3 d = vec3_sub(b, a);
    double ad = vec3_dot(a, d), above = d.z * vec3_dot(a, a) - a.z * ad,
           below = a.z * vec3_dot(d, d) - d.z * ad;
    double t = below != 0 ? above / below : 0;
    double end = shade_most(cosine(a), cosine(b));
    return t > 0 && t < 1 ? shade_most(end, cosine(vec3_add(a, vec3_scale(d, t)))) : end;
}

static double turn(double from, double to) { /* of two azimuths in -pi .. pi; the same */
    double d = to - from;
    return d > M_PI ? d - 2 * M_PI : d < -M_PI ? d + 2 * M_PI : d;
}

static void finish(struct aim_sector *x, double azimuth, double half, double highest, double lowest) {
    x->azimuth = azimuth;
    x->half = half < M_PI ? half : M_PI;
    x->cos_half = half < M_PI ? cos(half) : -2;
    x->along = (struct vec3){cos(azimuth), sin(azimuth), 0};
    x->low = 1 - highest * highest;
    x->high = 1 - lowest * lowest;
    x->area = x->half * (x->high - x->low);
}

static bool rectangle_sector(const struct aim_target *target, const struct aim_view *view, struct vec3 way,
                             struct aim_sector *x) {
    struct vec3 p[8];
    int n = outline(target, view, way, p);
    double first, at, left = 0, right = 0, sum = 0, highest = 0, lowest = 1;
    if (n < 3) {
        return false;
    }
    first = at = atan2(p[0].y, p[0].x);
    for (int i = 0; i < n; i++) {
        struct vec3 next = p[(i + 1) % n];
        double azimuth = i + 1 < n ? atan2(next.y, next.x) : first;
        sum += turn(at, azimuth);
        at = azimuth;
        left = shade_least(left, sum);
        right = shade_most(right, sum);
        highest = shade_most(highest, highest_between(p[i], next));
        lowest = shade_least(lowest, cosine(p[i]));
    }
    if (fabs(sum) > M_PI) { /* it goes around the normal */
        finish(x, 0, M_PI, 1, lowest);
    } else {
        finish(x, first + (left + right) / 2, (right - left) / 2, shade_least(highest, 1), lowest);
    }
    return x->area > 0;
}

static bool sphere_sector(const struct aim_target *target, const struct aim_view *view, struct vec3 way,
                          struct aim_sector *x) {
    struct vec3 m = seen(view, way);
    double distance = vec3_length(m), sine = target->radius_mm / distance;
    if (!(sine < 1)) {
        return false;
    }
    double delta = asin(sine), theta = acos(shade_most(-1, shade_least(1, m.z / distance)));
    double around = theta > delta && theta + delta < M_PI ? asin(sine / sin(theta)) : M_PI;
    double highest = theta > delta ? cos(theta - delta) : 1, lowest = cos(shade_least(theta + delta, M_PI_2));
    finish(x, atan2(m.y, m.x), around, highest, lowest);
    return theta - delta < M_PI_2 && x->area > 0;
}

void aim_from(const struct aim *aim, const struct hit *hit, struct aim_view *view) {
    view->n = hit->normal;
    vec3_frame(view->n, &view->s, &view->t);
    view->n_sectors = 0;
    view->area = 0;
    for (int i = 0; i < aim->n; i++) {
        const struct aim_target *target = &aim->target[i];
        struct aim_sector *x = &view->sector[view->n_sectors];
        struct vec3 way = vec3_sub(target->middle, hit->position);
        if (vec3_dot(way, view->n) <= -target->radius_mm) {
            continue;
        }
        bool found = false;
        if (!target->flat) {
            found = target->shape != hit->shape && sphere_sector(target, view, way, x);
        } else if (-vec3_dot(way, vec3_unit(vec3_cross(target->u, target->v))) > aim->lift_mm) {
            found = rectangle_sector(target, view, way, x);
        }
        if (found) {
            view->area += x->area;
            view->target[view->n_sectors++] = i;
        }
    }
    view->share = view->n_sectors == 0 ? 0 : aim->hollow[hit->shape] ? SHARE_HOLLOW : SHARE;
}

struct vec3 aim_sample(const struct aim_view *view, const double u[2]) {
    double rest = u[0] * view->area;
    int i = 0;
    while (i + 1 < view->n_sectors && rest >= view->sector[i].area) {
        rest -= view->sector[i++].area;
    }
    const struct aim_sector *x = &view->sector[i];
    double azimuth = x->azimuth + (2 * u[1] - 1) * x->half,
           sin2 = x->low + sampler_within(rest, x->area) * (x->high - x->low);
    double radius = sqrt(sin2), height = sqrt(1 - sin2);
    struct vec3 across =
        vec3_add(vec3_scale(view->s, radius * cos(azimuth)), vec3_scale(view->t, radius * sin(azimuth)));
    return vec3_add(across, vec3_scale(view->n, height));
}

double aim_density(const struct aim_view *view, struct vec3 l) {
    struct vec3 p = seen(view, l);
    double sin2 = p.x * p.x + p.y * p.y, radius = sqrt(sin2);
    int held = 0;
    for (int i = 0; i < view->n_sectors; i++) {
        const struct aim_sector *x = &view->sector[i];
        held +=
            sin2 >= x->low && sin2 <= x->high && p.x * x->along.x + p.y * x->along.y >= x->cos_half * radius;
    }
    return held > 0 ? held * p.z / view->area : 0;
}
