#include "proto/yaml_tree.h"

#include <assert.h>
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include "proto/file.h"
#include "proto/number.h"

#define TABLE_KEYS_MAX 64 /* of our own tables */

struct yaml_reader {
    const char *file;
    struct err_list *errors;
    size_t first_error;
    int reported; /* mistakes found, also those past ERR_LIST_OF_FILE */
    struct yaml_places *places;
    char path[sizeof(((struct yaml_place *)0)->path)];
};

static int read_value(struct yaml_reader *r, const struct yaml_key *key, const struct yaml_node *node,
                      void *object);

void yaml_error(struct yaml_reader *r, const struct yaml_node *node, const char *format, ...) {
    va_list ap;
    va_start(ap, format);
    err_list_mistake(r->errors, r->file, yaml_node_line(node), yaml_node_column(node), format, ap);
    va_end(ap);
    r->reported++;
}

static const char *name_of(const struct yaml_reader *r) {
    return r->path[0] ? r->path : "the file";
}

/* What a person wrote, for "must be a number, not ...". */
static const char *describe(const struct yaml_node *node, char *buffer, size_t size) {
    if (yaml_is_map(node))
        return "a mapping";
    if (yaml_is_list(node))
        return "a list";
    if (yaml_is_null(node))
        return "nothing";
    double number;
    bool quoted_number = !node->plain && number_read_double(node->text, &number);
    snprintf(buffer, size, quoted_number ? "the quoted text '%.40s' (leave the quotes out)" : "'%.40s'",
             node->text);
    return buffer;
}

static int wrong_type(struct yaml_reader *r, const struct yaml_node *node, const char *expected) {
    char buffer[96];
    yaml_error(r, node, "%s must be %s, not %s", name_of(r), expected, describe(node, buffer, sizeof buffer));
    return -ERR_INPUT;
}

static void place_add(struct yaml_reader *r, const struct yaml_node *node) {
    struct yaml_places *p = r->places;
    if (!p)
        return;
    if (p->n == p->capacity) {
        size_t capacity = p->capacity ? 2 * p->capacity : 32;
        struct yaml_place *grown = realloc(p->item, capacity * sizeof *grown);
        if (!grown)
            return;
        p->item = grown;
        p->capacity = capacity;
    }
    struct yaml_place *place = &p->item[p->n++];
    snprintf(place->path, sizeof place->path, "%s", r->path);
    place->line = node->line;
    place->column = node->column;
}

/* Both return the length to go back to with path_pop. */
static size_t path_push_key(struct yaml_reader *r, const char *name) {
    size_t length = strlen(r->path);
    snprintf(r->path + length, sizeof r->path - length, "%s%.64s", length ? "." : "", name);
    return length;
}

static size_t path_push_index(struct yaml_reader *r, size_t i) {
    size_t length = strlen(r->path);
    snprintf(r->path + length, sizeof r->path - length, "[%zu]", i);
    return length;
}

static void path_pop(struct yaml_reader *r, size_t length) {
    r->path[length] = '\0';
}

static bool is_plain(const struct yaml_node *node) {
    return node->kind == YAML_KIND_SCALAR && node->plain;
}

int yaml_read_double(struct yaml_reader *r, const struct yaml_node *node, double *value) {
    if (!is_plain(node) || !number_read_double(node->text, value))
        return wrong_type(r, node, "a number");
    return 0;
}

int yaml_read_int(struct yaml_reader *r, const struct yaml_node *node, int64_t low, int64_t high,
                  int64_t *value) {
    int64_t read;
    if (!is_plain(node) || !number_read_int(node->text, &read))
        return wrong_type(r, node, "a whole number");
    if (read < low || read > high) {
        yaml_error(r, node, "%s is %s; it must be from %lld to %lld", name_of(r), node->text, (long long)low,
                   (long long)high);
        return -ERR_INPUT;
    }
    *value = read;
    return 0;
}

int yaml_read_bool(struct yaml_reader *r, const struct yaml_node *node, bool *value) {
    bool yes = is_plain(node) && strcmp(node->text, "true") == 0;
    if (!yes && !(is_plain(node) && strcmp(node->text, "false") == 0))
        return wrong_type(r, node, "true or false");
    *value = yes;
    return 0;
}

