#include "fit/problem.h"

#include <math.h>
#include <stdlib.h>

#include "fit/noise_law.h"
#include "fit/loss.h"
#include "fit/spot.h"

#define BETA_MAX 1e12 /* far above any lobe (beta' 1e6 at grazing); keeps squares finite */
/* No visible mean is known better: counting alone leaves 1e-4 (measurement.md 6). */
#define FLOOR_RELATIVE 1e-5
#define FLOOR_ABSOLUTE 1e-7
#define AT_BOUND 1e-7 /* in coordinates */

static int check_point(const struct estimate_input *in, size_t i, struct err *e) {
    if (!(fabs(in->beta[i]) <= BETA_MAX)) {
        return err_set(
            e, ERR_RANGE,
            "point %zu (incidence %g deg, viewing %g deg): radiance factor %g is not a number below "
            "1e12; leave the point out",
            i + 1, in->theta_i_deg[i], in->theta_v_deg[i], in->beta[i]);
    }
    if (in->u_ind && !(in->u_ind[i] >= 0 && in->u_ind[i] <= BETA_MAX)) {
        return err_set(e, ERR_RANGE,
                       "point %zu (incidence %g deg, viewing %g deg): uncertainty %g must be a number >= 0",
                       i + 1, in->theta_i_deg[i], in->theta_v_deg[i], in->u_ind[i]);
    }
    return 0;
}

static int check_indices(size_t n_points, size_t n, const int *point, const char *what, struct err *e) {
    for (size_t i = 0; point && i < n; i++) {
        if (point[i] < 0 || (size_t)point[i] >= n_points) {
            return err_set(e, ERR_RANGE, "%s names point %d; there are points 0 to %zu", what, point[i],
                           n_points - 1);
        }
    }
    return 0;
}

static int check_finite(const double *x, size_t n, const char *what, struct err *e) {
    for (size_t i = 0; x && i < n; i++) {
        if (!(fabs(x[i]) <= 1e30)) {
            return err_set(e, ERR_RANGE, "%s holds %g; it must hold finite numbers", what, x[i]);
        }
    }
    return 0;
}

static int check_causes(const struct estimate_input *in, struct err *e) {
    int status = 0;
    for (size_t c = 0; c < in->n_common && !status; c++) {
        const struct estimate_common *x = &in->common[c];
        size_t n = x->point ? x->n : in->n;
        if (!(status = check_indices(in->n, n, x->point, "a common cause", e))) {
            status = check_finite(x->mean, n, "a common cause", e);
        }
    }
    for (size_t b = 0; b < in->n_bracket && !status; b++) {
        const struct estimate_bracket *x = &in->bracket[b];
        size_t n = x->point ? x->n : in->n;
        if (!(status = check_indices(in->n, n, x->point, "a bracket", e)) &&
            !(status = check_finite(x->tau_us, n, "a bracket", e)) &&
            !(status = check_finite(x->tau_r_us, n, "a bracket", e)) &&
            !(x->rate >= 0 && x->rate <= 1e30 && fabs(x->length_us) <= 1e30)) {
            status = err_set(e, ERR_RANGE,
                             "a bracket has drift rate %g per s and length %g us; both must be finite",
                             x->rate, x->length_us);
        }
    }
    return status;
}

static int check_input(const struct estimate_input *in, struct err *e) {
    double angles[] = {in->u_repeat_source_deg, in->u_repeat_sample_deg, in->u_zero_source_deg,
                       in->u_zero_sample_deg};
    for (size_t i = 0; i < sizeof angles / sizeof *angles; i++) {
        if (!(angles[i] >= 0 && angles[i] < 90)) {
            return err_set(e, ERR_RANGE, "an axis uncertainty of %g deg is not possible; give 0 to 90 deg",
                           angles[i]);
        }
    }
    if (!(fabs(in->polarisation) <= 1 && in->u_polarisation >= 0 && in->u_polarisation <= 1)) {
        return err_set(e, ERR_RANGE, "a polarisation of %g with u %g is not possible; P is -1 to 1",
                       in->polarisation, in->u_polarisation);
    }
    if (!(in->kappa > 0 && in->kappa <= 100)) {
        return err_set(e, ERR_RANGE, "kappa is %g; it is 1, or pi for the paper's printed form", in->kappa);
    }
    for (size_t i = 0; i < in->n; i++) {
        int status = check_point(in, i, e);
        if (status) {
            return status;
        }
    }
    return check_causes(in, e);
}

