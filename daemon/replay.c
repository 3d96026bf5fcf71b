#include "daemon/replay.h"

#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "daemon/replay_private.h"

static int make_folder(char dir[PATH_MAX], struct err *e) {
    const char *temporary = getenv("TMPDIR");
    snprintf(dir, PATH_MAX, "%s/goniod-replay-XXXXXX", temporary && *temporary ? temporary : "/tmp");
    if (mkdtemp(dir))
        return 0;
    int saved = errno;
    return err_errno(e, ERR_IO, saved, "cannot make the folder %s for the simulated session", dir);
}

static void remove_folder(const char *dir) {
    DIR *folder = opendir(dir);
    for (struct dirent *d; folder && (d = readdir(folder));) {
        char path[PATH_MAX];
        if (snprintf(path, sizeof path, "%s/%s", dir, d->d_name) < (int)sizeof path && *d->d_name != '.')
            unlink(path);
    }
    if (folder)
        closedir(folder);
    rmdir(dir);
}

static int simulate(struct derived *simulated, const struct recording *r,
                    const struct replay_options *options, struct err *e) {
    char dir[PATH_MAX], path[PATH_MAX];
    int rc = make_folder(dir, e);
    if (rc < 0)
        return rc;
    rc = replay_measure(r, options, dir, path, e);
    if (rc == 0)
        rc = derived_read(simulated, path, e);
    remove_folder(dir);
    return rc;
}

/* The truth is measured on the bench that it was measured on; the estimate with a noise of its own. */
static uint64_t usual_seed(const struct recording *r, enum replay_surface surface) {
    return surface == REPLAY_TRUTH ? r->seed : r->seed + 1;
}

int replay_run(struct replay *replay, const char *path, const struct replay_options *options, struct err *e) {
    struct replay_options chosen = *options;
    struct recording *r = calloc(1, sizeof *r);
    struct derived measured = {0}, simulated = {0};
    memset(replay, 0, sizeof *replay);
    if (!r)
        return err_set(e, ERR_NOMEM, "no memory for the recording");
    int rc = recording_read(r, path, options->surface, e);
    if (rc == 0)
        rc = derived_read(&measured, path, e);
    if (!chosen.has_seed)
        chosen.seed = usual_seed(r, chosen.surface);
    replay->seed = chosen.seed;
    if (rc == 0)
        rc = simulate(&simulated, r, &chosen, e);
    if (rc == 0)
        rc = replay_compare(replay, r, options->surface, &measured, &simulated, e);
    derived_free(&measured);
    derived_free(&simulated);
    recording_free(r);
    free(r);
    return rc;
}

void replay_free(struct replay *replay) {
    free(replay->point);
    replay->point = NULL;
}
