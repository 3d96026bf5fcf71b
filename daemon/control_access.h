/*
 * control_access.h — what the process at the other end of a unix socket may do.
 *
 * Decided by the kernel's word alone: its uid (SO_PEERCRED) and every one of its groups (SO_PEERGROUPS, so
 * that a supplementary group counts), never by what the client says.
 * Checked    tests/scenario/test_control.c
 */
#ifndef DAEMON_CONTROL_ACCESS_H
#define DAEMON_CONTROL_ACCESS_H

#include <stdbool.h>
#include <stddef.h>
#include <sys/types.h>

#include "daemon/config.h"
#include "proto/err.h"

struct control_rights {
    bool watch, operate;
    char who[64]; /* "uid 1000 (anna), pid 4711" for the log */
};

int control_access(int socket_fd, const struct config *config, struct control_rights *rights, struct err *e);
/* The rule itself: root and goniod's own user may do all; operate implies watch. */
struct control_rights control_access_rule(uid_t uid, const gid_t *groups, size_t n_groups,
                                          const struct config *config);

#endif