bool problem_at_bound(const struct problem *p, int column, double x) {
    return !(x > p->low[column] + AT_BOUND && x < p->high[column] - AT_BOUND);
}

double problem_floor(double beta) {
    return FLOOR_RELATIVE * fabs(beta) + FLOOR_ABSOLUTE;
}

/* beta: where a loss that is not linear is taken for its tangent. */
static void set_weight(struct problem *p, size_t i, double u2, double beta) {
    double slope;
    loss_value(p->loss, beta, &slope);
    p->u[i] = sqrt(u2);
    p->loss_weight[i] = loss_weight(p->loss, p->input->theta_i_deg[i], p->u[i]);
    p->root_weight[i] = p->loss_weight[i] * slope;
}

static int allocate(struct problem *p, struct err *e) {
    size_t n = p->n + 1; /* never of size 0 */
    p->u = calloc(n, sizeof(double));
    p->root_weight = calloc(n, sizeof(double));
    p->target = calloc(n, sizeof(double));
    p->loss_weight = calloc(n, sizeof(double));
    p->angle_u2 = calloc(n, sizeof(double));
    p->slope_source = calloc(n, sizeof(double));
    p->slope_sample = calloc(n, sizeof(double));
    p->slope_polarisation = calloc(n, sizeof(double));
    p->spot_source = calloc(n, sizeof(double));
    p->spot_sample = calloc(n, sizeof(double));
    p->model_beta = calloc(n, sizeof(double));
    p->gradient = calloc(n * (size_t)p->k, sizeof(double));
    if (!p->u || !p->root_weight || !p->target || !p->loss_weight || !p->angle_u2 || !p->slope_source ||
        !p->slope_sample || !p->slope_polarisation || !p->spot_source || !p->spot_sample || !p->model_beta ||
        !p->gradient) {
        return err_set(e, ERR_NOMEM, "no memory for a fit of %zu points", p->n);
    }
    return 0;
}

static struct aperture_form form_of(const struct estimate_input *in) {
    return (struct aperture_form){.source_width_deg = in->source_width_deg,
                                  .sensor_width_deg = in->sensor_width_deg,
                                  .beam_in_view = in->filling == ESTIMATE_BEAM_IN_VIEW};
}

/* One bound in coordinates; the other parameters are of no account there. */
static double bound_coordinate(const struct problem *p, int column, double bound) {
    double value[MATERIAL_PARAMETERS], x[COORDINATES_MAX];
    for (int i = 0; i < MATERIAL_PARAMETERS; i++) {
        value[i] = 1.5;
    }
    value[reflectance_parameter(p->model, column)] = bound;
    coordinates_from_value(p->model, value, x);
    return x[column];
}

static int set_bounds(struct problem *p, struct err *e) {
    coordinates_bounds(p->model, p->low, p->high);
    for (int j = 0; p->input->bound && j < p->k; j++) {
        enum material_parameter parameter = reflectance_parameter(p->model, j);
        const double *bound = p->input->bound[parameter];
        if (parameter == MATERIAL_BETA_PRIME) {
            continue;
        }
        p->low[j] = isnan(bound[0]) ? p->low[j] : bound_coordinate(p, j, bound[0]);
        p->high[j] = isnan(bound[1]) ? p->high[j] : bound_coordinate(p, j, bound[1]);
        if (!(isfinite(p->low[j]) && isfinite(p->high[j]) && p->low[j] < p->high[j])) {
            return err_set(e, ERR_RANGE, "the bounds %g to %g of parameter %d are no range of the model",
                           bound[0], bound[1], (int)parameter);
        }
    }
    return 0;
}

bool problem_out_of_plane(const struct estimate_input *in, size_t i) {
    return in->delta_phi_deg && in->delta_phi_deg[i] != 0;
}

/* Out of the plane the bench's axes have nothing to do with a point. */
static int set_directions(struct problem *p, struct err *e) {
    const struct estimate_input *in = p->input;
    int status = 0;
    for (size_t i = 0; i < p->n && !status; i++) {
        if (problem_out_of_plane(in, i)) {
            status = aperture_direct(&p->aperture, i, in->theta_i_deg[i], fabs(in->theta_v_deg[i]),
                                     in->delta_phi_deg[i], e);
        }
    }
    aperture_refill(&p->aperture);
    return status;
}

