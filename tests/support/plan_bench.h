/*
 * plan_bench.h — a bench, a diffuser and jobs for tests of job and plan, without any device.
 *
 * The certificate is an in-plane table over theta_i 0..80 and theta_v -85..85 deg, 380..780 nm, valid until
 * 2030-01-01. plan_bench_job puts the geometry and reference texts into a job of one sample and asserts that
 * it is read without a mistake.
 */
#ifndef TESTS_PLAN_BENCH_H
#define TESTS_PLAN_BENCH_H

#include "daemon/plan.h"
#include "proto/profile.h"

#define PLAN_BENCH_SAMPLE "  - {name: hg60, holder: sample, paint: Hooker's Green, size_mm: [60, 40]}\n"

struct plan_bench {
    struct config config;
    struct profile profile;
    struct plan_devices devices;
    struct job job;
    struct plan plan;
    struct err_list errors;
};

/* config_text NULL: the built-in bench. */
void plan_bench_open(struct plan_bench *b, const char *config_text);
void plan_bench_close(struct plan_bench *b);
/* samples, geometry and reference as they stand in a job file; NULL samples: PLAN_BENCH_SAMPLE. */
void plan_bench_job(struct plan_bench *b, const char *samples, const char *geometry, const char *reference);
int plan_bench_make(struct plan_bench *b); /* plan_make into b->plan and b->errors */

char *plan_bench_certificate(void); /* malloc */
/* "FILE:LINE:COLUMN: sentence" of every error, a line each, to stderr: for a failing test. */
void plan_bench_show(const struct err_list *errors);
bool plan_bench_says(const struct err_list *errors, const char *part);

#endif
