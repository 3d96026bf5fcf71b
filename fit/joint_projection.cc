#include "fit/joint_projection.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace {

constexpr int INNER_STEPS = 12;     /* the quadratic part is a few per cent: four reach the last bits */
constexpr double INNER_END = 1e-15; /* relative step */
constexpr double NO_LOBE = 1e-12;   /* of a band: S and t are then one number */

double *room_of(size_t n) {
    return static_cast<double *>(std::calloc(n + 1, sizeof(double)));
}

} // namespace

/* A column of the Jacobian of a band, as a combination of the shape's functions. */
struct Projection::combination {
    int function[3];
    double factor[3];
    int count;

    void add(int f, double x) {
        if (f >= 0) {
            function[count] = f;
            factor[count++] = x;
        }
    }
};

Projection::Projection(const struct joint_data *d, const double *start, bool per_band)
    : d_(d), per_band_(per_band), width_(reflectance_batch_width()) {
    std::fill(s_, s_ + BANDS, 0.1);
    std::fill(t_, t_ + BANDS, 1.0);
    std::copy(start, start + d->p->k, x_);
}

Projection::~Projection() {
    joint_shape_free(&shape_);
    for (double *room : {row_, moments_, pulled_, weighted_beta_, weighted_residual_}) {
        std::free(room);
    }
}

int Projection::init(struct err *e) {
    const size_t cells = d_->n_bands * d_->n;
    bool held[COORDINATES_MAX] = {};
    for (int c = 0; c < d_->p->k; c++) {
        held[c] = per_band_ && reflectance_parameter(d_->p->model, c) == MATERIAL_BETA_PRIME;
    }
    int status = joint_shape_init(&shape_, d_->p, held, e);
    if (status) {
        return status;
    }
    const size_t widest = moments_room(moments_products(shape_.functions));
    row_ = room_of(d_->n * widest);
    moments_ = room_of(d_->n_bands * widest);
    pulled_ = room_of(d_->n_bands * moments_room(shape_.functions));
    weighted_beta_ = room_of(cells);
    weighted_residual_ = room_of(cells);
    if (!row_ || !moments_ || !pulled_ || !weighted_beta_ || !weighted_residual_) {
        return err_set(e, ERR_NOMEM, "no memory for a joint fit of %zu values", cells);
    }
    for (size_t c = 0; c < cells; c++) {
        weighted_beta_[c] = d_->weight[c] * d_->beta[c];
    }
    return 0;
}

void Projection::take_moments(int functions) {
    const size_t columns = moments_products(functions);
    room_ = moments_room(columns);
    moments_lay_products(shape_.f, d_->n, functions, row_);
    moments_take(width_, d_->weight, d_->n, d_->n_bands, row_, columns, moments_);
}

/* Sums over points of weight f for the first functions. */
void Projection::pull(const double *weight, int functions) {
    pulled_room_ = moments_room(functions);
    moments_lay(shape_.f, d_->n, functions, row_);
    moments_take(width_, weight, d_->n, d_->n_bands, row_, functions, pulled_);
}

/* Gauss-Newton for S, and for t where it is free, on the moments alone. */
void Projection::solve_inside(int band) {
    double s = s_[band], t = t_[band];
    for (int step = 0; step < INNER_STEPS; step++) {
        double off[3];
        for (int f = 0; f < 3; f++) {
            off[f] = moment(band, f, JOINT_L1) * s + moment(band, f, JOINT_L2) * s * s +
                     moment(band, f, JOINT_P) * t - pulled(band, f);
        }
        const double g = off[JOINT_L1] + 2 * s * off[JOINT_L2];
        const double h = moment(band, JOINT_L1, JOINT_L1) + 4 * s * moment(band, JOINT_L1, JOINT_L2) +
                         4 * s * s * moment(band, JOINT_L2, JOINT_L2);
        const double cross = moment(band, JOINT_L1, JOINT_P) + 2 * s * moment(band, JOINT_L2, JOINT_P);
        const double hp = moment(band, JOINT_P, JOINT_P), det = h * hp - cross * cross;
        double ds = g / h, dt = 0;
        if (per_band_ && det > NO_LOBE * h * hp) {
            ds = (hp * g - cross * off[JOINT_P]) / det;
            dt = (h * off[JOINT_P] - cross * g) / det;
        }
        s -= ds;
        t -= dt;
        if (std::fabs(ds) <= INNER_END * std::fabs(s) && std::fabs(dt) <= INNER_END * std::fabs(t)) {
            break;
        }
    }
    s_[band] = s;
    t_[band] = t;
}

