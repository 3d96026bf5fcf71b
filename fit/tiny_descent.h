/*
 * tiny_descent.h — Ceres' TinySolver for a cost that is known by its sums: chi-square, J^T r and J^T J at a place.
 *
 * TinySolver forms J^T J and J^T r of whatever it is given. It is given the smallest problem that has those sums: J = R, the
 * Cholesky factor of J^T J, and r = R^-T J^T r with one more residual for the rest of the cost. So its dense algebra is
 * of k + 1 rows, and a place is visited once: at a step that is taken the sums of its trial serve again.
 * A search says how a place is visited; it ends before its last step is taken, once that is small.
 * Domain     k <= COORDINATES_MAX.
 * Promises   no allocation.
 * Checked    tests/unit/test_solve.c, test_joint.c
 */
#ifndef FIT_TINY_DESCENT_H
#define FIT_TINY_DESCENT_H

#include "fit/coordinates.h"

class TinyDescent {
  public:
    virtual ~TinyDescent() = default;
    /* The sums at x into now_, done or found done; false with a reason in trouble. */
    virtual bool visit(const double *x) = 0;
    /* From x, which was visited, down to where a step is below `smallest`. */
    void descend(double *x, double smallest, double radius);
    bool factor();
    /* R^-T J^T r of the last place, which is factored; l is R^T. */
    const double *reduce(double *y) const;
    /* The Jacobian scaled to columns of length 1 has a condition below 1e6. */
    bool well_conditioned();
    int k() const {
        return k_;
    }
    double chi2() const {
        return now_.chi2;
    }

    const char *trouble = nullptr;

  protected:
    TinyDescent() = default;

    int k_ = 0;
    struct { /* where it stands */
        double x[COORDINATES_MAX], chi2, g[COORDINATES_MAX], m[COORDINATES_MAX * COORDINATES_MAX];
        bool factored;
        double l[COORDINATES_MAX * COORDINATES_MAX]; /* of m, where factored */
    } now_;
};

constexpr double TINY_RADIUS = 1e4; /* of the trust region at first: TinySolver's own */

#endif
