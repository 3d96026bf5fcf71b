#include "fit/solve.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <new>
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
        if (aperture_eval(&p_->aperture, 0, p_->n, p_->model, value, &p_->optics, beta_.data(),
                          jacobians ? gradient_.data() : nullptr, nullptr)) {
            return false;
        }
        for (size_t i = 0; i < p_->n; i++) {
            residuals[i] = (beta_[i] - p_->input->beta[i]) * p_->root_weight[i];
        }
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

ceres::Solver::Options make_options() {
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_QR;
    options.logging_type = ceres::SILENT;
    options.num_threads = 1;
    options.max_num_iterations = 200;
    /* Ends on the flat bottom of the cost: a step of 1e-10 is 1e-6 of the smallest stated u. */
    options.function_tolerance = 1e-14;
    options.gradient_tolerance = 1e-12;
    options.parameter_tolerance = 1e-10;
    return options;
}

void minimise(const struct problem *p, const bool *held, struct solve_result *result,
              struct estimate_trace *trace, std::string *failure) {
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
        result->x[j] = std::min(std::max(result->x[j], p->low[j]), p->high[j]);
        problem.SetParameterLowerBound(blocks[j], 0, p->low[j]);
        problem.SetParameterUpperBound(blocks[j], 0, p->high[j]);
    }
    ceres::Solver::Summary summary;
    ceres::Solve(make_options(), &problem, &summary);
    result->chi2 = 2 * summary.final_cost;
    result->converged = summary.termination_type == ceres::CONVERGENCE;
    result->iterations = static_cast<int>(summary.iterations.size());
    if (summary.termination_type == ceres::FAILURE) {
        *failure = summary.message;
    }
    if (trace) {
        add_trace(trace, summary);
    }
}

/* Nothing to search for: the cost where it is held. */
void evaluate_held(const struct problem *p, struct solve_result *result) {
    std::vector<double> residuals(p->n);
    std::vector<const double *> blocks;
    for (int j = 0; j < p->k; j++) {
        blocks.push_back(&result->x[j]);
    }
    result->chi2 = NAN;
    if (Residuals(p).Evaluate(blocks.data(), residuals.data(), nullptr)) {
        result->chi2 = 0;
        for (double r : residuals) {
            result->chi2 += r * r;
        }
    }
    result->converged = true;
}

bool all_held(const struct problem *p, const bool *held) {
    return held && std::all_of(held, held + p->k, [](bool h) { return h; });
}

} // namespace

int solve_run(const struct problem *p, const double *start, const bool *held, struct solve_result *result,
              struct estimate_trace *trace, struct err *e) {
    try {
        FLAGS_minloglevel = google::GLOG_FATAL;
        *result = {};
        for (int j = 0; j < p->k; j++) {
            if (!std::isfinite(start[j])) {
                return err_set(e, ERR_FIT,
                               "the start of the fit is not a number; the points do not resemble a surface");
            }
            result->x[j] = start[j];
        }
        if (p->n == 0) {
            return err_set(e, ERR_FIT, "nothing to fit: there are no points");
        }
        std::string failure;
        if (all_held(p, held)) {
            evaluate_held(p, result);
        } else {
            minimise(p, held, result, trace, &failure);
        }
        if (!failure.empty() || !std::isfinite(result->chi2)) {
            return err_set(e, ERR_FIT, "the solver failed: %s",
                           failure.empty() ? "its cost is no number" : failure.c_str());
        }
        return 0;
    } catch (const std::bad_alloc &) {
        return err_set(e, ERR_NOMEM, "no memory for a fit of %zu points", p->n);
    } catch (const std::exception &x) {
        return err_set(e, ERR_FIT, "the solver failed: %s", x.what());
    }
}

const char *solve_name(void) {
    return "Ceres " CERES_VERSION_STRING " Solver, Levenberg-Marquardt, dense QR";
}
