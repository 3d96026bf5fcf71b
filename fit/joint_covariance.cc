#include "fit/joint_covariance.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <new>
#include <vector>

#include <Eigen/Dense>

#include "fit/drift.h"
#include "fit/joint_form.h"
#include "fit/quality.h"

namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;
using Index = Eigen::Index;
using ConstCells = Eigen::Map<const Matrix>;

/* White noise of pixels under triangles of 10 nm base every 5 nm: (1/6) / (2/3). */
constexpr double NEIGHBOURS = 0.25;

/* What a displacement of one value in every band does: to the shared coordinates (k * bands), and to the inner
 * parameters of the band itself with the shared ones held (inner * bands). */
struct response {
    Matrix shared, own;
};

/* Covariance of (shared, inner with the shared held): the raw form in which every part of V is added. */
class Parts {
  public:
    Parts(int k, int inner, int bands)
        : k_(k), inner_(inner), bands_(bands), sum(Matrix::Zero(size(), size())) {
    }
    int size() const {
        return k_ + inner_ * bands_;
    }
    /* The bands correlated by c. */
    void add(const response &r, const Matrix &c) {
        const Matrix moved = r.shared * c;
        sum.topLeftCorner(k_, k_) += moved * r.shared.transpose();
        for (int a = 0; a < inner_; a++) {
            const Matrix cross = moved * r.own.row(a).asDiagonal();
            sum.block(0, k_ + a * bands_, k_, bands_) += cross;
            sum.block(k_ + a * bands_, 0, bands_, k_) += cross.transpose();
            for (int b = 0; b < inner_; b++) {
                sum.block(k_ + a * bands_, k_ + b * bands_, bands_, bands_) +=
                    r.own.row(a).asDiagonal() * c * r.own.row(b).asDiagonal();
            }
        }
    }
    /* All bands as one. */
    Vector together(const response &r) const {
        Vector v(size());
        v.head(k_) = r.shared.rowwise().sum();
        for (int a = 0; a < inner_; a++) {
            v.segment(k_ + a * bands_, bands_) = r.own.row(a).transpose();
        }
        return v;
    }

  private:
    int k_, inner_, bands_;

  public:
    Matrix sum;
};

class Covariance {
  public:
    Covariance(const struct joint_data *d, const struct joint_solution *solution, bool per_band,
               const double *model, struct joint *out)
        : d_(d), in_(d->p->input), solution_(solution), model_(model), out_(out), inner_(per_band ? 2 : 1) {
    }
    ~Covariance() {
        joint_form_free(&form_);
    }
    Covariance(const Covariance &) = delete;
    Covariance &operator=(const Covariance &) = delete;

    int run(struct err *e);

  private:
    void tell_bounds();
    ConstCells shared(int band) const {
        return {form_.shared + static_cast<size_t>(band * form_.all) * form_.n, form_.all, size()};
    }
    ConstCells own(int band) const {
        return {form_.own + static_cast<size_t>(band * form_.inner) * form_.n, form_.inner, size()};
    }
    ConstCells block(int band) const {
        return {form_.block + band * form_.inner * form_.inner, form_.inner, form_.inner};
    }
    ConstCells g(int band) const {
        return {form_.g + band * form_.inner * form_.all, form_.inner, form_.all};
    }
    Index size() const {
        return static_cast<Index>(form_.n);
    }
    Matrix point_covariance(size_t i) const;
    response response_of(size_t i) const;
    double explained(const Matrix &raw) const;
    void add_expectation(double seen, double before, const Matrix &raw);
    void add_independent(Parts *p);
    void add_drift(Parts *p);
    void add_causes(Parts *p);
    response add_cause(Parts *p, const struct estimate_common *c, double scale, const double *spot);
    void add_own_causes(Parts *p);
    double change_of(const struct estimate_common *c, size_t at, size_t i, int band,
                     const double *spot) const;
    double togetherness(const struct estimate_common *c) const;
    Matrix to_rows() const;
    Vector inflation(const Matrix &rows, const Matrix &statistical) const;
    void store_nuisances(const Parts &statistical);
    int store(const Parts &statistical, const Parts &common, struct err *e);
    size_t cell(int band, size_t i) const {
        return static_cast<size_t>(band) * d_->n + i;
    }

