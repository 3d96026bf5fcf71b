#include "fit/advice.h"

#include <algorithm>
#include <cmath>
#include <new>
#include <vector>

#include <Eigen/Dense>

namespace {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Vector = Eigen::VectorXd;

constexpr double BLIND_DEG = 8; /* a usual lamp housing in front of the sensor (reflection-model.md 5.1) */

/* Of the set: what a new point will be known to, as a share of its value. */
double relative_u(const struct problem *p) {
    std::vector<double> all;
    for (size_t i = 0; i < p->n; i++) {
        all.push_back(p->u[i] / std::max(std::fabs(p->input->beta[i]), 0.005));
    }
    std::nth_element(all.begin(), all.begin() + all.size() / 2, all.end());
    return all[all.size() / 2];
}

/* A little of every parameter is known beforehand (a factor e^10): keeps an empty direction finite. */
Matrix prior_covariance(const struct problem *p, const struct uncertainty *u) {
    Matrix fisher = Eigen::Map<const Matrix>(u->fisher, p->k, p->k);
    fisher.diagonal().array() += 0.01;
    return fisher.inverse();
}

Vector row_of(const struct problem *p, const double *value, const double *chain, double theta_i_deg,
              double theta_v_deg, double *beta) {
    double gradient[COORDINATES_MAX] = {0};
    aperture_at(&p->aperture.form, theta_i_deg, theta_v_deg, p->model, value, &p->optics, beta, gradient,
                nullptr);
    return Eigen::Map<const Matrix>(chain, p->k, p->k).transpose() * Eigen::Map<const Vector>(gradient, p->k);
}

/* Viewing angles worth a look at one incidence: every 5 deg, and the flanks of the lobe, which a step may miss. */
std::vector<double> candidates(const struct problem *p, const double *value, double i_deg) {
    std::vector<double> all;
    for (double v_deg = -80; v_deg <= 80; v_deg += 5) {
        all.push_back(v_deg);
    }
    if (reflectance_column(p->model, MATERIAL_GAMMA) >= 0) {
        const double half_width_deg =
            2 * value[MATERIAL_GAMMA] * 180 / M_PI; /* phi is half of theta_v - theta_i */
        for (double widths : {-1.5, -0.8, 0.8, 1.5}) {
            const double v_deg = std::round(2 * (i_deg + widths * half_width_deg)) / 2; /* to 0.5 deg */
            if (std::fabs(v_deg) <= 80) {
                all.push_back(v_deg);
            }
        }
    }
    return all;
}

void search(const struct problem *p, const double *value, const struct uncertainty *u, int column,
            struct advice *next) {
    double chain[UNCERTAINTY_CELLS], best = -1, beta = 0, reach = 60;
    coordinates_chain(p->model, value, chain);
    for (size_t i = 0; i < p->n; i++) {
        reach = std::max(reach, p->input->theta_i_deg[i]);
    }
    const Matrix c = prior_covariance(p, u);
    const double relative = relative_u(p);
    for (double i_deg = 10; i_deg <= reach; i_deg += 5) {
        for (double v_deg : candidates(p, value, i_deg)) {
            if (std::fabs(i_deg + v_deg) < BLIND_DEG) {
                continue;
            }
            const Vector row = row_of(p, value, chain, i_deg, v_deg, &beta);
            const double sd = std::hypot(relative * beta, relative * 0.005);
            const Vector cr = c * row;
            const double gain = cr(column) * cr(column) / (sd * sd + row.dot(cr));
            if (gain > best) {
                best = gain;
                *next = {i_deg, v_deg};
            }
        }
    }
}

} // namespace

int advice_next(const struct problem *p, const double *value, const struct uncertainty *u, int column,
                struct advice *next, struct err *e) {
    try {
        search(p, value, u, column, next);
        return 0;
    } catch (const std::bad_alloc &) {
        return err_set(e, ERR_NOMEM, "no memory to search for the next geometry");
    }
}
