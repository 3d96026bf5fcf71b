#include "proto/output.h"

#include <errno.h>
#include <limits.h>
#include <stdbool.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static bool is_file(const char *path) {
    struct stat st;
    return stat(path, &st) == 0 && S_ISREG(st.st_mode);
}

static int refuse_existing(const char *path, struct err *e) {
    return err_set(e, ERR_BUSY, "%s: exists already; nothing is overwritten", path);
}

int output_check(const char *path, struct err *e) {
    char folder[PATH_MAX];
    const char *slash = strrchr(path, '/');
    if (is_file(path))
        return refuse_existing(path, e);
    snprintf(folder, sizeof folder, "%.*s", slash ? (int)(slash - path) + 1 : 1, slash ? path : ".");
    if (access(path, F_OK) == 0 ? access(path, W_OK) == 0 : access(folder, W_OK | X_OK) == 0)
        return 0; /* a device is there already */
    int saved_errno = errno;
    return err_errno(e, ERR_IO, saved_errno, "cannot write %s", path);
}

FILE *output_open(const char *path, struct err *e) {
    struct stat st;
    bool device = stat(path, &st) == 0 && !S_ISREG(st.st_mode);
    FILE *out = fopen(path, device ? "wb" : "wbx");
    int saved_errno = errno;
    if (!out && saved_errno == EEXIST)
        refuse_existing(path, e);
    else if (!out)
        err_errno(e, ERR_IO, saved_errno, "cannot write %s", path);
    return out;
}

int output_close(FILE *out, const char *path, int rc, struct err *e) {
    bool failed = ferror(out) != 0;
    if (fclose(out) != 0 || failed) {
        int saved_errno = errno;
        rc = err_errno(e, saved_errno == ENOSPC ? ERR_FULL : ERR_IO, saved_errno,
                       "%s could not be written whole", path);
    }
    if (rc < 0 && is_file(path))
        remove(path);
    return rc;
}

int output_end(const char *program, int status) {
    bool failed = ferror(stdout) != 0;
    if (fflush(stdout) == 0 && !failed)
        return status;
    int saved_errno = errno;
    fprintf(stderr, "%s: not everything could be written to the standard output: %s\n", program,
            strerror(saved_errno));
    return status ? status : 1;
}
