#include "fit/joint_form.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <new>

#include <Eigen/Dense>

namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;
using Index = Eigen::Index;
using Cells = Eigen::Map<Matrix>;
using ConstCells = Eigen::Map<const Matrix>;

constexpr double CONDITION_MAX = 1e6; /* as uncertainty.cc */

void find_free(struct joint_form *f, const struct joint_data *d, const struct joint_solution *solution) {
    const struct problem *p = d->p;
    bool no_lobe = false;
    for (int c = 0; c < p->k; c++) {
        const enum material_parameter parameter = reflectance_parameter(p->model, c);
        f->free[c] = parameter != MATERIAL_S && !problem_at_bound(p, c, solution->x[c]);
        no_lobe = no_lobe || (parameter == MATERIAL_BETA_PRIME && !f->free[c]);
    }
    for (int c = 0; c < p->k; c++) { /* no lobe: nothing in the data knows its shape */
        const enum material_parameter parameter = reflectance_parameter(p->model, c);
        f->free[c] = f->free[c] && !(no_lobe && !joint_shape_is_diffuse(p, c));
        f->free[c] = f->free[c] && !(f->inner == 2 && parameter == MATERIAL_BETA_PRIME);
    }
}

int allocate(struct joint_form *f, struct err *e) {
    const size_t all = static_cast<size_t>(f->all), inner = static_cast<size_t>(f->inner);
    const size_t bands = static_cast<size_t>(f->bands);
    auto room = [](size_t cells) { return static_cast<double *>(std::calloc(cells + 1, sizeof(double))); };
    f->schur = room(all * all);
    f->inverse = room(all * all);
    f->shared = room(bands * all * f->n);
    f->own = room(bands * inner * f->n);
    f->block = room(bands * inner * inner);
    f->g = room(bands * inner * all);
    return f->schur && f->inverse && f->shared && f->own && f->block && f->g
               ? 0
               : err_set(e, ERR_NOMEM, "no memory for the covariance of a joint fit of %zu points", f->n);
}

/* What a nuisance changes in the values of one band. */
void put_nuisances(const struct joint_form *f, const struct joint_data *d, const double *fitted,
                   Matrix *slopes) {
    for (int z = 0; z < f->all - f->k; z++) {
        for (size_t i = 0; i < f->n; i++) {
            double lobe, spot;
            nuisance_slope(d->p, z, i, &lobe, &spot);
            const double ratio = d->mean_beta[i] != 0 ? fitted[i] / d->mean_beta[i] : 1;
            (*slopes)(static_cast<Index>(i), f->k + z) = lobe + spot * ratio;
        }
    }
}

/* Slopes of one band's values: along the shared ones (n * all) and the inner parameters (n * inner). */
void form_band(const struct joint_form *f, const struct joint_data *d, const struct joint_solution *solution,
               const double *model, int band, Matrix *slopes, Matrix *own) {
    const struct joint_shape *shape = &f->shape;
    ConstCells of(shape->f, static_cast<Index>(shape->n), shape->functions);
    const double s = solution->s[band], t = solution->t[band];
    slopes->setZero(static_cast<Index>(f->n), f->all);
    own->resize(static_cast<Index>(f->n), f->inner);
    own->col(0) = of.col(JOINT_L1) + 2 * s * of.col(JOINT_L2);
    if (f->inner == 2) {
        own->col(1) = of.col(JOINT_P);
    }
    for (int j = 0; j < f->k; j++) {
        if (shape->l1[j] >= 0) {
            slopes->col(j) += s * of.col(shape->l1[j]) + s * s * of.col(shape->l2[j]);
        }
        if (shape->specular[j] >= 0) {
            slopes->col(j) += t * of.col(shape->specular[j]);
        }
    }
    put_nuisances(f, d, model + static_cast<size_t>(band) * f->n, slopes);
}

/* The responses of every band, the shared ones still without the inverse. */
void form_bands(struct joint_form *f, const struct joint_data *d, const struct joint_solution *solution,
                const double *model) {
    const Index n = static_cast<Index>(f->n), all = f->all, inner = f->inner;
    Cells schur(f->schur, all, all);
    for (int b = 0; b < f->bands; b++) {
        Matrix slopes, own;
        form_band(f, d, solution, model, b, &slopes, &own);
        Eigen::Map<const Vector> w(d->weight + b * d->n, n);
        const Matrix pulled = own.transpose() * w.asDiagonal();
        Cells block(f->block + b * inner * inner, inner, inner), answer(f->own + b * inner * n, inner, n);
        Cells g(f->g + b * inner * all, inner, all), shared(f->shared + b * all * n, all, n);
        block = pulled * own;
        answer = block.ldlt().solve(pulled);
        g = answer * slopes;
        slopes -= own * g;
        shared = slopes.transpose() * w.asDiagonal();
        schur += shared * slopes;
    }
    for (int z = 0; z < f->all - f->k; z++) {
        const double u = d->p->nuisance.of[z].u;
        schur(f->k + z, f->k + z) += 1 / (u * u);
    }
}

