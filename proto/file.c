#include "proto/file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

static int refuse_kind(const char *path, const struct stat *st, struct err *e) {
    const char *kind = S_ISDIR(st->st_mode) ? "a directory" : "a device, pipe or socket";
    return err_at(e, ERR_INPUT, path, 0, 0, "this is %s; a regular file is expected here", kind);
}

static int read_all(int fd, const char *path, char *text, size_t expected, size_t *size, struct err *e) {
    *size = 0;
    while (*size < expected) {
        ssize_t n = read(fd, text + *size, expected - *size);
        int saved = errno;
        if (n < 0 && saved == EINTR)
            continue;
        if (n < 0)
            return err_errno(e, ERR_IO, saved, "cannot read %s", path);
        if (n == 0)
            break;
        *size += (size_t)n;
    }
    return 0;
}

static int read_open(int fd, const char *path, size_t limit, char **text, size_t *size, struct err *e) {
    struct stat st;
    if (fstat(fd, &st) != 0)
        return err_errno(e, ERR_IO, errno, "cannot look at %s", path);
    if (!S_ISREG(st.st_mode))
        return refuse_kind(path, &st, e);
    /* One byte more than allowed is asked for: files of /proc say they are empty, and a file may grow. */
    size_t expected = limit + 1;
    char *buffer = malloc(expected + 1);
    if (!buffer)
        return err_set(e, ERR_NOMEM, "no memory left to read %s", path);
    int rc = read_all(fd, path, buffer, expected, size, e);
    if (rc == 0 && *size > limit)
        rc = err_at(e, ERR_INPUT, path, 0, 0, "the file is longer than %zu bytes, the most that is read here",
                    limit);
    if (rc != 0) {
        free(buffer);
        return rc;
    }
    buffer[*size] = '\0';
    char *shrunk = realloc(buffer, *size + 1);
    *text = shrunk ? shrunk : buffer;
    return 0;
}

int file_read(const char *path, size_t limit, char **text, size_t *size, struct err *e) {
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd < 0)
        return err_errno(e, ERR_IO, errno, "cannot open %s", path);
    int rc = read_open(fd, path, limit, text, size, e);
    close(fd);
    return rc;
}

/* Length of the UTF-8 sequence at p, 0 if it is none (RFC 3629: no overlong forms, no surrogates). */
static size_t utf8_length(const unsigned char *p, size_t left) {
    static const struct {
        unsigned char first_low, first_high, second_low, second_high, length;
    } forms[] = {
        {0xC2, 0xDF, 0x80, 0xBF, 2}, {0xE0, 0xE0, 0xA0, 0xBF, 3}, {0xE1, 0xEC, 0x80, 0xBF, 3},
        {0xED, 0xED, 0x80, 0x9F, 3}, {0xEE, 0xEF, 0x80, 0xBF, 3}, {0xF0, 0xF0, 0x90, 0xBF, 4},
        {0xF1, 0xF3, 0x80, 0xBF, 4}, {0xF4, 0xF4, 0x80, 0x8F, 4},
    };
    if (*p < 0x80)
        return (*p >= 0x20 && *p != 0x7F) || *p == '\t' || *p == '\n' || *p == '\r';
    for (size_t i = 0; i < sizeof forms / sizeof *forms; i++) {
        if (*p < forms[i].first_low || *p > forms[i].first_high)
            continue;
        if (left < forms[i].length || p[1] < forms[i].second_low || p[1] > forms[i].second_high)
            return 0;
        for (size_t k = 2; k < forms[i].length; k++)
            if ((p[k] & 0xC0) != 0x80)
                return 0;
        return forms[i].length;
    }
    return 0;
}

int file_check_text(const char *file, const char *text, size_t size, struct err *e) {
    int line = 1, column = 1;
    for (size_t i = 0; i < size;) {
        size_t length = utf8_length((const unsigned char *)text + i, size - i);
        if (length == 0)
            return err_at(e, ERR_INPUT, file, line, column,
                          "the byte 0x%02X is no text; the file must be UTF-8 without control characters",
                          (unsigned)(unsigned char)text[i]);
        column++;
        if (text[i] == '\n') {
            line++;
            column = 1;
        }
        i += length;
    }
    return 0;
}

void file_hash(const char *text, size_t size, char hex[17]) {
    uint64_t hash = 14695981039346656037u; /* FNV-1a, 64 bit: offset basis and prime */
    for (size_t i = 0; i < size; i++)
        hash = (hash ^ (unsigned char)text[i]) * 1099511628211u;
    snprintf(hex, 17, "%016llx", (unsigned long long)hash);
}
