#include "proto/profile.h"

#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "proto/file.h"
#include "proto/profile_inside.h"

#define TEXT_MAX (1 << 20)
#define TREE_LEVELS 5 /* from a program in build/ or build/tests/unit/ up to the source tree */

int profile_read_text(const char *file, const char *text, size_t size, struct profile *p,
                      struct err_list *errors) {
    memset(p, 0, sizeof *p);
    snprintf(p->file, sizeof p->file, "%s", file);
    file_hash(text, size, p->hash);
    int result = yaml_read_text(file, text, size, profile_keys, p, errors);
    return result ? result : profile_check(p, errors);
}

static bool in_folder(const char *folder, const char *name, char *path, size_t size) {
    int n = snprintf(path, size, "%s/%s.yaml", folder, name);
    return n > 0 && (size_t)n < size && access(path, R_OK) == 0;
}

/* drivers/profiles of the tree in which this program was built, or the folder of the prefix under which it is installed,
 * wherever that has been moved to */
static bool near_program(const char *name, char *path, size_t size) {
    char folder[PATH_MAX];
    ssize_t n = readlink("/proc/self/exe", folder, sizeof folder - 32);
    for (int level = 0; n > 0 && level < TREE_LEVELS; level++) {
        folder[n] = 0;
        char *slash = strrchr(folder, '/');
        if (!slash || slash == folder)
            return false;
        strcpy(slash, "/drivers/profiles");
        if (in_folder(folder, name, path, size))
            return true;
        strcpy(slash, "/share/goniod/profiles");
        if (in_folder(folder, name, path, size))
            return true;
        n = slash - folder;
    }
    return false;
}

static bool find(const char *name, char *path, size_t size) {
    const char *own = getenv("GONIOD_PROFILES");
    if (strchr(name, '/')) {
        int n = snprintf(path, size, "%s", name);
        return n > 0 && (size_t)n < size;
    }
    return (own && in_folder(own, name, path, size)) || near_program(name, path, size) ||
           in_folder(PROFILE_DIR, name, path, size);
}

int profile_load(const char *name, struct profile *p, struct err_list *errors) {
    char path[PATH_MAX], *text = NULL;
    size_t size;
    struct err e = {0};
    int result;
    if (!find(name, path, sizeof path))
        result = err_set(&e, ERR_INPUT,
                         "there is no profile '%s': expected %s.yaml in $GONIOD_PROFILES or %s, or a path",
                         name, name, PROFILE_DIR);
    else
        result = file_read(path, TEXT_MAX, &text, &size, &e);
    if (result) {
        err_list_add(errors, &e);
        return result;
    }
    result = profile_read_text(path, text, size, p, errors);
    free(text);
    return result;
}

const char *profile_alarm_text(const struct profile *p, int code) {
    for (int i = 0; i < p->n_alarms; i++)
        if (p->alarm[i].code == code)
            return p->alarm[i].text;
    return "unknown alarm, see the manual of the drive";
}

static bool listed(const int *list, int n, int code) {
    for (int i = 0; i < n; i++)
        if (list[i] == code)
            return true;
    return false;
}

bool profile_alarm_revokes(const struct profile *p, int code) {
    return listed(p->revokes, p->n_revokes, code);
}

bool profile_alarm_needs_person(const struct profile *p, int code) {
    return listed(p->no_reset, p->n_no_reset, code);
}

const char *profile_evidence_name(int evidence) {
    static const char *const NAMES[] = {"sources-only", "bench", "field"};
    return NAMES[evidence];
}

int profile_reg_words(const struct profile_reg *reg) {
    return reg->type == PROFILE_U32 || reg->type == PROFILE_S32 ? 2 : 1;
}

int32_t profile_raw_speed(const struct profile *p) {
    return (int32_t)lround(p->speed_deg_s * p->scale.speed.factor);
}

int32_t profile_raw_accel(const struct profile *p) {
    if (p->scale.accel.kind == PROFILE_ACCEL_NONE)
        return 0;
    if (p->scale.accel.kind == PROFILE_ACCEL_MS_PER_1000RPM) /* stage-modbus.md 2a */
        return (int32_t)lround(1e6 / (p->accel_deg_s2 * p->scale.speed.factor));
    return (int32_t)lround(p->accel_deg_s2 * p->scale.accel.factor);
}

int64_t profile_decode(const struct profile *p, enum profile_type type, const uint16_t *words) {
    if (type == PROFILE_U16)
        return words[0];
    if (type == PROFILE_S16)
        return (int16_t)words[0];
    uint32_t value = (uint32_t)words[p->low_word_first ? 1 : 0] << 16 | words[p->low_word_first ? 0 : 1];
    return type == PROFILE_S32 ? (int64_t)(int32_t)value : (int64_t)value;
}

int profile_encode(const struct profile *p, bool wide, int64_t value, uint16_t *words) {
    if (!wide) {
        words[0] = (uint16_t)value;
        return 1;
    }
    words[p->low_word_first ? 1 : 0] = (uint16_t)((uint32_t)value >> 16);
    words[p->low_word_first ? 0 : 1] = (uint16_t)value;
    return 2;
}

void profile_print_reference(FILE *out) {
    yaml_print_reference(out, "Register-map profile", profile_keys);
}