    const struct joint_data *d_;
    const struct estimate_input *in_;
    const struct joint_solution *solution_;
    const double *model_;
    struct joint *out_;
    int inner_;
    struct joint_form form_ = {};
    double expected_ = 0, variance_ = 0;
    double nuisance_u2_[NUISANCES_MAX] = {}; /* of how far each is from what it was, by the common causes */
};

void Covariance::tell_bounds() {
    for (int c = 0; c < d_->p->k; c++) {
        const enum material_parameter parameter = reflectance_parameter(d_->p->model, c);
        out_->at_bound[parameter] = parameter != MATERIAL_S && problem_at_bound(d_->p, c, solution_->x[c]);
    }
}

response Covariance::response_of(size_t i) const {
    response r{Matrix(form_.all, d_->n_bands), Matrix(inner_, d_->n_bands)};
    for (int b = 0; b < d_->n_bands; b++) {
        r.shared.col(b) = shared(b).col(static_cast<Index>(i));
        r.own.col(b) = own(b).col(static_cast<Index>(i));
    }
    return r;
}

/* B_p of measurement.md 8, with the angle part. */
Matrix Covariance::point_covariance(size_t i) const {
    const int n = d_->n_bands;
    Vector u(n);
    for (int b = 0; b < n; b++) {
        u(b) = d_->u[cell(b, i)];
    }
    Matrix c = d_->share[i] * u * u.transpose();
    for (int b = 0; b < n; b++) {
        c(b, b) = u(b) * u(b);
        const double rho = d_->rho_next[cell(b, i)];
        if (b + 1 < n && std::isfinite(rho)) {
            c(b, b + 1) = c(b + 1, b) = rho * u(b) * u(b + 1);
        }
    }
    c.array() += d_->p->angle_u2[i];
    return c;
}

/* tr(J^T W J C) of a covariance in raw form: what the fit takes up of a part of chi-square. */
double Covariance::explained(const Matrix &raw) const {
    const int k = form_.all, n = d_->n_bands;
    double sum = ConstCells(form_.schur, k, k).cwiseProduct(raw.topLeftCorner(k, k)).sum();
    for (int b = 0; b < n; b++) {
        for (int x = 0; x < inner_; x++) {
            for (int y = 0; y < inner_; y++) {
                sum += block(b)(x, y) * raw(k + x * n + b, k + y * n + b);
            }
        }
    }
    return sum;
}

/* A correlated part that `seen` of chi-square came with, of which the fit has taken up what raw gained since. */
void Covariance::add_expectation(double seen, double before, const Matrix &raw) {
    const double left = std::max(seen - (explained(raw) - before), 0.0);
    expected_ += left;
    variance_ += 4 * left + 2 * left * left;
}

void Covariance::add_independent(Parts *p) {
    double seen = 0, square = 0;
    for (size_t i = 0; i < d_->n; i++) {
        const Matrix c = point_covariance(i);
        p->add(response_of(i), c);
        for (int a = 0; a < d_->n_bands; a++) {
            const double wa = d_->weight[cell(a, i)];
            seen += wa * c(a, a);
            for (int b = 0; b < d_->n_bands && wa > 0; b++) {
                square += wa * d_->weight[cell(b, i)] * c(a, b) * c(a, b);
            }
        }
    }
    expected_ = std::max(seen - explained(p->sum), 1e-300);
    variance_ = 2 * square;
    if (!in_->u_ind) { /* no uncertainty given: the scatter has to tell */
        p->sum *= solution_->chi2 / expected_;
        variance_ *= solution_->chi2 / expected_ * (solution_->chi2 / expected_);
        expected_ = solution_->chi2;
    }
}

