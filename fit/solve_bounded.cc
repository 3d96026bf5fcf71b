#include "fit/solve_bounded.h"

#include <algorithm>
#include <vector>

#include <ceres/ceres.h>
#include <glog/logging.h>

namespace {

/* All weighted residuals of a problem; one block of size 1 for each coordinate, so that any can be held. */
class Residuals : public ceres::CostFunction {
  public:
    explicit Residuals(const struct problem *p) : p_(p), beta_(p->n), gradient_(p->n * p->k) {
        set_num_residuals(static_cast<int>(p->n));
        mutable_parameter_block_sizes()->assign(p->k, 1);
    }

    bool Evaluate(double const *const *x, double *residuals, double **jacobians) const override {
        double point[COORDINATES_MAX], value[MATERIAL_PARAMETERS], chain[COORDINATES_MAX * COORDINATES_MAX];
        for (int j = 0; j < p_->k; j++) {
            point[j] = *x[j];
        }
        coordinates_to_value(p_->model, point, value);
        if (problem_rows(p_, value, 0, p_->n, beta_.data(), jacobians ? gradient_.data() : nullptr,
                         nullptr)) {
            return false;
        }
        for (size_t i = 0; i < p_->n; i++) {
            residuals[i] = (beta_[i] - p_->input->beta[i]) * p_->root_weight[i];
        }
        nuisance_residuals(p_, residuals);
        if (jacobians) {
            coordinates_chain(p_->model, value, chain);
            fill(jacobians, chain);
        }
        return true;
    }

  private:
    void fill(double **jacobians, const double *chain) const {
        const int k = p_->k;
        for (int j = 0; j < k; j++) {
            if (!jacobians[j]) {
                continue;
            }
            for (size_t i = 0; i < p_->n; i++) {
                double sum = 0;
                for (int m = 0; m < k; m++) {
                    sum += gradient_[i * k + m] * chain[m * k + j];
                }
                jacobians[j][i] = sum * p_->root_weight[i];
            }
            nuisance_whiten(p_, jacobians[j]);
        }
    }

    const struct problem *p_;
    mutable std::vector<double> beta_, gradient_;
};

void add_trace(struct estimate_trace *trace, const ceres::Solver::Summary &summary) {
    double before_us = trace->n ? trace->step[trace->n - 1].t_us : 0;
    for (const auto &it : summary.iterations) {
        if (trace->n < ESTIMATE_TRACE_MAX) {
            trace->step[trace->n++] = {before_us + 1e6 * it.cumulative_time_in_seconds, it.cost};
        }
    }
}

ceres::Solver::Options make_options(bool normal_equations) {
    ceres::Solver::Options options;
    options.linear_solver_type = normal_equations ? ceres::DENSE_NORMAL_CHOLESKY : ceres::DENSE_QR;
    options.logging_type = ceres::SILENT;
    options.num_threads = 1;
    options.max_num_iterations = 200;
    /* Ends on the flat bottom of the cost: a step of 1e-10 is 1e-6 of the smallest stated u. */
    options.function_tolerance = 1e-14;
    options.gradient_tolerance = 1e-12;
    options.parameter_tolerance = 1e-10;
    return options;
}

} // namespace

int solve_bounded(const struct problem *p, const bool *held, bool normal_equations,
                  struct solve_result *result, struct estimate_trace *trace, struct err *e) {
    FLAGS_minloglevel = google::GLOG_FATAL;
    ceres::Problem::Options ownership;
    ownership.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    ownership.disable_all_safety_checks = true;
    ceres::Problem problem(ownership);
    Residuals residuals(p);
    std::vector<double *> blocks;
    for (int j = 0; j < p->k; j++) {
        blocks.push_back(&result->x[j]);
    }
    problem.AddResidualBlock(&residuals, nullptr, blocks);
    for (int j = 0; j < p->k; j++) {
        if (held && held[j]) {
            problem.SetParameterBlockConstant(blocks[j]);
            continue;
        }
        problem.SetParameterLowerBound(blocks[j], 0, p->low[j]);
        problem.SetParameterUpperBound(blocks[j], 0, p->high[j]);
    }
    ceres::Solver::Summary summary;
    ceres::Solve(make_options(normal_equations), &problem, &summary);
    result->chi2 = 2 * summary.final_cost;
    result->converged = summary.termination_type == ceres::CONVERGENCE;
    result->iterations += static_cast<int>(summary.iterations.size());
    if (trace) {
        add_trace(trace, summary);
    }
    return summary.termination_type == ceres::FAILURE
               ? err_set(e, ERR_FIT, "the solver failed: %s", summary.message.c_str())
               : 0;
}