int problem_init(struct problem *p, const struct estimate_input *input, struct err *e) {
    const double q = input->q > 0 && !input->band_beta && !input->q_is_one ? input->q : 1;
    *p = (struct problem){.n = input->n,
                          .input = input,
                          .optics = {.kappa = input->kappa, .q = q, .polarisation = input->polarisation}};
    int status = reflectance_find(input->model, &p->model, e);
    if (status || (status = check_input(input, e))) {
        return status;
    }
    p->k = reflectance_parameters(p->model);
    p->loss = input->loss == MATERIAL_LOSS_ML && (input->unweighted || !input->u_ind) ? MATERIAL_LOSS_OLS
                                                                                      : input->loss;
    const struct aperture_form form = form_of(input);
    if (!(status = set_bounds(p, e))) {
        status = allocate(p, e);
    }
    status = status ? status : nuisance_init(p, e);
    status =
        status ? status : aperture_init(&p->aperture, &form, p->n, input->theta_i_deg, input->theta_v_deg, e);
    status = status ? status : set_directions(p, e);
    for (size_t i = 0; i < p->n && !status; i++) {
        double u = input->u_ind ? fmax(input->u_ind[i], problem_floor(input->beta[i])) : 1;
        double slope;
        p->target[i] = loss_value(p->loss, input->beta[i], &slope);
        set_weight(p, i, u * u, input->beta[i]);
    }
    if (status) {
        problem_free(p);
    }
    return status;
}

void problem_free(struct problem *p) {
    aperture_free(&p->aperture);
    nuisance_free(p);
    free(p->u);
    free(p->root_weight);
    free(p->target);
    free(p->loss_weight);
    free(p->angle_u2);
    free(p->slope_source);
    free(p->slope_sample);
    free(p->slope_polarisation);
    free(p->spot_source);
    free(p->spot_sample);
    free(p->model_beta);
    free(p->gradient);
    *p = (struct problem){0};
}

void problem_residuals(const struct problem *p, size_t first, size_t n, const double *beta, double *residual,
                       double *slope) {
    const bool linear = loss_is_linear(p->loss); /* most fits: this loop is then a few vector instructions */
    for (size_t i = 0; i < n && linear; i++) {
        slope[i] = p->loss_weight[first + i];
        residual[i] = (beta[i] - p->target[first + i]) * slope[i];
    }
    for (size_t i = 0; i < n && !linear; i++) {
        const double weight = p->loss_weight[first + i];
        residual[i] = (loss_value(p->loss, beta[i], &slope[i]) - p->target[first + i]) * weight;
        slope[i] *= weight;
    }
}

int problem_evaluate(struct problem *p, const double *value, struct err *e) {
    int status =
        aperture_eval(&p->aperture, 0, p->n, p->model, value, &p->optics, p->model_beta, p->gradient, e);
    for (size_t i = 0; i < p->n && !status; i++) {
        double residual;
        problem_residuals(p, i, 1, &p->model_beta[i], &residual, &p->root_weight[i]);
    }
    return status;
}

double problem_chi2(const struct problem *p) {
    double sum = 0;
    for (size_t i = 0; i < p->n; i++) {
        double r, slope;
        problem_residuals(p, i, 1, &p->model_beta[i], &r, &slope);
        sum += r * r;
    }
    return sum + nuisance_chi2(p);
}

void problem_losses(const struct problem *p, double sum[MATERIAL_LOSSES]) {
    for (int k = 0; k < MATERIAL_LOSSES; k++) {
        const enum material_loss loss = (enum material_loss)k;
        sum[k] = loss == MATERIAL_LOSS_ML && !p->input->u_ind ? NAN : 0;
        for (size_t i = 0; i < p->n; i++) {
            double slope,
                r = loss_value(loss, p->model_beta[i], &slope) - loss_value(loss, p->input->beta[i], &slope);
            r *= loss_weight(loss, p->input->theta_i_deg[i], p->u[i]);
            sum[k] += r * r;
        }
    }
}

/* Slope over a step that stays inside the domain: across a kink of G it is the mean of both sides, which is
 * what a small random displacement sees. */
