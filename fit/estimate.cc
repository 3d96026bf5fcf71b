#include "fit/estimate.h"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <exception>
#include <iterator>
#include <new>
#include <set>
#include <string>
#include <utility>

#include "fit/advice.h"
#include "fit/limit.h"
#include "fit/quality.h"
#include "fit/solve.h"
#include "fit/start.h"

namespace {

/* A logarithmic uncertainty of 0.5 is a factor 1.65 either way: the value is then a guess, not a result. */
constexpr double U_LN_MAX = 0.5;
constexpr double AT_BOUND = 1e-7; /* in coordinates; the solver stops exactly on a bound */
constexpr size_t MARGIN = 2;      /* points beyond the parameters, so that chi-square can object */

/* One estimation from start to end; owns what its parts allocate. */
class Estimation {
  public:
    Estimation(const struct estimate_input *in, struct estimate *out) : in_(in), out_(out) {
    }
    ~Estimation() {
        problem_free(&p_);
        bandfit_free(&bands_);
        uncertainty_free(&u_);
    }
    Estimation(const Estimation &) = delete;
    Estimation &operator=(const Estimation &) = delete;

    int run(struct err *e);

  private:
    int solve_from_starts(struct err *e);
    int settle(struct err *e);
    int update_q(struct err *e);
    int find_bounds(struct err *e);
    int judge(struct err *e);
    int fill_limit(int column, double scale, struct err *e);
    int fill_spectrum(struct err *e);
    int explain_gap(int column, double variance, struct err *e);
    int find_hidden(struct err *e);
    void describe_input();
    void fill_parameters();
    int fill_quality(struct err *e);
    void warn_physics();
    bool too_few_points();
    int refuse_degenerate(struct err *e);
    void refuse(const std::string &words);
    void warn(const char *format, ...) __attribute__((format(printf, 2, 3)));
    const char *name(int column) const;
    bool has(enum material_parameter parameter) const;

