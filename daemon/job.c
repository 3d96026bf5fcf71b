#include "daemon/job.h"

#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "daemon/job_keys.h"

void job_complain(const struct job *job, struct err_list *errors, const char *path, const char *format, ...) {
    const struct yaml_place *place = yaml_place_near(&job->places, path);
    va_list args;
    va_start(args, format);
    err_list_mistake(errors, job->file, place ? place->line : 0, place ? place->column : 0, format, args);
    va_end(args);
}

static bool written(const struct job *job, const char *path) {
    return yaml_place_find(&job->places, path) != NULL;
}

/* A name becomes part of a session's file name. */
static void check_name(const struct job *job, struct err_list *errors, const char *path, const char *name) {
    static const char letters[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_";
    if (name[0] && name[strspn(name, letters)] != '\0')
        job_complain(job, errors, path, "'%s' cannot be part of a file name: use letters, digits, - and _",
                     name);
}

static void check_samples(const struct job *job, struct err_list *errors) {
    char path[64];
    for (int i = 0; i < job->n_samples; i++) {
        snprintf(path, sizeof path, "samples[%d].name", i);
        check_name(job, errors, path, job->sample[i].name);
        for (int j = 0; j < i; j++)
            if (job->sample[i].name[0] && strcmp(job->sample[i].name, job->sample[j].name) == 0) {
                job_complain(job, errors, path,
                             "sample '%s' is already in the list: each needs a name of its own",
                             job->sample[i].name);
                break;
            }
    }
}

static void check_geometry(const struct job *job, struct err_list *errors) {
    const struct job_geometry *g = &job->geometry;
    bool grid = written(job, "geometry.theta_i_deg") || written(job, "geometry.theta_v_deg");
    bool pairs = written(job, "geometry.pairs");
    if (grid && pairs)
        job_complain(job, errors, "geometry.pairs",
                     "either pairs, or theta_i_deg with theta_v_deg, not both");
    if (!pairs && !written(job, "geometry.theta_i_deg"))
        job_complain(job, errors, "geometry",
                     "theta_i_deg is missing: give theta_i_deg and theta_v_deg, or pairs");
    if (!pairs && !written(job, "geometry.theta_v_deg"))
        job_complain(job, errors, "geometry",
                     "theta_v_deg is missing: give theta_i_deg and theta_v_deg, or pairs");
    if (written(job, "geometry.mirror_step_deg") && g->mirror_step_deg == 0)
        job_complain(job, errors, "geometry.mirror_step_deg",
                     "a step of 0 deg never ends: leave the key out for no refinement");
    if (g->mirror_step_deg > 0 && g->mirror_half_width_deg == 0)
        job_complain(job, errors, "geometry.mirror_step_deg",
                     "mirror_half_width_deg is missing: how far around the "
                     "mirror direction?");
    if (g->mirror_half_width_deg > 0 && !written(job, "geometry.mirror_step_deg"))
        job_complain(job, errors, "geometry.mirror_half_width_deg",
                     "mirror_step_deg is missing: how far apart?");
    if (pairs && (g->mirror_step_deg > 0 || g->mirror_half_width_deg > 0))
        job_complain(job, errors, "geometry.pairs",
                     "pairs are measured as they are: the mirror keys belong to a grid");
}

static void check_exposure(const struct job *job, struct err_list *errors) {
    const struct job_exposure *x = &job->exposure;
    if (x->min_ms > x->max_ms)
        job_complain(job, errors, "exposure.min_ms", "min_ms (%g) is larger than max_ms (%g)", x->min_ms,
                     x->max_ms);
}

static void check_model(const struct job *job, struct err_list *errors) {
    const char *const *models = job_fit_models();
    for (int i = 0; models[i]; i++)
        if (strcmp(models[i], job->fit_model) == 0)
            return;
    const char *near = yaml_nearest(job->fit_model, models);
    job_complain(
        job, errors, "fit.model",
        "unknown model '%s'%s%s: lambert, oren-nayar, eq1, composite, heavy-tail, transmitted or two-lobe",
        job->fit_model, near ? ", did you mean " : "", near ? near : "");
}

static void check_wavelengths(const struct job *job, struct err_list *errors) {
    const struct certificate *c = &job->certificate;
    if (c->n == 0)
        return;
    double low = c->row[0].lambda_nm, high = low;
    for (size_t i = 1; i < c->n; i++) {
        low = c->row[i].lambda_nm < low ? c->row[i].lambda_nm : low;
        high = c->row[i].lambda_nm > high ? c->row[i].lambda_nm : high;
    }
    if (job->mean_nm[0] < low || job->mean_nm[1] > high)
        job_complain(job, errors, written(job, "mean_nm") ? "mean_nm" : "reference.certificate",
                     "the mean over %d .. %d nm needs more than the certificate %s covers (%g .. %g nm)",
                     job->mean_nm[0], job->mean_nm[1], job->reference.certificate_file, low, high);
}

static void read_certificate(struct job *job, const struct job_file *files, int n_files,
                             struct err_list *errors) {
    if (!job->reference.certificate_file[0])
        return;
    for (int i = 0; i < n_files; i++)
        if (strcmp(files[i].name, job->reference.certificate_file) == 0) {
            if (!files[i].text)
                return;
            if (certificate_read_text(files[i].name, files[i].text, files[i].size, &job->certificate,
                                      errors) == 0)
                check_wavelengths(job, errors);
            return;
        }
    job_complain(job, errors, "reference.certificate",
                 "the certificate '%s' did not come with the job: gonioctl "
                 "reads it from beside the job file and sends both",
                 job->reference.certificate_file);
}

static void check_reference(const struct job *job, struct err_list *errors) {
    if (job->reference.mode == REFERENCE_PER_INCIDENCE && written(job, "reference.geometry.theta_i_deg"))
        job_complain(job, errors, "reference.geometry.theta_i_deg",
                     "in mode per_incidence the diffuser is read at each theta_i of the job: only "
                     "theta_v_deg is used");
}

static void check(const struct job *job, struct err_list *errors) {
    check_name(job, errors, "name", job->name);
    check_name(job, errors, "series", job->series);
    check_samples(job, errors);
    if (written(job, "geometry"))
        check_geometry(job, errors);
    check_exposure(job, errors);
    if (written(job, "fit.model"))
        check_model(job, errors);
    if (job->mean_nm[0] >= job->mean_nm[1])
        job_complain(job, errors, "mean_nm", "the mean runs from the smaller wavelength to the larger one");
    check_reference(job, errors);
}

int job_read_text(const char *file, const char *text, size_t size, const struct job_file *files, int n_files,
                  struct job *job, struct err_list *errors) {
    *job = (struct job){0};
    snprintf(job->file, sizeof job->file, "%s", file);
    size_t before = errors->n;
    yaml_read_text_places(file, text, size, job_keys, job, errors, &job->places);
    if (job->places.n > 0)
        check(job, errors);
    yaml_sort_errors(errors, before);
    read_certificate(job, files, n_files, errors);
    if (!job->series[0])
        memcpy(job->series, job->name, sizeof job->series);
    job->text = strndup(text, size);
    return errors->n > before ? -ERR_INPUT : 0;
}

int job_check_expiry(const struct job *job, int64_t utc_s, struct err_list *errors) {
    time_t seconds = (time_t)utc_s;
    struct tm utc;
    char today[16];
    gmtime_r(&seconds, &utc);
    strftime(today, sizeof today, "%Y-%m-%d", &utc);
    /* Dates of the form YYYY-MM-DD sort as text. */
    const char *until = job->certificate.valid_until;
    if (!until[0] || strcmp(today, until) <= 0 || job->reference.accept_expired)
        return 0;
    job_complain(job, errors, "reference.certificate",
                 "the certificate %s was valid until %s, today is %s: have the diffuser calibrated, or state "
                 "accept_expired: true",
                 job->reference.certificate_file, until, today);
    return -ERR_INPUT;
}

void job_free(struct job *job) {
    for (int i = 0; i < JOB_SAMPLES; i++)
        free(job->sample[i].notes);
    certificate_free(&job->certificate);
    yaml_places_free(&job->places);
    free(job->text);
    *job = (struct job){0};
}

void job_print_reference(void *file) {
    yaml_print_reference(file, "job.yaml", job_keys);
    yaml_print_reference(file, "job.yaml: angles from, to, step", job_range_keys);
}
