#include "fit/estimate.h"

#include <algorithm>
#include <cstdio>
#include <exception>
#include <new>
#include <set>
#include <utility>

#include "fit/instrument.h"
#include "fit/start.h"
#include "fit/verdict.h"
#include "fit/words.h"

namespace {

constexpr int PASSES_MAX = 8;
constexpr double NUISANCE_SETTLED = 1e-4; /* of the u of its prior; what it moves is then far below any u */
constexpr size_t MARGIN = 2; /* geometries beyond the parameters, so that chi-square can object */

/* One estimation from start to end; owns what its parts allocate. */
class Estimation {
  public:
    Estimation(const struct estimate_input *in, struct estimate *out) : in_(in), out_(out) {
    }
    ~Estimation() {
        problem_free(&fit_.p);
        bandfit_free(&fit_.bands);
    }
    Estimation(const Estimation &) = delete;
    Estimation &operator=(const Estimation &) = delete;

    int run(struct err *e);

  private:
    void describe_input();
    bool too_few_geometries();
    int solve_from_starts(struct err *e);
    int solve_bands(struct err *e);
    void update_q();
    int prepare_pass(int pass, double *moved, struct err *e);
    int settle(struct err *e);

    const struct estimate_input *in_;
    struct estimate *out_;
    struct settled fit_ = {};
};

void Estimation::describe_input() {
    std::snprintf(out_->model, sizeof out_->model, "%s", reflectance_name(fit_.p.model));
    out_->provisional = in_->any_provisional;
    out_->n_points = static_cast<int>(in_->n);
    out_->n_parameters = fit_.p.k;
    out_->kappa = in_->kappa;
    out_->q = 1;
    out_->mean_low_nm = in_->mean_low_nm;
    out_->mean_high_nm = in_->mean_high_nm;
    out_->source_width_deg = in_->source_width_deg;
    out_->sensor_width_deg = in_->sensor_width_deg;
    out_->beam_in_view = in_->filling == ESTIMATE_BEAM_IN_VIEW;
    if (in_->n > 0) {
        auto i = std::minmax_element(in_->theta_i_deg, in_->theta_i_deg + in_->n);
        auto v = std::minmax_element(in_->theta_v_deg, in_->theta_v_deg + in_->n);
        out_->theta_i_low_deg = *i.first;
        out_->theta_i_high_deg = *i.second;
        out_->theta_v_low_deg = *v.first;
        out_->theta_v_high_deg = *v.second;
    }
}

bool Estimation::too_few_geometries() {
    const size_t needed = fit_.p.k + MARGIN;
    std::set<std::pair<double, double>> geometries;
    for (size_t i = 0; i < in_->n && geometries.size() < needed; i++) {
        geometries.insert({in_->theta_i_deg[i], in_->theta_v_deg[i]});
    }
    if (geometries.size() < needed) {
        words_refuse(
            out_,
            "%zu points at %zu different geometries; the %s model has %d parameters and needs at least %zu "
            "geometries: measure on",
            in_->n, geometries.size(), out_->model, fit_.p.k, needed);
    }
    return geometries.size() < needed;
}

int Estimation::solve_from_starts(struct err *e) {
    double x[START_MAX][COORDINATES_MAX];
    const int n = start_find(&fit_.p, x);
    struct err last = {};
    bool any = false;
    for (int i = 0; i < n; i++) {
        struct solve_result result;
        struct err failure = {};
        if (solve_run(&fit_.p, x[i], nullptr, &result, in_->trace, &failure)) {
            last = failure;
            continue;
        }
        out_->iterations += result.iterations;
        if (!any || result.chi2 < fit_.best.chi2) {
            fit_.best = result;
            coordinates_order(fit_.p.model, fit_.best.x);
            any = true;
        }
    }
    return any ? 0 : err_set(e, ERR_FIT, "%s", last.text);
}

int Estimation::solve_bands(struct err *e) {
    bandfit_free(&fit_.bands);
    return in_->band_beta ? bandfit_run(&fit_.bands, &fit_.p, fit_.value, e) : 0;
}

void Estimation::update_q() {
    const bool interreflects = reflectance_column(fit_.p.model, MATERIAL_SIGMA) >= 0;
    if (in_->band_beta && !in_->q_is_one && interreflects) {
        fit_.p.optics.q = bandfit_q(&fit_.bands, in_->mean_low_nm, in_->mean_high_nm);
    }
}

/* The weights, and with them the nuisances, are taken from the model of the first pass. */
int Estimation::prepare_pass(int pass, double *moved, struct err *e) {
    *moved = 0;
    int status = problem_evaluate(&fit_.p, fit_.value, e);
    if (status || pass > 0) {
        return status ? status : nuisance_adopt(&fit_.p, fit_.value, moved, e);
    }
    return problem_reweigh(&fit_.p, fit_.value, e);
}

/* Two passes: each takes q from the spectrum of the one before; more only where a nuisance still moves. */
int Estimation::settle(struct err *e) {
    for (int pass = 0;; pass++) {
        double moved;
        coordinates_to_value(fit_.p.model, fit_.best.x, fit_.value);
        int status = prepare_pass(pass, &moved, e);
        bool last = pass == PASSES_MAX || (pass >= 2 && moved < NUISANCE_SETTLED);
        if (status || (status = solve_bands(e)) || last) {
            return status;
        }
        update_q();
        struct solve_result next;
        if ((status = solve_run(&fit_.p, fit_.best.x, nullptr, &next, in_->trace, e))) {
            return status;
        }
        out_->iterations += next.iterations;
        fit_.best = next;
        coordinates_order(fit_.p.model, fit_.best.x);
    }
}

int Estimation::run(struct err *e) {
    int status = problem_init(&fit_.p, in_, e);
    if (status) {
        return status;
    }
    describe_input();
    if (too_few_geometries()) {
        return 0;
    }
    if ((status = solve_from_starts(e)) || (status = settle(e))) {
        return status;
    }
    status = verdict_fill(&fit_, out_, e);
    return status || !out_->converged || !in_->polarisation_unknown
               ? status
               : instrument_span(&fit_.p, &fit_.best, out_, e);
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
    const struct aperture_form form = {estimate->source_width_deg, estimate->sensor_width_deg,
                                       estimate->beam_in_view};
    int status = reflectance_find(estimate->model, &model, e);
    const struct reflectance_optics optics = {estimate->kappa, estimate->q, estimate->polarisation};
    for (size_t i = 0; i < n && !status; i++) {
        status = problem_axis_slopes(&form, model, estimate->value, &optics, theta_i_deg[i], theta_v_deg[i],
                                     mirrored && mirrored[i], &source[i], &sample[i], e);
    }
    return status;
}