    const struct estimate_input *in_;
    struct estimate *out_;
    struct problem p_ = {};
    struct bandfit bands_ = {};
    struct uncertainty u_ = {};
    struct solve_result best_ = {};
    double value_[MATERIAL_PARAMETERS] = {};
    bool free_[COORDINATES_MAX] = {};
    bool misfit_ = false;
};

const char *const parameter_names[] = {"S", "sigma", "gamma", "beta'", "n"};

const char *Estimation::name(int column) const {
    return parameter_names[reflectance_parameter(p_.model, column)];
}

bool Estimation::has(enum material_parameter parameter) const {
    for (int j = 0; j < p_.k; j++) {
        if (reflectance_parameter(p_.model, j) == parameter) {
            return true;
        }
    }
    return false;
}

void Estimation::warn(const char *format, ...) {
    if (out_->n_warnings < MATERIAL_WARNINGS) {
        va_list arguments;
        va_start(arguments, format);
        std::vsnprintf(out_->warning[out_->n_warnings++], sizeof out_->warning[0], format, arguments);
        va_end(arguments);
    }
}

void Estimation::refuse(const std::string &words) {
    out_->converged = false;
    std::snprintf(out_->refusal, sizeof out_->refusal, "%s", words.c_str());
}

void Estimation::describe_input() {
    std::snprintf(out_->model, sizeof out_->model, "%s", reflectance_name(p_.model));
    out_->provisional = in_->any_provisional;
    out_->n_points = static_cast<int>(in_->n);
    out_->n_parameters = p_.k;
    out_->kappa = in_->kappa;
    out_->q = 1;
    out_->mean_low_nm = in_->mean_low_nm;
    out_->mean_high_nm = in_->mean_high_nm;
    if (in_->n > 0) {
        auto i = std::minmax_element(in_->theta_i_deg, in_->theta_i_deg + in_->n);
        auto v = std::minmax_element(in_->theta_v_deg, in_->theta_v_deg + in_->n);
        out_->theta_i_low_deg = *i.first;
        out_->theta_i_high_deg = *i.second;
        out_->theta_v_low_deg = *v.first;
        out_->theta_v_high_deg = *v.second;
    }
}

bool Estimation::too_few_points() {
    std::set<std::pair<double, double>> geometries;
    for (size_t i = 0; i < in_->n && geometries.size() <= p_.k + MARGIN; i++) {
        geometries.insert({in_->theta_i_deg[i], in_->theta_v_deg[i]});
    }
    if (geometries.size() >= p_.k + MARGIN) {
        return false;
    }
    char words[sizeof out_->refusal];
    std::snprintf(
        words, sizeof words,
        "%zu points at %zu different geometries; the %s model has %d parameters and needs at least %zu "
        "geometries: measure on",
        in_->n, geometries.size(), out_->model, p_.k, p_.k + MARGIN);
    refuse(words);
    return true;
}

int Estimation::solve_from_starts(struct err *e) {
    double x[START_MAX][COORDINATES_MAX];
    const int n = start_find(&p_, x);
    struct err last = {};
    bool any = false;
    for (int i = 0; i < n; i++) {
        struct solve_result result;
        struct err failure = {};
        if (solve_run(&p_, x[i], nullptr, &result, in_->trace, &failure)) {
            last = failure;
        } else if (!any || result.chi2 < best_.chi2) {
            best_ = result;
            any = true;
        }
    }
    return any ? 0 : err_set(e, ERR_FIT, "%s", last.text);
}

int Estimation::update_q(struct err *e) {
    bandfit_free(&bands_);
    if (!in_->band_beta) {
        return 0;
    }
    int status = bandfit_run(&bands_, &p_, value_, e);
    if (!status && !in_->q_is_one && has(MATERIAL_SIGMA)) {
        p_.q = bandfit_q(&bands_, in_->mean_low_nm, in_->mean_high_nm);
    }
    return status;
}

/* Two passes: each takes q from the spectrum of the one before; the weights are taken from the model once. */
int Estimation::settle(struct err *e) {
    for (int pass = 0; pass <= 2; pass++) {
        coordinates_to_value(p_.model, best_.x, value_);
        int status = problem_evaluate(&p_, value_, e);
        if (status || pass == 2) {
            return status           ? status
                   : in_->band_beta ? (bandfit_free(&bands_), bandfit_run(&bands_, &p_, value_, e))
                                    : 0;
        }
        if (pass == 0 && (status = problem_reweigh(&p_, value_, e))) {
            return status;
        }
        struct solve_result next;
        if ((status = update_q(e)) || (status = solve_run(&p_, best_.x, nullptr, &next, in_->trace, e))) {
            return status;
        }
        best_ = next;
    }
    return 0;
}

int Estimation::find_bounds(struct err *e) {
    double low[COORDINATES_MAX], high[COORDINATES_MAX];
    coordinates_bounds(p_.model, low, high);
    for (int j = 0; j < p_.k; j++) {
        free_[j] = best_.x[j] > low[j] + AT_BOUND && best_.x[j] < high[j] - AT_BOUND;
        out_->at_bound[reflectance_parameter(p_.model, j)] = !free_[j];
    }
    if (has(MATERIAL_BETA_PRIME) && out_->at_bound[MATERIAL_BETA_PRIME]) {
        for (int j = 0; j < p_.k; j++) { /* no lobe: nothing in the data knows its width or index */
            enum material_parameter parameter = reflectance_parameter(p_.model, j);
            if (parameter == MATERIAL_GAMMA || parameter == MATERIAL_N) {
                free_[j] = false;
                out_->not_identifiable[parameter] = true;
            }
        }
    }
    return uncertainty_compute(&u_, &p_, value_, free_, e);
}

int Estimation::refuse_degenerate(struct err *e) {
    std::string names;
    int worst = 0;
    for (int j = 0; j < p_.k; j++) {
        if (free_[j] && std::fabs(u_.weakest[j]) > 0.3) {
            names += (names.empty() ? "" : ", ") + std::string(name(j));
        }
        worst = std::fabs(u_.weakest[j]) > std::fabs(u_.weakest[worst]) ? j : worst;
    }
    struct advice next = {};
    int status = advice_next(&p_, value_, &u_, worst, &next, e);
    char words[sizeof out_->refusal];
    std::snprintf(
        words, sizeof words,
        "these angles cannot tell %s (condition of the Jacobian %.0e): measure next at incidence %g deg, "
        "viewing %g deg",
        names.c_str(), u_.condition, next.theta_i_deg, next.theta_v_deg);
    refuse(words);
    return status;
}

void Estimation::fill_parameters() {
    double chain[UNCERTAINTY_CELLS];
    const int k = p_.k;
    coordinates_chain(p_.model, value_, chain);
    std::copy(value_, value_ + MATERIAL_PARAMETERS, out_->value);
    for (int a = 0; a < k; a++) {
        for (int b = 0; b < k; b++) {
            double statistical = 0, common = 0;
            for (int x = 0; x < k; x++) {
                for (int y = 0; y < k; y++) {
                    const double factor = chain[a * k + x] * chain[b * k + y];
                    statistical += factor * (u_.independent[x * k + y] + u_.drift[x * k + y]);
                    common += factor * u_.common[x * k + y];
                }
            }
            const int row = reflectance_parameter(p_.model, a), column = reflectance_parameter(p_.model, b);
            out_->statistical[row][column] = statistical;
            out_->common[row][column] = common;
        }
    }
    for (int a = 0; a < k; a++) { /* a parameter at its bound has a limit, no standard deviation */
        const int row = reflectance_parameter(p_.model, a);
        for (int c = 0; !free_[a] && c < MATERIAL_PARAMETERS; c++) {
            out_->statistical[row][c] = out_->statistical[c][row] = 0;
            out_->common[row][c] = out_->common[c][row] = 0;
        }
    }
}

int Estimation::fill_quality(struct err *e) {
    double scaled = 0;
    for (size_t i = 0; i < p_.n; i++) {
        const double r = (in_->beta[i] - p_.model_beta[i]) / p_.u[i];
        scaled += r * r;
    }
    const double n = static_cast<double>(p_.n);
    out_->chi2 = in_->u_ind ? scaled : n - p_.k;
    out_->bic = (in_->u_ind ? scaled : n * std::log(std::max(scaled / n, 1e-300))) + p_.k * std::log(n);
    out_->r2 = quality_r2(&p_);
    out_->q = p_.q;
    out_->specular_energy = has(MATERIAL_BETA_PRIME)
                                ? quality_specular_energy(value_[MATERIAL_BETA_PRIME], value_[MATERIAL_GAMMA])
                                : 0;
    if (in_->u_ind && !in_->unweighted) {
        const double limit = quality_chi2_limit(u_.chi2_expected, u_.chi2_variance);
        misfit_ = out_->chi2 > limit;
        if (misfit_) {
            warn("the model does not fit: chi-square %.4g, expected %.4g, 99.9 %% point %.4g; the parameters "
                 "are "
                 "descriptive, u from sweep scatter",
                 out_->chi2, u_.chi2_expected, limit);
            uncertainty_inflate(&u_, &p_);
        }
    }
    return quality_median_error(&p_, &out_->median_relative_error, e);
}

int Estimation::fill_limit(int column, double scale, struct err *e) {
    const enum material_parameter parameter = reflectance_parameter(p_.model, column);
    double limit = 0, at[COORDINATES_MAX], value[MATERIAL_PARAMETERS];
    bool found = false;
    int status = limit_find(&p_, &best_, column, scale, &limit, &found, e);
    if (status) {
        return status;
    }
    std::copy(best_.x, best_.x + p_.k, at);
    at[column] = limit;
    coordinates_to_value(p_.model, at, value);
    out_->limit_95[parameter] = value[parameter];
    if (found) {
        warn("%s is at its bound %.3g; 95 %% limit %.3g", name(column), value_[parameter], value[parameter]);
    } else {
        out_->not_identifiable[parameter] = true;
    }
    return 0;
}

/* Why these points do not tell a parameter, and the geometry that would. */
int Estimation::explain_gap(int column, double variance, struct err *e) {
    struct advice next = {};
    int status = advice_next(&p_, value_, &u_, column, &next, e);
    const enum material_parameter parameter = reflectance_parameter(p_.model, column);
    struct material_gap *gap = &out_->gap[parameter];
    if (free_[column]) {
        std::snprintf(gap->why, sizeof gap->why, "u of %s is a factor %.2g with incidence %g to %g deg",
                      name(column), std::exp(std::min(std::sqrt(variance), 99.0)), out_->theta_i_low_deg,
                      out_->theta_i_high_deg);
    } else if (out_->at_bound[parameter]) {
        std::snprintf(gap->why, sizeof gap->why, "every value within the bounds of %s fits these points",
                      name(column));
    } else {
        std::snprintf(gap->why, sizeof gap->why, "there is no lobe in these points that could show %s",
                      name(column));
    }
    gap->has_next = status == 0;
    gap->next_theta_i_deg = next.theta_i_deg;
    gap->next_theta_v_deg = next.theta_v_deg;
    warn("%s is not identifiable: %s; measure next at incidence %g deg, viewing %g deg", name(column),
         gap->why, next.theta_i_deg, next.theta_v_deg);
    return status;
}

int Estimation::find_hidden(struct err *e) {
    for (int j = 0; j < p_.k; j++) {
        const enum material_parameter parameter = reflectance_parameter(p_.model, j);
        const double variance =
            u_.independent[j * p_.k + j] + u_.drift[j * p_.k + j] + u_.common[j * p_.k + j];
        if (free_[j] && variance > U_LN_MAX * U_LN_MAX) {
            out_->not_identifiable[parameter] = true;
        }
        if (!out_->not_identifiable[parameter]) {
            continue;
        }
        int status = explain_gap(j, variance, e);
        if (status) {
            return status;
        }
    }
    return 0;
}

void Estimation::warn_physics() {
    if (!in_->u_ind) {
        warn("no uncertainties were given: all points count alike, u is from their scatter, independence is "
             "assumed");
    }
    if (has(MATERIAL_SIGMA) && value_[MATERIAL_SIGMA] > 0.8) {
        warn("sigma %.3g rad is beyond the range Oren and Nayar's constants were made for (0.8)",
             value_[MATERIAL_SIGMA]);
    }
    const double from_deg = has(MATERIAL_SIGMA) ? quality_negative_from_deg(value_[MATERIAL_SIGMA]) : NAN;
    if (std::isfinite(from_deg)) {
        warn("the direct diffuse term is negative towards the mirror direction from %g deg on", from_deg);
    }
    if (out_->specular_energy > 1) {
        warn("specular energy w = %.3g: the lobe would return more light than it receives (w > 1)",
             out_->specular_energy);
    }
}

int Estimation::fill_spectrum(struct err *e) {
    std::fill_n(out_->s_lambda, BANDS, NAN);
    std::fill_n(out_->u_s_lambda, BANDS, NAN);
    if (!in_->band_beta) {
        return 0;
    }
    out_->band_first = BANDS;
    for (int band = 0; band < BANDS; band++) {
        out_->s_lambda[band] = bands_.s[band];
        if (std::isfinite(bands_.s[band])) {
            out_->has_spectrum = true;
            out_->band_first = std::min(out_->band_first, band);
            out_->band_last = band;
        }
    }
    out_->band_first = out_->has_spectrum ? out_->band_first : 0;
    return uncertainty_of_bands(&u_, &p_, value_, &bands_, out_->u_s_lambda, e);
}

int Estimation::judge(struct err *e) {
    int status = fill_quality(e);
    const double scale = misfit_ ? out_->chi2 / u_.chi2_expected : 1;
    for (int j = 0; j < p_.k && !status; j++) {
        const enum material_parameter parameter = reflectance_parameter(p_.model, j);
        if (out_->at_bound[parameter] && !out_->not_identifiable[parameter]) {
            status = fill_limit(j, scale, e);
        }
    }
    if (status || (status = find_hidden(e))) {
        return status;
    }
    fill_parameters();
    warn_physics();
    return fill_spectrum(e);
}

int Estimation::run(struct err *e) {
    int status = problem_init(&p_, in_, e);
    if (status) {
        return status;
    }
    describe_input();
    if (too_few_points()) {
        return 0;
    }
    if ((status = solve_from_starts(e)) || (status = settle(e))) {
        return status;
    }
    if (!best_.converged) {
        refuse("the fit did not settle; the points do not resemble this model");
        return 0;
    }
    struct err degenerate = {};
    status = find_bounds(&degenerate);
    if (status == -ERR_FIT) {
        return refuse_degenerate(e);
    }
    if (status) {
        return err_set(e, static_cast<enum err_code>(degenerate.code), "%s", degenerate.text);
    }
    out_->converged = true;
    return judge(e);
}

} // namespace

int estimate_fit(const struct estimate_input *input, struct estimate *estimate, struct err *e) {
    *estimate = {};
    try {
        int status = Estimation(input, estimate).run(e);
        estimate->converged = estimate->converged && status == 0;
        return status;
    } catch (const std::bad_alloc &) {
        return err_set(e, ERR_NOMEM, "no memory for a fit of %zu points", input->n);
    } catch (const std::exception &x) {
        return err_set(e, ERR_FIT, "the estimation failed: %s", x.what());
    } catch (...) {
        return err_set(e, ERR_FIT, "the estimation failed for an unknown reason");
    }
}

int estimate_axis_slopes(const struct estimate *estimate, size_t n, const double *theta_i_deg,
                         const double *theta_v_deg, const bool *mirrored, double *source, double *sample,
                         struct err *e) {
    enum reflectance_model model;
    int status = reflectance_find(estimate->model, &model, e);
    for (size_t i = 0; i < n && !status; i++) {
        status = problem_axis_slopes(model, estimate->value, estimate->kappa * estimate->q, theta_i_deg[i],
                                     theta_v_deg[i], mirrored && mirrored[i], &source[i], &sample[i], e);
    }
    return status;
}
