#include "fit/verdict.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "fit/suggest.h"
#include "fit/crossval.h"
#include "fit/gap.h"
#include "fit/instrument.h"
#include "fit/limit.h"
#include "fit/misfit.h"
#include "fit/profile.h"
#include "fit/quality.h"
#include "fit/words.h"

namespace {

/* A logarithmic uncertainty of 0.5 is a factor 1.65 either way: the value is then a guess, not a result. */
constexpr double U_LN_MAX = 0.5;
constexpr double STEP_LEFT_U = 0.1; /* of a parameter's u */
constexpr size_t FLANK_POINTS_MIN = 2;
constexpr double NARROWEST_RAD =
    0.01; /* the lower bound of gamma: half of such a lobe is seen at this distance */
constexpr double Z_95 = 1.6448536269514722; /* one-sided */

class Verdict {
  public:
    Verdict(struct settled *fit, struct estimate *out)
        : fit_(fit), p_(&fit->p), in_(fit->p.input), out_(out), k_(fit->p.k) {
    }
    ~Verdict() {
        uncertainty_free(&u_);
    }
    Verdict(const Verdict &) = delete;
    Verdict &operator=(const Verdict &) = delete;

    int fill(struct err *e);

  private:
    void find_bounds();
    bool hangs_on_lost_lobe(int column, const bool *lost) const;
    bool is_settled();
    int refuse(struct err *e);
    int fill_quality(struct err *e);
    int judge_misfit(double chi2, struct err *e);
    double profile_scale(int column) const;
    int stretch_flat(struct err *e);
    void fill_covariance();
    int fill_limit(int column, struct err *e);
    void add_shift(int column, const double *x_at_limit);
    void clear_bound_rows();
    void find_lost_lobe();
    void find_unsampled();
    void add_saturation(int column);
    int find_gaps(struct err *e);
    void warn_physics();
    int fill_spectrum(struct err *e);
    double relative_u(int column) const;
    bool has(enum material_parameter wanted) const {
        return reflectance_column(p_->model, wanted) >= 0;
    }
    enum material_parameter parameter(int column) const {
        return reflectance_parameter(p_->model, column);
    }
    const char *name(int column) const {
        const enum material_parameter at = parameter(column);
        return at == MATERIAL_BETA_PRIME ? "beta'" : material_parameter_name(out_->model, at);
    }

