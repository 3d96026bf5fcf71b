#include <stdlib.h>
#include <string.h>

#include "daemon/job.h"
#include "daemon/job_keys.h"
#include "proto/file.h"

/* A path in a job is relative to the job file. */
static void beside(const char *job_path, const char *name, char *path, size_t size) {
    const char *slash = strrchr(job_path, '/');
    int folder = slash && name[0] != '/' ? (int)(slash - job_path) + 1 : 0;
    snprintf(path, size, "%.*s%s", folder, job_path, name);
}

static int load_certificate(const char *job_path, const struct job *job, struct job_file *file,
                            struct err_list *errors) {
    char path[1024], *text;
    struct err e = {0};
    beside(job_path, job->reference.certificate_file, path, sizeof path);
    *file = (struct job_file){0};
    snprintf(file->name, sizeof file->name, "%s", job->reference.certificate_file);
    int rc = file_read(path, CERTIFICATE_BYTES_MAX, &text, &file->size, &e);
    if (rc < 0)
        job_complain(job, errors, "reference.certificate", "certificate %s: %s", file->name, e.text);
    else
        file->text = text;
    return rc;
}

static void read_again(const char *path, const char *text, size_t size, const struct job_file *file,
                       struct job *job, struct err_list *errors) {
    job_free(job);
    job_read_text(path, text, size, file, 1, job, errors);
}

int job_load_files(const char *path, char **text, size_t *size, struct job_file *files_out, int *n_files,
                   struct err_list *errors) {
    struct err e = {0};
    *n_files = 0;
    int rc = file_read(path, YAML_BYTES_MAX, text, size, &e);
    if (rc < 0) {
        err_list_add(errors, &e);
        return rc;
    }
    /* Only the names of files are wanted here; job_read_text reports what is wrong with the rest. */
    struct job *job = calloc(1, sizeof *job);
    struct err_list ignored = {0};
    if (!job) {
        free(*text);
        return -ERR_NOMEM;
    }
    job_read_text(path, *text, *size, NULL, 0, job, &ignored);
    if (job->reference.certificate_file[0]) {
        rc = load_certificate(path, job, &files_out[0], errors);
        if (rc == 0)
            *n_files = 1;
        else /* what else is wrong with the job comes in the same pass */
            read_again(path, *text, *size, &files_out[0], job, errors);
    }
    job_free(job);
    free(job);
    err_list_free(&ignored);
    if (rc < 0) {
        free(*text);
        *text = NULL;
    }
    return rc;
}

void job_files_free(struct job_file *files, int n) {
    for (int i = 0; i < n; i++)
        free((char *)files[i].text);
}
