#include "fit/fitset.h"

#include "fit/words.h"

/* Apart from fitset.c, so that a reader of points does not bring the solver with it. */
int fitset_fit(struct fitset *d, struct estimate *estimate, struct err *e) {
    const struct estimate_input *input;
    *estimate = (struct estimate){0};
    int status = fitset_input(d, &input, e);
    if (status || (status = estimate_fit(input, estimate, e))) {
        return status;
    }
    for (int rule = 0; rule < MASK_RULES; rule++) {
        if (d->mask.left_out[rule] > 0) {
            words_warn(estimate, "left out: %zu points %s", d->mask.left_out[rule],
                       mask_words((enum mask_rule)rule));
        }
    }
    if (d->independence_assumed) {
        words_warn(estimate, "only a total uncertainty was given: independence of the points was assumed");
    }
    return 0;
}