static int slope_along(const struct aperture_form *form, enum reflectance_model model, const double *value,
                       const struct reflectance_optics *optics, double theta_i_deg, double theta_v_deg,
                       double di, double dv, double *slope, struct err *e) {
    const double step_deg = 1e-4; /* smaller than any lobe, larger than rounding: error about 1e-8 relative */
    double beta[2], span = 0;
    for (int side = 0; side < 2; side++) {
        double h = side ? step_deg : -step_deg;
        double i_deg = theta_i_deg + h * di, v_deg = theta_v_deg + h * dv;
        if (i_deg >= 90 || fabs(v_deg) >= 90) {
            i_deg = theta_i_deg;
            v_deg = theta_v_deg;
            h = 0;
        }
        int status = aperture_at(form, i_deg, v_deg, model, value, optics, &beta[side], NULL, e);
        if (status) {
            return status;
        }
        span += fabs(h);
    }
    *slope = span == 0 ? 0 : (beta[1] - beta[0]) / span;
    return 0;
}

int problem_axis_slopes(const struct aperture_form *form, enum reflectance_model model, const double *value,
                        const struct reflectance_optics *optics, double theta_i_deg, double theta_v_deg,
                        bool mirrored, double *source, double *sample, struct err *e) {
    double sign = mirrored ? -1 : 1;
    int status = slope_along(form, model, value, optics, theta_i_deg, theta_v_deg, sign, 0, source, e);
    return status ? status
                  : slope_along(form, model, value, optics, theta_i_deg, theta_v_deg, -sign, sign, sample, e);
}

static void noise_of(const struct problem *p, struct noise_law *law) {
    const struct estimate_input *in = p->input;
    for (size_t i = 0; in->u_ind && i < p->n; i++) {
        noise_law_add(law, fmax(in->u_ind[i], problem_floor(in->beta[i])), p->model_beta[i]);
    }
    noise_law_solve(law);
}

/* Axis errors of point i: those of each reading alone into angle_u2, those of the zeros as slopes. */
static void add_spot(struct problem *p, size_t i) {
    const struct estimate_input *in = p->input;
    const double u2_source = in->u_repeat_source_deg * in->u_repeat_source_deg;
    const double u2_sample = in->u_repeat_sample_deg * in->u_repeat_sample_deg;
    struct spot s;
    spot_at(in, i, &s);
    const double k_source = p->model_beta[i] * s.source, k_sample = p->model_beta[i] * s.sample;
    const double by_source = p->slope_source[i] + k_source, by_sample = p->slope_sample[i] + k_sample;
    p->angle_u2[i] = by_source * by_source * u2_source + by_sample * by_sample * u2_sample;
    if (s.own_reference) {
        p->angle_u2[i] += k_source * k_source * u2_source + k_sample * k_sample * u2_sample;
    }
    p->spot_source[i] = s.zeros_cancel ? 0 : k_source;
    p->spot_sample[i] = s.zeros_cancel ? 0 : k_sample;
}

int problem_slopes(struct problem *p, const double *value, struct err *e) {
    const struct estimate_input *in = p->input;
    int status = 0;
    for (size_t i = 0; i < p->n && !status; i++) {
        double di_deg, dv_deg, factor;
        if (problem_out_of_plane(in, i)) {
            continue;
        }
        nuisance_shift(p, i, &di_deg, &dv_deg, &factor);
        status =
            problem_axis_slopes(&p->aperture.form, p->model, value, &p->optics, in->theta_i_deg[i] + di_deg,
                                in->theta_v_deg[i] + dv_deg, in->mirrored && in->mirrored[i],
                                &p->slope_source[i], &p->slope_sample[i], e);
        add_spot(p, i);
    }
    return status || in->u_polarisation == 0
               ? status
               : aperture_polarisation_slope(&p->aperture, p->model, value, p->slope_polarisation, e);
}

int problem_reweigh(struct problem *p, const double *value, struct err *e) {
    const struct estimate_input *in = p->input;
    struct noise_law law = {0};
    int status = problem_slopes(p, value, e);
    if (status || !in->u_ind) {
        return status;
    }
    noise_of(p, &law);
    for (size_t i = 0; i < p->n; i++) {
        double u = fmax(in->u_ind[i], problem_floor(in->beta[i]));
        double carry = noise_law_carry(&law, u, in->beta[i], p->model_beta[i]);
        set_weight(p, i, u * u * carry + p->angle_u2[i], p->model_beta[i]);
    }
    nuisance_weigh(p);
    return 0;
}
