#include "proto/yaml.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define NAME_MAX_BYTES 48 /* longer words are nobody's slip of the pen */

static int least(int a, int b) {
    return a < b ? a : b;
}

/* Edit distance where a swap of neighbours counts one ("hodler", "holder"): optimal string alignment. */
static int distance(const char *a, const char *b) {
    int n = (int)strlen(a), m = (int)strlen(b);
    int d[NAME_MAX_BYTES + 1][NAME_MAX_BYTES + 1];
    for (int i = 0; i <= n; i++)
        d[i][0] = i;
    for (int k = 0; k <= m; k++)
        d[0][k] = k;
    for (int i = 1; i <= n; i++)
        for (int k = 1; k <= m; k++) {
            int replaced = d[i - 1][k - 1] + (a[i - 1] != b[k - 1]);
            d[i][k] = least(least(d[i - 1][k], d[i][k - 1]) + 1, replaced);
            if (i > 1 && k > 1 && a[i - 1] == b[k - 2] && a[i - 2] == b[k - 1])
                d[i][k] = least(d[i][k], d[i - 2][k - 2] + 1);
        }
    return d[n][m];
}

const char *yaml_nearest(const char *name, const char *const *names) {
    size_t length = strlen(name);
    if (length > NAME_MAX_BYTES)
        return NULL;
    const char *best = NULL;
    int best_distance = (int)(length / 3) + 1;
    for (int i = 0; names[i]; i++) {
        if (strlen(names[i]) > NAME_MAX_BYTES)
            continue;
        int found = distance(name, names[i]);
        if (found < best_distance) {
            best_distance = found;
            best = names[i];
        }
    }
    return best;
}

static const char *type_name(enum yaml_type type) {
    static const char *const names[] = {
        [YAML_STRING] = "text",
        [YAML_DOUBLE] = "number",
        [YAML_INT] = "whole number",
        [YAML_BOOL] = "true or false",
        [YAML_CHOICE] = "one of",
        [YAML_DOUBLES] = "list of numbers",
        [YAML_INTS] = "list of whole numbers",
        [YAML_STRINGS] = "list of texts",
        [YAML_MAP] = "mapping",
        [YAML_LIST] = "list of mappings",
        [YAML_CUSTOM] = "see text",
    };
    return names[type];
}

static void print_type(FILE *out, const struct yaml_key *key) {
    fputs(type_name(key->type), out);
    for (int i = 0; key->type == YAML_CHOICE && key->choices[i]; i++)
        fprintf(out, "%s `%s`", i ? "," : "", key->choices[i]);
}

static void print_range(FILE *out, const struct yaml_key *key) {
    if (key->low != key->high && isinf(key->high))
        fprintf(out, "at least %.10g", key->low);
    else if (key->low != key->high && isinf(key->low))
        fprintf(out, "at most %.10g", key->high);
    else if (key->low != key->high)
        fprintf(out, "%.10g to %.10g", key->low, key->high);
    if (key->unit)
        fprintf(out, "%s%s", key->low != key->high ? " " : "", key->unit);
}

static void print_default(FILE *out, const struct yaml_key *key) {
    if (key->required)
        fputs("required", out);
    else if (key->default_text && key->type != YAML_MAP)
        fprintf(out, "`%s`", key->default_text);
}

static void print_rows(FILE *out, const char *prefix, const struct yaml_key *keys) {
    for (const struct yaml_key *key = keys; key->name; key++) {
        fprintf(out, "| `%s%s` | ", prefix, key->name);
        print_type(out, key);
        fputs(" | ", out);
        print_range(out, key);
        fputs(" | ", out);
        print_default(out, key);
        fprintf(out, " | %s |\n", key->doc ? key->doc : "");
        if (key->type == YAML_MAP || key->type == YAML_LIST) {
            char inner[160];
            snprintf(inner, sizeof inner, "%s%s%s.", prefix, key->name, key->type == YAML_LIST ? "[]" : "");
            print_rows(out, inner, key->keys);
        }
    }
}

void yaml_print_reference(FILE *out, const char *title, const struct yaml_key *keys) {
    fprintf(out, "## %s\n\n| key | type | range | default | meaning |\n|---|---|---|---|---|\n", title);
    print_rows(out, "", keys);
    fputc('\n', out);
}

const struct yaml_place *yaml_place_find(const struct yaml_places *places, const char *path) {
    for (size_t i = 0; i < places->n; i++)
        if (strcmp(places->item[i].path, path) == 0)
            return &places->item[i];
    return NULL;
}

const struct yaml_place *yaml_place_near(const struct yaml_places *places, const char *path) {
    char at[sizeof places->item->path];
    const struct yaml_place *place;
    snprintf(at, sizeof at, "%s", path);
    for (size_t n = strlen(at); !(place = yaml_place_find(places, at)) && n > 0;) {
        while (n > 0 && at[n] != '.' && at[n] != '[')
            n--;
        at[n] = 0;
    }
    return place;
}

void yaml_places_free(struct yaml_places *places) {
    free(places->item);
    memset(places, 0, sizeof *places);
}
