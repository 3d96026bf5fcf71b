/*
 * control_private.h — what the files of the control thread share: its loop, its clients, its desk.
 * Checked    tests/scenario/test_control.c, tests/wire/test_protocol.py
 */
#ifndef DAEMON_CONTROL_PRIVATE_H
#define DAEMON_CONTROL_PRIVATE_H

#include <pthread.h>
#include <jansson.h>

#include "daemon/control.h"
#include "daemon/control_client.h"

struct control_pending { /* an order on the desk whose outcome somebody waits for */
    int64_t ticket;      /* 0 = free */
    uint64_t client;
    json_t *id;
};

struct control {
    uv_loop_t loop;
    uv_pipe_t listener;
    uv_async_t stop;
    uv_poll_t desk_ready; /* outcomes, a snapshot or events */
    uv_signal_t terminate, interrupt;
    pthread_t thread;
    struct control_options options;
    struct control_client *clients;
    int n_clients;
    uint64_t next_number;
    struct control_pending pending[DESK_ORDERS];
    int64_t last_event;      /* serial of the newest event sent out */
    int64_t snapshot_serial; /* of the newest seen ... */
    uint64_t snapshot_at_ms; /* ... and when (uv_now) */
    int lock_fd;             /* flock of SOCKET.lock: one goniod a socket */
    char path[108];
};

/* control_methods.c: answers a request, or puts an order on the desk and answers when its outcome comes. */
void control_handle_line(struct control_client *client, const char *line, size_t size);
void control_take_from_desk(struct control *control);
/* control_check.c: plans a job in a worker thread and answers. Takes run over. */
void control_check(struct control_client *client, const json_t *id, struct desk_run *run);

void control_forget_client(struct control *control, struct control_client *client);
struct control_client *control_find_client(struct control *control, uint64_t number);

#endif
