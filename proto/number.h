/*
 * number.h — numbers from text, the same in every locale.
 *
 * A decimal number is [+-]digits[.digits][e[+-]digits] with a digit on at least one side of the point;
 * nothing before or after it, no hexadecimal, no inf or nan. A whole number is [+-]digits or [+-]0xdigits.
 * Errors     false: not of this form, or too large for the type; *value is then unchanged.
 * Checked    tests/unit/test_number.c
 */
#ifndef PROTO_NUMBER_H
#define PROTO_NUMBER_H

#include <stdbool.h>
#include <stdint.h>

bool number_read_double(const char *text, double *value);
bool number_read_int(const char *text, int64_t *value);

#endif
