#include "daemon/control_client.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/control_private.h"
#include "proto/rpc.h"

struct write_request {
    uv_write_t uv;
    bool last;
    char *text;
};

static void on_closed(uv_handle_t *handle) {
    struct control_client *c = handle->data;
    control_forget_client(c->control, c);
    free(c->line);
    free(c);
}

void control_client_close(struct control_client *c) {
    if (!c->closing)
        uv_close((uv_handle_t *)&c->pipe, on_closed);
    c->closing = true;
}

static bool unread(const struct control_client *c) {
    return uv_stream_get_write_queue_size((const uv_stream_t *)&c->pipe) > 0;
}

static void tell_missed(struct control_client *c) {
    json_t *params = json_pack("{s:s, s:I}", "event", "missed", "count", (json_int_t)c->missed);
    c->missed = 0;
    control_client_send(c, rpc_event_text(params));
    json_decref(params);
}

static void on_written(uv_write_t *uv, int status) {
    struct write_request *w = (struct write_request *)uv;
    struct control_client *c = uv->handle->data;
    bool last = w->last;
    free(w->text);
    free(w);
    if (c->closing)
        return;
    if (status < 0 || last || (c->ended && c->owed == 0 && !unread(c)))
        control_client_close(c);
    else if (c->missed && !unread(c))
        tell_missed(c);
}

static void put(struct control_client *c, char *text, bool last) {
    struct write_request *w = text && !c->closing ? calloc(1, sizeof *w) : NULL;
    if (!w) {
        free(text);
        return;
    }
    w->text = text;
    w->last = last;
    uv_buf_t buf = uv_buf_init(text, (unsigned)strlen(text));
    if (uv_write(&w->uv, (uv_stream_t *)&c->pipe, &buf, 1, on_written) != 0) {
        free(text);
        free(w);
        control_client_close(c);
    }
}

void control_client_send(struct control_client *c, char *text) {
    size_t unread = uv_stream_get_write_queue_size((uv_stream_t *)&c->pipe);
    if (text && !c->closing && unread + strlen(text) > CONTROL_UNREAD_MAX) {
        /* Whoever has not read 4 MiB will not read a farewell either. */
        fprintf(stderr, "goniod: let client %llu go: it left %zu bytes unread\n",
                (unsigned long long)c->number, unread);
        free(text);
        control_client_close(c);
        return;
    }
    put(c, text, false);
}

void control_client_settle(struct control_client *c, char *text) {
    c->owed--;
    control_client_send(c, text);
    if (c->ended && c->owed == 0 && !unread(c))
        control_client_close(c);
}

void control_client_event(struct control_client *c, const char *text, size_t size) {
    if (!c->watching || c->closing)
        return;
    if (uv_stream_get_write_queue_size((uv_stream_t *)&c->pipe) > CONTROL_UNREAD_EVENTS) {
        c->missed++;
        return;
    }
    put(c, strndup(text, size), false);
}

void control_client_dismiss(struct control_client *c, const char *sentence) {
    struct err e = {0};
    err_set(&e, ERR_USAGE, "%s", sentence);
    uv_read_stop((uv_stream_t *)&c->pipe);
    put(c, rpc_error_text(NULL, rpc_code_of(&e), &e, NULL), true);
}

static void on_alloc(uv_handle_t *handle, size_t suggested, uv_buf_t *buf) {
    struct control_client *c = handle->data;
    if (c->capacity - c->used < 4096) {
        size_t capacity = c->capacity ? 2 * c->capacity : 8192;
        char *grown = realloc(c->line, capacity);
        if (grown) {
            c->line = grown;
            c->capacity = capacity;
        }
    }
    (void)suggested;
    *buf = uv_buf_init(c->line + c->used, (unsigned)(c->capacity - c->used));
}

static size_t line_max(const struct control_client *c) {
    return c->rights.operate ? RPC_LINE_MAX : CONTROL_LINE_WATCH;
}

static void on_read(uv_stream_t *stream, ssize_t n, const uv_buf_t *buf) {
    struct control_client *c = stream->data;
    (void)buf;
    if (n < 0) {
        /* `echo '{...}' | socat` ends its lines at once, and waits for the answer. */
        c->ended = n == UV_EOF && (c->owed > 0 || unread(c));
        if (c->ended)
            uv_read_stop(stream);
        else
            control_client_close(c);
        return;
    }
    size_t scanned = c->used, start = 0;
    c->used += (size_t)n;
    char *end;
    while (!c->closing && scanned < c->used && (end = memchr(c->line + scanned, '\n', c->used - scanned))) {
        size_t stop = (size_t)(end - c->line);
        control_handle_line(c, c->line + start, stop - start);
        start = scanned = stop + 1;
    }
    memmove(c->line, c->line + start, c->used - start);
    c->used -= start;
    if (c->used > line_max(c)) {
        char sentence[128];
        snprintf(sentence, sizeof sentence,
                 "a line of more than %zu bytes is not taken; send one request a line", line_max(c));
        c->used = 0;
        control_client_dismiss(c, sentence);
    }
}

int control_client_read(struct control_client *c) {
    return uv_read_start((uv_stream_t *)&c->pipe, on_alloc, on_read);
}
