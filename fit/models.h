/*
 * models.h — every model fitted to the same points, ranked by what the data need (fit/choice.h).
 *
 * A model that these points defeat is among the last with its reason in estimate.refusal, and takes no other along.
 * Shapes     fit[REFLECTANCE_MODELS], filled from the first; the recommended first.
 * Errors     those of fit/estimate.h but -ERR_FIT.
 * Checked    tests/scenario/test_fit_choice.c, tests/unit/test_goniofit.py
 */
#ifndef FIT_MODELS_H
#define FIT_MODELS_H

#include "fit/choice.h"
#include "fit/fitset.h"

struct model_fit {
    struct estimate estimate; /* its bic is the one that ranks */
    struct estimate_trace trace;
    struct choice choice; /* of several; its text is empty for one alone, its estimate NULL */
};

/* name NULL: all of them, cross-validated. data's model and trace are those of the last one fitted. */
int models_fit(struct fitset *data, const char *name, struct model_fit *fit, size_t *n, struct err *e);

#endif
