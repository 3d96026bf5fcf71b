/*
 * yaml.h — YAML into structs by tables of keys; every mistake found in one pass, each with file:line:column.
 *
 * One table describes a mapping: key, type, where the value goes, range, unit, default, and one line of
 * documentation. The same table reads, checks (unknown key with its nearest known neighbour, wrong type, out
 * of range, missing, doubled) and prints the reference documentation.
 *
 * Shapes     offset is into the caller's struct. Strings are fixed char arrays (too long is an error). Lists
 * of scalars or of mappings go into fixed arrays with a count; `custom` parses what no type covers. Errors
 * all go to the err_list; yaml_read returns -ERR_INPUT if there was any, -ERR_IO if the file cannot be read.
 * Checked    tests/unit/test_yaml.c, tests/fuzz/fuzz_yaml.c
 */
#ifndef PROTO_YAML_H
#define PROTO_YAML_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "proto/err.h"

struct fy_node;

enum yaml_type {
    YAML_STRING,  /* char[size] */
    YAML_DOUBLE,  /* double */
    YAML_INT,     /* int */
    YAML_BOOL,    /* bool */
    YAML_CHOICE,  /* int: index into choices */
    YAML_DOUBLES, /* double[capacity], count at count_offset */
    YAML_MAP,     /* a struct at offset, by `keys` */
    YAML_LIST,    /* struct[capacity] of `element_size`, by `keys`, count at count_offset */
    YAML_CUSTOM   /* custom(reader, node, struct) */
};

struct yaml_reader; /* file name, errors so far */

struct yaml_key {
    const char *name;
    enum yaml_type type;
    size_t offset;
    size_t size;                 /* YAML_STRING: bytes of the array; YAML_LIST: bytes of one element */
    size_t count_offset;         /* YAML_DOUBLES, YAML_LIST */
    int capacity;                /* YAML_DOUBLES, YAML_LIST */
    double low, high;            /* numbers; low == high means unbounded */
    const char *const *choices;  /* YAML_CHOICE, ends with NULL */
    const struct yaml_key *keys; /* YAML_MAP, YAML_LIST: ends with name == NULL */
    int (*custom)(struct yaml_reader *r, struct fy_node *node, void *object);
    bool required;
    size_t set_offset;        /* offset + 1 of a bool that becomes true when the key is present; 0 = none */
    const char *default_text; /* applied as if written; NULL = leave as is */
    const char *unit;
    const char *doc;
};

/* text may come from a socket; file is the name used in messages. */
int yaml_read_text(const char *file, const char *text, size_t size, const struct yaml_key *keys, void *object,
                   struct err_list *errors);
int yaml_read_file(const char *path, const struct yaml_key *keys, void *object, struct err_list *errors);

/* For custom parsers: reports at the node's place; reads a scalar. */
void yaml_error(struct yaml_reader *r, struct fy_node *node, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
int yaml_read_map(struct yaml_reader *r, struct fy_node *node, const struct yaml_key *keys, void *object);
int yaml_read_double(struct yaml_reader *r, struct fy_node *node, double *value);
const char *yaml_scalar(struct fy_node *node, size_t *size); /* NULL if not a scalar; not terminated */

/* Where a key was written, for contradictions found after reading: "samples[1].size_mm". line 0 if it was
 * not. */
struct yaml_place {
    char path[96];
    int line, column;
};
struct yaml_places { /* filled by yaml_read_* when given through yaml_read_text_places */
    struct yaml_place *item;
    size_t n, capacity;
};
int yaml_read_text_places(const char *file, const char *text, size_t size, const struct yaml_key *keys,
                          void *object, struct err_list *errors, struct yaml_places *places);
const struct yaml_place *yaml_place_find(const struct yaml_places *places, const char *path);
void yaml_places_free(struct yaml_places *places);

/* The nearest of names within an edit distance of 1/3 of its length, or NULL. */
const char *yaml_nearest(const char *name, const char *const *names);
/* Reference documentation of a table as Markdown. */
void yaml_print_reference(FILE *out, const char *title, const struct yaml_key *keys);

#endif
