#include "fit/render/gleam.h"

#include "fit/render/sampler.h"

#define MOST 0.9      /* of the draws by the estimate: something may stand in between */
#define LEAST 1e-3    /* of a bell in front of its target; with less it is not drawn by */
#define LOGISTIC 0.41 /* scale of the logistic density by which exp(-x^2) has the least mean square weight */
/* Of least squares; for lobes of 0.3 rad the middle then stands to a tenth of their width. */
#define STEPS 3
#define ASIDE 0.5 /* of the bell's widths: where its slope is taken */

struct fit { /* sum of k |r + J x|^2 over both lobes: its matrix and its gradient, both halved */
    double xx, xy, yy, x, y;
};

static struct vec3 mirror(const struct gleam_surface *s) {
    return vec3_sub(vec3_scale(s->normal, 2 * vec3_dot(s->normal, s->way)), s->way);
}

/* k of exp(-k phi^2), near the lobe's middle. */
static double narrowness(const struct shade_paint *p) {
    return p->tail > 0 ? p->tail_strength : p->exponent;
}

/* One lobe around w, the direction away from the surface; ex, ey: where w goes as x and y grow. */
static void add_lobe(const struct gleam_surface *s, struct vec3 w, struct vec3 ex, struct vec3 ey,
                     struct fit *fit) {
    struct vec3 sum = vec3_add(s->way, w), h = vec3_unit(sum), t[2];
    double each = 1 / vec3_length(sum), k = narrowness(s->drawn);
    vec3_frame(s->normal, &t[0], &t[1]);
    for (int i = 0; i < 2; i++) {
        double r = vec3_dot(t[i], h), jx = each * (vec3_dot(t[i], ex) - r * vec3_dot(h, ex)),
               jy = each * (vec3_dot(t[i], ey) - r * vec3_dot(h, ey));
        fit->xx += k * jx * jx;
        fit->xy += k * jx * jy;
        fit->yy += k * jy * jy;
        fit->x += k * jx * r;
        fit->y += k * jy * r;
    }
}

/* Of one or two lobes: either may be NULL. */
static struct fit fit_around(const struct gleam_surface *near, const struct gleam_surface *far,
                             struct vec3 middle, struct vec3 ex, struct vec3 ey) {
    struct fit fit = {0};
    if (near) {
        add_lobe(near, middle, ex, ey, &fit);
    }
    if (far) {
        add_lobe(far, vec3_scale(middle, -1), vec3_scale(ex, -1), vec3_scale(ey, -1), &fit);
    }
    return fit;
}

static struct vec3 between(const struct gleam_surface *near, const struct gleam_surface *far) {
    return vec3_unit(vec3_sub(vec3_scale(mirror(near), narrowness(near->drawn)),
                              vec3_scale(mirror(far), narrowness(far->drawn))));
}

/* P = R'R, R = (root, xy/root; 0, height): x = R^-1 g for g of the round bell. */
static void set_axes(struct gleam *gleam, const struct fit *f, double det, struct vec3 ex, struct vec3 ey) {
    double root = sqrt(f->xx), height = sqrt(det / f->xx);
    gleam->axis[0] = vec3_scale(ex, 1 / root);
    gleam->axis[1] = vec3_scale(vec3_sub(ey, vec3_scale(ex, f->xy / f->xx)), 1 / height);
    gleam->dual[0] = vec3_add(vec3_scale(ex, root), vec3_scale(ey, f->xy / root));
    gleam->dual[1] = vec3_scale(ey, height);
    gleam->peak = sqrt(det);
    gleam->cut = -INFINITY;
    gleam->kept = 1;
}

static bool make_bell(const struct gleam_surface *near, const struct gleam_surface *far, struct vec3 m,
                      int steps, struct gleam *gleam) {
    struct vec3 ex, ey;
    for (int i = 0;; i++) {
        vec3_frame(m, &ex, &ey);
        struct fit f = fit_around(near, far, m, ex, ey);
        double det = f.xx * f.yy - f.xy * f.xy;
        if (!(det > 0 && det < INFINITY)) {
            return false;
        }
        if (i == steps) {
            gleam->middle = m;
            set_axes(gleam, &f, det, ex, ey);
            return true;
        }
        double x = (f.xy * f.y - f.yy * f.x) / det, y = (f.xy * f.x - f.xx * f.y) / det;
        m = vec3_unit(vec3_add(m, vec3_add(vec3_scale(ex, x), vec3_scale(ey, y))));
    }
}

