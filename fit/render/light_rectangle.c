#include "fit/render/light.h"

/* Seen smaller than this (sr) its points are drawn evenly over its area: the even solid angle is then the same to a
 * thousandth, and its formula would cancel. */
#define SMALL_SR 1e-3

struct seen { /* from a place: x and y of its sides on its own axes, z its plane's distance; all mm */
    double x0, x1, y0, y1, z;
};

static struct vec3 vector(const double v[3]) {
    return (struct vec3){v[0], v[1], v[2]};
}

static struct seen seen_from(const struct light *light, struct vec3 from) {
    const struct light_rectangle *r = &light->rectangle;
    struct vec3 way = vec3_sub(vector(light->at_mm), from);
    double x = vec3_dot(way, r->x), y = vec3_dot(way, r->y);
    return (struct seen){x - r->width_mm / 2, x + r->width_mm / 2, y - r->height_mm / 2, y + r->height_mm / 2,
                         -vec3_dot(way, r->z)};
}

/* Half the sum over its edges of angle times normal (Lambert): the illuminance for radiance 1, by direction. */
static struct vec3 illuminance(const struct seen *s) {
    const double corner[5][2] = {
        {s->x0, s->y0}, {s->x1, s->y0}, {s->x1, s->y1}, {s->x0, s->y1}, {s->x0, s->y0}};
    struct vec3 sum = {0, 0, 0};
    for (int i = 0; i < 4; i++) {
        struct vec3 a = vec3_unit((struct vec3){corner[i][0], corner[i][1], s->z});
        struct vec3 b = vec3_unit((struct vec3){corner[i + 1][0], corner[i + 1][1], s->z});
        struct vec3 cross = vec3_cross(a, b);
        double angle = atan2(vec3_length(cross), vec3_dot(a, b));
        sum = vec3_add(sum, vec3_scale(vec3_unit(cross), angle / 2));
    }
    return sum;
}

int light_rectangle_prepare(struct light *light, const char *folder, struct err *e) {
    struct light_rectangle *r = &light->rectangle;
    struct vec3 at = vector(light->at_mm), towards = vec3_sub(vector(r->look_at_mm), at);
    struct vec3 across = vec3_cross(vector(r->up), towards);
    (void)folder;
    if (!(vec3_length(across) > 1e-9 * vec3_length(towards) * vec3_length(vector(r->up)))) {
        return err_set(
            e, ERR_INPUT,
            "this rectangle faces nowhere, or along `up`: look_at_mm must differ from at_mm, and `up` from "
            "the way between them, as [0, 0, 1]");
    }
    r->z = vec3_unit(towards);
    r->x = vec3_unit(across);
    r->y = vec3_cross(r->z, r->x);
    struct seen seen = seen_from(light, (struct vec3){0, 0, 0});
    if (!(seen.z > 0)) {
        return err_set(
            e, ERR_INPUT,
            "this rectangle turns its back to the scene's origin, which its light is measured at: it "
            "shines to the side of look_at_mm");
    }
    light->radiance = M_PI / vec3_length(illuminance(&seen));
    return 0;
}

/* Urena, Fajardo and King, EGSR 2013: even in solid angle. */
struct cap {
    double b0, b1, k, solid_angle;
};

/* z component of the normal of the plane through the place and an edge at distance d, the other sides' alike. */
static double edge_normal(double d, double z) {
    return d / sqrt(d * d + z * z);
}

static struct cap cap_of(const struct seen *s) {
    double a0 = edge_normal(-s->y0, s->z), a1 = edge_normal(s->x1, s->z), a2 = edge_normal(s->y1, s->z),
           a3 = edge_normal(-s->x0, s->z);
    /* The normals of neighbouring planes stand across each other on the axes: their cosine is the product. */
    double g0 = acos(-a0 * a1), g1 = acos(-a1 * a2), g2 = acos(-a2 * a3), g3 = acos(-a3 * a0);
    double k = 2 * M_PI - g2 - g3;
    return (struct cap){a0, a2, k, g0 + g1 - k};
}

static bool is_small(const struct light *light, const struct seen *s) {
    double x = (s->x0 + s->x1) / 2, y = (s->y0 + s->y1) / 2, d2 = x * x + y * y + s->z * s->z;
    return light->rectangle.width_mm * light->rectangle.height_mm * s->z < SMALL_SR * d2 * sqrt(d2);
}

static double area_density(const struct light *light, double distance2, double z) {
    return distance2 * sqrt(distance2) / (light->rectangle.width_mm * light->rectangle.height_mm * z);
}

static double within(double v, double low, double high) {
    return v < low ? low : v > high ? high : v;
}

/* The point of the rectangle's plane for u, even in solid angle. */
static void draw_on_cap(const struct seen *s, const struct cap *c, const double u[2], double *x, double *y) {
    double au = u[0] * c->solid_angle + c->k;
    double fu = (cos(au) * c->b0 - c->b1) / sin(au);
    double cu = within(copysign(1 / sqrt(fu * fu + c->b0 * c->b0), fu), -1, 1);
    *x = within(cu * s->z / sqrt(fmax(1 - cu * cu, 1e-30)), s->x0, s->x1);
    double d2 = *x * *x + s->z * s->z;
    double h0 = s->y0 / sqrt(d2 + s->y0 * s->y0), h1 = s->y1 / sqrt(d2 + s->y1 * s->y1);
    double h = h0 + u[1] * (h1 - h0);
    *y = within(h * sqrt(d2 / fmax(1 - h * h, 1e-30)), s->y0, s->y1);
}

bool light_rectangle_sample(const struct light *light, struct vec3 from, const double u[2],
                            struct light_sample *sample) {
    const struct light_rectangle *r = &light->rectangle;
    struct seen s = seen_from(light, from);
    bool small = is_small(light, &s);
    double x = s.x0 + u[0] * r->width_mm, y = s.y0 + u[1] * r->height_mm;
    struct cap cap = {0};
    if (!(s.z > 0)) {
        return false;
    }
    if (!small) {
        cap = cap_of(&s);
        draw_on_cap(&s, &cap, u, &x, &y);
    }
    double distance2 = x * x + y * y + s.z * s.z, distance = sqrt(distance2);
    struct vec3 way = vec3_add(vec3_add(vec3_scale(r->x, x), vec3_scale(r->y, y)), vec3_scale(r->z, -s.z));
    sample->l = vec3_scale(way, 1 / distance);
    sample->distance_mm = distance;
    sample->density = small ? area_density(light, distance2, s.z) : 1 / cap.solid_angle;
    sample->radiance = light->radiance;
    return true;
}

bool light_rectangle_meet(const struct light *light, struct vec3 from, struct vec3 l,
                          struct light_sample *sample) {
    const struct light_rectangle *r = &light->rectangle;
    struct seen s = seen_from(light, from);
    double towards = -vec3_dot(l, r->z), t = s.z / towards;
    if (!(s.z > 0 && towards > 0)) {
        return false;
    }
    double x = t * vec3_dot(l, r->x), y = t * vec3_dot(l, r->y);
    if (!(x >= s.x0 && x <= s.x1 && y >= s.y0 && y <= s.y1)) {
        return false;
    }
    sample->distance_mm = t;
    sample->density = is_small(light, &s) ? area_density(light, t * t, s.z) : 1 / cap_of(&s).solid_angle;
    sample->radiance = light->radiance;
    return true;
}
