/* Preloaded into a program by a test: folders whose path holds NETWORK_FOLDER lie on NFS, as statfs tells it. */
#include <dlfcn.h>
#include <linux/magic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/vfs.h>

int statfs(const char *path, struct statfs *fs) {
    union {
        void *object;
        int (*function)(const char *, struct statfs *);
    } next = {.object = dlsym(RTLD_NEXT, "statfs")};
    const char *folder = getenv("NETWORK_FOLDER");
    int result = next.function(path, fs);
    if (result == 0 && folder && strstr(path, folder))
        fs->f_type = NFS_SUPER_MAGIC;
    return result;
}
