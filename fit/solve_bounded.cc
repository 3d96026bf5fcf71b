#include "fit/solve_bounded.h"

#include <algorithm>
#include <memory>
#include <vector>

#include <ceres/ceres.h>
#include <glog/logging.h>

#include "fit/stopwatch.h"

namespace {

/* All weighted residuals of a problem; one block of size 1 for each coordinate, so that any can be held. */
class Residuals : public ceres::CostFunction {
  public:
    explicit Residuals(const struct problem *p)
        : p_(p), room_(reflectance_batch_room(p->n)), beta_(room_), weight_(p->n), slope_(room_ * p->k) {
        set_num_residuals(static_cast<int>(p->n));
        mutable_parameter_block_sizes()->assign(p->k, 1);
    }

    bool Evaluate(double const *const *x, double *residuals, double **jacobians) const override {
        double point[COORDINATES_MAX], value[MATERIAL_PARAMETERS], chain[COORDINATES_MAX * COORDINATES_MAX];
        for (int j = 0; j < p_->k; j++) {
            point[j] = *x[j];
        }
        coordinates_to_value(p_->model, point, value);
        if (aperture_columns(&p_->aperture, 0, p_->n, p_->model, value, &p_->optics, beta_.data(),
                             slope_.data(), room_, nullptr)) {
            return false;
        }
        problem_residuals(p_, 0, p_->n, beta_.data(), residuals, weight_.data());
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
                    sum += slope_[m * room_ + i] * chain[m * k + j];
                }
                jacobians[j][i] = sum * weight_[i];
            }
            nuisance_whiten(p_, jacobians[j]);
        }
    }

    const struct problem *p_;
    size_t room_; /* of a column */
    mutable std::vector<double> beta_, weight_, slope_;
};

/* Each iteration into a trace, with where it stands. */
class Watch : public ceres::IterationCallback {
  public:
    Watch(struct estimate_trace *trace, const struct problem *p, const double *x)
        : trace_(trace), k_(p->k), x_(x), before_us_(trace->n ? trace->step[trace->n - 1].t_us : 0),
          begun_us_(1e6 * stopwatch_s()) {
    }
    ceres::CallbackReturnType operator()(const ceres::IterationSummary &summary) override {
        if (trace_->n < ESTIMATE_TRACE_MAX) {
            struct estimate_step *step = &trace_->step[trace_->n++];
            *step = {before_us_ + 1e6 * stopwatch_s() - begun_us_, summary.cost, {}};
            std::copy(x_, x_ + k_, step->x);
        }
        return ceres::SOLVER_CONTINUE;
    }

  private:
    struct estimate_trace *trace_;
    int k_;
    const double *x_;
    double before_us_, begun_us_;
};

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
    ceres::Solver::Options options = make_options(normal_equations);
    std::unique_ptr<Watch> watch;
    if (trace) {
        watch = std::make_unique<Watch>(trace, p, result->x);
        options.callbacks.push_back(watch.get());
        options.update_state_every_iteration = true;
    }
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    result->chi2 = 2 * summary.final_cost;
    result->converged = summary.termination_type == ceres::CONVERGENCE;
    result->iterations += static_cast<int>(summary.iterations.size());
    return summary.termination_type == ceres::FAILURE
               ? err_set(e, ERR_FIT, "the solver failed: %s", summary.message.c_str())
               : 0;
}
