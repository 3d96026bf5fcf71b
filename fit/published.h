/*
 * published.h — the four parameter sets of the paper, Hooker's Green: what a stated figure of accuracy refers to.
 *
 * sigma, gamma, beta' and n as printed; the paper never prints S, so it is assumed (reflection-model.md 1.5). As
 * radiance factors, kappa = 1: the paper's own form has kappa = pi with the same S.
 * Shapes     value[] by enum material_parameter of the composite model.
 * Source     paper, Experimental results; reflection-model.md 1.5.
 * Checked    tests/unit/test_fit_parts.c
 */
#ifndef FIT_PUBLISHED_H
#define FIT_PUBLISHED_H

#include "proto/material.h"

#ifdef __cplusplus
extern "C" {
#endif

#define PUBLISHED_SETS 4

struct published {
    const char *name, *description;
    double value[MATERIAL_PARAMETERS];
};

extern const struct published published[PUBLISHED_SETS];

#ifdef __cplusplus
}
#endif

#endif