void Covariance::add_drift(Parts *p) {
    for (size_t x = 0; x < in_->n_bracket; x++) {
        const struct estimate_bracket *bracket = &in_->bracket[x];
        const Index n = static_cast<Index>(bracket->point ? bracket->n : d_->n);
        if (n == 0 || bracket->rate == 0) {
            continue;
        }
        Matrix moved(p->size(), n), drift(n, n);
        double seen = 0;
        for (Index a = 0; a < n; a++) {
            const size_t i = bracket->point ? static_cast<size_t>(bracket->point[a]) : static_cast<size_t>(a);
            response r = response_of(i);
            double weighed = 0;
            for (int b = 0; b < d_->n_bands; b++) { /* the lamp drifts as a whole */
                const double beta = model_[cell(b, i)];
                r.shared.col(b) *= beta;
                r.own.col(b) *= beta;
                weighed += d_->weight[cell(b, i)] * beta * beta;
            }
            moved.col(a) = p->together(r);
            for (Index c = 0; c < n; c++) {
                drift(a, c) = drift_covariance(bracket, static_cast<size_t>(a), static_cast<size_t>(c));
            }
            seen += weighed * drift(a, a);
        }
        const double before = explained(p->sum);
        p->sum += moved * drift * moved.transpose();
        add_expectation(seen, before, p->sum);
    }
}

/* How far a cause moves all bands as one, 0..1: what its mean keeps of its bands, beside what noise would keep. */
double Covariance::togetherness(const struct estimate_common *c) const {
    double seen = 0, room = 0;
    const size_t n = c->bands ? (c->point ? c->n : d_->n) : 0;
    for (size_t x = 0; x < n; x++) {
        double sum = 0, noise = 0, last = 0;
        int count = 0;
        for (int band = 0; band < BANDS; band++) {
            if (band_nm(band) < in_->mean_low_nm || band_nm(band) > in_->mean_high_nm) {
                continue;
            }
            const double here = c->bands[x * BANDS + band];
            sum += here;
            noise += here * here + 2 * NEIGHBOURS * here * last;
            last = here;
            count++;
        }
        if (std::isfinite(sum) && std::isfinite(c->mean[x])) {
            seen += c->mean[x] * c->mean[x] * count * count - noise;
            room += sum * sum - noise;
        }
    }
    return room > 0 ? std::min(std::max(seen / room, 0.0), 1.0) : 1;
}

double Covariance::change_of(const struct estimate_common *c, size_t at, size_t i, int band,
                             const double *spot) const {
    const double fitted = model_[cell(band, i)];
    const double ratio = d_->mean_beta[i] != 0 ? fitted / d_->mean_beta[i] : 1;
    if (spot) { /* an angle moves the lobe, which has no colour; K moves every band in proportion */
        return c->mean[at] + spot[i] * ratio;
    }
    const double own = c->bands ? c->bands[at * BANDS + d_->band[band]] : NAN;
    return std::isfinite(own) ? own : c->mean[at] * ratio;
}

/* Returns what the cause does to the parameters, band by band. */
response Covariance::add_cause(Parts *p, const struct estimate_common *c, double scale, const double *spot) {
    const int n = d_->n_bands;
    const size_t count = c->point ? c->n : d_->n;
    response sum{Matrix::Zero(form_.all, n), Matrix::Zero(inner_, n)};
    double seen = 0;
    for (size_t x = 0; x < count; x++) {
        const size_t i = c->point ? static_cast<size_t>(c->point[x]) : x;
        for (int b = 0; b < n; b++) {
            if (d_->weight[cell(b, i)] == 0) {
                continue;
            }
            const double change = scale * change_of(c, x, i, b, spot);
            sum.shared.col(b) += shared(b).col(static_cast<Index>(i)) * change;
            sum.own.col(b) += own(b).col(static_cast<Index>(i)) * change;
            seen += d_->weight[cell(b, i)] * change * change;
        }
    }
    const double together = spot ? 1 : togetherness(c), before = explained(p->sum);
    Matrix correlation = Matrix::Constant(n, n, together);
    for (int b = 0; b < n; b++) {
        correlation(b, b) = 1;
        if (b + 1 < n && d_->band[b + 1] == d_->band[b] + 1) {
            correlation(b, b + 1) = correlation(b + 1, b) = together + (1 - together) * NEIGHBOURS;
        }
    }
    p->add(sum, correlation);
    add_expectation(seen, before, p->sum);
    return sum;
}

