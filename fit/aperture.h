/*
 * aperture.h — the model as a source and a sensor of finite angular width see it.
 *
 * The instrument averages radiance over the directions its light comes from and goes to. A source of width w_s sends
 * an even share from each theta_i + a, |a| <= w_s / 2, a sensor of width w_v takes one from each theta_v + b, and the
 * irradiance of a share goes as the cosine of its incidence:
 *     beta_seen = sum_ab cos(theta_i + a) beta(theta_i + a, theta_v + b) / sum_ab cos(theta_i + a)
 * The divisor is what the reading of the reference brings. With the beam inside the view every share lands whole and
 * the viewed part of it goes as cos(theta_v + b), which takes the place of cos(theta_i + a).
 * Sums are by Gauss-Legendre, 3 points an axis up to 1 deg, 4 up to 2, 5 beyond; the geometries are kept, since no
 * parameter moves them. Shares past the normal go on mirrored; what lies beyond 90 deg sees no surface and is left
 * out. Widths are those in the plane of incidence; what lies across it moves phi by its square only. A sensor out of
 * that plane is as wide in its own, through it and the normal: its shares keep their azimuth.
 *
 * Shapes     as fit/reflectance.h; points first .. first + n - 1 of the set.
 * Domain     widths 0 .. 20 deg; both 0 is fit/reflectance_batch.h itself (aperture_at: reflectance_eval), to the bit.
 * Promises   no allocation but in aperture_init; reciprocal, widths and spots changing places too.
 * Errors     as fit/reflectance.h; aperture_init also -ERR_RANGE (a width), -ERR_NOMEM.
 * Source     measurement.md 1 and 7; reflection-model.md 3.6.
 * Checked    tests/unit/test_aperture.c against an integral of its own
 */
#ifndef FIT_APERTURE_H
#define FIT_APERTURE_H

#include <stdbool.h>

#include "fit/reflectance_batch.h"

#ifdef __cplusplus
extern "C" {
#endif

#define APERTURE_WIDTH_MAX_DEG 20.0

struct aperture_form {
    double source_width_deg, sensor_width_deg; /* full */
    bool beam_in_view;
};

struct aperture {
    struct aperture_form form;
    size_t n;
    int nodes;                             /* of a point; 1 without widths */
    struct reflectance_geometry *geometry; /* [n * nodes] */
    double *weight;                        /* [n * nodes]; NULL: each point is its one node as it is */
    struct reflectance_batch batch;        /* the same geometry, for aperture_columns */
    double *memory;                        /* of the batch */
};

int aperture_init(struct aperture *a, const struct aperture_form *form, size_t n, const double *theta_i_deg,
                  const double *theta_v_deg, struct err *e);
void aperture_refill(struct aperture *a); /* after geometry[] was changed */
void aperture_free(struct aperture *a);
int aperture_eval(const struct aperture *a, size_t first, size_t n, enum reflectance_model model,
                  const double *value, const struct reflectance_optics *optics, double *beta,
                  double *gradient, struct err *e);
/* The same in columns, as fit/reflectance_batch.h, which see; beta and slope are 0 from n to the end of the room. */
int aperture_columns(const struct aperture *a, size_t first, size_t n, enum reflectance_model model,
                     const double *value, const struct reflectance_optics *optics, double *beta,
                     double *slope, size_t stride, struct err *e);
int aperture_parts(const struct aperture *a, size_t point, enum reflectance_model model, const double *value,
                   const struct reflectance_optics *optics, struct reflectance_parts *parts, struct err *e);
/* slope[n] = d beta / d polarisation of all points */
int aperture_polarisation_slope(const struct aperture *a, enum reflectance_model model, const double *value,
                                double *slope, struct err *e);
/* A point is seen from elsewhere, and its value times factor; where that lies beyond 90 deg it stays. */
int aperture_move(struct aperture *a, size_t point, double theta_i_deg, double theta_v_deg, double factor,
                  struct err *e);
/* A point lies out of the plane of incidence: theta_r_deg >= 0, dphi_deg as fit/reflectance.h has it. */
int aperture_direct(struct aperture *a, size_t point, double theta_i_deg, double theta_r_deg, double dphi_deg,
                    struct err *e);
/* A geometry that is in no set. theta_i_deg < 0 is the same seen from the other side. */
int aperture_at(const struct aperture_form *form, double theta_i_deg, double theta_v_deg,
                enum reflectance_model model, const double *value, const struct reflectance_optics *optics,
                double *beta, double *gradient, struct err *e);

#ifdef __cplusplus
}
#endif

#endif
