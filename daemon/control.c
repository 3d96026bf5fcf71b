#include "daemon/control.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "daemon/control_private.h"

void control_forget_client(struct control *control, struct control_client *client) {
    struct control_client **at = &control->clients;
    while (*at && *at != client)
        at = &(*at)->next;
    if (*at) {
        *at = client->next;
        control->n_clients--;
    }
}

struct control_client *control_find_client(struct control *control, uint64_t number) {
    struct control_client *c = control->clients;
    while (c && c->number != number)
        c = c->next;
    return c;
}

static const char *admit(struct control *control, struct control_client *c) {
    uv_os_fd_t fd;
    struct err e = {0};
    if (control->n_clients > CONTROL_CLIENTS)
        return "64 clients are connected already; close one and try again";
    if (uv_fileno((uv_handle_t *)&c->pipe, &fd) != 0 ||
        control_access(fd, control->options.config, &c->rights, &e) != 0)
        return "the kernel does not say who is asking, so nothing is answered";
    if (!c->rights.watch) {
        fprintf(stderr, "goniod: refused %s: not in a group of access.watch or access.operate\n",
                c->rights.who);
        return "not allowed: your user is in no group named under access.watch or access.operate of "
               "goniod.yaml";
    }
    return NULL;
}

static void on_connection(uv_stream_t *listener, int status) {
    struct control *control = listener->data;
    struct control_client *c = status == 0 ? calloc(1, sizeof *c) : NULL;
    if (!c)
        return;
    c->control = control;
    c->number = ++control->next_number;
    uv_pipe_init(&control->loop, &c->pipe, 0);
    c->pipe.data = c;
    c->next = control->clients;
    control->clients = c;
    control->n_clients++;
    if (uv_accept(listener, (uv_stream_t *)&c->pipe) != 0) {
        control_client_close(c);
        return;
    }
    const char *refusal = admit(control, c);
    if (refusal)
        control_client_dismiss(c, refusal);
    else if (control_client_read(c) != 0)
        control_client_close(c);
}

static void close_any(uv_handle_t *handle, void *arg) {
    (void)arg;
    if (!uv_is_closing(handle))
        uv_close(handle, NULL);
}

static void shut(struct control *control) {
    for (struct control_client *c = control->clients; c; c = c->next)
        control_client_close(c);
    uv_walk(&control->loop, close_any, NULL);
}

static void on_stop(uv_async_t *stop) {
    shut(stop->data);
}

static void on_desk(uv_poll_t *poll, int status, int events) {
    (void)status;
    (void)events;
    control_take_from_desk(poll->data);
}

static void on_signal(uv_signal_t *signal, int number) {
    struct control *control = signal->data;
    control->options.on_signal(control->options.arg, number);
}

static void *run(void *arg) {
    struct control *control = arg;
    sigset_t pipe; /* a client that has left is an error of the write to it, nothing more */
    sigemptyset(&pipe);
    sigaddset(&pipe, SIGPIPE);
    pthread_sigmask(SIG_BLOCK, &pipe, NULL);
    uv_run(&control->loop, UV_RUN_DEFAULT);
    return NULL;
}

/* The lock, not the socket file, says whether a goniod lives here: a file stays behind after kill -9, a lock
 * does not. */
static int own_path(struct control *control, struct err *e) {
    char lock[128];
    snprintf(lock, sizeof lock, "%s.lock", control->path);
    control->lock_fd = open(lock, O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    if (control->lock_fd < 0)
        return err_errno(e, ERR_IO, errno,
                         "cannot make %s; does its folder exist and may goniod write there?", lock);
    if (flock(control->lock_fd, LOCK_EX | LOCK_NB) != 0)
        return err_set(e, ERR_BUSY, "another goniod serves %s; stop it, or give this one its own --socket",
                       control->path);
    unlink(control->path);
    return 0;
}

static int listen_on(struct control *control, struct err *e) {
    uv_pipe_init(&control->loop, &control->listener, 0);
    control->listener.data = control;
    int rc = uv_pipe_bind(&control->listener, control->path);
    /* Who may do what is decided from the peer's identity, so anyone may knock. */
    if (rc == 0)
        rc = chmod(control->path, 0666) == 0 ? 0 : -errno;
    if (rc == 0)
        rc = uv_listen((uv_stream_t *)&control->listener, CONTROL_CLIENTS, on_connection);
    return rc == 0 ? 0 : err_errno(e, ERR_IO, -rc, "cannot listen on %s", control->path);
}

static int open_loop(struct control *control, struct err *e) {
    int rc = uv_loop_init(&control->loop);
    if (rc != 0)
        return err_errno(e, ERR_IO, -rc, "cannot make an event loop");
    uv_async_init(&control->loop, &control->stop, on_stop);
    uv_poll_init(&control->loop, &control->desk_ready, desk_control_fd(control->options.desk));
    uv_poll_start(&control->desk_ready, UV_READABLE, on_desk);
    control->stop.data = control->desk_ready.data = control;
    uv_signal_init(&control->loop, &control->terminate);
    uv_signal_init(&control->loop, &control->interrupt);
    control->terminate.data = control->interrupt.data = control;
    uv_signal_start(&control->terminate, on_signal, SIGTERM);
    uv_signal_start(&control->interrupt, on_signal, SIGINT);
    return listen_on(control, e);
}

static void release(struct control *control) {
    if (control->lock_fd >= 0)
        close(control->lock_fd);
    free(control);
}

int control_start(struct control **out, const struct control_options *options, struct err *e) {
    struct control *control = calloc(1, sizeof *control);
    if (!control)
        return err_set(e, ERR_NOMEM, "no memory for the control thread");
    control->options = *options;
    control->lock_fd = -1;
    if (strlen(options->socket_path) >= sizeof control->path) {
        free(control);
        return err_set(e, ERR_USAGE, "the socket path %s is longer than the %zu bytes a socket may have",
                       options->socket_path, sizeof control->path - 1);
    }
    strcpy(control->path, options->socket_path);
    int rc = own_path(control, e);
    if (rc == 0 && (rc = open_loop(control, e)) != 0) {
        shut(control);
        uv_run(&control->loop, UV_RUN_DEFAULT);
        uv_loop_close(&control->loop);
    }
    if (rc != 0) {
        release(control);
        return rc;
    }
    rc = pthread_create(&control->thread, NULL, run, control);
    if (rc != 0) {
        release(control);
        return err_errno(e, ERR_IO, rc, "cannot start the control thread");
    }
    *out = control;
    return 0;
}

void control_stop(struct control *control) {
    if (!control)
        return;
    uv_async_send(&control->stop);
    pthread_join(control->thread, NULL);
    uv_loop_close(&control->loop);
    unlink(control->path);
    release(control);
}