int invert(struct joint_form *f, struct err *e) {
    if (f->all == 0) {
        return 0;
    }
    Cells schur(f->schur, f->all, f->all), inverse(f->inverse, f->all, f->all);
    const Vector scale = schur.diagonal().cwiseSqrt().cwiseMax(1e-300).cwiseInverse();
    Eigen::SelfAdjointEigenSolver<Matrix> eigen(scale.asDiagonal() * schur * scale.asDiagonal());
    const double low = eigen.eigenvalues()(0), high = eigen.eigenvalues()(f->all - 1);
    if (!(low > 0 && std::sqrt(high / low) < CONDITION_MAX)) {
        return err_set(e, ERR_FIT,
                       "the bands together cannot tell the shared parameters apart: measure at more angles");
    }
    inverse = scale.asDiagonal() * eigen.eigenvectors() * eigen.eigenvalues().cwiseInverse().asDiagonal() *
              eigen.eigenvectors().transpose() * scale.asDiagonal();
    Cells shared(f->shared, f->all, static_cast<Index>(f->n) * f->bands);
    shared = (inverse * shared).eval();
    return 0;
}

int init(struct joint_form *f, const struct joint_data *d, const struct joint_solution *solution,
         const double *model, struct err *e) {
    bool held[COORDINATES_MAX];
    find_free(f, d, solution);
    std::transform(f->free, f->free + COORDINATES_MAX, held, [](bool is_free) { return !is_free; });
    int status = joint_shape_init(&f->shape, d->p, held, e);
    if (status || (status = joint_shape_at(&f->shape, solution->x, e))) {
        return status;
    }
    f->k = f->shape.k;
    f->all = f->k + d->p->nuisance.m;
    if ((status = allocate(f, e))) {
        return status;
    }
    form_bands(f, d, solution, model);
    return invert(f, e);
}

} // namespace

int joint_form_init(struct joint_form *f, const struct joint_data *d, const struct joint_solution *solution,
                    bool beta_prime_per_band, const double *model, struct err *e) {
    *f = {};
    f->inner = beta_prime_per_band ? 2 : 1;
    f->bands = d->n_bands;
    f->n = d->n;
    try {
        return init(f, d, solution, model, e);
    } catch (const std::bad_alloc &) {
        return err_set(e, ERR_NOMEM, "no memory for the covariance of a joint fit of %zu values",
                       d->n_values);
    }
}

void joint_form_free(struct joint_form *f) {
    joint_shape_free(&f->shape);
    std::free(f->schur);
    std::free(f->inverse);
    std::free(f->shared);
    std::free(f->own);
    std::free(f->block);
    std::free(f->g);
    *f = {};
}

/* At the minimum over all the rest only the priors' pull, and what the points want of the nuisances, is left: both are in
 * how the shared ones answer to the residuals. */
void joint_form_step(const struct joint_form *f, const struct joint_data *d, const double *model,
                     double step[NUISANCES_MAX]) {
    ConstCells inverse(f->inverse, f->all, f->all);
    for (int z = 0; z < f->all - f->k; z++) {
        step[z] = 0;
        for (int b = 0; b < f->bands; b++) {
            ConstCells shared(f->shared + static_cast<size_t>(b * f->all) * f->n, f->all,
                              static_cast<Index>(f->n));
            for (size_t i = 0; i < f->n; i++) {
                const size_t at = static_cast<size_t>(b) * f->n + i;
                const double rest = d->weight[at] > 0 ? d->beta[at] - model[at] : 0;
                step[z] += shared(f->k + z, static_cast<Index>(i)) * rest;
            }
        }
        for (int y = 0; y < f->all - f->k; y++) {
            const struct nuisance *other = &d->p->nuisance.of[y];
            step[z] -= inverse(f->k + z, f->k + y) * (other->at - other->mean) / (other->u * other->u);
        }
    }
}
