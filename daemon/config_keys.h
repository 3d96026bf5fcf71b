/*
 * config_keys.h — the tables of keys of goniod.yaml; what config.c reads, checks and prints by.
 *
 * Offsets are into struct config (config_keys) and struct config_axis (the axis tables). An axis is written
 * as `manual`, as {fixed_deg: X}, or as a mapping of config_axis_keys.
 * Checked    tests/unit/test_config.c
 */
#ifndef DAEMON_CONFIG_KEYS_H
#define DAEMON_CONFIG_KEYS_H

#include "proto/yaml.h"

extern const struct yaml_key config_keys[];
extern const struct yaml_key config_axis_keys[];
extern const struct yaml_key config_fixed_keys[];
extern const struct yaml_key config_zone_keys[];

#endif
