/*
 * yaml_tree.h — a YAML text as a tree of nodes that know their place; internal to proto/yaml*.c.
 *
 * Shapes     a mapping has key[n] (scalars) and item[n]; a list has item[n]; a scalar has text, NUL-terminated and
 *            without NUL inside. line and column count from 1.
 * Errors     yaml_parse adds every mistake to errors and returns -ERR_INPUT when it made no tree. Doubled keys are
 *            reported and stay in the tree; the first is the one that counts. Without content: *root NULL.
 * Source     YAML 1.2.2, parsed by libfyaml 0.7.
 * Checked    tests/unit/test_yaml.c, tests/fuzz/fuzz_yaml.c
 */
#ifndef PROTO_YAML_TREE_H
#define PROTO_YAML_TREE_H

#include <stdbool.h>
#include <stddef.h>

#include "proto/err.h"
#include "proto/yaml.h"

enum yaml_kind { YAML_KIND_SCALAR, YAML_KIND_MAP, YAML_KIND_LIST };

struct yaml_node {
    enum yaml_kind kind;
    bool plain; /* not quoted: may be a number, a boolean or null */
    int line, column;
    char *text;
    size_t size, n, capacity;
    struct yaml_node **key, **item;
};

int yaml_parse(const char *file, const char *text, size_t size, struct yaml_node **root,
               struct err_list *errors);
void yaml_tree_free(struct yaml_node *node);

#endif