int yaml_read_string(struct yaml_reader *r, const struct yaml_node *node, char *value, size_t size) {
    if (node->kind != YAML_KIND_SCALAR || yaml_is_null(node))
        return wrong_type(r, node, "text");
    if (node->size >= size) {
        yaml_error(r, node, "%s is %zu bytes long; at most %zu fit", name_of(r), node->size, size - 1);
        return -ERR_INPUT;
    }
    memcpy(value, node->text, node->size + 1);
    return 0;
}

static int check_range(struct yaml_reader *r, const struct yaml_key *key, const struct yaml_node *node,
                       double value) {
    if (key->low == key->high || (value >= key->low && value <= key->high))
        return 0;
    const char *unit = key->unit ? key->unit : "", *gap = key->unit ? " " : "";
    if (isinf(key->high))
        yaml_error(r, node, "%s is %s; it must be at least %.10g%s%s", name_of(r), node->text, key->low, gap,
                   unit);
    else if (isinf(key->low))
        yaml_error(r, node, "%s is %s; it must be at most %.10g%s%s", name_of(r), node->text, key->high, gap,
                   unit);
    else
        yaml_error(r, node, "%s is %s; it must be from %.10g to %.10g%s%s", name_of(r), node->text, key->low,
                   key->high, gap, unit);
    return -ERR_INPUT;
}

static int read_double_in_range(struct yaml_reader *r, const struct yaml_key *key,
                                const struct yaml_node *node, double *value) {
    int rc = yaml_read_double(r, node, value);
    return rc != 0 ? rc : check_range(r, key, node, *value);
}

static int read_int_in_range(struct yaml_reader *r, const struct yaml_key *key, const struct yaml_node *node,
                             int *value) {
    int64_t read;
    int rc = yaml_read_int(r, node, INT_MIN, INT_MAX, &read);
    if (rc == 0)
        rc = check_range(r, key, node, (double)read);
    if (rc == 0)
        *value = (int)read;
    return rc;
}

static int read_choice(struct yaml_reader *r, const struct yaml_key *key, const struct yaml_node *node,
                       int *value) {
    const char *text = yaml_text(node);
    for (int i = 0; text && key->choices[i]; i++)
        if (strcmp(text, key->choices[i]) == 0) {
            *value = i;
            return 0;
        }
    char all[200] = "", buffer[96];
    for (int i = 0; key->choices[i]; i++) {
        size_t used = strlen(all);
        snprintf(all + used, sizeof all - used, "%s%s", i ? ", " : "", key->choices[i]);
    }
    const char *near = text ? yaml_nearest(text, key->choices) : NULL;
    yaml_error(r, node, "%s must be one of %s, not %s%s%s%s", name_of(r), all,
               describe(node, buffer, sizeof buffer), near ? "; did you mean '" : "", near ? near : "",
               near ? "'?" : "");
    return -ERR_INPUT;
}

static int read_string_key(struct yaml_reader *r, const struct yaml_key *key, const struct yaml_node *node,
                           char *value) {
    int rc = yaml_read_string(r, node, value, key->size);
    if (rc == 0 && key->required && node->size == 0) {
        yaml_error(r, node, "%s must not be empty", name_of(r));
        return -ERR_INPUT;
    }
    return rc;
}

static int check_list(struct yaml_reader *r, const struct yaml_key *key, const struct yaml_node *node) {
    if (node->kind != YAML_KIND_LIST)
        return wrong_type(r, node,
                          key->type == YAML_LIST      ? "a list of mappings"
                          : key->type == YAML_STRINGS ? "a list of texts, as [a, b]"
                                                      : "a list of numbers, as [1, 2]");
    if (node->n > (size_t)key->capacity || node->n < (size_t)key->minimum) {
        yaml_error(r, node, "%s has %zu items; it must have from %d to %d", name_of(r), node->n, key->minimum,
                   key->capacity);
        return -ERR_INPUT;
    }
    return 0;
}

