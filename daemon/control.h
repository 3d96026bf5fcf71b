/*
 * control.h — goniod's socket: who may watch, who may operate, and every method by one table.
 *
 * A thread of its own (libuv) that never blocks and never touches the bench: it reads the published snapshot,
 * puts commands on the desk, and sends events. A client that does not read loses events (and is told how
 * many), never the campaign's time; past its limits it is let go.
 *
 * Access     by the peer's uid and all its groups (SO_PEERCRED, SO_PEERGROUPS): root and goniod's own user may do
 *            all; members of an `operate` group may operate and watch; of a `watch` group may watch.
 * Limits     64 clients; a line of 64 KiB for who may watch, RPC_LINE_MAX for who may operate; 4 MiB of unread bytes.
 * Checked    tests/scenario/test_control.c, tests/wire/test_protocol.py; docs/protocol.md
 */
#ifndef DAEMON_CONTROL_H
#define DAEMON_CONTROL_H

#include "daemon/config.h"
#include "daemon/desk.h"
#include "proto/err.h"

struct control;
struct json_t;

struct control_options {
    const char *socket_path;
    const struct config *config; /* access groups */
    struct desk *desk;
    /* Reads and plans a job without touching a device; the plan as JSON (plan_to_json with "text" for
     * people), or NULL with all mistakes. Called in a worker thread, several at once. */
    struct json_t *(*check)(void *arg, const struct desk_run *run, struct err_list *errors);
    void (*on_signal)(void *arg, int signal_number); /* SIGTERM, SIGINT; called in the control thread */
    void *arg;
};

/* Binds the socket (-ERR_BUSY: another goniod answers there; a dead one's socket is replaced) and starts the
 * thread. */
int control_start(struct control **control, const struct control_options *options, struct err *e);
void control_stop(struct control *control); /* lets clients go, removes the socket, joins the thread */

#endif
