#include "daemon/control_access.h"

#include <errno.h>
#include <grp.h>
#include <pwd.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <unistd.h>

#define GROUPS_MAX 1024

static bool member(const gid_t *groups, size_t n, const char (*names)[32], int n_names) {
    for (int i = 0; i < n_names; i++) {
        const struct group *g = getgrnam(names[i]);
        for (size_t k = 0; g && k < n; k++)
            if (groups[k] == g->gr_gid)
                return true;
    }
    return false;
}

struct control_rights control_access_rule(uid_t uid, const gid_t *groups, size_t n_groups,
                                          const struct config *config) {
    struct control_rights r = {0};
    r.operate = uid == 0 || uid == geteuid() || member(groups, n_groups, config->operate, config->n_operate);
    r.watch = r.operate || member(groups, n_groups, config->watch, config->n_watch);
    return r;
}

int control_access(int fd, const struct config *config, struct control_rights *rights, struct err *e) {
    struct ucred peer;
    socklen_t size = sizeof peer;
    if (getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0)
        return err_errno(e, ERR_PERMISSION, errno, "the kernel does not say who connected");
    gid_t groups[GROUPS_MAX + 1];
    size = GROUPS_MAX * sizeof *groups;
    if (getsockopt(fd, SOL_SOCKET, SO_PEERGROUPS, groups, &size) != 0)
        return err_errno(e, ERR_PERMISSION, errno, "the kernel does not say which groups the client is in");
    size_t n = size / sizeof *groups;
    groups[n++] = peer.gid;
    *rights = control_access_rule(peer.uid, groups, n, config);
    const struct passwd *user = getpwuid(peer.uid);
    snprintf(rights->who, sizeof rights->who, "uid %u (%.24s), pid %d", (unsigned)peer.uid,
             user ? user->pw_name : "?", (int)peer.pid);
    return 0;
}