static int read_item(struct yaml_reader *r, const struct yaml_key *key, const struct yaml_node *node,
                     char *first, size_t i) {
    switch (key->type) {
    case YAML_DOUBLES:
        return read_double_in_range(r, key, node, (double *)(void *)first + i);
    case YAML_INTS:
        return read_int_in_range(r, key, node, (int *)(void *)first + i);
    case YAML_STRINGS:
        return yaml_read_string(r, node, first + i * key->size, key->size);
    default:
        return yaml_read_map(r, node, key->keys, first + i * key->size);
    }
}

static int read_list(struct yaml_reader *r, const struct yaml_key *key, const struct yaml_node *node,
                     char *object) {
    int *count = (int *)(void *)(object + key->count_offset);
    *count = 0;
    if (check_list(r, key, node) != 0)
        return -ERR_INPUT;
    int rc = 0;
    for (size_t i = 0; i < node->n; i++) {
        size_t back = path_push_index(r, i);
        place_add(r, node->item[i]);
        if (read_item(r, key, node->item[i], object + key->offset, i) != 0)
            rc = -ERR_INPUT;
        path_pop(r, back);
    }
    *count = (int)node->n;
    return rc;
}

static int read_custom(struct yaml_reader *r, const struct yaml_key *key, const struct yaml_node *node,
                       void *object) {
    int before = r->reported;
    int rc = key->custom(r, node, object);
    if (rc != 0 && r->reported == before)
        yaml_error(r, node, "%s cannot be read as it is written", name_of(r));
    return r->reported == before ? 0 : -ERR_INPUT;
}

static int read_value(struct yaml_reader *r, const struct yaml_key *key, const struct yaml_node *node,
                      void *object) {
    char *target = (char *)object + key->offset;
    switch (key->type) {
    case YAML_STRING:
        return read_string_key(r, key, node, target);
    case YAML_DOUBLE:
        return read_double_in_range(r, key, node, (double *)(void *)target);
    case YAML_INT:
        return read_int_in_range(r, key, node, (int *)(void *)target);
    case YAML_BOOL:
        return yaml_read_bool(r, node, (bool *)target);
    case YAML_CHOICE:
        return read_choice(r, key, node, (int *)(void *)target);
    case YAML_DOUBLES:
    case YAML_INTS:
    case YAML_STRINGS:
    case YAML_LIST:
        return read_list(r, key, node, object);
    case YAML_MAP:
        return yaml_read_map(r, node, key->keys, target);
    case YAML_CUSTOM:
        return read_custom(r, key, node, object);
    }
    return -ERR_INPUT;
}

static int find_key(const struct yaml_key *keys, const char *name) {
    for (int i = 0; keys[i].name; i++)
        if (strcmp(keys[i].name, name) == 0)
            return i;
    return -1;
}

static int list_names(const struct yaml_key *keys, const char **names) {
    int n = 0;
    while (keys[n].name) {
        assert(n < TABLE_KEYS_MAX);
        names[n] = keys[n].name;
        n++;
    }
    names[n] = NULL;
    return n;
}

static void join_names(const char *const *names, char *text, size_t size) {
    text[0] = '\0';
    for (int i = 0; names[i]; i++) {
        size_t used = strlen(text);
        snprintf(text + used, size - used, "%s%s", i ? ", " : "", names[i]);
    }
}

static void report_unknown(struct yaml_reader *r, const struct yaml_key *keys, const struct yaml_node *node) {
    const char *names[TABLE_KEYS_MAX + 1];
    char all[320];
    list_names(keys, names);
    const char *near = yaml_nearest(node->text, names);
    join_names(names, all, sizeof all);
    const char *in = r->path[0] ? " in " : "";
    if (near)
        yaml_error(r, node, "unknown key '%.64s'%s%s; did you mean '%s'?", node->text, in, r->path, near);
    else
        yaml_error(r, node, "unknown key '%.64s'%s%s; known here: %s", node->text, in, r->path, all);
}

static void apply_default(struct yaml_reader *r, const struct yaml_key *key, void *object) {
    struct yaml_node *node = NULL;
    struct yaml_places *places = r->places;
    yaml_parse("(default)", key->default_text, strlen(key->default_text), &node, r->errors);
    if (!node)
        return;
    r->places = NULL; /* nobody wrote it, so it has no place */
    read_value(r, key, node, object);
    r->places = places;
    yaml_tree_free(node);
}

