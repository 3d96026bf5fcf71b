#include "proto/number.h"

#include <errno.h>
#include <locale.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static size_t skip_digits(const char **text) {
    const char *from = *text;
    while (**text >= '0' && **text <= '9')
        ++*text;
    return (size_t)(*text - from);
}

static bool is_decimal(const char *text) {
    if (*text == '+' || *text == '-')
        text++;
    size_t digits = skip_digits(&text);
    if (*text == '.') {
        text++;
        digits += skip_digits(&text);
    }
    if (digits == 0)
        return false;
    if (*text == 'e' || *text == 'E') {
        text++;
        if (*text == '+' || *text == '-')
            text++;
        if (skip_digits(&text) == 0)
            return false;
    }
    return *text == '\0';
}

bool number_read_double(const char *text, double *value) {
    if (!is_decimal(text))
        return false;
    /* glibc hands out a static object for "C": nothing is allocated, nothing can fail. */
    double parsed = strtod_l(text, NULL, newlocale(LC_ALL_MASK, "C", (locale_t)0));
    if (!isfinite(parsed))
        return false;
    *value = parsed;
    return true;
}

bool number_read_int(const char *text, int64_t *value) {
    const char *digits = text + (*text == '+' || *text == '-');
    bool hexadecimal = digits[0] == '0' && (digits[1] == 'x' || digits[1] == 'X');
    const char *allowed = hexadecimal ? "0123456789abcdefABCDEF" : "0123456789";
    const char *first = digits + (hexadecimal ? 2 : 0);
    if (*first == '\0' || first[strspn(first, allowed)] != '\0')
        return false;
    errno = 0;
    long long magnitude = strtoll(first, NULL, hexadecimal ? 16 : 10);
    if (errno == ERANGE)
        return false;
    *value = *text == '-' ? -magnitude : magnitude;
    return true;
}
