#include "fit/render/shape.h"

struct kind { /* NULL: nothing to do */
    const char *name;
    bool (*hit)(const struct shape *s, const struct ray *ray, struct hit *hit);
    double (*reach)(const struct shape *s);
    bool (*shadow)(const struct shape *s, const struct hit *hit, struct vec3 l);
    int (*prepare)(struct shape *s, const char *folder, struct err_list *errors, struct err *e);
    void (*free)(struct shape *s);
    bool (*blocks)(const struct shape *s, const struct ray *ray, double far_mm); /* NULL: by hit */
};

static double cylinder_reach(const struct shape *s) {
    return hypot(s->cylinder.radius_mm, s->cylinder.length_mm / 2);
}

static double sphere_reach(const struct shape *s) {
    return s->sphere.radius_mm;
}

static double rectangle_reach(const struct shape *s) {
    return hypot(s->rectangle.width_mm, s->rectangle.height_mm) / 2;
}

static double board_reach(const struct shape *s) {
    int rows = (s->n_materials + s->board.columns - 1) / s->board.columns;
    return hypot(rows, s->board.columns) * (s->board.patch_mm + s->board.gap_mm) / 2;
}

static double fold_reach(const struct shape *s) {
    return hypot(s->fold.width_mm, s->fold.length_mm / 2);
}

static const struct kind kinds[SHAPE_KINDS] = {
    [SHAPE_CYLINDER] = {.name = "cylinder", .hit = shape_cylinder_hit, .reach = cylinder_reach},
    [SHAPE_SPHERE] = {.name = "sphere", .hit = shape_sphere_hit, .reach = sphere_reach},
    [SHAPE_RECTANGLE] = {"rectangle", shape_rectangle_hit, rectangle_reach, shape_rectangle_shadow,
                         shape_rectangle_prepare, shape_rectangle_free, NULL},
    [SHAPE_BOARD] = {.name = "board", .hit = shape_board_hit, .reach = board_reach},
    [SHAPE_FOLD] = {.name = "fold",
                    .hit = shape_fold_hit,
                    .reach = fold_reach,
                    .prepare = shape_fold_prepare},
    [SHAPE_MESH] = {"mesh", shape_mesh_hit, shape_mesh_reach, shape_mesh_shadow, shape_mesh_prepare,
                    shape_mesh_free, shape_mesh_blocks},
};

const char *shape_name(enum shape_kind kind) {
    return kinds[kind].name;
}

int shape_prepare(struct shape *s, const char *folder, struct err_list *errors, struct err *e) {
    s->frame = frame_make(s->at_mm, s->turn_deg);
    return kinds[s->kind].prepare ? kinds[s->kind].prepare(s, folder, errors, e) : 0;
}

void shape_free(struct shape *s) {
    if (kinds[s->kind].free) {
        kinds[s->kind].free(s);
    }
}

bool shape_hit(const struct shape *s, const struct ray *ray, struct hit *hit) {
    return kinds[s->kind].hit(s, ray, hit);
}

bool shape_blocks(const struct shape *s, const struct ray *ray, double far_mm) {
    struct hit hit = {.t_mm = far_mm};
    return kinds[s->kind].blocks ? kinds[s->kind].blocks(s, ray, far_mm) : shape_hit(s, ray, &hit);
}

bool shape_shadows_itself(const struct shape *s, const struct hit *hit, struct vec3 l) {
    return kinds[s->kind].shadow && kinds[s->kind].shadow(s, hit, l);
}

bool shape_is_convex(const struct shape *s) {
    return s->kind != SHAPE_MESH && !(s->kind == SHAPE_RECTANGLE && s->rectangle.relief.height_mm) &&
           !(s->kind == SHAPE_FOLD && s->fold.angle_deg < 180);
}

double shape_reach_mm(const struct shape *s) {
    return kinds[s->kind].reach(s);
}

double shape_distance_mm(const struct shape *s, struct vec3 place) {
    struct vec3 own = frame_into(&s->frame, vec3_sub(place, s->frame.at));
    if (s->kind != SHAPE_RECTANGLE) {
        return fmax(vec3_length(own) - shape_reach_mm(s), 0);
    }
    double x = fmax(fabs(own.x) - s->rectangle.width_mm / 2, 0);
    double y = fmax(fabs(own.y) - s->rectangle.height_mm / 2, 0);
    return sqrt(x * x + y * y + own.z * own.z);
}
