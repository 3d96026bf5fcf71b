/*
 * place.h — where a file stands that a scene file names: from the scene's folder on, unless the name begins with `/`.
 *
 * Checked    tests/unit/test_scene.c, test_relief.c, test_colour.c: by what they read
 */
#ifndef FIT_RENDER_PLACE_H
#define FIT_RENDER_PLACE_H

#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#define PLACE_MAX 1024

static inline void place_of(char path[PLACE_MAX], const char *folder, const char *name) {
    snprintf(path, PLACE_MAX, "%s%s%s", name[0] == '/' ? "" : folder, name[0] == '/' ? "" : "/", name);
}

/* In capitals, too. */
static inline bool place_ends(const char *name, const char *end) {
    size_t n = strlen(name), k = strlen(end);
    return n > k && strcasecmp(name + n - k, end) == 0;
}

#endif
