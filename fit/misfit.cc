#include "fit/misfit.h"

#include <algorithm>
#include <cmath>
#include <new>
#include <vector>

#include <Eigen/Dense>

#include "fit/quality.h"
#include "fit/sweeps.h"

namespace {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Vector = Eigen::VectorXd;
using ConstCells = Eigen::Map<const Matrix>;

/* Below it a residual is rounding of the data or of the model, not model error (the floor of u in fit/problem.c). */
constexpr double RESIDUAL_MIN = 1e-5;
/* A sweep that alone holds a direction leaves no residual in it: its leverage is taken as no more than this. */
constexpr double LEVERAGE_MAX = 0.98;

double rms_relative(const struct problem *p) {
    double left = 0, all = 0;
    for (size_t i = 0; i < p->n; i++) {
        const double r = p->input->beta[i] - p->model_beta[i];
        left += r * r;
        all += p->input->beta[i] * p->input->beta[i];
    }
    return all > 0 ? std::sqrt(left / all) : 0;
}

int look_along_sweeps(const struct problem *p, double *n_effective, double *agreement, struct err *e) {
    struct sweeps s;
    std::vector<double> residual(p->n);
    int status = sweeps_find(&s, p->n, p->input->theta_i_deg, p->input->theta_v_deg, e);
    if (status) {
        return status;
    }
    for (size_t i = 0; i < p->n; i++) {
        residual[i] = (p->input->beta[i] - p->model_beta[i]) / p->u[i];
    }
    *n_effective = sweeps_effective(&s, residual.data());
    *agreement = sweeps_agreement(&s, residual.data());
    sweeps_free(&s);
    return 0;
}

Matrix power(const Matrix &symmetric, double exponent, double low) {
    const Eigen::SelfAdjointEigenSolver<Matrix> eigen(symmetric);
    const Vector root = eigen.eigenvalues().cwiseMax(low).array().pow(exponent);
    return eigen.eigenvectors() * root.asDiagonal() * eigen.eigenvectors().transpose();
}

class Sandwich {
  public:
    Sandwich(struct uncertainty *u, const struct problem *p) : u_(u), p_(p), k_(p->k) {
        for (int c = 0; c < k_; c++) {
            if (u->free[c]) {
                at_.push_back(c);
            }
        }
    }
    void apply(const struct sweeps &s, double floor);

  private:
    Matrix of_sweeps(const struct sweeps &s) const;
    Matrix block(const double *cells) const {
        return ConstCells(cells, k_, k_)(at_, at_);
    }

    struct uncertainty *u_;
    const struct problem *p_;
    int k_;
    std::vector<int> at_; /* the free columns */
};

/* In coordinates where F is the identity: M_g = Q F_g Q, with Q the root of F^-1. */
Matrix Sandwich::of_sweeps(const struct sweeps &s) const {
    const Eigen::Index m = static_cast<Eigen::Index>(at_.size());
    const ConstCells h(u_->h, k_, static_cast<Eigen::Index>(p_->n));
    const Matrix fisher = block(u_->fisher);
    const Vector scale = fisher.diagonal().cwiseSqrt(); /* units apart, so that the root keeps its digits */
    const Matrix normal = scale.cwiseInverse().asDiagonal() * fisher * scale.cwiseInverse().asDiagonal();
    const Matrix root = scale.asDiagonal() * power(normal, 0.5, 0);
    std::vector<Matrix> leverage(s.n_sweeps, Matrix::Zero(m, m));
    std::vector<Vector> score(s.n_sweeps, Vector::Zero(m));
    for (size_t i = 0; i < p_->n; i++) {
        const Vector column = h.col(static_cast<Eigen::Index>(i));
        const Vector x = root.transpose() * column(at_); /* F^1/2 h_i = F^-1/2 J_i^T w_i */
        const double w = p_->root_weight[i] * p_->root_weight[i];
        leverage[s.sweep[i]] += x * x.transpose() / w;
        score[s.sweep[i]] += x * (p_->input->beta[i] - p_->model_beta[i]);
    }
    Matrix sum = Matrix::Zero(m, m);
    for (size_t g = 0; g < s.n_sweeps; g++) {
        const Vector d = power(Matrix::Identity(m, m) - leverage[g], -0.5, 1 - LEVERAGE_MAX) * score[g];
        sum += d * d.transpose();
    }
    const Matrix back = scale.cwiseInverse().asDiagonal() * power(normal, -0.5, 1e-13);
    return back * sum * back.transpose();
}

void Sandwich::apply(const struct sweeps &s, double floor) {
    const Matrix drift = block(u_->drift), before = block(u_->independent) + drift;
    if (at_.empty() || !(before.diagonal().minCoeff() > 0)) {
        return;
    }
    const Vector scale = before.diagonal().cwiseSqrt();
    const Vector unscale = scale.cwiseInverse();
    const Matrix normal = unscale.asDiagonal() * before * unscale.asDiagonal();
    const Matrix root = power(normal, 0.5, 1e-13), unroot = power(normal, -0.5, 1e-13);
    const Matrix seen = unscale.asDiagonal() * of_sweeps(s) * unscale.asDiagonal();
    const Matrix ratio = unroot * seen * unroot;
    const Matrix raised = root * power((ratio + ratio.transpose()) / 2, 1, floor) * root;
    const Matrix after = scale.asDiagonal() * raised * scale.asDiagonal() - drift;
    for (size_t a = 0; a < at_.size(); a++) {
        for (size_t b = 0; b < at_.size(); b++) {
            u_->independent[at_[a] * k_ + at_[b]] = (after(a, b) + after(b, a)) / 2;
        }
    }
}

} // namespace

int misfit_judge(struct misfit *m, const struct problem *p, const struct uncertainty *u, double chi2,
                 struct err *e) {
    *m = {false, 0, 1, static_cast<double>(p->n)};
    try {
        double agreement = 0;
        int status = look_along_sweeps(p, &m->n_effective, &agreement, e);
        if (p->input->u_ind) {
            m->limit = quality_chi2_limit(u->chi2_expected, u->chi2_variance);
            m->is = chi2 > m->limit;
            m->scatter = m->is ? std::max(1.0, chi2 / u->chi2_expected) : 1;
        } else {
            m->is = agreement > QUALITY_Z_999 && rms_relative(p) > RESIDUAL_MIN;
        }
        return status;
    } catch (const std::bad_alloc &) {
        return err_set(e, ERR_NOMEM, "no memory for the residuals of %zu points", p->n);
    }
}

int misfit_inflate(const struct misfit *m, struct uncertainty *u, const struct problem *p, struct err *e) {
    struct sweeps s = {};
    int status = m->is ? sweeps_find(&s, p->n, p->input->theta_i_deg, p->input->theta_v_deg, e) : 0;
    if (status || !m->is) {
        return status;
    }
    try {
        u->scatter = m->scatter;
        Sandwich(u, p).apply(s, m->scatter * static_cast<double>(p->n) / m->n_effective);
    } catch (const std::bad_alloc &) {
        status = err_set(e, ERR_NOMEM, "no memory for the covariance of %zu points", p->n);
    }
    sweeps_free(&s);
    return status;
}
