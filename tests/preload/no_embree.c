/* Preloaded into a program by a test: Embree is not installed. */
#include <dlfcn.h>
#include <stddef.h>
#include <string.h>

void *dlopen(const char *file, int flags) {
    union {
        void *object;
        void *(*function)(const char *, int);
    } next = {.object = dlsym(RTLD_NEXT, "dlopen")};
    return next.function(file && strstr(file, "libembree") ? "libembree-that-is-not-there.so" : file, flags);
}
