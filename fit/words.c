#include "fit/words.h"

#include <stdarg.h>
#include <stdio.h>

void words_warn(struct estimate *estimate, const char *format, ...) {
    if (estimate->n_warnings < MATERIAL_WARNINGS) {
        va_list arguments;
        va_start(arguments, format);
        vsnprintf(estimate->warning[estimate->n_warnings++], sizeof estimate->warning[0], format, arguments);
        va_end(arguments);
    }
}

void words_refuse(struct estimate *estimate, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(estimate->refusal, sizeof estimate->refusal, format, arguments);
    va_end(arguments);
    estimate->converged = false;
}
