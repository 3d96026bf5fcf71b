/*
 * spread_paint.h — what the covariance of a paint's parameters and S(lambda) makes of its planes a, b, c.
 *
 * The joint covariance, common part included, is factored C = L L^T; a draw is L z with z normal, and the same draws
 * serve every pixel. Bands without a row follow their neighbours' rows as paint.h holds them.
 *
 * Shapes     draw[SPREAD_DRAWS][n] deviations of joint->row[]; shared[parameter][rank] rows of L; basis[set][kind][xyz]
 *            [rank]: change of X, Y, Z for each unit of a (kind 0), b (1) and of the slope of c by beta' (2);
 *            normal[SPREAD_DRAWS][rank]: z; band[kind][BANDS][rank]: what L changes in a band of S (kind 0) and of beta' (1).
 * Errors     -ERR_STATE a joint fit of another model than the paint; -ERR_NOMEM.
 * Checked    tests/unit/test_render_spread.c
 */
#ifndef FIT_RENDER_SPREAD_PAINT_H
#define FIT_RENDER_SPREAD_PAINT_H

#include "fit/render/planes.h"
#include "fit/render/scene.h"
#include "proto/joint.h"

#define SPREAD_DRAWS 256
#define SPREAD_KINDS 3
#define SPREAD_BAND_KINDS 2

struct spread_paint {
    int n, rank, sets;
    bool moves[MATERIAL_PARAMETERS]; /* parameters whose slopes of a, b, c are needed */
    bool beta_prime_by_band;
    double *draw; /* NULL where n is 0 */
    double *normal, *band;
    double *shared, *basis;
    struct colour_matrix *matrix; /* [SPREAD_DRAWS][sets]: X, Y, Z of a, b, c with the S of a draw */
    double (*per_band)[3]; /* [SPREAD_DRAWS][sets]: X, Y, Z of the slope of c by beta', beta' by bands */
    struct colour_matrix best[PLANES_SETS];
};

/* joint NULL: nothing is known of the paint's uncertainty, and nothing of it is counted. */
int spread_paint_make(const struct scene *scene, int paint, const struct joint *joint, uint64_t seed,
                      struct spread_paint *p, struct err *e);
void spread_paint_free(struct spread_paint *p);
/* Change of the shared parameter in a draw. */
double spread_paint_change(const struct spread_paint *p, const struct joint *joint, int draw, int parameter);
/* l [n * n] becomes the factor of the symmetric c [n * n], semidefinite; returns its rank, the columns used. */
int spread_factor(int n, const double *c, double *l);

#endif