    struct settled *fit_;
    struct problem *p_;
    const struct estimate_input *in_;
    struct estimate *out_;
    int k_;
    struct uncertainty u_ = {};
    bool free_[COORDINATES_MAX] = {};
    bool open_[COORDINATES_MAX] = {}; /* still moving where the solver ended */
    struct misfit misfit_ = {};
};

void Verdict::find_bounds() {
    const double *x = fit_->best.x;
    for (int j = 0; j < k_; j++) {
        free_[j] = !problem_at_bound(p_, j, x[j]);
        out_->at_bound[parameter(j)] = !free_[j];
    }
    for (int j = 0; j < k_; j++) { /* without a lobe nothing in the data knows its width, tail or index */
        if (hangs_on_lost_lobe(j, out_->at_bound)) {
            free_[j] = false;
            out_->not_identifiable[parameter(j)] = true;
        }
    }
}

/* The index is told by either lobe. */
bool Verdict::hangs_on_lost_lobe(int column, const bool *lost) const {
    const bool first = lost[MATERIAL_BETA_PRIME], second = lost[MATERIAL_EXTRA_2];
    switch (reflectance_kind(p_->model, parameter(column))) {
    case REFLECTANCE_WIDTH:
        return parameter(column) == MATERIAL_GAMMA ? first : second;
    case REFLECTANCE_TAIL:
        return first;
    case REFLECTANCE_INDEX:
        return first && (second || !has(MATERIAL_EXTRA_2));
    default:
        return false;
    }
}

/* A solver may creep along a valley so flat that its end is of no account: what one more Newton step would move is
 * then far inside the u of each parameter, and what the valley leaves open shows in that u. */
bool Verdict::is_settled() {
    bool settled = true;
    for (int j = 0; j < k_ && !fit_->best.converged; j++) {
        double step = 0;
        for (size_t i = 0; free_[j] && i < p_->n; i++) {
            step += u_.h[j * p_->n + i] * (in_->beta[i] - p_->model_beta[i]);
        }
        open_[j] = !(std::fabs(step) <= STEP_LEFT_U * std::sqrt(u_.independent[j * k_ + j]));
        settled = settled && !open_[j];
    }
    return settled;
}

int Verdict::refuse(struct err *e) {
    const bool moving = std::any_of(open_, open_ + k_, [](bool open) { return open; });
    std::string names;
    int worst = 0;
    for (int j = 0; j < k_; j++) {
        if (moving ? open_[j] : free_[j] && std::fabs(u_.weakest[j]) > 0.3) {
            names += (names.empty() ? "" : ", ") + std::string(name(j));
        }
        worst = std::fabs(u_.weakest[j]) > std::fabs(u_.weakest[worst]) ? j : worst;
    }
    struct suggestion next = {};
    int status = suggest_next(p_, fit_->value, u_.fisher, worst, &next, e);
    words_refuse(
        out_,
        "these points do not determine %s (%s; condition of the Jacobian %.0e): measure on, best next at "
        "incidence %g deg, viewing %g deg",
        names.empty() ? "the parameters" : names.c_str(), moving ? "the fit does not settle" : "singular",
        u_.condition, next.theta_i_deg, next.theta_v_deg);
    return status;
}

int Verdict::judge_misfit(double chi2, struct err *e) {
    int status = misfit_judge(&misfit_, p_, &u_, chi2, e);
    if (!status && misfit_.is && in_->u_ind) {
        words_warn(
            out_,
            "the model does not fit: chi-square %.4g, expected %.4g, 99.9 %% point %.4g; the parameters are "
            "descriptive, u from sweep scatter",
            chi2, u_.chi2_expected, misfit_.limit);
    } else if (!status && misfit_.is) {
        words_warn(
            out_,
            "the model does not fit: neighbours in a sweep lie on the same side of it; the parameters are "
            "descriptive, u from sweep scatter");
    }
    return status ? status : misfit_inflate(&misfit_, &u_, p_, e);
}

int Verdict::fill_quality(struct err *e) {
    double scaled = 0;
    for (size_t i = 0; i < p_->n; i++) {
        const double r = (in_->beta[i] - p_->model_beta[i]) / p_->u[i];
        scaled += r * r;
    }
    scaled += nuisance_chi2(p_);
    int status = judge_misfit(scaled, e);
    const double n = static_cast<double>(p_->n), worth = misfit_.n_effective;
    out_->chi2 = in_->u_ind ? scaled : n - k_;
    const bool in_u = p_->loss == MATERIAL_LOSS_ML;
    out_->bic = quality_bic(in_u ? scaled : problem_chi2(p_), n, worth, k_, in_u);
    out_->n_effective = worth;
    out_->r2 = quality_r2(p_);
    out_->minimised = p_->loss;
    problem_losses(p_, out_->loss);
    out_->q = p_->optics.q;
    out_->specular_energy = quality_specular_energy(p_->model, fit_->value);
    if (in_->cross_validate && crossval_loio(p_, &fit_->best, &out_->loio, nullptr)) {
        out_->loio = 0;
    }
    return status ? status : quality_median_error(p_, &out_->median_relative_error, e);
}

/* Lets u grow where chi-square is flatter than the parabola it comes from. */
int Verdict::stretch_flat(struct err *e) {
    double factor[COORDINATES_MAX];
    for (int j = 0; j < k_; j++) {
        const int at = j * k_ + j;
        const double u = std::sqrt(u_.independent[at] + u_.drift[at] + u_.common[at]);
        factor[j] = 1;
        if (free_[j] && u > PROFILE_FROM) {
            int status = profile_stretch(p_, &fit_->best, j, u, profile_scale(j), &factor[j], e);
            if (status) {
                return status;
            }
        }
    }
    for (int a = 0; a < k_; a++) {
        for (int b = 0; b < k_; b++) {
            u_.independent[a * k_ + b] *= factor[a] * factor[b];
            u_.drift[a * k_ + b] *= factor[a] * factor[b];
            u_.common[a * k_ + b] *= factor[a] * factor[b];
        }
    }
    return 0;
}

void Verdict::fill_covariance() {
    double chain[UNCERTAINTY_CELLS];
    coordinates_chain(p_->model, fit_->value, chain);
    std::copy(fit_->value, fit_->value + MATERIAL_PARAMETERS, out_->value);
    for (int a = 0; a < k_; a++) {
        for (int b = 0; b < k_; b++) {
            double statistical = 0, common = 0;
            for (int x = 0; x < k_; x++) {
                for (int y = 0; y < k_; y++) {
                    const double factor = chain[a * k_ + x] * chain[b * k_ + y];
                    statistical += factor * (u_.independent[x * k_ + y] + u_.drift[x * k_ + y]);
                    common += factor * u_.common[x * k_ + y];
                }
            }
            out_->statistical[parameter(a)][parameter(b)] = statistical;
            out_->common[parameter(a)][parameter(b)] = common;
        }
    }
}

/* What the others move while a parameter walks from its bound to its limit, as a standard uncertainty. */
void Verdict::add_shift(int column, const double *x_at_limit) {
    double moved[MATERIAL_PARAMETERS], shift[MATERIAL_PARAMETERS] = {};
    coordinates_to_value(p_->model, x_at_limit, moved);
    for (int j = 0; j < k_; j++) {
        if (j != column && free_[j]) {
            const double value = out_->value[parameter(j)], size = moved[parameter(j)];
            const bool linear = reflectance_kind(p_->model, parameter(j)) == REFLECTANCE_TAIL;
            const double moved_ln = linear ? 0 : value * std::log(size / value);
            shift[parameter(j)] =
                (std::fabs(moved_ln) > std::fabs(size - value) ? moved_ln : size - value) / Z_95;
        }
    }
    for (int a = 0; a < MATERIAL_PARAMETERS; a++) {
        for (int b = 0; b < MATERIAL_PARAMETERS; b++) {
            out_->statistical[a][b] += shift[a] * shift[b];
        }
    }
}

/* What a rise of the cost by one is in units of the parameter's variance: the whole V, misfit included, over the inverse
 * curvature. 1 where the weights are all there is to know. */
double Verdict::profile_scale(int column) const {
    bool with[COORDINATES_MAX];
    std::copy(free_, free_ + COORDINATES_MAX, with);
    with[column] = true;
    struct uncertainty u = {};
    double scale = misfit_.scatter * (in_->u_ind ? 1 : problem_chi2(p_) / u_.chi2_expected);
    if (uncertainty_compute(&u, p_, fit_->value, with, nullptr) == 0 &&
        misfit_inflate(&misfit_, &u, p_, nullptr) == 0) {
        const int at = column * k_ + column;
        double curvature = 0;
        for (size_t i = 0; i < p_->n; i++) {
            const double h = u.h[column * p_->n + i] / p_->root_weight[i];
            curvature += h * h;
        }
        scale = (u.independent[at] + u.drift[at] + u.common[at]) / curvature;
    }
    uncertainty_free(&u);
    return scale;
}

int Verdict::fill_limit(int column, struct err *e) {
    double at_limit[COORDINATES_MAX], value[MATERIAL_PARAMETERS];
    bool found = false;
    int status = limit_find(p_, &fit_->best, column, profile_scale(column), at_limit, &found, e);
    if (status) {
        return status;
    }
    coordinates_to_value(p_->model, at_limit, value);
    out_->limit_95[parameter(column)] = value[parameter(column)];
    out_->not_identifiable[parameter(column)] = !found;
    if (found) {
        words_warn(out_, "%s is at its bound %.3g; 95 %% limit %.3g", name(column),
                   out_->value[parameter(column)], value[parameter(column)]);
    }
    add_shift(column, at_limit);
    add_saturation(column);
    return 0;
}

/* Beyond about 1 rad sigma no longer shows (reflection-model.md 1.2), so the surface may well be rougher than the bound:
 * what the others would then be is part of their u. */
void Verdict::add_saturation(int column) {
    const double beyond = 0.4; /* in ln sigma: half as rough again */
    if (reflectance_kind(p_->model, parameter(column)) != REFLECTANCE_ROUGHNESS ||
        fit_->best.x[column] - p_->low[column] < p_->high[column] - fit_->best.x[column]) {
        return;
    }
    bool held[COORDINATES_MAX] = {};
    double start[COORDINATES_MAX];
    struct solve_result rougher;
    std::copy(fit_->best.x, fit_->best.x + COORDINATES_MAX, start);
    held[column] = true;
    start[column] += beyond;
    if (solve_run(p_, start, held, &rougher, nullptr, nullptr) == 0) {
        add_shift(column, rougher.x);
    }
}

/* A parameter at its bound, or without a lobe to show it, has no standard deviation. */
void Verdict::clear_bound_rows() {
    for (int j = 0; j < k_; j++) {
        for (int c = 0; !free_[j] && c < MATERIAL_PARAMETERS; c++) {
            out_->statistical[parameter(j)][c] = out_->statistical[c][parameter(j)] = 0;
            out_->common[parameter(j)][c] = out_->common[c][parameter(j)] = 0;
        }
    }
}

double Verdict::relative_u(int column) const {
    const enum material_parameter at = parameter(column);
    const double size = coordinates_scale(p_->model, out_->value, column);
    return std::sqrt(out_->statistical[at][at] + out_->common[at][at]) / size;
}

/* A lobe whose height is a guess: what hangs on it is then told by noise, whatever its own u says. */
void Verdict::find_lost_lobe() {
    bool lost[MATERIAL_PARAMETERS] = {};
    for (int j = 0; j < k_; j++) {
        const int at = j * k_ + j;
        const double u = std::sqrt(u_.independent[at] + u_.drift[at] + u_.common[at]);
        lost[parameter(j)] = reflectance_kind(p_->model, parameter(j)) == REFLECTANCE_HEIGHT &&
                             (out_->at_bound[parameter(j)] || u > U_LN_MAX);
    }
    for (int j = 0; j < k_; j++) {
        if ((lost[parameter(j)] && free_[j]) || hangs_on_lost_lobe(j, lost)) {
            out_->not_identifiable[parameter(j)] = true;
        }
    }
}

/* What lies between the samples: the width of a lobe that no point sees the flank of, the height of one that none sees. */
void Verdict::find_unsampled() {
    for (int j = 0; j < k_; j++) {
        const enum reflectance_kind kind = reflectance_kind(p_->model, parameter(j));
        const bool narrow = kind == REFLECTANCE_WIDTH && free_[j] &&
                            gap_flank_points(p_, out_->value[parameter(j)]) < FLANK_POINTS_MIN;
        const bool unseen =
            kind == REFLECTANCE_HEIGHT && out_->at_bound[parameter(j)] && gap_nearest_phi(p_) > NARROWEST_RAD;
        out_->not_identifiable[parameter(j)] |= narrow || unseen;
    }
}

int Verdict::find_gaps(struct err *e) {
    int status = 0;
    find_lost_lobe();
    find_unsampled();
    for (int j = 0; j < k_ && !status; j++) {
        if (free_[j] && !(relative_u(j) <= U_LN_MAX)) {
            out_->not_identifiable[parameter(j)] = true;
        }
        if (out_->not_identifiable[parameter(j)]) {
            const struct gap gap = {j, free_[j], relative_u(j)};
            status = gap_explain(&gap, p_, fit_->value, &u_, out_, e);
        }
    }
    return status;
}

void Verdict::warn_physics() {
    const double *value = fit_->value;
    if (p_->loss != MATERIAL_LOSS_ML && in_->u_ind) {
        words_warn(
            out_,
            "fitted by the loss %s: u is that of the points, carried through the weights of this loss; "
            "chi-square is not at its least",
            material_loss_name(p_->loss));
    }
    if (!in_->u_ind) {
        words_warn(
            out_,
            "no uncertainties were given: all points count alike, u is from their scatter, independence is "
            "assumed");
    }
    if (has(MATERIAL_SIGMA) && value[MATERIAL_SIGMA] > 0.8) {
        words_warn(out_, "sigma %.3g rad is beyond the range Oren and Nayar's constants were made for (0.8)",
                   value[MATERIAL_SIGMA]);
    }
    const double from_deg = has(MATERIAL_SIGMA) ? quality_negative_from_deg(value[MATERIAL_SIGMA]) : NAN;
    if (std::isfinite(from_deg)) {
        words_warn(out_, "the direct diffuse term is negative towards the mirror direction from %g deg on",
                   from_deg);
    }
    if (out_->specular_energy > 1) {
        words_warn(out_,
                   "specular energy w = %.3g: the lobes would return more light than they receive (w > 1)",
                   out_->specular_energy);
    }
}

int Verdict::fill_spectrum(struct err *e) {
    std::fill_n(out_->s_lambda, BANDS, NAN);
    std::fill_n(out_->u_s_lambda, BANDS, NAN);
    if (!in_->band_beta) {
        return 0;
    }
    out_->band_first = BANDS;
    for (int band = 0; band < BANDS; band++) {
        out_->s_lambda[band] = fit_->bands.s[band];
        if (std::isfinite(fit_->bands.s[band])) {
            out_->has_spectrum = true;
            out_->band_first = std::min(out_->band_first, band);
            out_->band_last = band;
        }
    }
    out_->band_first = out_->has_spectrum ? out_->band_first : 0;
    return uncertainty_of_bands(&u_, p_, fit_->value, &fit_->bands, out_->u_s_lambda, e);
}

int Verdict::fill(struct err *e) {
    find_bounds();
    struct err singular = {};
    int status = uncertainty_compute(&u_, p_, fit_->value, free_, &singular);
    out_->condition = u_.condition;
    if (status == -ERR_FIT || (!status && !is_settled())) {
        return refuse(e);
    }
    if (status) {
        return err_set(e, static_cast<enum err_code>(singular.code), "%s", singular.text);
    }
    out_->converged = true;
    status = fill_quality(e);
    if (!status) {
        status = stretch_flat(e);
    }
    fill_covariance();
    for (int j = 0; j < k_ && !status; j++) {
        if (out_->at_bound[parameter(j)]) {
            status = fill_limit(j, e);
        }
    }
    clear_bound_rows();
    if (status || (status = find_gaps(e))) {
        return status;
    }
    warn_physics();
    instrument_report(p_, &u_, out_);
    return fill_spectrum(e);
}

} // namespace

int verdict_fill(struct settled *fit, struct estimate *estimate, struct err *e) {
    return Verdict(fit, estimate).fill(e);
}
