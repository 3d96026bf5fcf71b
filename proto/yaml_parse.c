#include "proto/yaml_tree.h"

#include <libfyaml.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include "proto/file.h"

#define NODES_MAX 200000

struct builder {
    const char *file, *text;
    size_t size;
    struct err_list *errors;
    struct yaml_node *root;
    struct yaml_node *open[YAML_DEPTH_MAX];        /* mappings and lists not yet closed */
    struct yaml_node *pending_key[YAML_DEPTH_MAX]; /* of a mapping: its key that waits for a value */
    struct fy_mark last_mark;
    int depth, documents, nodes;
};

static int refuse(struct builder *b, const struct fy_mark *mark, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

static int refuse(struct builder *b, const struct fy_mark *mark, const char *format, ...) {
    va_list ap;
    va_start(ap, format);
    err_list_mistake(b->errors, b->file, mark ? mark->line + 1 : 0, mark ? mark->column + 1 : 0, format, ap);
    va_end(ap);
    return -ERR_INPUT;
}

void yaml_tree_free(struct yaml_node *node) {
    if (!node)
        return;
    for (size_t i = 0; i < node->n; i++) {
        yaml_tree_free(node->kind == YAML_KIND_MAP ? node->key[i] : NULL);
        yaml_tree_free(node->item[i]);
    }
    free(node->key);
    free(node->item);
    free(node->text);
    free(node);
}

static int grow(struct yaml_node *parent) {
    size_t capacity = parent->capacity ? 2 * parent->capacity : 4;
    struct yaml_node **item = realloc(parent->item, capacity * sizeof *item);
    if (!item)
        return -ERR_NOMEM;
    parent->item = item;
    if (parent->kind == YAML_KIND_MAP) {
        struct yaml_node **key = realloc(parent->key, capacity * sizeof *key);
        if (!key)
            return -ERR_NOMEM;
        parent->key = key;
    }
    parent->capacity = capacity;
    return 0;
}

static int append(struct builder *b, struct yaml_node *parent, struct yaml_node *key,
                  struct yaml_node *item) {
    if (parent->n == parent->capacity && grow(parent) != 0)
        return refuse(b, NULL, "no memory left to read this file");
    if (parent->kind == YAML_KIND_MAP)
        parent->key[parent->n] = key;
    parent->item[parent->n++] = item;
    return 0;
}

/* Puts a node into its place; on failure the node is freed. */
static int attach(struct builder *b, struct yaml_node *node, const struct fy_mark *mark) {
    if (b->depth == 0) {
        b->root = node;
        return 0;
    }
    struct yaml_node *parent = b->open[b->depth - 1];
    struct yaml_node **key = &b->pending_key[b->depth - 1];
    int rc = 0;
    if (parent->kind == YAML_KIND_MAP && !*key) {
        if (node->kind == YAML_KIND_SCALAR)
            *key = node;
        else
            rc = refuse(b, mark, "a key must be a plain word, not a mapping or a list");
    } else if (parent->kind == YAML_KIND_MAP && parent->n == YAML_KEYS_MAX) {
        rc = refuse(b, mark, "a mapping may hold at most %d keys", YAML_KEYS_MAX);
    } else {
        rc = append(b, parent, *key, node);
        if (rc == 0)
            *key = NULL;
    }
    if (rc != 0)
        yaml_tree_free(node);
    return rc;
}

static struct yaml_node *new_node(struct builder *b, enum yaml_kind kind, const struct fy_mark *mark) {
    struct yaml_node *node = calloc(1, sizeof *node);
    if (!node) {
        refuse(b, mark, "no memory left to read this file");
        return NULL;
    }
    node->kind = kind;
    node->line = mark ? mark->line + 1 : 0;
    node->column = mark ? mark->column + 1 : 0;
    return node;
}

static int take_scalar(struct builder *b, struct fy_token *value, const struct fy_mark *mark) {
    size_t size = 0;
    const char *text = fy_token_get_text(value, &size);
    if (!text)
        text = "";
    if (memchr(text, '\0', size))
        return refuse(b, mark, "the text holds a NUL character; write it without");
    struct yaml_node *node = new_node(b, YAML_KIND_SCALAR, mark);
    if (!node)
        return -ERR_NOMEM;
    enum fy_scalar_style style = fy_scalar_token_get_style(value);
    node->plain = style == FYSS_PLAIN || style == FYSS_ANY; /* ANY: nothing was written */
    if (style == FYSS_SINGLE_QUOTED || style == FYSS_DOUBLE_QUOTED)
        node->column--; /* the mark stands behind the opening quote */
    node->text = strndup(text, size);
    node->size = size;
    if (!node->text) {
        yaml_tree_free(node);
        return refuse(b, mark, "no memory left to read this file");
    }
    return attach(b, node, mark);
}

static int open_container(struct builder *b, enum yaml_kind kind, const struct fy_mark *mark) {
    if (b->depth == YAML_DEPTH_MAX)
        return refuse(b, mark, "nested deeper than %d levels; nothing here needs that", YAML_DEPTH_MAX);
    struct yaml_node *node = new_node(b, kind, mark);
    if (!node)
        return -ERR_NOMEM;
    int rc = attach(b, node, mark);
    if (rc != 0)
        return rc;
    b->pending_key[b->depth] = NULL;
    b->open[b->depth++] = node;
    return 0;
}

static void report_doubled_keys(struct builder *b, const struct yaml_node *map) {
    for (size_t i = 1; i < map->n; i++)
        for (size_t k = 0; k < i; k++) {
            if (map->key[i]->size != map->key[k]->size || strcmp(map->key[i]->text, map->key[k]->text) != 0)
                continue;
            struct fy_mark mark = {.line = map->key[i]->line - 1, .column = map->key[i]->column - 1};
            refuse(b, &mark, "the key '%.64s' stands here a second time; it was first given in line %d",
                   map->key[i]->text, map->key[k]->line);
            break;
        }
}

static int refuse_properties(struct builder *b, struct fy_event *event) {
    struct fy_token *anchor = fy_event_get_anchor_token(event), *tag = fy_event_get_tag_token(event);
    if (anchor)
        return refuse(b, fy_token_start_mark(anchor),
                      "anchors (&name) are not used here; write the value where it is needed");
    if (tag)
        return refuse(b, fy_token_start_mark(tag), "tags (!name) are not used here; write the plain value");
    return 0;
}

/* A value that is not there has no mark: it gets the place of its key. */
static const struct fy_mark *mark_of(struct builder *b, struct fy_event *event) {
    const struct fy_mark *mark = fy_event_start_mark(event);
    if (mark)
        b->last_mark = *mark;
    return &b->last_mark;
}

static int take_event(struct builder *b, struct fy_event *event) {
    const struct fy_mark *mark = mark_of(b, event);
    switch (event->type) {
    case FYET_ALIAS:
        return refuse(b, mark, "aliases (*name) are not used here; write the value itself");
    case FYET_SCALAR:
    case FYET_MAPPING_START:
    case FYET_SEQUENCE_START:
        if (refuse_properties(b, event) != 0)
            return -ERR_INPUT;
        if (++b->nodes > NODES_MAX)
            return refuse(b, mark, "more than %d values; nothing here needs that many", NODES_MAX);
        if (event->type == FYET_SCALAR)
            return take_scalar(b, event->scalar.value, mark);
        return open_container(b, event->type == FYET_MAPPING_START ? YAML_KIND_MAP : YAML_KIND_LIST, mark);
    case FYET_MAPPING_END:
        report_doubled_keys(b, b->open[b->depth - 1]);
        b->depth--;
        return 0;
    case FYET_SEQUENCE_END:
        b->depth--;
        return 0;
    case FYET_DOCUMENT_START:
        if (b->documents++ > 0)
            return refuse(b, mark, "a second document starts here (---); a file holds one");
        return 0;
    default:
        return 0;
    }
}

/* The first tab in the indentation of a line; false if there is none. */
static bool find_tab(const char *text, size_t size, struct fy_mark *mark) {
    int line = 0;
    for (const char *at = text, *end = text + size; at && at < end; line++) {
        const char *first = at;
        while (first < end && *first == ' ')
            first++;
        if (first < end && *first == '\t') {
            *mark = (struct fy_mark){.line = line, .column = (int)(first - at)};
            return true;
        }
        at = memchr(at, '\n', (size_t)(end - at));
        at = at ? at + 1 : NULL;
    }
    return false;
}

/* libfyaml counts from 0 in its marks and from 1 in its collected diagnostics. What it says of a tab in the
 * indentation helps nobody. */
static int report_syntax(struct builder *b, struct fy_diag *diag) {
    struct fy_mark tab;
    if (find_tab(b->text, b->size, &tab))
        return refuse(b, &tab, "this is no YAML: a tab indents this line; use spaces");
    void *previous = NULL;
    struct fy_diag_error *first = fy_diag_errors_iterate(diag, &previous);
    if (!first)
        return refuse(b, NULL, "this is no YAML text");
    struct fy_mark mark = {.line = first->line - 1, .column = first->column - 1};
    return refuse(b, &mark, "this is no YAML: %s", first->msg);
}

static int build(struct builder *b, struct fy_parser *parser, struct fy_diag *diag) {
    bool ended = false;
    int rc = 0;
    while (rc == 0 && !ended) {
        struct fy_event *event = fy_parser_parse(parser);
        if (!event)
            return report_syntax(b, diag);
        ended = event->type == FYET_STREAM_END;
        rc = take_event(b, event);
        fy_parser_event_free(parser, event);
    }
    return rc;
}

static int build_text(struct builder *b, const char *text, size_t size) {
    struct fy_diag_cfg diag_cfg;
    fy_diag_cfg_default(&diag_cfg);
    diag_cfg.fp = NULL;
    struct fy_diag *diag = fy_diag_create(&diag_cfg);
    if (!diag)
        return refuse(b, NULL, "no memory left to read this file");
    fy_diag_set_collect_errors(diag, true);
    struct fy_parse_cfg cfg = {.flags = FYPCF_QUIET | FYPCF_JSON_NONE, .diag = diag};
    struct fy_parser *parser = fy_parser_create(&cfg);
    int rc;
    if (!parser || fy_parser_set_string(parser, text, size) != 0)
        rc = refuse(b, NULL, "no memory left to read this file");
    else
        rc = build(b, parser, diag);
    fy_parser_destroy(parser);
    fy_diag_destroy(diag);
    return rc;
}

int yaml_parse(const char *file, const char *text, size_t size, struct yaml_node **root,
               struct err_list *errors) {
    struct builder b = {.file = file, .text = text, .size = size, .errors = errors};
    struct err e = {0};
    *root = NULL;
    if (size > YAML_BYTES_MAX)
        return refuse(&b, NULL, "%zu bytes long; at most %d are read", size, YAML_BYTES_MAX);
    if (file_check_text(file, text, size, &e) != 0) {
        err_list_add(errors, &e);
        return -ERR_INPUT;
    }
    int rc = build_text(&b, text, size);
    /* An unfinished mapping keeps a key that no value has claimed. */
    for (int i = 0; i < b.depth; i++)
        yaml_tree_free(b.pending_key[i]);
    if (rc != 0) {
        yaml_tree_free(b.root);
        return rc;
    }
    *root = b.root;
    return 0;
}
