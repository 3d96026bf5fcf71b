/* Preloaded into goniod: ends it as kill -9 would at its k-th write to a session, with half of the bytes written.
 * KILL_AT_WRITE=k; KILL_COUNT=FILE: no kill, the number of writes goes into FILE at the end. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static atomic_long writes;

static int is_session(int fd) {
    char link[40], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t n = readlink(link, path, sizeof path - 1);
    path[n > 0 ? n : 0] = 0;
    return strstr(path, ".gonio") != NULL && strstr(path, ".gonio-shm") == NULL;
}

static ssize_t pass(const char *name, int fd, const void *bytes, size_t size, off64_t offset) {
    ssize_t (*real)(int, const void *, size_t, off64_t) =
        (ssize_t(*)(int, const void *, size_t, off64_t))dlsym(RTLD_NEXT, name);
    const char *at = getenv("KILL_AT_WRITE");
    if (!is_session(fd))
        return real(fd, bytes, size, offset);
    if (atomic_fetch_add(&writes, 1) + 1 != (at ? atol(at) : 0))
        return real(fd, bytes, size, offset);
    real(fd, bytes, size / 2, offset);
    kill(getpid(), SIGKILL);
    return -1;
}

ssize_t pwrite64(int fd, const void *bytes, size_t size, off64_t offset) {
    return pass("pwrite64", fd, bytes, size, offset);
}

ssize_t pwrite(int fd, const void *bytes, size_t size, off_t offset) {
    return pass("pwrite", fd, bytes, size, offset);
}

__attribute__((destructor)) static void report(void) {
    const char *path = getenv("KILL_COUNT");
    FILE *out = path ? fopen(path, "w") : NULL;
    if (!out)
        return;
    fprintf(out, "%ld\n", atomic_load(&writes));
    fclose(out);
}
