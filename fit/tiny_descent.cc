#include "fit/tiny_descent.h"

#include <algorithm>
#include <cmath>

#include <ceres/tiny_solver.h>

#include "fit/cholesky.h"

namespace {

/* The square of it is what the normal equations lose: half of a double's digits, and beyond it the decisive ones. */
constexpr double CONDITION_MAX = 1e6;
/* Below it the cost's change is rounding. TinySolver takes absolute tolerances: those of where it starts. */
constexpr double FLAT = 1e-14;
constexpr int ITERATIONS_MAX = 50;

/* TinySolver's cost function: K columns, of which those beyond the free ones are a unit matrix and stay where they
 * are. A trial that cannot be made gets the present cost, at which the solver ends. */
template <int K> struct Normal {
    using Scalar = double;
    enum { NUM_RESIDUALS = K + 1, NUM_PARAMETERS = K };

    bool operator()(const double *x, double *residuals, double *jacobian) const {
        const bool visited = search->visit(x);
        std::fill(residuals, residuals + K + 1, 0.0);
        if (!jacobian) {
            residuals[K] = std::sqrt(visited ? search->chi2() : taken_chi2);
            return true;
        }
        taken_chi2 = search->chi2();
        std::fill(jacobian, jacobian + K * (K + 1), 0.0);
        reduce(residuals, jacobian);
        return true;
    }

    /* The small problem with the points' J^T J, J^T r and cost. */
    void reduce(double *residuals, double *jacobian) const {
        double rest = search->chi2();
        const int k = search->k();
        if (!search->factor()) { /* no slope: the solver ends here */
            search->trouble = "the normal equations are singular";
            std::fill(residuals, residuals + K + 1, 0.0);
            return;
        }
        const double *l = search->reduce(residuals);
        for (int a = 0; a < K; a++) {
            jacobian[a * (K + 1) + a] = 1;
            for (int b = 0; b <= a && a < k; b++) {
                jacobian[a * (K + 1) + b] = l[a * k + b];
            }
            rest -= residuals[a] * residuals[a];
        }
        residuals[K] = std::sqrt(std::max(0.0, rest));
    }

    TinyDescent *search;
    mutable double taken_chi2; /* TinySolver calls through a const reference */
};

template <int K> void go_down(TinyDescent *search, double *x, double smallest, double radius) {
    Normal<K> f{search, search->chi2()};
    ceres::TinySolver<Normal<K>> solver;
    typename ceres::TinySolver<Normal<K>>::Parameters v;
    v.setZero();
    std::copy(x, x + search->k(), v.data());
    solver.options.max_num_iterations = ITERATIONS_MAX;
    solver.options.gradient_tolerance = 0;
    solver.options.cost_threshold = 0;
    solver.options.parameter_tolerance = smallest / (v.norm() + smallest);
    solver.options.function_tolerance = FLAT * search->chi2();
    solver.options.initial_trust_region_radius = radius;
    solver.Solve(f, &v);
    std::copy(v.data(), v.data() + search->k(), x);
}

} // namespace

void TinyDescent::descend(double *x, double smallest, double radius) {
    k_ <= 5 ? go_down<5>(this, x, smallest, radius) : go_down<COORDINATES_MAX>(this, x, smallest, radius);
}

bool TinyDescent::factor() {
    now_.factored = now_.factored || cholesky_factor(k_, now_.m, now_.l);
    return now_.factored;
}

const double *TinyDescent::reduce(double *y) const {
    cholesky_lower(k_, now_.l, now_.g, y);
    return now_.l;
}

/* The determinant of the scaled columns answers for most: with k eigenvalues of mean 1 the least of
 * them is above det (1 - 1/k)^(k - 1), that is det / e. */
bool TinyDescent::well_conditioned() {
    if (!factor()) {
        return false;
    }
    double determinant = 1;
    for (int a = 0; a < k_; a++) {
        determinant *= now_.l[a * k_ + a] * now_.l[a * k_ + a] / now_.m[a * k_ + a];
    }
    return k_ * M_E < determinant * CONDITION_MAX ||
           std::sqrt(cholesky_condition(k_, now_.m)) < CONDITION_MAX;
}
