/* Preloaded into goniod by a test: a disk that stalls. When the file named by STALL_FILE exists, it is removed and the
 * next sync takes STALL_MS longer. */
#include <dlfcn.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

static void stall(void) {
    const char *file = getenv("STALL_FILE"), *ms = getenv("STALL_MS");
    if (!file || !ms || unlink(file) != 0)
        return;
    struct timespec t = {.tv_sec = strtol(ms, NULL, 10) / 1000,
                         .tv_nsec = strtol(ms, NULL, 10) % 1000 * 1000000};
    nanosleep(&t, NULL);
}

static int real_sync(const char *name, int fd) {
    union {
        void *object;
        int (*function)(int);
    } next = {.object = dlsym(RTLD_NEXT, name)};
    return next.function(fd);
}

int fsync(int fd) {
    stall();
    return real_sync("fsync", fd);
}

int fdatasync(int fd) {
    stall();
    return real_sync("fdatasync", fd);
}