/* A bell whose part below x is known in closed form, as wide as exp(-x^2): the logistic density. */
static double below(double x) {
    return 1 / (1 + exp(-x / LOGISTIC));
}

static double below_inverse(double u) {
    return LOGISTIC * log(u / (1 - u));
}

static double bell(double x) {
    double t = exp(-fabs(x) / LOGISTIC);
    return t / (LOGISTIC * (1 + t) * (1 + t));
}

static void turn_axes(struct vec3 *axis, double c, double s) {
    struct vec3 first = vec3_add(vec3_scale(axis[0], c), vec3_scale(axis[1], s));
    axis[1] = vec3_sub(vec3_scale(axis[1], c), vec3_scale(axis[0], s));
    axis[0] = first;
}

void gleam_cut(struct gleam *gleam, const struct aim_target *target, struct vec3 from) {
    struct vec3 way = vec3_sub(target->middle, from);
    double nearest = INFINITY, c = 1, s = 0;
    for (int i = 0; i < 4; i++) {
        struct vec3 side = i % 2 ? target->u : target->v, out = i % 2 ? target->v : target->u;
        double sign = i < 2 ? 1 : -1;
        struct vec3 inward = vec3_cross(vec3_add(way, vec3_scale(out, sign)), side);
        inward = vec3_scale(inward, vec3_dot(inward, way) < 0 ? -1 : 1);
        double x = vec3_dot(inward, gleam->axis[0]), y = vec3_dot(inward, gleam->axis[1]);
        double length = hypot(x, y), away = vec3_dot(inward, gleam->middle) / length;
        if (length > 0 && away < nearest) {
            nearest = away;
            c = x / length;
            s = y / length;
        }
    }
    turn_axes(gleam->axis, c, s);
    turn_axes(gleam->dual, c, s);
    gleam->cut = -nearest;
    gleam->kept = 1 - below(gleam->cut);
}

struct two_ways {
    double diffuse, gloss;
};

static struct two_ways ways_of(const struct gleam_surface *s, struct vec3 w) {
    struct shade_abc x =
        shade(SHADE_SIGMA | SHADE_SPECULAR | SHADE_RELATIVES, s->drawn, NULL, s->normal, w, s->way);
    double one = s->energy->s_typical,
           scale = energy_scale(s->energy, vec3_dot(s->normal, w), vec3_dot(s->normal, s->way));
    return (struct two_ways){scale * (shade_most(x.a, 0) * one + x.b * one * one), scale * x.c};
}

static double gloss_at(const struct gleam_surface *near, const struct gleam_surface *far,
                       const struct gleam *gleam, int axis, double x) {
    struct vec3 w = vec3_unit(vec3_add(gleam->middle, vec3_scale(gleam->axis[axis], x)));
    return ways_of(near, w).gloss * ways_of(far, vec3_scale(w, -1)).gloss;
}

/* Where all of the gloss is brightest, not the lobes alone: towards grazing directions it grows. */
static struct vec3 brightest(const struct gleam_surface *near, const struct gleam_surface *far,
                             const struct gleam *gleam) {
    struct vec3 at = gleam->middle;
    for (int i = 0; i < 2; i++) {
        double up = gloss_at(near, far, gleam, i, ASIDE), down = gloss_at(near, far, gleam, i, -ASIDE);
        if (up > 0 && down > 0) { /* exp(-x^2 + 2 q x) is brightest at q */
            double q = log(up / down) / (4 * ASIDE);
            at = vec3_add(at, vec3_scale(gleam->axis[i], shade_most(-1, shade_least(1, q))));
        }
    }
    return vec3_unit(at);
}

bool gleam_make(const struct gleam_surface *near, const struct gleam_surface *far, struct gleam *gleam) {
    return make_bell(near, far, between(near, far), STEPS, gleam) &&
           make_bell(near, far, brightest(near, far, gleam), 0, gleam) &&
           vec3_dot(gleam->middle, near->normal) > 0 && vec3_dot(gleam->middle, far->normal) < 0;
}

/* Over the bell, cut by the target. */
static double extent_of(const struct gleam *gleam) {
    return M_PI * gleam->kept / gleam->peak;
}

