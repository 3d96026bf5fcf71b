/*
 * yaml_table.h — how the rows of a table of keys are written (struct yaml_key, proto/yaml.h).
 *
 * A row names its key and the field that takes the value; type, offset, size and capacity follow from the field,
 * and a field of another type does not compile. What else is to say stands behind: .required, .default_text,
 * .unit, .doc.
 * Shapes     at: `struct x, field`, given through a macro of the table's own, as AT(optics.beam_mm) from
 *            #define AT(field) struct config, field
 *            count: likewise, the int that counts the items. A table of a mapping inside has the offsets of the same
 *            struct; that of a list's items has those of one item. A table ends with {0}.
 *                YAML_NUMBER("beam_mm", AT(optics.beam_mm), 0.1, 500, .required = true, .unit = "mm")
 * Domain     low .. high as written; low == high: any number.
 * Checked    tests/unit/test_yaml.c
 */
#ifndef PROTO_YAML_TABLE_H
#define PROTO_YAML_TABLE_H

#include "proto/yaml.h"

#define YAML_FIELD(type_, field_) (((type_ *)0)->field_)
#define YAML_ROOM(...) (sizeof YAML_FIELD(__VA_ARGS__) / sizeof YAML_FIELD(__VA_ARGS__)[0])
#define YAML_OFFSET(kind, ...) _Generic(YAML_FIELD(__VA_ARGS__), kind : offsetof(__VA_ARGS__))
#define YAML_ROW(key, kind, ...)                                                                             \
    { .name = key, .type = kind, __VA_ARGS__ }

/* char[], double, int, bool */
#define YAML_TEXT(key, at, ...)                                                                              \
    YAML_ROW(key, YAML_STRING, .offset = YAML_OFFSET(char *, at), .size = sizeof YAML_FIELD(at), __VA_ARGS__)
#define YAML_NUMBER(key, at, low_, high_, ...)                                                               \
    YAML_ROW(key, YAML_DOUBLE, .offset = YAML_OFFSET(double, at), .low = low_, .high = high_, __VA_ARGS__)
#define YAML_INTEGER(key, at, low_, high_, ...)                                                              \
    YAML_ROW(key, YAML_INT, .offset = YAML_OFFSET(int, at), .low = low_, .high = high_, __VA_ARGS__)
#define YAML_FLAG(key, at, ...) YAML_ROW(key, YAML_BOOL, .offset = YAML_OFFSET(bool, at), __VA_ARGS__)
/* index into words: an int, or an enum, which is unsigned where no value is negative */
#define YAML_WORD(key, at, words, ...)                                                                       \
    YAML_ROW(key, YAML_CHOICE,                                                                               \
             .offset = _Generic(YAML_FIELD(at), int                                                          \
                                : offsetof(at), unsigned                                                     \
                                : offsetof(at)),                                                             \
             .choices = words, __VA_ARGS__)
/* double[], int[], char[][]: as many as the field has room for */
#define YAML_COUNT(...) .count_offset = YAML_OFFSET(int, __VA_ARGS__)
#define YAML_NUMBERS(key, at, count, low_, high_, ...)                                                       \
    YAML_ROW(key, YAML_DOUBLES, .offset = YAML_OFFSET(double *, at), YAML_COUNT(count),                      \
             .capacity = YAML_ROOM(at), .low = low_, .high = high_, __VA_ARGS__)
#define YAML_INTEGERS(key, at, count, low_, high_, ...)                                                      \
    YAML_ROW(key, YAML_INTS, .offset = YAML_OFFSET(int *, at), YAML_COUNT(count), .capacity = YAML_ROOM(at), \
             .low = low_, .high = high_, __VA_ARGS__)
#define YAML_TEXTS(key, at, count, ...)                                                                      \
    YAML_ROW(key, YAML_STRINGS, .offset = offsetof(at), .size = sizeof YAML_FIELD(at)[0], YAML_COUNT(count), \
             .capacity = YAML_ROOM(at), __VA_ARGS__)
/* a mapping inside, and a list of mappings */
#define YAML_PART(key, table, ...) YAML_ROW(key, YAML_MAP, .keys = table, __VA_ARGS__)
#define YAML_PARTS(key, at, count, table, ...)                                                               \
    YAML_ROW(key, YAML_LIST, .offset = offsetof(at), .size = sizeof YAML_FIELD(at)[0], YAML_COUNT(count),    \
             .capacity = YAML_ROOM(at), .keys = table, __VA_ARGS__)
/* what no type covers: read(reader, node, struct) */
#define YAML_OWN(key, read, ...) YAML_ROW(key, YAML_CUSTOM, .custom = read, __VA_ARGS__)
/* in a row: the bool at `flag` becomes true when the key is written */
#define YAML_SETS(flag) .set_offset = YAML_OFFSET(bool, flag) + 1

#endif
