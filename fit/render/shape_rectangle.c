#include "fit/render/shape.h"

#include <stdlib.h>
#include <string.h>

#include "fit/render/place.h"
#include "fit/render/sha256.h"

/* Where a ray meets the plane z = 0 from its front, in the rectangle's own coordinates from its centre. */
static bool meet(const struct shape *s, double half_width, double half_height, const struct ray *ray,
                 double before_mm, double *t, double *x, double *y) {
    struct vec3 o = frame_into(&s->frame, vec3_sub(ray->origin, s->frame.at));
    struct vec3 d = frame_into(&s->frame, ray->direction);
    if (d.z == 0) {
        return false;
    }
    *t = -o.z / d.z;
    *x = o.x + *t * d.x;
    *y = o.y + *t * d.y;
    return *t > ray->near_mm && *t < before_mm && fabs(*x) <= half_width && fabs(*y) <= half_height;
}

static void fill(const struct ray *ray, double t, struct vec3 normal, int paint, struct hit *hit) {
    hit->t_mm = t;
    hit->position = vec3_add(ray->origin, vec3_scale(ray->direction, t));
    hit->normal = normal;
    hit->paint = paint;
}

bool shape_rectangle_hit(const struct shape *s, const struct ray *ray, struct hit *hit) {
    const struct shape_rectangle *r = &s->rectangle;
    double t, x, y;
    if (!meet(s, r->width_mm / 2, r->height_mm / 2, ray, hit->t_mm, &t, &x, &y)) {
        return false;
    }
    double u = x + r->width_mm / 2, v = r->height_mm / 2 - y;
    int paint = s->paint_of[0];
    if (r->mask) {
        int column = (int)(u / r->width_mm * r->mask_width), row = (int)(v / r->height_mm * r->mask_height);
        column = column < r->mask_width ? column : r->mask_width - 1;
        row = row < r->mask_height ? row : r->mask_height - 1;
        paint = s->paint_of[r->mask[(size_t)row * (size_t)r->mask_width + (size_t)column]];
    }
    struct vec3 normal =
        r->relief.height_mm ? frame_out(&s->frame, relief_normal(&r->relief, u, v)) : s->frame.z;
    fill(ray, t, normal, paint, hit);
    return true;
}

bool shape_rectangle_shadow(const struct shape *s, const struct hit *hit, struct vec3 l) {
    const struct shape_rectangle *r = &s->rectangle;
    if (!r->relief.height_mm) {
        return false;
    }
    struct vec3 at = frame_into(&s->frame, vec3_sub(hit->position, s->frame.at));
    return relief_shadow(&r->relief, at.x + r->width_mm / 2, r->height_mm / 2 - at.y,
                         frame_into(&s->frame, l));
}

bool shape_board_hit(const struct shape *s, const struct ray *ray, struct hit *hit) {
    const struct shape_board *b = &s->board;
    double step = b->patch_mm + b->gap_mm, t, x, y;
    int rows = (s->n_materials + b->columns - 1) / b->columns;
    double width = b->columns * step - b->gap_mm, height = rows * step - b->gap_mm;
    if (!meet(s, width / 2, height / 2, ray, hit->t_mm, &t, &x, &y)) {
        return false;
    }
    double u = x + width / 2, v = height / 2 - y;
    int column = (int)(u / step), row = (int)(v / step), patch = row * b->columns + column;
    if (u - column * step > b->patch_mm || v - row * step > b->patch_mm || patch >= s->n_materials) {
        return false;
    }
    fill(ray, t, s->frame.z, s->paint_of[patch], hit);
    return true;
}

/* -1: the raster has a colour that is not listed; its pixel is told. */
static int mask_index(const struct shape *s, const struct raster *raster, size_t pixel) {
    const uint16_t *code = raster->rgb + 3 * pixel;
    unsigned colour = (unsigned)(code[0] >> 8) << 16 | (unsigned)(code[1] >> 8) << 8 | code[2] >> 8;
    for (int i = 0; i < s->n_materials; i++) {
        if (s->rectangle.mask_colour[i] == colour) {
            return i;
        }
    }
    return -1;
}

static int fill_mask(struct shape *s, const char *path, const struct raster *raster, struct err *e) {
    struct shape_rectangle *r = &s->rectangle;
    size_t n = (size_t)raster->width * (size_t)raster->height;
    r->mask_width = raster->width;
    r->mask_height = raster->height;
    r->mask = malloc(n);
    if (!r->mask) {
        return err_set(e, ERR_NOMEM, "no memory for the mask %s", path);
    }
    for (size_t i = 0; i < n; i++) {
        int index = mask_index(s, raster, i);
        if (index < 0) {
            const uint16_t *code = raster->rgb + 3 * i;
            return err_set(
                e, ERR_INPUT,
                "%s: the pixel in column %zu of row %zu is #%02x%02x%02x, which `mask` does not list", path,
                i % (size_t)raster->width, i / (size_t)raster->width, code[0] >> 8, code[1] >> 8,
                code[2] >> 8);
        }
        r->mask[i] = (uint8_t)index;
    }
    return 0;
}

int shape_rectangle_prepare(struct shape *s, const char *folder, struct err_list *errors, struct err *e) {
    (void)errors;
    struct shape_rectangle *r = &s->rectangle;
    struct raster raster = {0};
    char path[PLACE_MAX];
    int status = 0;
    if (r->mask_file[0]) {
        place_of(path, folder, r->mask_file);
        status = raster_read(path, &raster, e);
        status = status ? status : fill_mask(s, path, &raster, e);
        status = status ? status : sha256_of_file(path, r->mask_sha256, e);
        raster_free(&raster);
    }
    if (!status && r->relief_file[0] && r->relief_mm > 0) { /* a relief of no height is not even read */
        place_of(path, folder, r->relief_file);
        status = raster_read(path, &raster, e);
        status =
            status ? status : relief_make(&r->relief, &raster, r->width_mm, r->height_mm, r->relief_mm, e);
        status = status ? status : sha256_of_file(path, r->relief_sha256, e);
        raster_free(&raster);
    }
    return status;
}

void shape_rectangle_free(struct shape *s) {
    free(s->rectangle.mask);
    s->rectangle.mask = NULL;
    relief_free(&s->rectangle.relief);
}