static void fill_missing(struct yaml_reader *r, const struct yaml_node *map, const struct yaml_key *key,
                         void *object) {
    size_t back = path_push_key(r, key->name);
    if (key->required)
        yaml_error(r, map, "the key '%s' is missing%s%s", r->path, key->doc ? ": " : "",
                   key->doc ? key->doc : "");
    else if (key->default_text)
        apply_default(r, key, object);
    path_pop(r, back);
}

static void read_key(struct yaml_reader *r, const struct yaml_key *key, const struct yaml_node *name,
                     const struct yaml_node *value, void *object) {
    size_t back = path_push_key(r, key->name);
    place_add(r, name);
    read_value(r, key, value, object);
    if (key->set_offset)
        *(bool *)((char *)object + key->set_offset - 1) = true;
    path_pop(r, back);
}

int yaml_read_map(struct yaml_reader *r, const struct yaml_node *node, const struct yaml_key *keys,
                  void *object) {
    bool seen[TABLE_KEYS_MAX + 1] = {false};
    int before = r->reported;
    if (node->kind != YAML_KIND_MAP)
        return wrong_type(r, node, "a mapping (key: value)");
    for (size_t i = 0; i < node->n; i++) {
        int k = find_key(keys, node->key[i]->text);
        if (k < 0)
            report_unknown(r, keys, node->key[i]);
        else if (!seen[k]) /* a doubled key was reported when the text was parsed */
            read_key(r, &keys[k], node->key[i], node->item[i], object);
        if (k >= 0)
            seen[k] = true;
    }
    for (int k = 0; keys[k].name; k++)
        if (!seen[k])
            fill_missing(r, node, &keys[k], object);
    return r->reported == before ? 0 : -ERR_INPUT;
}

static bool stands_before(const struct err *a, const struct err *b) {
    return a->line != b->line ? a->line < b->line : a->column < b->column;
}

/* By place, and at one place in the order found: insertion sort of at most ERR_LIST_OF_FILE entries. */
void yaml_sort_errors(struct err_list *errors, size_t first) {
    for (size_t i = first + 1; i < errors->n; i++) {
        struct err moved = errors->item[i];
        size_t k = i;
        for (; k > first && stands_before(&moved, &errors->item[k - 1]); k--)
            errors->item[k] = errors->item[k - 1];
        errors->item[k] = moved;
    }
}

static int read_tree(struct yaml_reader *r, const struct yaml_node *root, const struct yaml_key *keys,
                     void *object) {
    if (root && !yaml_is_null(root))
        return yaml_read_map(r, root, keys, object);
    const char *names[TABLE_KEYS_MAX + 1];
    char all[320];
    list_names(keys, names);
    join_names(names, all, sizeof all);
    yaml_error(r, NULL, "the file is empty; a mapping with these keys is expected: %s", all);
    return -ERR_INPUT;
}

int yaml_read_text_places(const char *file, const char *text, size_t size, const struct yaml_key *keys,
                          void *object, struct err_list *errors, struct yaml_places *places) {
    struct yaml_reader r = {.file = file, .errors = errors, .first_error = errors->n, .places = places};
    struct yaml_node *root = NULL;
    int rc = yaml_parse(file, text, size, &root, errors);
    if (rc == 0)
        rc = read_tree(&r, root, keys, object);
    yaml_tree_free(root);
    yaml_sort_errors(errors, r.first_error);
    return errors->n > r.first_error ? -ERR_INPUT : rc;
}

int yaml_read_text(const char *file, const char *text, size_t size, const struct yaml_key *keys, void *object,
                   struct err_list *errors) {
    return yaml_read_text_places(file, text, size, keys, object, errors, NULL);
}

int yaml_read_file(const char *path, const struct yaml_key *keys, void *object, struct err_list *errors) {
    struct err e = {0};
    char *text = NULL;
    size_t size = 0;
    int rc = file_read(path, YAML_BYTES_MAX, &text, &size, &e);
    if (rc != 0) {
        err_list_add(errors, &e);
        return rc;
    }
    rc = yaml_read_text(path, text, size, keys, object, errors);
    free(text);
    return rc;
}
