/*
 * relief.h — the height of a painted surface over its plane: normals, and the shadow that it casts on itself.
 *
 * Codes 0..65535 of a grey picture are heights 0..scale_mm; texel centres stand at ((i + 0.5) / columns) of the
 * width. Between them heights and slopes are linear in each direction (the slopes of texels are central differences),
 * so that normals have no edges; outside, the border goes on. The relief is thought low: it turns the normal and
 * casts shadows, and is seen where its plane is.
 *
 * Units      u in 0..width_mm from the left, v in 0..height_mm from the top; normals and l have x to the right, y up.
 * Checked    tests/unit/test_relief.c
 */
#ifndef FIT_RENDER_RELIEF_H
#define FIT_RENDER_RELIEF_H

#include <stdbool.h>

#include "fit/render/raster.h"
#include "fit/render/vec3.h"

struct relief {
    int columns, rows;
    double texel_x_mm, texel_y_mm, highest_mm;
    float *height_mm;
};

int relief_make(struct relief *relief, const struct raster *raster, double width_mm, double height_mm,
                double scale_mm, struct err *e);
void relief_free(struct relief *relief);
struct vec3 relief_normal(const struct relief *relief, double u_mm, double v_mm);
/* Whether the way from there towards l runs through the relief, looked at every half texel. */
bool relief_shadow(const struct relief *relief, double u_mm, double v_mm, struct vec3 l);

#endif
