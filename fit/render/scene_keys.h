/*
 * scene_keys.h — the tables of keys of a scene file; docs/scene-file.md is printed from them.
 */
#ifndef FIT_RENDER_SCENE_KEYS_H
#define FIT_RENDER_SCENE_KEYS_H

#include "proto/yaml.h"

extern const struct yaml_key scene_keys[];
extern const char *const scene_models[]; /* indexed by scene_material.model */

#endif
