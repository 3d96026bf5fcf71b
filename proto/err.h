/*
 * err.h — what went wrong, in one sentence, for a person who can act on it.
 *
 * A function that can fail returns 0 or a negative code (-ERR_...) and fills a struct err of the caller. The
 * sentence says what happened, what was expected, and what to do. The first cause wins: a struct err that
 * already holds a code keeps it, so callers up the stack may add theirs without hiding the root.
 *
 * file, line, column are set where a file is at fault (line and column count from 1; 0 = unknown).
 * saved_errno is the errno of the failing call, read in the very next statement by the caller of err_errno.
 * A reader of a file collects all its errors in a struct err_list, then refuses once; more than ERR_LIST_OF_FILE of one
 * file help nobody and are not kept.
 * Every function accepts e == NULL. Not thread safe on one struct err; no global state.
 * Checked    tests/unit/test_err.c
 */
#ifndef PROTO_ERR_H
#define PROTO_ERR_H

#include <stdarg.h>
#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

enum err_code {
    ERR_NONE = 0,
    ERR_USAGE,      /* the command line or an argument of a call                    -> exit status 2 */
    ERR_INPUT,      /* the content of a file or message                             -> exit status 2 */
    ERR_RANGE,      /* outside the domain of a formula or the limits of a device */
    ERR_IO,         /* the operating system refused */
    ERR_FULL,       /* no space left on the device that holds the session */
    ERR_TIMEOUT,    /* no answer within the stated time */
    ERR_LINK,       /* the link to a device is down (it will be reconnected) */
    ERR_BUSY,       /* not now: a link in quarantine, a device or file owned by another */
    ERR_DEVICE,     /* a device answered, and the answer is no: exception, alarm, refused move */
    ERR_PERMISSION, /* the right to open or to command is missing */
    ERR_CANCELLED,  /* a cancel token was raised */
    ERR_STATE,      /* the command does not fit the present state */
    ERR_FIT,        /* the estimation cannot give an answer from these data */
    ERR_NOMEM,
    ERR_CODES
};

#define ERR_LIST_OF_FILE 100

struct err {
    int code; /* positive enum err_code, ERR_NONE while empty */
    int saved_errno;
    int line, column;
    char file[256];
    char text[512];
};

struct err_list {
    struct err *item;
    size_t n, capacity;
};

/* Each returns -code, so that a failing function can end in `return err_set(...)`. */
int err_set(struct err *e, enum err_code code, const char *format, ...) __attribute__((format(printf, 3, 4)));
int err_errno(struct err *e, enum err_code code, int saved_errno, const char *format, ...)
    __attribute__((format(printf, 4, 5))); /* appends ": " and strerror */
int err_at(struct err *e, enum err_code code, const char *file, int line, int column, const char *format, ...)
    __attribute__((format(printf, 6, 7)));

void err_clear(struct err *e);
const char *err_name(int code); /* "timeout", accepts either sign */
/* "FILE:LINE:COLUMN: sentence", or the sentence alone. Returns buffer. */
const char *err_format(const struct err *e, char *buffer, size_t size);

int err_list_add(struct err_list *list, const struct err *e); /* -ERR_NOMEM or 0 */
/* A mistake in a file, formatted, as one more of the list. Always -ERR_INPUT, for `return`. */
int err_list_mistake(struct err_list *list, const char *file, int line, int column, const char *format,
                     va_list arguments) __attribute__((format(printf, 5, 0)));
void err_list_free(struct err_list *list);

#ifdef __cplusplus
}
#endif

#endif
