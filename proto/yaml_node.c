#include "proto/yaml_tree.h"

#include <jansson.h>
#include <string.h>

#include "proto/number.h"

bool yaml_is_map(const struct yaml_node *node) {
    return node && node->kind == YAML_KIND_MAP;
}

bool yaml_is_list(const struct yaml_node *node) {
    return node && node->kind == YAML_KIND_LIST;
}

bool yaml_is_null(const struct yaml_node *node) {
    static const char *const spellings[] = {"", "~", "null", "Null", "NULL"};
    if (!node || node->kind != YAML_KIND_SCALAR || !node->plain)
        return false;
    for (size_t i = 0; i < sizeof spellings / sizeof *spellings; i++)
        if (strcmp(node->text, spellings[i]) == 0)
            return true;
    return false;
}

const char *yaml_text(const struct yaml_node *node) {
    return node && node->kind == YAML_KIND_SCALAR ? node->text : NULL;
}

size_t yaml_count(const struct yaml_node *node) {
    return node ? node->n : 0;
}

const struct yaml_node *yaml_item(const struct yaml_node *node, size_t i) {
    return i < yaml_count(node) ? node->item[i] : NULL;
}

const struct yaml_node *yaml_item_key(const struct yaml_node *map, size_t i) {
    return yaml_is_map(map) && i < map->n ? map->key[i] : NULL;
}

const char *yaml_item_name(const struct yaml_node *map, size_t i) {
    return yaml_text(yaml_item_key(map, i));
}

const struct yaml_node *yaml_find(const struct yaml_node *map, const char *name) {
    if (!yaml_is_map(map))
        return NULL;
    for (size_t i = 0; i < map->n; i++)
        if (strcmp(map->key[i]->text, name) == 0)
            return map->item[i];
    return NULL;
}

int yaml_node_line(const struct yaml_node *node) {
    return node ? node->line : 0;
}

int yaml_node_column(const struct yaml_node *node) {
    return node ? node->column : 0;
}

static json_t *scalar_json(const struct yaml_node *node) {
    int64_t whole;
    double number;
    if (yaml_is_null(node))
        return json_null();
    if (node->plain && strcmp(node->text, "true") == 0)
        return json_true();
    if (node->plain && strcmp(node->text, "false") == 0)
        return json_false();
    if (node->plain && number_read_int(node->text, &whole))
        return json_integer(whole);
    if (node->plain && number_read_double(node->text, &number))
        return json_real(number);
    return json_stringn(node->text, node->size);
}

static json_t *node_json(const struct yaml_node *node) {
    if (node->kind == YAML_KIND_SCALAR)
        return scalar_json(node);
    json_t *json = node->kind == YAML_KIND_MAP ? json_object() : json_array();
    for (size_t i = 0; i < node->n; i++) {
        json_t *item = node_json(node->item[i]);
        if (node->kind == YAML_KIND_MAP)
            json_object_set_new(json, node->key[i]->text, item);
        else
            json_array_append_new(json, item);
    }
    return json;
}

char *yaml_node_json(const struct yaml_node *node) {
    json_t *json = node_json(node);
    char *text = json ? json_dumps(json, JSON_ENCODE_ANY) : NULL;
    json_decref(json);
    return text;
}