double Projection::take_residuals() {
    double cost = 0;
    for (int b = 0; b < d_->n_bands; b++) {
        const size_t at = b * d_->n;
        cost += moments_residuals(width_, shape_.f, d_->n, s_[b], t_[b], d_->beta + at, d_->weight + at,
                                  weighted_residual_ + at);
    }
    return cost;
}

double Projection::dot(int band, const struct combination &x, const struct combination &y) const {
    double sum = 0;
    for (int i = 0; i < x.count; i++) {
        for (int j = 0; j < y.count; j++) {
            sum += x.factor[i] * y.factor[j] * moment(band, x.function[i], y.function[j]);
        }
    }
    return sum;
}

void Projection::combine(int band, struct combination *outer, struct combination *own) const {
    const double s = s_[band];
    for (int j = 0; j < shape_.k; j++) {
        outer[j].add(shape_.l1[j], s);
        outer[j].add(shape_.l2[j], s * s);
        outer[j].add(shape_.specular[j], t_[band]);
    }
    own[0].add(JOINT_L1, 1);
    own[0].add(JOINT_L2, 2 * s);
    own[1].add(JOINT_P, 1);
}

/* One band's part of the outer problem: its normal block less what S and t take up. */
void Projection::project(int band, double *gradient, double *normal) const {
    const int k = shape_.k;
    struct combination outer[COORDINATES_MAX] = {}, own[2] = {};
    double cross[2][COORDINATES_MAX] = {}, taken[2][COORDINATES_MAX] = {};
    combine(band, outer, own);
    const double h = dot(band, own[0], own[0]), hp = per_band_ ? dot(band, own[1], own[1]) : 1;
    const double mixed = per_band_ ? dot(band, own[0], own[1]) : 0, det = h * hp - mixed * mixed;
    const bool both = per_band_ && det > NO_LOBE * h * hp; /* else t stays */
    for (int j = 0; j < k; j++) {
        cross[0][j] = dot(band, own[0], outer[j]);
        cross[1][j] = both ? dot(band, own[1], outer[j]) : 0;
        taken[0][j] = both ? (hp * cross[0][j] - mixed * cross[1][j]) / det : cross[0][j] / h;
        taken[1][j] = both ? (h * cross[1][j] - mixed * cross[0][j]) / det : 0;
    }
    for (int j = 0; j < k; j++) {
        for (int i = 0; i < outer[j].count; i++) {
            gradient[j] += outer[j].factor[i] * pulled(band, outer[j].function[i]);
        }
        for (int i = 0; i <= j; i++) {
            const double sum =
                dot(band, outer[i], outer[j]) - cross[0][i] * taken[0][j] - cross[1][i] * taken[1][j];
            normal[i * k + j] += sum;
            normal[j * k + i] += i == j ? 0 : sum;
        }
    }
}

bool Projection::evaluate(const double *x, double *cost, double *gradient, double *normal) {
    const int k = shape_.k;
    for (int j = 0; j < k; j++) {
        x_[shape_.column[j]] = x[j];
    }
    if (joint_shape_at(&shape_, x_, nullptr)) {
        return false;
    }
    evaluations_++;
    take_moments(normal ? shape_.functions : JOINT_P + 1);
    pull(weighted_beta_, JOINT_P + 1);
    for (int b = 0; b < d_->n_bands; b++) {
        solve_inside(b);
    }
    *cost = take_residuals();
    if (normal) {
        pull(weighted_residual_, shape_.functions);
        std::fill(gradient, gradient + k, 0.0);
        std::fill(normal, normal + k * k, 0.0);
        for (int b = 0; b < d_->n_bands; b++) {
            project(b, gradient, normal);
        }
    }
    return std::isfinite(*cost);
}

void Projection::report(struct joint_solution *out, double *model) const {
    const double *l1 = shape_.f, *l2 = l1 + d_->n, *p = l2 + d_->n;
    std::copy(x_, x_ + d_->p->k, out->x);
    coordinates_order(d_->p->model, out->x);
    for (int b = 0; b < d_->n_bands; b++) {
        out->s[b] = s_[b];
        out->t[b] = t_[b];
        for (size_t i = 0; model && i < d_->n; i++) {
            model[b * d_->n + i] = s_[b] * l1[i] + s_[b] * s_[b] * l2[i] + t_[b] * p[i];
        }
    }
    out->evaluations += evaluations_;
}
