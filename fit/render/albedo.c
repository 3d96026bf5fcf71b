#include "fit/render/albedo.h"

#include "proto/units.h"

#define AROUND 32  /* azimuths */
#define DIFFUSE 32 /* cosines of the exit angle */
#define FACETS 120 /* angles between normal and facet */
#define ALL (SHADE_SIGMA | SHADE_SPECULAR | SHADE_RELATIVES)

static const struct vec3 normal = {0, 0, 1};

static struct vec3 toward(double cosine, double sine, double azimuth) {
    return (struct vec3){sine * cos(azimuth), sine * sin(azimuth), cosine};
}

/* By equal steps of cos^2: each cell has the same projected solid angle. */
static void add_diffuse(const struct shade_paint *p, struct vec3 l, struct albedo *sum) {
    double part = 1.0 / (DIFFUSE * AROUND);
    for (int i = 0; i < DIFFUSE * AROUND; i++) {
        double cos2 = (i % DIFFUSE + 0.5) / DIFFUSE, azimuth = (i / DIFFUSE + 0.5) * 2 * M_PI / AROUND;
        struct vec3 v = toward(sqrt(cos2), sqrt(1 - cos2), azimuth);
        struct shade_abc x = shade(SHADE_SIGMA | SHADE_RELATIVES, p, NULL, normal, l, v);
        sum->diffuse += part * fmax(x.a, 0) / l.z;
        sum->inter += part * x.b / l.z;
    }
}

/* phi = width sinh t: as dense as the lobe near its axis, and out to the horizon. d omega_r = 4 (l.h) d omega_h. */
static void add_specular(const struct shade_paint *p, struct vec3 l, double width, struct albedo *sum) {
    double step = asinh(M_PI_2 / width) / FACETS;
    for (int i = 0; i < FACETS * AROUND; i++) {
        double t = (i % FACETS + 0.5) * step, phi = width * sinh(t);
        double azimuth = (i / FACETS + 0.5) * 2 * M_PI / AROUND,
               across = width * cosh(t) * step * 2 * M_PI / AROUND;
        struct vec3 h = toward(cos(phi), sin(phi), azimuth);
        double along = vec3_dot(l, h);
        struct vec3 v = vec3_sub(vec3_scale(h, 2 * along), l);
        if (along > 0 && v.z > 0) {
            double c = shade(ALL, p, NULL, normal, l, v).c / l.z;
            sum->specular += c * v.z * 4 * along * sin(phi) * across / M_PI;
        }
    }
}

struct albedo albedo_at(const struct paint *paint, double theta_deg) {
    struct albedo sum = {0};
    const struct shade_paint *p = &paint->shade;
    struct vec3 l = toward(sin(rad_from_deg(90 - theta_deg)), sin(rad_from_deg(theta_deg)), 0);
    double narrow = sqrt(M_LN2 / fmax(p->exponent, p->beta_prime_2 > 0 ? p->exponent_2 : 0));
    add_diffuse(p, l, &sum);
    if (p->beta_prime > 0 || p->beta_prime_2 > 0) {
        add_specular(p, l, fmin(narrow, 1), &sum);
    }
    return sum;
}

double albedo_above_one_deg(const struct paint *paint, double *highest) {
    static const double angles_deg[] = {0, 15, 30, 45, 60, 70, 75, 80, 85, 89.5};
    double s = 0, first_deg = -1;
    *highest = 0;
    for (int k = 0; k < BANDS; k++) {
        s = fmax(s, paint->s[k]);
    }
    for (size_t i = 0; i < sizeof angles_deg / sizeof *angles_deg; i++) {
        struct albedo x = albedo_at(paint, angles_deg[i]);
        double whole = s * x.diffuse + s * s * x.inter + x.specular;
        first_deg = first_deg < 0 && whole > 1 ? angles_deg[i] : first_deg;
        *highest = fmax(*highest, whole);
    }
    return first_deg;
}
