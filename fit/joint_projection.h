/*
 * joint_projection.h — all bands at one set of shared coordinates: S (and t) of each eliminated, cost, gradient and normal
 * matrix of what is left.
 *
 * The normal matrix is Kaufman's, the Schur complement of the arrow. S of each band is found exactly for the shape given,
 * from where the last evaluation left it.
 * Shapes     gradient[shared()], normal[shared()^2], of half the sum of squares.
 * Promises   after init nothing is allocated.
 * Errors     -ERR_NOMEM.
 * Checked    tests/unit/test_joint.c
 */
#ifndef FIT_JOINT_PROJECTION_H
#define FIT_JOINT_PROJECTION_H

#include "fit/joint_shape.h"
#include "fit/joint_solve.h"
#include "fit/moments.h"

class Projection {
  public:
    Projection(const struct joint_data *d, const double *start, bool per_band);
    ~Projection();
    Projection(const Projection &) = delete;
    Projection &operator=(const Projection &) = delete;

    int init(struct err *e);
    int shared() const {
        return shape_.k;
    }
    int column(int j) const {
        return shape_.column[j];
    }
    double start(int j) const {
        return x_[column(j)];
    }
    /* False where x lies outside the model or the cost is no number. gradient and normal may be NULL. */
    bool evaluate(const double *x, double *cost, double *gradient, double *normal);
    void report(struct joint_solution *out, double *model) const;

  private:
    struct combination;
    void combine(int band, struct combination *outer, struct combination *own) const;
    double moment(int band, int a, int b) const {
        return moments_[band * room_ + moments_at(a, b)];
    }
    double pulled(int band, int function) const {
        return pulled_[band * pulled_room_ + function];
    }
    double dot(int band, const struct combination &x, const struct combination &y) const;
    void take_moments(int functions);
    void pull(const double *weight, int functions);
    void solve_inside(int band);
    double take_residuals();
    void project(int band, double *gradient, double *normal) const;

    const struct joint_data *d_;
    bool per_band_;
    enum reflectance_width width_;
    struct joint_shape shape_ = {};
    double x_[COORDINATES_MAX] = {};
    size_t room_ = 0, pulled_room_ = 0;                              /* of a band in moments_ and pulled_ */
    double *row_ = nullptr, *moments_ = nullptr, *pulled_ = nullptr; /* of fit/moments.h */
    double *weighted_beta_ = nullptr, *weighted_residual_ = nullptr; /* [bands * n] */
    double s_[BANDS], t_[BANDS];
    int evaluations_ = 0;
};

#endif
