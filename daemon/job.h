/*
 * job.h — job.yaml: what to measure, on which samples, against which reference (form: design 10).
 *
 * A job is read as text (it may come over the socket) together with the files it names; goniod opens no path
 * that a client sent. All mistakes come in one pass with file:line:column, and a struct job that was refused
 * is freed like any other. Angles of lists are sorted and free of duplicates.
 * Checked    tests/unit/test_job.c, tests/fuzz/fuzz_job.c
 */
#ifndef DAEMON_JOB_H
#define DAEMON_JOB_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "proto/certificate.h"
#include "proto/err.h"
#include "proto/material.h"
#include "proto/yaml.h"

#define JOB_SAMPLES 16
#define JOB_ANGLES 64
#define JOB_VIEWS 512
#define JOB_PAIRS 4096
#define JOB_FILES 8

struct job_sample {
    char name[48], holder[32];
    char paint[64], support[64];
    double size_mm[2]; /* in the plane of incidence, across it */
    bool has_water;
    double water_percent;
    char *notes; /* the mapping as one line of JSON, or NULL */
};

enum job_reference_mode {
    REFERENCE_FIXED,
    REFERENCE_PER_INCIDENCE,
    REFERENCE_EVERY_GEOMETRY,
    REFERENCE_START_END
};

struct job_reference {
    enum job_reference_mode mode;
    double theta_i_deg, theta_v_deg; /* of fixed and start_end, and the control geometry of every_geometry */
    char holder[32];
    char certificate_file[128];
    double size_mm; /* diameter of the diffuser; 0 = not stated, its footprint is then not checked */
    double bracket_min;
    double angular_u_rel; /* 0 = not stated */
    bool accept_expired;  /* the certificate's valid_until may have passed */
};

struct job_geometry {
    int n_theta_i, n_theta_v;
    double theta_i_deg[JOB_ANGLES];
    double theta_v_deg[JOB_VIEWS]; /* written out from the list or from/to/step */
    /* Further views around theta_v = theta_i, as far as theta_v_deg reaches; 0 = no refinement. */
    double mirror_step_deg, mirror_half_width_deg;
    bool reciprocity;
    int n_pairs;
    double pair_deg[JOB_PAIRS][2]; /* theta_i, theta_v */
};

struct job_exposure {
    double target; /* of saturation */
    double min_ms, max_ms;
    int average;
    double dark_every_min;
};

struct job {
    char file[128], name[48], series[48];
    int n_samples;
    struct job_sample sample[JOB_SAMPLES];
    struct job_geometry geometry;
    int mean_nm[2];
    struct job_exposure exposure;
    struct job_reference reference;
    struct certificate certificate;
    char fit_model[24]; /* or "all" */
    enum material_loss fit_loss;
    char *text;                /* as sent, for the session */
    struct yaml_places places; /* where each key was written, for contradictions found later */
};

struct job_file { /* a file the job names, as sent */
    char name[128];
    const char *text; /* NULL: could not be read, which has been said */
    size_t size;
};

int job_read_text(const char *file, const char *text, size_t size, const struct job_file *files, int n_files,
                  struct job *job, struct err_list *errors);
/* A mistake of the job at the place of a key ("samples[0].size_mm"), found by whoever sets it against
 * something else. */
void job_complain(const struct job *job, struct err_list *errors, const char *path, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
/* Refuses a certificate whose valid_until lies before the day of utc_s, unless the job accepts that. */
int job_check_expiry(const struct job *job, int64_t utc_s, struct err_list *errors);
const char *job_mode_name(enum job_reference_mode mode); /* "every_geometry" */
/* Reads the job and the files it names from disk (gonioctl's side and tests); files_out for sending, free
 * with job_files_free, the text with free. files_out has room for JOB_FILES. */
int job_load_files(const char *path, char **text, size_t *size, struct job_file *files_out, int *n_files,
                   struct err_list *errors);
void job_files_free(struct job_file *files, int n);
void job_free(struct job *job);
void job_print_reference(void *file); /* FILE * */

#endif
