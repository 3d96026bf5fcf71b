/*
 * problem.h — the points of one fit, checked, with their geometry and the weights they carry.
 *
 * The working struct of fit/: made once from a struct estimate_input, read by the solver, the band fit and
 * the covariance. u[] is the independent standard uncertainty of a mean: u_ind, raised to a floor, and after
 * problem_reweigh with the axis repeatability of the fitted model (measurement.md 6 and 8).
 * Errors     -ERR_RANGE (a sentence naming the point), -ERR_USAGE, -ERR_NOMEM.
 * Checked    tests/unit/test_estimate_input.c
 */
#ifndef FIT_PROBLEM_H
#define FIT_PROBLEM_H

#include "fit/aperture.h"
#include "fit/coordinates.h"
#include "fit/estimate.h"
#include "fit/nuisance.h"

#ifdef __cplusplus
extern "C" {
#endif

struct problem {
    enum reflectance_model model;
    int k;
    size_t n;
    const struct estimate_input *input;
    struct aperture aperture; /* the geometry of the points */
    enum material_loss loss;
    double *u;                    /* [n] */
    double *target, *loss_weight; /* [n] l(beta) and weight of fit/loss.h */
    double *root_weight; /* [n] loss_weight dl / d beta at the last evaluation: of residuals in beta */
    double *angle_u2;    /* [n] variance of the mean by axis repeatability; 0 at first */
    double *slope_source, *slope_sample; /* [n] d beta / d axis per degree; 0 at first */
    double *slope_polarisation;          /* [n] d beta / dP; 0 where its u is 0 */
    double *spot_source, *spot_sample;   /* [n] what a zero moves through K (fit/spot.h); 0 at first */
    double *model_beta;                  /* [n] of the last evaluation */
    double *gradient;                    /* [n * k] with respect to the parameters, of the same */
    struct reflectance_optics optics;
    double low[COORDINATES_MAX], high[COORDINATES_MAX]; /* bounds of the coordinates */
    struct nuisances nuisance;
};

int problem_init(struct problem *p, const struct estimate_input *input, struct err *e);
void problem_free(struct problem *p);
/* Weighted residuals of the loss for model values of the points first .., and their slopes by these values. */
void problem_residuals(const struct problem *p, size_t first, size_t n, const double *beta, double *residual,
                       double *slope);
/* Model and gradient at value into model_beta and gradient. */
int problem_evaluate(struct problem *p, const double *value, struct err *e);
/* Whether coordinate x of a column stands at one of its bounds, where the solvers stop exactly. */
bool problem_at_bound(const struct problem *p, int column, double x);
double problem_floor(double beta); /* what u of a mean or a band is raised to */
bool problem_out_of_plane(const struct estimate_input *input, size_t i);
/* Slopes along both axes, and what follows from them, of the last problem_evaluate. */
int problem_slopes(struct problem *p, const double *value, struct err *e);
/* Slopes and weights anew from the model of the last problem_evaluate. */
int problem_reweigh(struct problem *p, const double *value, struct err *e);
double problem_chi2(const struct problem *p); /* what the fit minimises, at the last evaluation */
/* The five losses there, sums of squares; ml is NaN where no u is given. */
void problem_losses(const struct problem *p, double sum[MATERIAL_LOSSES]);

int problem_axis_slopes(const struct aperture_form *form, enum reflectance_model model, const double *value,
                        const struct reflectance_optics *optics, double theta_i_deg, double theta_v_deg,
                        bool mirrored, double *source, double *sample, struct err *e);

#ifdef __cplusplus
}
#endif

#endif
