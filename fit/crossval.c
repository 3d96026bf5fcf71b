#include "fit/crossval.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/loss.h"
#include "fit/sweeps.h"

static int evaluate_at(struct problem *p, const double *x, struct err *e) {
    double value[MATERIAL_PARAMETERS];
    coordinates_to_value(p->model, x, value);
    return problem_evaluate(p, value, e);
}

/* Sum of squares of the sweep's residuals, foretold by the others; weight: of all points. */
static int leave_out(struct problem *p, const struct sweeps *s, size_t sweep, const double *weight,
                     const struct solve_result *best, double *sum, struct err *e) {
    struct solve_result without;
    for (size_t i = 0; i < p->n; i++) {
        p->loss_weight[i] = p->root_weight[i] = s->sweep[i] == sweep ? 0 : weight[i];
    }
    int status = solve_run(p, best->x, NULL, &without, NULL, e);
    if (status || (status = evaluate_at(p, without.x, e))) {
        return status;
    }
    for (size_t i = 0; i < p->n; i++) {
        double slope, r = (p->target[i] - loss_value(p->loss, p->model_beta[i], &slope)) * weight[i];
        *sum += s->sweep[i] == sweep ? r * r : 0;
    }
    return 0;
}

static int leave_each_out(struct problem *p, const struct sweeps *s, const struct solve_result *best,
                          double *loio, struct err *e) {
    double *weight = calloc(p->n + 1, sizeof *weight), sum = 0;
    int status = 0;
    if (!weight) {
        return err_set(e, ERR_NOMEM, "no memory to leave out incidences of %zu points", p->n);
    }
    memcpy(weight, p->loss_weight, p->n * sizeof *weight);
    for (size_t sweep = 0; sweep < s->n_sweeps && !status; sweep++) {
        status = leave_out(p, s, sweep, weight, best, &sum, e);
    }
    memcpy(p->loss_weight, weight, p->n * sizeof *weight);
    free(weight);
    *loio = sqrt(sum / (double)p->n);
    int back = evaluate_at(p, best->x, e);
    return status ? status : back;
}

int crossval_loio(struct problem *p, const struct solve_result *best, double *loio, struct err *e) {
    struct sweeps s;
    int status = sweeps_find(&s, p->n, p->input->theta_i_deg, p->input->theta_v_deg, e);
    if (!status && s.n_sweeps < CROSSVAL_SWEEPS_MIN) {
        status = err_set(e, ERR_FIT, "%zu incidences are too few to leave one out; %d are needed", s.n_sweeps,
                         CROSSVAL_SWEEPS_MIN);
    }
    if (!status) {
        status = leave_each_out(p, &s, best, loio, e);
    }
    sweeps_free(&s);
    return status;
}