void Covariance::add_causes(Parts *p) {
    for (size_t c = 0; c < in_->n_common; c++) {
        add_cause(p, &in_->common[c], 1, nullptr);
    }
    for (int z = 0; z < form_.all - form_.k; z++) {
        nuisance_u2_[z] = p->sum(form_.k + z, form_.k + z);
    }
    add_own_causes(p);
}

/* A zero or P moves the nuisance that stands for it: what is left between both is the nuisance's error. */
void Covariance::add_own_causes(Parts *p) {
    const std::vector<double> none(d_->n + 1);
    struct nuisance_cause own[NUISANCE_CAUSES];
    const int n_own = nuisance_causes(d_->p, none.data(), own);
    for (int c = 0; c < n_own; c++) {
        const struct estimate_common cause = {d_->n, nullptr, own[c].slope, nullptr};
        const response moved = add_cause(p, &cause, own[c].u, own[c].spot);
        for (int z = 0; z < form_.all - form_.k; z++) {
            const bool its = d_->p->nuisance.of[z].kind == own[c].kind;
            const double left = moved.shared.row(form_.k + z).sum() - (its ? own[c].share * own[c].u : 0);
            nuisance_u2_[z] += left * left;
        }
    }
}

/* From the raw form to the rows of the answer, in parameters; names the rows as it goes. */
Matrix Covariance::to_rows() const {
    const int k = form_.k, all = form_.all, n = d_->n_bands;
    const struct joint_shape *shape = &form_.shape;
    double value[MATERIAL_PARAMETERS], cells[COORDINATES_MAX * COORDINATES_MAX];
    coordinates_to_value(d_->p->model, solution_->x, value);
    coordinates_chain(d_->p->model, value, cells);
    Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> chain(
        cells, d_->p->k, d_->p->k);
    Matrix rows = Matrix::Zero(k + inner_ * n, all + inner_ * n);
    for (int i = 0; i < k; i++) {
        out_->row[i] = {static_cast<int>(reflectance_parameter(d_->p->model, shape->column[i])), -1};
        for (int j = 0; j < k; j++) {
            rows(i, j) = chain(shape->column[i], shape->column[j]);
        }
    }
    for (int b = 0; b < n; b++) {
        for (int a = 0; a < inner_; a++) {
            const int at = k + a * n + b;
            const double scale = a == 0 ? 1 : value[MATERIAL_BETA_PRIME];
            out_->row[at] = {a == 0 ? MATERIAL_S : MATERIAL_BETA_PRIME, d_->band[b]};
            rows(at, all + a * n + b) = scale;
            rows.row(at).head(all) = -scale * g(b).row(a);
        }
    }
    for (int c = 0; c < d_->p->k && inner_ == 2; c++) { /* A held, beta' of each band answers to n */
        for (int j = 0; j < k && reflectance_parameter(d_->p->model, c) == MATERIAL_BETA_PRIME; j++) {
            for (int b = 0; b < n; b++) {
                rows(k + n + b, j) += solution_->t[b] * chain(c, shape->column[j]);
            }
        }
    }
    return rows;
}

