#include "fit/uncertainty.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <new>
#include <vector>

#include <Eigen/Dense>

#include "fit/drift.h"

namespace {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Vector = Eigen::VectorXd;
using Cells = Eigen::Map<Matrix>;
using ConstCells = Eigen::Map<const Matrix>;

/* Beyond this the free parameters cannot be told apart in double precision: J^T J carries the square. */
constexpr double CONDITION_MAX = 1e6;

struct cause { /* a common cause, made alike for the user's and for the two axis zeros */
    size_t n;
    const int *point;
    const double *mean, *bands;
    double scale;
    bool colourless = false;             /* it moves the lobe: the mean's change is that of every band */
    const double *spot = nullptr;        /* [n] of an axis zero: comes on top, in proportion to beta */
    double nuisance[NUISANCES_MAX] = {}; /* how far it moves the nuisances themselves */

    size_t at(size_t i) const {
        return point ? static_cast<size_t>(point[i]) : i;
    }
    double change(size_t i) const {
        return scale * (mean[i] + (spot ? spot[i] : 0));
    }
};

std::vector<cause> causes_of(const struct problem *p) {
    const struct estimate_input *in = p->input;
    std::vector<cause> all;
    for (size_t c = 0; c < in->n_common; c++) {
        const struct estimate_common *x = &in->common[c];
        all.push_back({x->point ? x->n : p->n, x->point, x->mean, x->bands, 1});
    }
    struct nuisance_cause own[NUISANCE_CAUSES];
    const int n_own = nuisance_causes(p, nullptr, own);
    for (int x = 0; x < n_own; x++) {
        cause c{p->n, nullptr, own[x].slope, nullptr, own[x].u, true, own[x].spot};
        for (int z = 0; z < p->nuisance.m; z++) {
            c.nuisance[z] = p->nuisance.of[z].kind == own[x].kind ? own[x].share * own[x].u : 0;
        }
        all.push_back(c);
    }
    return all;
}

/* Jacobian with respect to the coordinates, columns of held parameters zero. */
Matrix jacobian(const struct problem *p, const double *value, const bool *is_free) {
    double cells[UNCERTAINTY_CELLS];
    coordinates_chain(p->model, value, cells);
    Matrix j = ConstCells(p->gradient, static_cast<Eigen::Index>(p->n), p->k) * ConstCells(cells, p->k, p->k);
    for (int c = 0; c < p->k; c++) {
        if (!is_free[c]) {
            j.col(c).setZero();
        }
    }
    return j;
}

/* Inverse of the Fisher matrix over its free columns, by its column-normalised form. */
bool invert(struct uncertainty *u, const Matrix &fisher, Matrix *inverse) {
    std::vector<int> columns;
    for (int c = 0; c < fisher.rows(); c++) {
        if (u->free[c]) {
            columns.push_back(c);
        }
    }
    const int m = static_cast<int>(columns.size());
    *inverse = Matrix::Zero(fisher.rows(), fisher.rows());
    u->condition = 1;
    if (m == 0) {
        return true;
    }
    Matrix normalised(m, m);
    for (int a = 0; a < m; a++) {
        for (int b = 0; b < m; b++) {
            double scale = std::sqrt(fisher(columns[a], columns[a]) * fisher(columns[b], columns[b]));
            normalised(a, b) = scale > 0 ? fisher(columns[a], columns[b]) / scale : 0;
        }
    }
    Eigen::SelfAdjointEigenSolver<Matrix> eigen(normalised);
    double low = eigen.eigenvalues()(0), high = eigen.eigenvalues()(m - 1);
    u->condition = low > 0 ? std::sqrt(high / low) : INFINITY;
    for (int a = 0; a < m; a++) {
        u->weakest[columns[a]] = eigen.eigenvectors()(a, 0);
    }
    if (!(u->condition < CONDITION_MAX)) {
        return false;
    }
    Matrix small = eigen.eigenvectors() * eigen.eigenvalues().cwiseInverse().asDiagonal() *
                   eigen.eigenvectors().transpose();
    for (int a = 0; a < m; a++) {
        for (int b = 0; b < m; b++) {
            double scale = std::sqrt(fisher(columns[a], columns[a]) * fisher(columns[b], columns[b]));
            (*inverse)(columns[a], columns[b]) = small(a, b) / scale;
        }
    }
    return true;
}

void add_expectation(struct uncertainty *u, double projected) {
    projected = std::max(projected, 0.0);
    u->chi2_expected += projected;
    u->chi2_variance += 4 * projected + 2 * projected * projected;
}

/* W' = W^1/2 B B W^1/2: the weights of the points, less what the nuisances explain (fit/nuisance.h). P' the same from
 * their precision. */
Matrix weigh(const struct problem *p, const Vector &root, Matrix columns) {
    for (Eigen::Index c = 0; c < columns.cols(); c++) {
        Vector x = root.cwiseProduct(columns.col(c));
        nuisance_whiten(p, x.data());
        nuisance_whiten(p, x.data());
        columns.col(c) = root.cwiseProduct(x);
    }
    return columns;
}

struct workspace {
    const struct problem *p;
    Matrix j, wj, inverse, h; /* j and wj = W' j are n * k, h is k * n */
    Vector precision;         /* 1 / u^2: the weight, unless the fit was to count all points alike */
    Matrix pj, precise;       /* P' j and j^T P' j */
};

/* What a correlated change of the points, which moves the parameters, leaves in chi-square. */
double seen_by(const workspace &w, const Vector &change, const Vector &moved) {
    const double all = change.dot(weigh(w.p, w.precision.cwiseSqrt(), change).col(0));
    return all - 2 * moved.dot(w.pj.transpose() * change) + moved.dot(w.precise * moved);
}

/* D_b of one bracket in absolute terms, scaled by the given values of its points. */
Matrix drift_matrix(const struct estimate_bracket *b, size_t n, const double *beta) {
    Matrix d(n, n);
    for (size_t x = 0; x < n; x++) {
        for (size_t y = x; y < n; y++) {
            d(x, y) = d(y, x) = drift_covariance(b, x, y) * beta[x] * beta[y];
        }
    }
    return d;
}

/* The covariance of parameters and nuisances, one part of it. */
void add_to(struct uncertainty *u, const Matrix &covariance, const workspace &w, double *cells) {
    Cells(cells, w.p->k, w.p->k) += covariance.topLeftCorner(w.p->k, w.p->k);
    for (int z = 0; z < w.p->nuisance.m; z++) {
        u->nuisance_u2[z] += covariance(w.p->k + z, w.p->k + z);
    }
}

void add_drift(struct uncertainty *u, const workspace &w) {
    const struct estimate_input *in = w.p->input;
    for (size_t b = 0; b < in->n_bracket; b++) {
        const struct estimate_bracket *x = &in->bracket[b];
        const size_t n = x->point ? x->n : w.p->n;
        if (n == 0 || x->rate == 0) {
            continue;
        }
        std::vector<double> beta(n);
        Matrix h(w.h.rows(), n), pj(n, w.p->k), axis(n, w.p->nuisance.m);
        Vector precision(n);
        for (size_t i = 0; i < n; i++) {
            const size_t at = x->point ? static_cast<size_t>(x->point[i]) : i;
            beta[i] = w.p->model_beta[at];
            h.col(i) = w.h.col(at);
            pj.row(i) = w.pj.row(at);
            precision(i) = w.precision(at);
            for (int z = 0; z < w.p->nuisance.m; z++) {
                axis(i, z) = w.p->nuisance.axis[z][at] * std::sqrt(precision(i) * w.p->nuisance.removed[z]);
            }
        }
        Matrix d = drift_matrix(x, n, beta.data());
        const Matrix moved = h * d * h.transpose(), of_x = moved.topLeftCorner(w.p->k, w.p->k);
        add_to(u, moved, w, u->drift);
        const double seen = precision.dot(d.diagonal()) - (axis.transpose() * d * axis).trace();
        const double explained = 2 * (pj.transpose() * d * h.topRows(w.p->k).transpose()).trace();
        add_expectation(u, seen - explained + (w.precise * of_x).trace());
    }
}

void add_common(struct uncertainty *u, const workspace &w) {
    for (const cause &c : causes_of(w.p)) {
        Vector change = Vector::Zero(w.p->n);
        for (size_t i = 0; i < c.n; i++) {
            change(c.at(i)) += c.change(i);
        }
        Vector moved = w.h * change;
        add_expectation(u, seen_by(w, change, moved.head(w.p->k)));
        for (int z = 0; z < w.p->nuisance.m; z++) {
            moved(w.p->k + z) -= c.nuisance[z];
        }
        add_to(u, moved * moved.transpose(), w, u->common);
    }
}

/* Mean and variance of chi-square from independent errors: trace of P and 2 P^2 where the residuals over u are
 * (I - A B^T) times the errors over u, P = (I - A B^T)(I - B A^T). With the weights of the errors: n - k, twice that. */
void expect_chi2(struct uncertainty *u, const workspace &w) {
    const Eigen::Index n = static_cast<Eigen::Index>(w.p->n), k = w.p->k;
    const Vector root = w.precision.cwiseSqrt();
    Matrix z(n, 2 * k), middle = Matrix::Zero(2 * k, 2 * k);
    z.leftCols(k) = root.asDiagonal() * w.j;
    z.rightCols(k) = root.cwiseInverse().asDiagonal() * w.h.topRows(k).transpose();
    middle.topLeftCorner(k, k) = z.rightCols(k).transpose() * z.rightCols(k);
    middle.topRightCorner(k, k) = middle.bottomLeftCorner(k, k) = -Matrix::Identity(k, k);
    const Matrix turn = middle * (z.transpose() * z); /* P = I + z middle z^T */
    u->chi2_expected = std::max(1.0, static_cast<double>(n) + turn.trace());
    u->chi2_variance = 2 * std::max(1.0, static_cast<double>(n) + 2 * turn.trace() + (turn * turn).trace());
}

/* The same beside free nuisances, whose priors are causes; the variance is that much at most. */
void expect_beside_nuisances(struct uncertainty *u, const workspace &w, const Vector &variance) {
    double left = w.p->n - (w.inverse * (w.wj.transpose() * variance.asDiagonal() * w.wj)).trace();
    for (int z = 0; z < w.p->nuisance.m; z++) {
        const double *axis = w.p->nuisance.axis[z];
        left -= w.p->nuisance.removed[z] * Eigen::Map<const Vector>(axis, w.p->n).squaredNorm();
    }
    u->chi2_expected = std::max(1.0, left);
    u->chi2_variance = 2 * u->chi2_expected;
}

void add_independent(struct uncertainty *u, const workspace &w) {
    const int free_count = static_cast<int>(std::count(u->free, u->free + w.p->k, true));
    const double degrees = std::max<double>(1, static_cast<double>(w.p->n) - free_count);
    Vector variance(w.p->n);
    for (size_t i = 0; i < w.p->n; i++) {
        variance(i) = w.p->u[i] * w.p->u[i];
    }
    if (!w.p->input->u_ind) { /* no uncertainty given: the scatter has to tell */
        const double scatter = problem_chi2(w.p) / degrees;
        for (size_t i = 0; i < w.p->n; i++) { /* alike in the terms of the loss */
            variance(i) = scatter / (w.p->root_weight[i] * w.p->root_weight[i]);
        }
    }
    add_to(u, w.h * variance.asDiagonal() * w.h.transpose(), w, u->independent);
    if (w.p->nuisance.m > 0) {
        expect_beside_nuisances(u, w, variance);
    } else {
        expect_chi2(u, w);
    }
}

/* How each point moves the nuisances: z = U (I + G^T W G)^-1 (G^T W - G^T W J H) d beta, G scaled by U. */
Matrix nuisance_rows(const workspace &w) {
    const struct nuisances *s = &w.p->nuisance;
    const Eigen::Index n = static_cast<Eigen::Index>(w.p->n);
    const Vector root = Eigen::Map<const Vector>(w.p->root_weight, n);
    Matrix g(n, s->m), u = Matrix::Zero(s->m, s->m);
    for (int z = 0; z < s->m; z++) {
        u(z, z) = s->of[z].u;
        g.col(z) = Eigen::Map<const Vector>(s->of[z].slope, n) * s->of[z].u;
    }
    const Matrix wg = root.cwiseAbs2().asDiagonal() * g;
    const Matrix a = Matrix::Identity(s->m, s->m) + g.transpose() * wg;
    return u * a.inverse() * (wg.transpose() - (wg.transpose() * w.j) * w.h);
}

int compute(struct uncertainty *u, const struct problem *p, const double *value, struct err *e) {
    const Eigen::Index n = static_cast<Eigen::Index>(p->n);
    workspace w{p, jacobian(p, value, u->free), {}, {}, {}, {}, {}, {}};
    w.precision = Eigen::Map<const Vector>(p->u, n).cwiseAbs2().cwiseInverse();
    w.wj = weigh(p, Eigen::Map<const Vector>(p->root_weight, n), w.j);
    w.pj = weigh(p, w.precision.cwiseSqrt(), w.j);
    w.precise = w.j.transpose() * w.pj;
    Matrix fisher = w.j.transpose() * w.wj;
    Cells(u->fisher, p->k, p->k) = fisher;
    if (!invert(u, fisher, &w.inverse)) {
        return err_set(e, ERR_FIT, "the points cannot tell the parameters apart (condition %.1g)",
                       u->condition);
    }
    w.h = w.inverse * w.wj.transpose();
    const Matrix z = nuisance_rows(w);
    w.h.conservativeResize(p->k + p->nuisance.m, Eigen::NoChange);
    w.h.bottomRows(p->nuisance.m) = z;
    add_independent(u, w);
    add_drift(u, w);
    add_common(u, w);
    u->h = static_cast<double *>(std::malloc(sizeof(double) * (w.h.size() + 1)));
    if (!u->h) {
        return err_set(e, ERR_NOMEM, "no memory for the covariance of %zu points", p->n);
    }
    std::memcpy(u->h, w.h.data(), sizeof(double) * w.h.size());
    return 0;
}

/* Slope of S_b with respect to the coordinates of the shared parameters, and its own row of H. */
void band_rows(const struct problem *p, const double *value, const Matrix &j, struct bandfit *f, int band,
               Vector *own, Vector *shared) {
    double normal = 0;
    const double s = f->s[band];
    own->setZero(p->n);
    shared->setZero(p->k);
    bandfit_weights(f, p, band);
    for (size_t i = 0; i < p->n; i++) {
        const struct bandfit_point *x = &f->point[i];
        const double slope = x->l1 + 2 * s * x->l2;
        (*own)(i) = f->weight[i] * slope;
        normal += f->weight[i] * slope * slope;
    }
    *own /= normal;
    const double mean = value[MATERIAL_S];
    for (int c = 0; c < p->k; c++) {
        const enum material_parameter parameter = reflectance_parameter(p->model, c);
        for (size_t i = 0; parameter != MATERIAL_S && i < p->n; i++) {
            const struct bandfit_point *x = &f->point[i];
            double slope = j(i, c); /* the lobe is the mean's */
            if (parameter == MATERIAL_SIGMA) {
                slope = (s * x->l1_slope + s * s * x->l2_slope) * value[MATERIAL_SIGMA];
            } else if (reflectance_kind(p->model, parameter) == REFLECTANCE_TRANSMISSION) {
                slope *= (s * x->l1 + s * s * x->l2) / (mean * x->l1 + p->optics.q * mean * mean * x->l2);
            }
            (*shared)(c) -= (*own)(i)*slope;
        }
    }
}

double band_ratio(const struct problem *p, size_t i, double fitted) {
    return p->model_beta[i] != 0 ? fitted / p->model_beta[i] : 1;
}

struct band_work {
    const struct uncertainty *u;
    const struct problem *p;
    std::vector<cause> causes;
    std::vector<Matrix> drift; /* relative to beta_1 beta_2 */
    Vector own, shared;        /* dS = own . d beta_b + shared . d x */
    Vector through;            /* [n] d S by the means: through the shared parameters and the nuisances */
    Vector fitted;             /* of the band */
};

/* A free nuisance moves the model of every band; its slope is of the lobe, which has no colour. */
void find_through(band_work &w) {
    const Eigen::Index n = static_cast<Eigen::Index>(w.p->n), m = w.p->nuisance.m;
    ConstCells h(w.u->h, w.p->k + m, n);
    w.through = h.topRows(w.p->k).transpose() * w.shared;
    for (Eigen::Index z = 0; z < m; z++) {
        w.through -=
            h.row(w.p->k + z).transpose() * w.own.dot(Eigen::Map<const Vector>(w.p->nuisance.of[z].slope, n));
    }
}

/* The noise of the means through what all bands share. */
double shared_variance(const band_work &w) {
    const Eigen::Index n = static_cast<Eigen::Index>(w.p->n);
    double sum = w.shared.dot(ConstCells(w.u->independent, w.p->k, w.p->k) * w.shared);
    if (w.p->nuisance.m > 0) {
        const Vector u = Eigen::Map<const Vector>(w.p->u, n);
        const Vector direct = ConstCells(w.u->h, w.p->k, n).transpose() * w.shared;
        sum += w.through.cwiseProduct(u).squaredNorm() - direct.cwiseProduct(u).squaredNorm();
    }
    return std::max(sum, 0.0);
}

double drift_variance(const band_work &w) {
    const struct estimate_input *in = w.p->input;
    double sum = 0;
    for (size_t b = 0; b < in->n_bracket; b++) {
        const struct estimate_bracket *x = &in->bracket[b];
        Vector row(w.drift[b].rows());
        for (Eigen::Index i = 0; i < row.size(); i++) {
            const size_t at = x->point ? static_cast<size_t>(x->point[i]) : static_cast<size_t>(i);
            /* the lamp drifts as a whole: the mean and the band move together */
            row(i) = w.own(at) * w.fitted(at) + w.through(at) * w.p->model_beta[at];
        }
        sum += row.dot(w.drift[b] * row);
    }
    return sum;
}

double common_variance(const band_work &w, int band) {
    double sum = 0;
    for (const cause &c : w.causes) {
        double moved = 0;
        for (size_t i = 0; i < c.n; i++) {
            const size_t at = c.at(i);
            const double mean = c.change(i), ratio = band_ratio(w.p, at, w.fitted(at));
            double here =
                c.colourless ? c.scale * (c.mean[i] + (c.spot ? c.spot[i] * ratio : 0)) : mean * ratio;
            if (c.bands && std::isfinite(c.bands[i * BANDS + band])) {
                here = c.scale * c.bands[i * BANDS + band];
            }
            moved += w.own(at) * here + w.through(at) * mean;
        }
        sum += moved * moved;
    }
    return sum;
}

double band_variance(band_work &w, const double *value, const Matrix &j, struct bandfit *f, int band) {
    band_rows(w.p, value, j, f, band, &w.own, &w.shared);
    const double s = f->s[band];
    for (size_t i = 0; i < w.p->n; i++) {
        const struct bandfit_point *x = &f->point[i];
        w.fitted(i) = s * x->l1 + s * s * x->l2 + x->specular;
    }
    find_through(w);
    return f->variance[band] * std::max(1.0, w.u->scatter) + shared_variance(w) + drift_variance(w) +
           common_variance(w, band);
}

void compute_bands(const struct uncertainty *u, const struct problem *p, const double *value,
                   struct bandfit *f, double *u_s) {
    Matrix j = jacobian(p, value, u->free);
    band_work w{u, p, causes_of(p), {}, {}, {}, {}, Vector(p->n)};
    for (size_t b = 0; b < p->input->n_bracket; b++) {
        const struct estimate_bracket *x = &p->input->bracket[b];
        const size_t n = x->point ? x->n : p->n;
        w.drift.push_back(drift_matrix(x, n, std::vector<double>(n, 1.0).data()));
    }
    for (int band = 0; band < BANDS; band++) {
        u_s[band] = std::isfinite(f->s[band]) ? std::sqrt(band_variance(w, value, j, f, band)) : NAN;
    }
}

} // namespace

int uncertainty_compute(struct uncertainty *u, const struct problem *p, const double *value,
                        const bool *is_free, struct err *e) {
    *u = {};
    std::copy(is_free, is_free + p->k, u->free);
    try {
        return compute(u, p, value, e);
    } catch (const std::bad_alloc &) {
        return err_set(e, ERR_NOMEM, "no memory for the covariance of %zu points", p->n);
    }
}

void uncertainty_free(struct uncertainty *u) {
    std::free(u->h);
    u->h = nullptr;
}

int uncertainty_of_bands(const struct uncertainty *u, const struct problem *p, const double *value,
                         struct bandfit *f, double *u_s, struct err *e) {
    try {
        compute_bands(u, p, value, f, u_s);
        return 0;
    } catch (const std::bad_alloc &) {
        return err_set(e, ERR_NOMEM, "no memory for the spectrum of %zu points", p->n);
    }
}
