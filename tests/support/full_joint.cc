#include "tests/support/full_joint.h"

#include <cmath>
#include <vector>

#include <ceres/ceres.h>

namespace {

/* One band, by the model itself: blocks are the shared coordinates, S and t. */
class Band : public ceres::CostFunction {
  public:
    Band(const struct joint_data *d, int row) : d_(d), row_(row) {
        set_num_residuals(static_cast<int>(d->n));
        mutable_parameter_block_sizes()->assign({d->p->k, 1, 1});
    }

    bool Evaluate(double const *const *x, double *residuals, double **jacobians) const override {
        residuals_at(x[0], *x[1], *x[2], residuals);
        for (int block = 0; jacobians && block < 3; block++) {
            const int size = parameter_block_sizes()[block];
            for (int j = 0; jacobians[block] && j < size;
                 j++) { /* central: the slopes of the model stay untested here */
                std::vector<double> shared(x[0], x[0] + d_->p->k), up(d_->n), down(d_->n);
                double s = *x[1], t = *x[2], h = 1e-6;
                double *moved = block == 0 ? &shared[j] : block == 1 ? &s : &t;
                *moved += h;
                residuals_at(shared.data(), s, t, up.data());
                *moved -= 2 * h;
                residuals_at(shared.data(), s, t, down.data());
                for (size_t i = 0; i < d_->n; i++) {
                    jacobians[block][i * size + j] = (up[i] - down[i]) / (2 * h);
                }
            }
        }
        return true;
    }

  private:
    void residuals_at(const double *x, double s, double t, double *residuals) const {
        double value[MATERIAL_PARAMETERS];
        std::vector<double> beta(d_->n);
        const struct reflectance_optics optics = {d_->p->optics.kappa, 1, 0};
        coordinates_to_value(d_->p->model, x, value);
        value[MATERIAL_S] = s;
        value[MATERIAL_BETA_PRIME] *= t;
        reflectance_eval(d_->p->model, d_->n, d_->p->aperture.geometry, value, &optics, beta.data(), nullptr,
                         nullptr);
        for (size_t i = 0; i < d_->n; i++) {
            const size_t at = row_ * d_->n + i;
            residuals[i] = std::sqrt(d_->weight[at]) * (beta[i] - d_->beta[at]);
        }
    }

    const struct joint_data *d_;
    size_t row_;
};

} // namespace

double full_joint(const struct joint_data *d, bool beta_prime_per_band, const bool *held, double *x,
                  double *s, double *t) {
    ceres::Problem problem;
    std::vector<int> fixed = {0};
    for (int c = 1; c < d->p->k; c++) {
        if ((held && held[c]) ||
            (beta_prime_per_band && reflectance_parameter(d->p->model, c) == MATERIAL_BETA_PRIME)) {
            fixed.push_back(c);
        }
    }
    for (int b = 0; b < d->n_bands; b++) {
        problem.AddResidualBlock(new Band(d, b), nullptr, x, s + b, t + b);
        if (!beta_prime_per_band) {
            problem.SetParameterBlockConstant(t + b);
        }
    }
    problem.SetManifold(x, new ceres::SubsetManifold(d->p->k, fixed));
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_QR;
    options.logging_type = ceres::SILENT;
    options.max_num_iterations = 200;
    options.function_tolerance = 1e-15;
    options.parameter_tolerance = 1e-12;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    return summary.termination_type == ceres::CONVERGENCE ? 2 * summary.final_cost : -1;
}
