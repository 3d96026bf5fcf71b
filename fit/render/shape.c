#include "fit/render/shape.h"

static bool cylinder_convex(const struct shape *s) {
    return !s->cylinder.open;
}

static double cylinder_reach(const struct shape *s) {
    return hypot(s->cylinder.radius_mm, s->cylinder.length_mm / 2);
}

static bool always(const struct shape *s) {
    (void)s;
    return true;
}

static double sphere_reach(const struct shape *s) {
    return s->sphere.radius_mm;
}

static const struct {
    const char *name;
    bool (*hit)(const struct shape *s, const struct ray *ray, struct hit *hit);
    bool (*convex)(const struct shape *s);
    double (*reach)(const struct shape *s);
} kinds[SHAPE_KINDS] = {
    [SHAPE_CYLINDER] = {"cylinder", shape_cylinder_hit, cylinder_convex, cylinder_reach},
    [SHAPE_SPHERE] = {"sphere", shape_sphere_hit, always, sphere_reach},
};

const char *shape_name(enum shape_kind kind) {
    return kinds[kind].name;
}

int shape_prepare(struct shape *s, const char *folder, struct err_list *errors) {
    (void)folder;
    (void)errors;
    s->frame = frame_make(s->at_mm, s->turn_deg);
    return 0;
}

void shape_free(struct shape *s) {
    (void)s;
}

bool shape_hit(const struct shape *s, const struct ray *ray, struct hit *hit) {
    return kinds[s->kind].hit(s, ray, hit);
}

bool shape_is_convex(const struct shape *s) {
    return kinds[s->kind].convex(s);
}

double shape_reach_mm(const struct shape *s) {
    return kinds[s->kind].reach(s);
}
