#include "fit/joint_fit.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/joint_covariance.h"
#include "fit/joint_form.h"

#define MOVES_MAX 6
#define SETTLED 1e-4 /* of the u of a nuisance's prior, as estimate.cc */

static int refuse(struct joint *joint, const char *why) {
    joint->converged = false;
    snprintf(joint->refusal, sizeof joint->refusal, "%.255s", why);
    return 0;
}

static void clear(struct joint *joint, const struct estimate *start, bool per_band) {
    *joint = (struct joint){.beta_prime_per_band = per_band, .kappa = start->kappa, .chi2 = NAN};
    snprintf(joint->model, sizeof joint->model, "%s", start->model);
    for (int p = 0; p < MATERIAL_PARAMETERS; p++) {
        joint->value[p] = NAN;
    }
    for (int b = 0; b < BANDS; b++) {
        joint->s_lambda[b] = joint->beta_prime[b] = NAN;
    }
}

static void fill(struct joint *joint, const struct joint_data *d, const struct joint_solution *solution) {
    double value[MATERIAL_PARAMETERS];
    coordinates_to_value(d->p->model, solution->x, value);
    for (int c = 0; c < d->p->k; c++) {
        const enum material_parameter p = reflectance_parameter(d->p->model, c);
        const bool per_band = p == MATERIAL_S || (p == MATERIAL_BETA_PRIME && joint->beta_prime_per_band);
        joint->value[p] = per_band ? NAN : value[p];
    }
    for (int b = 0; b < d->n_bands; b++) {
        joint->s_lambda[d->band[b]] = solution->s[b];
        if (material_parameter_name(joint->model, MATERIAL_BETA_PRIME)) {
            joint->beta_prime[d->band[b]] = solution->t[b] * value[MATERIAL_BETA_PRIME];
        }
    }
    joint->n_points = (int)d->n;
    joint->n_values = (int)d->n_values;
    joint->n_bands = d->n_bands;
    joint->chi2 = solution->chi2;
    joint->converged = solution->converged;
    joint->polarisation = d->p->input->polarisation;
    joint->u_polarisation = d->p->input->u_polarisation;
    for (int z = 0; z < d->p->nuisance.m; z++) { /* their u comes with the covariance */
        const struct nuisance *found = &d->p->nuisance.of[z];
        *(found->kind == NUISANCE_OFFSET ? &joint->mirror_offset_deg : &joint->polarisation) = found->at;
    }
}

/* Twice: with the u of the readings, and with what the model of the first makes of them. */
static int solve(struct joint_data *d, const double *value, bool per_band, struct joint_solution *solution,
                 double *model, struct err *e) {
    double x[COORDINATES_MAX];
    coordinates_from_value(d->p->model, value, x);
    int status = joint_solve(d, x, per_band, solution, model, e);
    if (status || !d->known || d->p->input->unweighted) {
        return status;
    }
    joint_data_reweigh(d, model);
    memcpy(x, solution->x, sizeof x);
    return joint_solve(d, x, per_band, solution, model, e);
}

/* Moves mirror offset and P to where the bands want them; *moved in units of the u of their priors. */
static int move_nuisances(struct joint_data *d, const struct estimate *start, bool per_band,
                          const struct joint_solution *solution, const double *model, double *moved,
                          struct err *e) {
    struct problem *p = d->p;
    struct joint_form form;
    double step[NUISANCES_MAX] = {0};
    int status = joint_form_init(&form, d, solution, per_band, model, e);
    if (!status) {
        joint_form_step(&form, d, model, step);
        status = nuisance_move(p, step, e);
    }
    joint_form_free(&form);
    *moved = 0;
    for (int z = 0; z < p->nuisance.m; z++) {
        *moved = fmax(*moved, fabs(step[z]) / p->nuisance.of[z].u);
    }
    p->optics.q = start->q; /* the slopes are those of the means' model, from where it now stands */
    status = status ? status : problem_evaluate(p, start->value, e);
    return status ? status : problem_slopes(p, start->value, e);
}

/* With what the bands say of the instrument: from the estimate of the means a step or two. */
static int settle(struct joint_data *d, const struct estimate *start, bool per_band,
                  struct joint_solution *solution, double *model, struct err *e) {
    double moved = d->p->nuisance.m > 0 ? INFINITY : 0;
    int status = solve(d, start->value, per_band, solution, model, e);
    for (int i = 0; i < MOVES_MAX && moved > SETTLED && !status; i++) {
        status = move_nuisances(d, start, per_band, solution, model, &moved, e);
        if (!status && moved > SETTLED) {
            double x[COORDINATES_MAX];
            memcpy(x, solution->x, sizeof x);
            status = joint_solve(d, x, per_band, solution, model, e);
        }
    }
    return status;
}

static int fit_bands(struct joint_data *d, const struct estimate *start, struct joint *joint, struct err *e) {
    struct joint_solution solution;
    const bool per_band = joint->beta_prime_per_band;
    if (d->n_bands == 0) {
        return refuse(joint, "no band was measured at three points or more");
    }
    double *model = calloc((size_t)d->n_bands * d->n, sizeof *model);
    if (!model) {
        return err_set(e, ERR_NOMEM, "no memory for a joint fit of %zu values", d->n_values);
    }
    int status = settle(d, start, per_band, &solution, model, e);
    if (!status) {
        solution.chi2 += nuisance_chi2(d->p);
        fill(joint, d, &solution);
        status = joint_covariance(d, &solution, per_band, model, joint, e);
    }
    free(model);
    return status;
}

static int fit_problem(struct problem *p, const struct estimate *start, struct joint *joint, struct err *e) {
    struct joint_data d;
    p->optics.q = start->q;
    int status = nuisance_take(p, start, e);
    if (status || (status = problem_evaluate(p, start->value, e)) ||
        (status = problem_reweigh(p, start->value, e)) || (status = joint_data_init(&d, p, e))) {
        return status;
    }
    status = fit_bands(&d, start, joint, e);
    joint_data_free(&d);
    return status;
}

int joint_fit(const struct estimate_input *input, const struct estimate *start, bool beta_prime_per_band,
              struct joint *joint, struct err *e) {
    struct problem p;
    struct err failure = {0};
    clear(joint, start, beta_prime_per_band);
    if (!start->converged || !input->band_beta) {
        return refuse(joint, start->converged ? "the points have no bands" : start->refusal);
    }
    if (beta_prime_per_band && !material_parameter_name(start->model, MATERIAL_BETA_PRIME)) {
        return err_set(e, ERR_USAGE, "the %s model has no beta' that could be free per band", start->model);
    }
    int status = problem_init(&p, input, e);
    if (status) {
        return status;
    }
    status = fit_problem(&p, start, joint, &failure);
    problem_free(&p);
    if (status) {
        joint_free(joint);
    }
    if (status == -ERR_FIT) { /* bands that defeat the fit say so; the estimate of the means stands */
        return refuse(joint, failure.text);
    }
    if (status && e) {
        *e = failure;
    }
    return status;
}
