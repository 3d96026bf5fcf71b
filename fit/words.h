/*
 * words.h — the sentences of an estimate: warnings, and the refusal that stands in its place.
 *
 * Checked    tests/unit/test_estimate_limits.c
 */
#ifndef FIT_WORDS_H
#define FIT_WORDS_H

#include "proto/material.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Dropped, once MATERIAL_WARNINGS are there. */
void words_warn(struct estimate *estimate, const char *format, ...) __attribute__((format(printf, 2, 3)));
void words_refuse(struct estimate *estimate, const char *format, ...) __attribute__((format(printf, 2, 3)));

#ifdef __cplusplus
}
#endif

#endif
