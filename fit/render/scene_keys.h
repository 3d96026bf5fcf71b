/*
 * scene_keys.h — the tables of keys of a scene file; docs/scene-file.md is printed from them.
 *
 * Checked    tests/unit/test_scene.c
 */
#ifndef FIT_RENDER_SCENE_KEYS_H
#define FIT_RENDER_SCENE_KEYS_H

#include "proto/yaml.h"

#define SCENE_MM_MAX 1e6

/* Three numbers; count: of those read. */
#define SCENE_VECTOR(key, where, count, before, text)                                                        \
    {                                                                                                        \
        .name = key, .type = YAML_DOUBLES, .offset = where, .count_offset = count, .capacity = 3,            \
        .minimum = 3, .low = -SCENE_MM_MAX, .high = SCENE_MM_MAX, .default_text = before, .doc = text        \
    }
#define SCENE_LENGTH(key, where, needed, before, text)                                                       \
    {                                                                                                        \
        .name = key, .type = YAML_DOUBLE, .offset = where, .low = 1e-6, .high = SCENE_MM_MAX,                \
        .required = needed, .default_text = before, .unit = "mm", .doc = text                                \
    }

extern const struct yaml_key scene_keys[];
extern const struct yaml_key scene_shape_keys[];
extern const struct yaml_key scene_light_keys[];
extern const char *const scene_models[]; /* indexed by scene_material.model; NULL ends each list */
extern const char *const scene_observers[], *const scene_spaces[],
                                                *const scene_adaptations[]; /* as in colour.h */
extern const char *const scene_energies[];                                  /* as in energy.h */

#endif
