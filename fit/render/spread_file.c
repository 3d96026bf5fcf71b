#include <string.h>

#include "fit/render/exr.h"
#include "fit/render/spread.h"

static void fill_row(void *arg, int y, float *const *row) {
    const struct spread *s = arg;
    for (int k = 0; k < SPREAD_PLANES; k++) {
        memcpy(row[k], s->plane[k] + (size_t)y * (size_t)s->width, (size_t)s->width * sizeof **row);
    }
}

int spread_save(const char *path, const struct spread *spread, const char *origin_json, struct err *e) {
    static const char channel[SPREAD_PLANES][EXR_NAME_MAX] = {
        "X",         "Y",         "Z",         "covXYZ.XX", "covXYZ.XY",   "covXYZ.XZ", "covXYZ.YY",
        "covXYZ.YZ", "covXYZ.ZZ", "Lab.L",     "Lab.a",     "Lab.b",       "covLab.LL", "covLab.La",
        "covLab.Lb", "covLab.aa", "covLab.ab", "covLab.bb", "dE00.median", "dE00.p95",  "dE00.sampling",
        "noise.varY"};
    const struct exr_text text = {"goniod", origin_json};
    struct exr_form form = {.width = spread->width,
                            .height = spread->height,
                            .n_channels = SPREAD_PLANES,
                            .n_texts = 1,
                            .channel = channel,
                            .text = &text,
                            .fill = fill_row,
                            .arg = (void *)spread};
    return exr_save(path, &form, e);
}
