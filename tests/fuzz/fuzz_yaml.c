#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "proto/yaml.h"

struct part {
    char name[8];
    double size;
};

struct thing {
    char title[16];
    double factor, list[4];
    int address, mode, pair[2], n_list, n_pair, n_word, n_part;
    bool on;
    char word[3][6];
    struct part main_part, part[2];
};

static int read_any(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    (void)object;
    char *json = yaml_node_json(node), text[5];
    free(json);
    for (size_t i = 0; i < yaml_count(node); i++) {
        double number;
        yaml_find(node, yaml_is_map(node) ? yaml_item_name(node, i) : "a");
        if (yaml_read_string(r, yaml_item(node, i), text, sizeof text) == 0)
            yaml_read_double(r, yaml_item(node, i), &number);
    }
    return 0;
}

static const char *const modes[] = {"a", "bb", "ccc", NULL};
static const struct yaml_key part_keys[] = {
    {.name = "name", .type = YAML_STRING, .offset = offsetof(struct part, name), .size = 8, .required = true},
    {.name = "size", .type = YAML_DOUBLE, .offset = offsetof(struct part, size), .low = 0, .high = INFINITY},
    {0},
};

#define AT(member) .offset = offsetof(struct thing, member)
#define COUNT(member) .count_offset = offsetof(struct thing, member)
static const struct yaml_key keys[] = {
    {.name = "title", .type = YAML_STRING, AT(title), .size = 16, .required = true},
    {.name = "f", .type = YAML_DOUBLE, AT(factor), .low = -1, .high = 1, .default_text = "0.25"},
    {.name = "i", .type = YAML_INT, AT(address), .low = 0, .high = 65535},
    {.name = "m", .type = YAML_CHOICE, AT(mode), .choices = modes},
    {.name = "on", .type = YAML_BOOL, AT(on)},
    {.name = "l", .type = YAML_DOUBLES, AT(list), COUNT(n_list), .capacity = 4},
    {.name = "p", .type = YAML_INTS, AT(pair), COUNT(n_pair), .capacity = 2, .minimum = 2},
    {.name = "w", .type = YAML_STRINGS, AT(word), COUNT(n_word), .capacity = 3, .size = 6},
    {.name = "main", .type = YAML_MAP, AT(main_part), .keys = part_keys},
    {.name = "parts",
     .type = YAML_LIST,
     AT(part),
     .size = sizeof(struct part),
     COUNT(n_part),
     .capacity = 2,
     .keys = part_keys},
    {.name = "any", .type = YAML_CUSTOM, .custom = read_any},
    {0},
};

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct thing thing = {0};
    struct err_list errors = {0};
    struct yaml_places places = {0};
    int rc = yaml_read_text_places("f", (const char *)data, size, keys, &thing, &errors, &places);
    if ((rc == 0) != (errors.n == 0) || errors.n > ERR_LIST_OF_FILE)
        abort();
    if (thing.n_list > 4 || thing.n_pair > 2 || thing.n_word > 3 || thing.n_part > 2)
        abort();
    yaml_places_free(&places);
    err_list_free(&errors);
    return 0;
}
