/*
 * yaml.h — YAML into structs by tables of keys; every mistake found in one pass, each with file:line:column.
 *
 * One table describes a mapping: key, type, where the value goes, range, unit, default, and one line of
 * documentation. The same table reads, checks (unknown key with its nearest known neighbour, wrong type, out
 * of range, missing, doubled) and prints the reference documentation.
 *
 * Shapes     offset is into the caller's struct. Strings are fixed char arrays (too long is an error). Lists
 *            of scalars or of mappings go into fixed arrays with a count; `custom` parses what no type covers
 *            and is given the struct itself (its offset is not added). A map that is left out is left alone,
 *            unless its default_text is "{}", which applies the defaults inside.
 * Domain     UTF-8, at most YAML_BYTES_MAX, YAML_DEPTH_MAX levels, one document. Anchors, aliases and tags
 *            are refused: a value stands where it is used. Numbers are decimal and do not depend on the
 *            locale; a YAML_INT may also be hexadecimal (0x7C). A quoted scalar is a string, never a number.
 * Errors     all go to the err_list, sorted by place, at most ERR_LIST_OF_FILE; a file that is no YAML gives
 *            the first syntax error alone. yaml_read_text returns -ERR_INPUT if there was any, yaml_read_file also
 *            -ERR_IO if the file cannot be read. The struct is then filled in part and must not be used.
 * Checked    tests/unit/test_yaml.c, tests/fuzz/fuzz_yaml.c
 */
#ifndef PROTO_YAML_H
#define PROTO_YAML_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "proto/err.h"

#define YAML_BYTES_MAX (1 << 20)
#define YAML_DEPTH_MAX 32
#define YAML_KEYS_MAX 512 /* of one mapping */

struct yaml_node; /* a scalar, a mapping or a list, with its place; valid while the reader runs */

enum yaml_type {
    YAML_STRING,  /* char[size] */
    YAML_DOUBLE,  /* double */
    YAML_INT,     /* int */
    YAML_BOOL,    /* bool */
    YAML_CHOICE,  /* int: index into choices */
    YAML_DOUBLES, /* double[capacity], count at count_offset */
    YAML_INTS,    /* int[capacity], count at count_offset */
    YAML_STRINGS, /* char[capacity][size], count at count_offset */
    YAML_MAP,     /* a struct at offset, by `keys` */
    YAML_LIST,    /* struct[capacity] of `size` bytes, by `keys`, count at count_offset */
    YAML_CUSTOM   /* custom(reader, node, struct) */
};

struct yaml_reader; /* file name, errors so far */

struct yaml_key {
    const char *name;
    enum yaml_type type;
    size_t offset;
    size_t size;                /* YAML_STRING, YAML_STRINGS: bytes of one array; YAML_LIST: of one element */
    size_t count_offset;        /* of the int that counts a list's items */
    int capacity, minimum;      /* items a list may and must have at the least */
    double low, high;           /* numbers; low == high means unbounded */
    const char *const *choices; /* YAML_CHOICE, ends with NULL */
    const struct yaml_key *keys; /* YAML_MAP, YAML_LIST: ends with name == NULL */
    int (*custom)(struct yaml_reader *r, const struct yaml_node *node, void *object);
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

/* For custom parsers. yaml_error reports at the node's place. Each yaml_read_... checks, reports a mistake
 * itself and returns -ERR_INPUT then; a custom parser may ignore that and go on to find more. */
void yaml_error(struct yaml_reader *r, const struct yaml_node *node, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
int yaml_read_map(struct yaml_reader *r, const struct yaml_node *node, const struct yaml_key *keys,
                  void *object);
int yaml_read_double(struct yaml_reader *r, const struct yaml_node *node, double *value);
int yaml_read_int(struct yaml_reader *r, const struct yaml_node *node, int64_t low, int64_t high,
                  int64_t *value);
int yaml_read_bool(struct yaml_reader *r, const struct yaml_node *node, bool *value);
int yaml_read_string(struct yaml_reader *r, const struct yaml_node *node, char *value, size_t size);

/* Looking at a node: nothing here reports. Items count from 0, in the order written. */
bool yaml_is_map(const struct yaml_node *node);
bool yaml_is_list(const struct yaml_node *node);
bool yaml_is_null(const struct yaml_node *node);                           /* nothing, ~ or null */
const char *yaml_text(const struct yaml_node *node);                       /* NULL if not a scalar */
size_t yaml_count(const struct yaml_node *node);                           /* items; 0 for a scalar */
const struct yaml_node *yaml_item(const struct yaml_node *node, size_t i); /* value i of a map or list */
const char *yaml_item_name(const struct yaml_node *map, size_t i);
const struct yaml_node *yaml_item_key(const struct yaml_node *map, size_t i);     /* for the key's place */
const struct yaml_node *yaml_find(const struct yaml_node *map, const char *name); /* NULL if absent */
int yaml_node_line(const struct yaml_node *node);
int yaml_node_column(const struct yaml_node *node);
/* The node as one line of JSON; malloc, NULL when out of memory. Numbers and booleans stay what they are. */
char *yaml_node_json(const struct yaml_node *node);

/* Where a key was written, for contradictions found after reading: "samples[1].size_mm". */
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
/* NULL: nobody wrote it. */
const struct yaml_place *yaml_place_find(const struct yaml_places *places, const char *path);
/* Where to complain of it: its own place, else that of the key or item it would stand in; NULL: of none of them. */
const struct yaml_place *yaml_place_near(const struct yaml_places *places, const char *path);
void yaml_places_free(struct yaml_places *places);
/* Puts the errors of one file from index `first` on into the order of their places. */
void yaml_sort_errors(struct err_list *errors, size_t first);

/* The nearest of names within an edit distance of 1/3 of its length, or NULL. */
const char *yaml_nearest(const char *name, const char *const *names);
/* Reference documentation of a table as Markdown. */
void yaml_print_reference(FILE *out, const char *title, const struct yaml_key *keys);

#endif
