#include "fit/models.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int fit_one(struct fitset *data, const char *name, struct model_fit *fit, struct err *e) {
    struct err failure = {0};
    *fit = (struct model_fit){0};
    data->input.model = name;
    data->input.trace = &fit->trace;
    int status = fitset_fit(data, &fit->estimate, &failure);
    if (status == -ERR_FIT) {
        snprintf(fit->estimate.model, sizeof fit->estimate.model, "%s", name);
        snprintf(fit->estimate.refusal, sizeof fit->estimate.refusal, "%.255s", failure.text);
        return 0;
    }
    if (status && e) {
        *e = failure;
    }
    return status;
}

static int rank(struct model_fit *fit, size_t n, bool u_stated, struct err *e) {
    struct choice choice[REFLECTANCE_MODELS];
    struct model_fit *sorted = calloc(n, sizeof *sorted);
    if (!sorted) {
        return err_set(e, ERR_NOMEM, "no memory to compare %zu models", n);
    }
    for (size_t i = 0; i < n; i++) {
        choice[i] = (struct choice){.estimate = &fit[i].estimate, .u_stated = u_stated};
    }
    choice_rank(choice, n);
    for (size_t i = 0; i < n; i++) {
        size_t from = 0;
        while (choice[i].estimate != &fit[from].estimate) {
            from++;
        }
        sorted[i] = fit[from];
        sorted[i].choice = choice[i];
        sorted[i].choice.estimate = NULL; /* it has moved */
        sorted[i].estimate.bic = isfinite(choice[i].bic) ? choice[i].bic : sorted[i].estimate.bic;
    }
    memcpy(fit, sorted, n * sizeof *sorted);
    free(sorted);
    return 0;
}

int models_fit(struct fitset *data, const char *name, struct model_fit *fit, size_t *n, struct err *e) {
    int status = 0;
    *n = 0;
    data->input.cross_validate = !name;
    for (int m = 0; m < REFLECTANCE_MODELS && !status; m++) {
        const char *model = reflectance_name((enum reflectance_model)m);
        if (!name || strcmp(name, model) == 0) {
            status = fit_one(data, model, &fit[(*n)++], e);
        }
    }
    const bool u_stated = data->has_u && data->input.loss == MATERIAL_LOSS_ML;
    return status || name ? status : rank(fit, *n, u_stated, e);
}
