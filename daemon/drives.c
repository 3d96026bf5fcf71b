#include "daemon/drives.h"

#include <errno.h>
#include <jansson.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>

static void file_name(const char *state_dir, char path[PATH_MAX]) {
    snprintf(path, PATH_MAX, "%s/drives.json", state_dir);
}

static void unit_key(const struct config_axis *axis, char *key, size_t size) {
    snprintf(key, size, "%s#%d", axis->link, axis->unit);
}

static json_t *load(const char *state_dir) {
    char path[PATH_MAX];
    file_name(state_dir, path);
    json_t *all = json_load_file(path, 0, NULL);
    return json_is_object(all) ? all : (json_decref(all), json_object());
}

static json_t *find(const json_t *all, const struct config_axis *axis, const struct profile *p) {
    char key[160];
    unit_key(axis, key, sizeof key);
    json_t *unit = json_object_get(all, key);
    const char *hash = json_string_value(json_object_get(unit, "hash"));
    return hash && !strcmp(hash, p->hash) ? unit : NULL;
}

static bool flag(const char *state_dir, const struct config_axis *axis, const struct profile *p,
                 const char *name) {
    json_t *all = load(state_dir);
    bool set = json_is_true(json_object_get(find(all, axis, p), name));
    json_decref(all);
    return set;
}

bool drives_position_valid(const char *state_dir, const struct config_axis *axis, const struct profile *p) {
    return flag(state_dir, axis, p, "position_valid");
}

bool drives_commissioned(const char *state_dir, const struct config_axis *axis, const struct profile *p) {
    return flag(state_dir, axis, p, "commissioned");
}

static int store(const char *state_dir, const json_t *all, struct err *e) {
    char path[PATH_MAX], fresh[PATH_MAX + 8];
    file_name(state_dir, path);
    snprintf(fresh, sizeof fresh, "%s.new", path);
    int failed = json_dump_file(all, fresh, JSON_INDENT(1) | JSON_SORT_KEYS) || rename(fresh, path);
    int saved = errno;
    return failed ? err_errno(e, ERR_IO, saved, "cannot write %s, which records what is known of each drive",
                              path)
                  : 0;
}

int drives_record(const char *state_dir, const struct config_axis *axis, const struct profile *p,
                  const struct drive_record *record, struct err *e) {
    char key[160];
    unit_key(axis, key, sizeof key);
    json_t *all = load(state_dir);
    bool commissioned =
        record->commissioned || json_is_true(json_object_get(find(all, axis, p), "commissioned"));
    json_t *unit = json_pack("{s:s, s:s, s:b, s:b, s:I}", "profile", p->id, "hash", p->hash, "commissioned",
                             commissioned, "position_valid", record->position_valid, "utc_us",
                             (json_int_t)record->utc_us);
    json_object_set_new(all, key, unit);
    int result = store(state_dir, all, e);
    json_decref(all);
    return result;
}