/* By the one lobe alone, the other surface diffuse. */
static double part_of_one(const struct gleam_surface *near, const struct gleam_surface *far, bool by_near,
                          const struct aim_target *target, struct vec3 from) {
    struct gleam gleam;
    if (!make_bell(by_near ? near : NULL, by_near ? NULL : far,
                   by_near ? mirror(near) : vec3_scale(mirror(far), -1), 0, &gleam)) {
        return 0;
    }
    gleam_cut(&gleam, target, from);
    struct two_ways a = ways_of(near, gleam.middle), b = ways_of(far, vec3_scale(gleam.middle, -1));
    return (by_near ? a.gloss * b.diffuse : a.diffuse * b.gloss) * extent_of(&gleam);
}

/* What comes over both surfaces in each of the four ways; area: of the far one as seen (aim.h). */
static struct gleam_parts parts_of(const struct gleam_surface *near, const struct gleam_surface *far,
                                   const struct gleam *gleam, const struct aim_target *target,
                                   struct vec3 from, double area) {
    struct two_ways a = ways_of(near, gleam->middle), b = ways_of(far, vec3_scale(gleam->middle, -1));
    return (struct gleam_parts){
        .gleams = a.gloss * b.gloss * extent_of(gleam),
        .facets = part_of_one(near, far, true, target, from),
        .glints = part_of_one(near, far, false, target, from),
        .aim = a.diffuse * b.diffuse * area / vec3_dot(near->normal, gleam->middle),
    };
}

static double area_of(const struct aim_view *seen, int target) {
    double area = 0;
    for (int i = 0; i < seen->n_sectors; i++) {
        area += seen->target[i] == target ? seen->sector[i].area : 0;
    }
    return area;
}

void gleam_none(struct gleam_view *view) {
    view->n = 0;
    view->sum = 0;
    view->part = (struct gleam_parts){0, 0, 0, 0};
}

void gleam_from(const struct glint_view *glints, const struct aim_view *seen,
                const struct gleam_surface *near, struct vec3 from, struct gleam_view *view) {
    struct gleam_parts *sum = &view->part;
    gleam_none(view);
    for (int i = 0; i < glints->n; i++) {
        const struct glint *g = glints->glint[i];
        struct gleam_surface far = {g->drawn, g->normal, g->l, g->energy};
        struct gleam *gleam = &view->gleam[view->n];
        if (!gleam_make(near, &far, gleam)) {
            continue;
        }
        gleam_cut(gleam, g->shape, from);
        if (!(gleam->kept > LEAST)) {
            continue;
        }
        struct gleam_parts part = parts_of(near, &far, gleam, g->shape, from, area_of(seen, g->target));
        sum->facets += g->light * part.facets;
        sum->glints += g->light * part.glints;
        sum->aim += g->light * part.aim;
        gleam->share = g->light * part.gleams;
        view->sum += gleam->share;
        view->n += gleam->share > 0;
    }
    double all = view->sum + sum->facets + sum->glints + sum->aim, scale = MOST / all;
    if (!(view->sum > 0 && all < INFINITY)) {
        gleam_none(view);
        return;
    }
    *sum =
        (struct gleam_parts){view->sum * scale, sum->facets * scale, sum->glints * scale, sum->aim * scale};
}

struct vec3 gleam_sample(const struct gleam_view *view, const double u[2]) {
    double rest = u[0] * view->sum;
    int i = 0;
    while (i + 1 < view->n && rest >= view->gleam[i].share) {
        rest -= view->gleam[i++].share;
    }
    const struct gleam *g = &view->gleam[i];
    double first = below_inverse(1 - g->kept * sampler_within(rest, g->share));
    struct vec3 x = vec3_scale(g->axis[0], first), y = vec3_scale(g->axis[1], below_inverse(u[1]));
    return vec3_unit(vec3_add(g->middle, vec3_add(x, y)));
}

double gleam_density(const struct gleam_view *view, struct vec3 l) {
    double sum = 0;
    for (int i = 0; i < view->n; i++) {
        const struct gleam *g = &view->gleam[i];
        double z = vec3_dot(l, g->middle);
        if (z > 0) {
            double x = vec3_dot(l, g->dual[0]) / z, y = vec3_dot(l, g->dual[1]) / z;
            sum += x >= g->cut ? g->share * g->peak / g->kept * bell(x) * bell(y) / (z * z * z) : 0;
        }
    }
    return view->n > 0 ? sum / view->sum : 0;
}