/* Factor on each row's statistical u by the scatter of whole sweeps of one incidence, at least the plain scatter's. */
Vector Covariance::inflation(const Matrix &rows, const Matrix &statistical) const {
    const Parts form(form_.all, inner_, d_->n_bands);
    std::map<double, Vector> score;
    for (size_t i = 0; i < d_->n; i++) {
        response r = response_of(i);
        for (int b = 0; b < d_->n_bands; b++) {
            const double rest = d_->beta[cell(b, i)] - model_[cell(b, i)];
            r.shared.col(b) *= rest;
            r.own.col(b) *= rest;
        }
        Vector &sum =
            score.try_emplace(std::round(in_->theta_i_deg[i]), Vector::Zero(form.size())).first->second;
        sum += form.together(r);
    }
    const double sweeps = static_cast<double>(score.size());
    Vector sandwich = Vector::Zero(rows.rows());
    for (const auto &sweep : score) {
        sandwich += (rows * sweep.second).cwiseAbs2() * (sweeps / std::max(sweeps - 1, 1.0));
    }
    Vector factor(rows.rows());
    for (Index i = 0; i < rows.rows(); i++) {
        const double ratio = statistical(i, i) > 0 ? sandwich(i) / statistical(i, i) : 1;
        factor(i) = std::sqrt(std::max({1.0, solution_->chi2 / expected_, ratio}));
    }
    return factor;
}

void Covariance::store_nuisances(const Parts &statistical) {
    const int m = form_.all - form_.k;
    Matrix rows = Matrix::Zero(m, statistical.size());
    rows.middleCols(form_.k, m).setIdentity();
    const Matrix s = rows * statistical.sum * rows.transpose();
    const Vector factor = out_->misfit ? inflation(rows, s) : Vector::Ones(m);
    for (int z = 0; z < m; z++) {
        const double u = std::sqrt(s(z, z) * factor(z) * factor(z) + nuisance_u2_[z]);
        (d_->p->nuisance.of[z].kind == NUISANCE_OFFSET ? out_->u_mirror_offset_deg : out_->u_polarisation) =
            u;
    }
}

int Covariance::store(const Parts &statistical, const Parts &common, struct err *e) {
    const Matrix rows = to_rows();
    Matrix s = rows * statistical.sum * rows.transpose(), c = rows * common.sum * rows.transpose();
    out_->chi2_expected = expected_;
    out_->misfit = in_->u_ind && solution_->chi2 > quality_chi2_limit(expected_, variance_);
    if (out_->misfit) {
        const Vector factor = inflation(rows, s);
        s = factor.asDiagonal() * s * factor.asDiagonal();
    }
    store_nuisances(statistical);
    int status = joint_allocate(out_, static_cast<int>(s.rows()), e);
    for (Index i = 0; i < s.rows() && !status; i++) { /* symmetric to the last bit */
        for (Index j = 0; j < s.rows(); j++) {
            out_->statistical[i * s.rows() + j] = (s(i, j) + s(j, i)) / 2;
            out_->common[i * s.rows() + j] = (c(i, j) + c(j, i)) / 2;
        }
    }
    return status;
}

int Covariance::run(struct err *e) {
    tell_bounds();
    int status = joint_form_init(&form_, d_, solution_, inner_ == 2, model_, e);
    if (status) {
        return status;
    }
    Parts statistical(form_.all, inner_, d_->n_bands), common(form_.all, inner_, d_->n_bands);
    add_independent(&statistical);
    add_drift(&statistical);
    add_causes(&common);
    return store(statistical, common, e);
}

} // namespace

int joint_covariance(const struct joint_data *d, const struct joint_solution *solution,
                     bool beta_prime_per_band, const double *model, struct joint *joint, struct err *e) {
    try {
        return Covariance(d, solution, beta_prime_per_band, model, joint).run(e);
    } catch (const std::bad_alloc &) {
        return err_set(e, ERR_NOMEM, "no memory for the covariance of a joint fit of %zu values",
                       d->n_values);
    }
}
