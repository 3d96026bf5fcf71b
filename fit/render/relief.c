#include "fit/render/relief.h"

#include <stdlib.h>

#define CODE_MM(code) ((code) / 65535.0)
#define STEP 0.5      /* of a texel */
#define GRAIN 65535.0 /* heights closer than one step of the codes are the same height */

int relief_make(struct relief *relief, const struct raster *raster, double width_mm, double height_mm,
                double scale_mm, struct err *e) {
    size_t n = (size_t)raster->width * (size_t)raster->height;
    *relief = (struct relief){.columns = raster->width,
                              .rows = raster->height,
                              .texel_x_mm = width_mm / raster->width,
                              .texel_y_mm = height_mm / raster->height,
                              .height_mm = malloc(n * sizeof *relief->height_mm)};
    if (!relief->height_mm) {
        return err_set(e, ERR_NOMEM, "no memory for a height map of %d x %d", raster->width, raster->height);
    }
    for (size_t i = 0; i < n; i++) {
        relief->height_mm[i] = (float)(CODE_MM(raster->rgb[3 * i]) * scale_mm);
        relief->highest_mm = fmax(relief->highest_mm, relief->height_mm[i]);
    }
    return 0;
}

void relief_free(struct relief *relief) {
    free(relief->height_mm);
    *relief = (struct relief){0};
}

static int inside(int i, int n) {
    return i < 0 ? 0 : i >= n ? n - 1 : i;
}

static double texel(const struct relief *r, int column, int row) {
    return r
        ->height_mm[(size_t)inside(row, r->rows) * (size_t)r->columns + (size_t)inside(column, r->columns)];
}

struct between { /* four texels around a place, and how near it is to the later ones */
    int column, row;
    double x, y;
};

static struct between between(const struct relief *r, double u_mm, double v_mm) {
    double x = fmin(fmax(u_mm / r->texel_x_mm - 0.5, 0), r->columns - 1);
    double y = fmin(fmax(v_mm / r->texel_y_mm - 0.5, 0), r->rows - 1);
    return (struct between){(int)x, (int)y, x - floor(x), y - floor(y)};
}

static double blend(const struct between *b, const double corner[4]) {
    double top = corner[0] + b->x * (corner[1] - corner[0]),
           bottom = corner[2] + b->x * (corner[3] - corner[2]);
    return top + b->y * (bottom - top);
}

static double height_at(const struct relief *r, double u_mm, double v_mm) {
    struct between b = between(r, u_mm, v_mm);
    double corner[4];
    for (int i = 0; i < 4; i++) {
        corner[i] = texel(r, b.column + i % 2, b.row + i / 2);
    }
    return blend(&b, corner);
}

struct vec3 relief_normal(const struct relief *relief, double u_mm, double v_mm) {
    struct between b = between(relief, u_mm, v_mm);
    double right[4], down[4];
    for (int i = 0; i < 4; i++) {
        int column = inside(b.column + i % 2, relief->columns), row = inside(b.row + i / 2, relief->rows);
        right[i] = texel(relief, column + 1, row) - texel(relief, column - 1, row);
        down[i] = texel(relief, column, row + 1) - texel(relief, column, row - 1);
    }
    return vec3_unit((struct vec3){-blend(&b, right) / (2 * relief->texel_x_mm),
                                   blend(&b, down) / (2 * relief->texel_y_mm), 1});
}

bool relief_shadow(const struct relief *relief, double u_mm, double v_mm, struct vec3 l) {
    double across = fmax(fabs(l.x) / relief->texel_x_mm, fabs(l.y) / relief->texel_y_mm);
    double start = height_at(relief, u_mm, v_mm), grain = relief->highest_mm / GRAIN;
    double width = relief->columns * relief->texel_x_mm, height = relief->rows * relief->texel_y_mm;
    if (l.z <= 0) {
        return true;
    }
    if (across == 0) {
        return false;
    }
    for (double t = STEP / across;; t += STEP / across) {
        double u = u_mm + t * l.x, v = v_mm - t * l.y, z = start + t * l.z;
        if (z > relief->highest_mm || u < 0 || v < 0 || u > width || v > height) {
            return false;
        }
        if (height_at(relief, u, v) > z + grain) {
            return true;
        }
    }
}
