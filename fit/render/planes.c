#include "fit/render/planes.h"

#include <stdlib.h>
#include <string.h>

static double *plane(struct planes *p) {
    size_t size = (size_t)p->width * (size_t)p->height * sizeof(double);
    p->bytes += size;
    return calloc(1, size);
}

int planes_make(struct planes *p, int width, int height, int n_sets, bool with_b, bool with_c,
                struct err *e) {
    size_t pixels = (size_t)width * (size_t)height;
    *p = (struct planes){.width = width, .height = height, .n_sets = n_sets};
    bool enough = (p->paint = malloc(pixels * sizeof *p->paint)) != NULL;
    for (int j = 0; j < n_sets && enough; j++) {
        p->set[j].a = plane(p);
        p->set[j].b = with_b ? plane(p) : NULL;
        p->set[j].c = with_c ? plane(p) : NULL;
        enough = p->set[j].a && (!with_b || p->set[j].b) && (!with_c || p->set[j].c);
    }
    if (!enough) {
        planes_free(p);
        return err_set(e, ERR_NOMEM, "no memory for the planes of %d x %d pixels; render fewer pixels", width,
                       height);
    }
    p->bytes += pixels * sizeof *p->paint;
    memset(p->paint, 0xff, pixels * sizeof *p->paint);
    return 0;
}

int planes_add_indirect(struct planes *p, struct err *e) {
    size_t n = (size_t)p->width * (size_t)p->height * BANDS;
    for (int j = 0; j < p->n_sets; j++) {
        p->set[j].indirect = calloc(n, sizeof *p->set[j].indirect);
        if (!p->set[j].indirect) {
            return err_set(e, ERR_NOMEM,
                           "no memory for the spectra of %d x %d pixels; render fewer pixels, or one bounce",
                           p->width, p->height);
        }
        p->bytes += n * sizeof *p->set[j].indirect;
    }
    return 0;
}

bool planes_have_indirect(const struct planes *p) {
    return p->n_sets > 0 && p->set[0].indirect;
}

int planes_add_noise(struct planes *p, struct err *e) {
    p->noise = plane(p);
    return p->noise ? 0
                    : err_set(e, ERR_NOMEM, "no memory for the noise of %d x %d pixels", p->width, p->height);
}

void planes_free(struct planes *p) {
    for (int j = 0; j < p->n_sets; j++) {
        free(p->set[j].a);
        free(p->set[j].b);
        free(p->set[j].c);
        free(p->set[j].indirect);
    }
    free(p->paint);
    free(p->noise);
    free(p->extra);
    *p = (struct planes){0};
}

int planes_add_extra(struct planes *p, const struct planes_extra *extra, size_t n, struct err *e) {
    if (n == 0) {
        return 0;
    }
    if (p->n_extra + n > p->extra_capacity) {
        size_t capacity = 2 * (p->n_extra + n);
        struct planes_extra *grown = realloc(p->extra, capacity * sizeof *grown);
        if (!grown) {
            return err_set(e, ERR_NOMEM, "no memory for %zu pixels of several paints", p->n_extra + n);
        }
        p->extra = grown;
        p->extra_capacity = capacity;
    }
    memcpy(p->extra + p->n_extra, extra, n * sizeof *extra);
    p->n_extra += n;
    return 0;
}
