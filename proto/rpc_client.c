#include "proto/rpc.h"

#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#define SYSTEM_SOCKET "/run/goniod/goniod.sock"
#define EVENTS_KEPT 1024

struct rpc_client {
    int fd;
    int next_id;
    char *buffer;
    size_t used, capacity;
    json_t *events; /* array of params, oldest first */
    char path[108];
};

const char *rpc_default_socket(void) {
    static char path[256];
    const char *named = getenv("GONIOD_SOCKET");
    const char *runtime = getenv("XDG_RUNTIME_DIR");
    if (named && *named)
        return named;
    if (runtime && *runtime && access(SYSTEM_SOCKET, F_OK) != 0) {
        snprintf(path, sizeof path, "%s/goniod.sock", runtime);
        return path;
    }
    return SYSTEM_SOCKET;
}

static int refused(const char *path, int why, struct err *e) {
    if (why == EACCES)
        return err_errno(e, ERR_PERMISSION, why,
                         "may not open the socket %s: ask for membership in a group of goniod's access list",
                         path);
    if (why == ENOENT || why == ECONNREFUSED)
        return err_errno(
            e, ERR_LINK, why,
            "no goniod answers at %s: start goniod, or name its socket with --socket or GONIOD_SOCKET", path);
    return err_errno(e, ERR_LINK, why, "cannot connect to %s", path);
}

int rpc_connect(struct rpc_client **client, const char *path, struct err *e) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    if (!path)
        path = rpc_default_socket();
    if (strlen(path) >= sizeof address.sun_path)
        return err_set(e, ERR_USAGE, "the socket path %s is longer than the %zu bytes a socket may have",
                       path, sizeof address.sun_path - 1);
    strcpy(address.sun_path, path);
    int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd < 0)
        return err_errno(e, ERR_IO, errno, "cannot make a socket");
    if (connect(fd, (struct sockaddr *)&address, sizeof address) != 0) {
        int why = errno;
        close(fd);
        return refused(path, why, e);
    }
    struct rpc_client *c = calloc(1, sizeof *c);
    if (!c) {
        close(fd);
        return err_set(e, ERR_NOMEM, "no memory for a client");
    }
    c->fd = fd;
    c->events = json_array();
    strcpy(c->path, path);
    *client = c;
    return 0;
}

void rpc_close(struct rpc_client *c) {
    if (!c)
        return;
    close(c->fd);
    json_decref(c->events);
    free(c->buffer);
    free(c);
}

int rpc_descriptor(const struct rpc_client *c) {
    return c->fd;
}

static int send_all(struct rpc_client *c, const char *text, struct err *e) {
    size_t left = strlen(text);
    while (left) {
        ssize_t n = send(c->fd, text, left, MSG_NOSIGNAL);
        int why = errno;
        if (n < 0 && why == EINTR)
            continue;
        if (n < 0)
            return err_errno(e, ERR_LINK, why, "goniod at %s closed the connection", c->path);
        text += n;
        left -= (size_t)n;
    }
    return 0;
}

static int fill(struct rpc_client *c, struct err *e) {
    if (c->used + 65536 > c->capacity) {
        size_t capacity = c->capacity ? 2 * c->capacity : 131072;
        char *grown = realloc(c->buffer, capacity);
        if (!grown)
            return err_set(e, ERR_NOMEM, "no memory for a reply of over %zu bytes", c->used);
        c->buffer = grown;
        c->capacity = capacity;
    }
    ssize_t n = recv(c->fd, c->buffer + c->used, c->capacity - c->used, 0);
    int why = errno;
    if (n == 0)
        return err_set(e, ERR_LINK, "goniod at %s closed the connection", c->path);
    if (n < 0 && why != EINTR)
        return err_errno(e, ERR_LINK, why, "lost goniod at %s", c->path);
    c->used += n > 0 ? (size_t)n : 0;
    return 0;
}

