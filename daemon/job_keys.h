/*
 * job_keys.h — the tables of keys of job.yaml; what job.c reads, checks and prints by.
 *
 * Offsets are into struct job (job_keys) and struct job_sample (job_sample_keys). A list of angles is written
 * as numbers or as a mapping of job_range_keys.
 * Checked    tests/unit/test_job.c
 */
#ifndef DAEMON_JOB_KEYS_H
#define DAEMON_JOB_KEYS_H

#include "proto/yaml.h"

extern const struct yaml_key job_keys[];
extern const struct yaml_key job_range_keys[];
const char *const *job_fit_models(void); /* ends with NULL */

#endif
