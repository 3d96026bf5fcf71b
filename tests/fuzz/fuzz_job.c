/* A job file as a stranger may send it, with a certificate after the first NUL byte. */
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/job.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    const uint8_t *end = size ? memchr(data, '\0', size) : NULL;
    size_t job_size = end ? (size_t)(end - data) : size;
    char *text = malloc(size + 1);
    if (!text)
        return 0;
    if (size)
        memcpy(text, data, size);
    text[size] = '\0';
    struct job_file file = {"ptfe.csv", end ? text + job_size + 1 : "", end ? size - job_size - 1 : 0};
    struct job *job = malloc(sizeof *job);
    struct err_list errors = {0};
    if (job) {
        int rc = job_read_text("job.yaml", text, job_size, &file, 1, job, &errors);
        if ((rc == 0) != (errors.n == 0))
            abort();
        job_check_expiry(job, 1767225600, &errors);
        job_free(job);
    }
    err_list_free(&errors);
    free(job);
    free(text);
    return 0;
}