/* One message, or NULL with 0 where the buffer holds no whole line. */
static int take_line(struct rpc_client *c, json_t **message, struct err *e) {
    char *end = c->used ? memchr(c->buffer, '\n', c->used) : NULL;
    *message = NULL;
    if (!end)
        return 0;
    *message = json_loadb(c->buffer, (size_t)(end - c->buffer), 0, NULL);
    size_t taken = (size_t)(end + 1 - c->buffer);
    memmove(c->buffer, end + 1, c->used - taken);
    c->used -= taken;
    return *message ? 0 : err_set(e, ERR_LINK, "goniod at %s sent a line that is not JSON", c->path);
}

static int next_message(struct rpc_client *c, int silence_ms, json_t **message, struct err *e) {
    for (;;) {
        int rc = take_line(c, message, e);
        if (rc != 0 || *message)
            return rc;
        struct pollfd fd = {.fd = c->fd, .events = POLLIN};
        int ready = poll(&fd, 1, silence_ms);
        int why = errno;
        if (ready < 0 && why == EINTR)
            return err_set(e, ERR_CANCELLED, "interrupted while waiting for goniod");
        if (ready < 0)
            return err_errno(e, ERR_IO, why, "cannot wait for goniod");
        if (ready == 0)
            return err_set(e, ERR_TIMEOUT, "goniod at %s gave no answer in time", c->path);
        rc = fill(c, e);
        if (rc != 0)
            return rc;
    }
}

static void keep_event(struct rpc_client *c, json_t *message) {
    json_t *params = json_object_get(message, "params");
    if (params && json_array_size(c->events) < EVENTS_KEPT)
        json_array_append(c->events, params);
}

static int server_error(const json_t *error, struct err_list *errors, struct err *e) {
    const char *message = json_string_value(json_object_get(error, "message"));
    int code = RPC_OWN - (int)json_integer_value(json_object_get(error, "code"));
    if (errors)
        rpc_read_mistakes(json_object_get(json_object_get(error, "data"), "errors"), errors);
    if (code <= ERR_NONE || code >= ERR_CODES)
        code = ERR_USAGE;
    return err_set(e, (enum err_code)code, "%s", message ? message : "goniod refused without a reason");
}

static int send_request(struct rpc_client *c, const char *method, json_t *params, struct err *e) {
    json_t *request = json_pack("{s:s, s:i, s:s, s:o}", "jsonrpc", "2.0", "id", ++c->next_id, "method",
                                method, "params", params ? params : json_object());
    char *body = request ? json_dumps(request, JSON_COMPACT) : NULL;
    char *text = NULL;
    json_decref(request);
    if (!body)
        return err_set(e, ERR_USAGE, "the parameters of %s are not UTF-8 text", method);
    int rc = asprintf(&text, "%s\n", body) < 0 ? err_set(e, ERR_NOMEM, "no memory for a request") : 0;
    if (rc == 0)
        rc = send_all(c, text, e);
    free(text);
    free(body);
    return rc;
}

int rpc_call(struct rpc_client *c, const char *method, json_t *params, int silence_ms, json_t **result,
             struct err_list *errors, struct err *e) {
    int rc = send_request(c, method, params, e);
    while (rc == 0) {
        json_t *message;
        rc = next_message(c, silence_ms, &message, e);
        if (rc != 0)
            return rc;
        json_t *id = json_object_get(message, "id");
        json_t *error = json_object_get(message, "error");
        if (!id)
            keep_event(c, message);
        if (json_integer_value(id) == c->next_id || (error && json_is_null(id))) {
            rc = error ? server_error(error, errors, e) : 0;
            if (rc == 0 && result)
                *result = json_incref(json_object_get(message, "result"));
            json_decref(message);
            return rc;
        }
        json_decref(message);
    }
    return rc;
}

int rpc_next_event(struct rpc_client *c, int silence_ms, json_t **params, struct err *e) {
    while (json_array_size(c->events) == 0) {
        json_t *message;
        int rc = next_message(c, silence_ms, &message, e);
        if (rc != 0)
            return rc;
        keep_event(c, message);
        json_decref(message);
    }
    *params = json_incref(json_array_get(c->events, 0));
    json_array_remove(c->events, 0);
    return 0;
}
