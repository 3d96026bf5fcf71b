/*
 * drives.h — what is known of each drive beyond its profile: commissioned when, and may its position be trusted.
 *
 * STATE/drives.json: {"LINK#UNIT": {"profile","hash","commissioned","position_valid","utc"}}. A record of
 * another profile text (hash) counts as none. Written whole to a new file and renamed, so that a crash leaves
 * the old one.
 * Errors     -ERR_IO.
 * Checked    tests/unit/test_drives.c
 */
#ifndef DAEMON_DRIVES_H
#define DAEMON_DRIVES_H

#include <stdbool.h>
#include <stdint.h>

#include "daemon/config.h"
#include "proto/profile.h"

struct drive_record {
    bool position_valid, commissioned;
    int64_t utc_us;
};

bool drives_position_valid(const char *state_dir, const struct config_axis *axis, const struct profile *p);
bool drives_commissioned(const char *state_dir, const struct config_axis *axis, const struct profile *p);
/* commissioned, once recorded for this profile text, stays; position_valid is as given. */
int drives_record(const char *state_dir, const struct config_axis *axis, const struct profile *p,
                  const struct drive_record *record, struct err *e);

#endif
