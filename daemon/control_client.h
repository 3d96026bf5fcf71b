/*
 * control_client.h — one connection to goniod's socket: lines in, lines out, within its limits.
 *
 * Belongs to the control thread. A line that is too long ends the connection with a sentence; 4 MiB of replies that
 * nobody reads end it too, with the sentence in goniod's log. Events are dropped rather than queued for a slow reader,
 * and the number of missed ones is told when it reads again.
 * Checked    tests/scenario/test_control.c
 */
#ifndef DAEMON_CONTROL_CLIENT_H
#define DAEMON_CONTROL_CLIENT_H

#include <stdbool.h>
#include <stdint.h>
#include <uv.h>

#include "daemon/control_access.h"

#define CONTROL_CLIENTS 64
#define CONTROL_LINE_WATCH (64 * 1024)
#define CONTROL_UNREAD_MAX (4 * 1024 * 1024)
#define CONTROL_UNREAD_EVENTS (256 * 1024)

struct control;

struct control_client {
    uv_pipe_t pipe;
    struct control *control;
    struct control_client *next;
    uint64_t number; /* never used twice: a late outcome cannot reach another client */
    struct control_rights rights;
    bool watching, closing;
    bool ended;      /* it has sent its last line, and still reads */
    int owed;        /* answers that come later: orders on the desk, plans being made */
    uint64_t missed; /* events dropped since the last one sent */
    char *line;
    size_t used, capacity;
};

int control_client_read(struct control_client *client); /* each whole line goes to control_handle_line */
void control_client_send(struct control_client *client, char *text); /* takes text over; NULL is ignored */
/* Sends an owed answer; a client that has ended its lines is let go with the last one. */
void control_client_settle(struct control_client *client, char *text);
/* Sends if the client watches and reads; else counts it as missed. */
void control_client_event(struct control_client *client, const char *text, size_t size);
/* Sends a last sentence, then closes when it is out. */
void control_client_dismiss(struct control_client *client, const char *sentence);
void control_client_close(struct control_client *client);

#endif
