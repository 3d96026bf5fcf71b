/*
 * sheet.h — one rendering under many lights, side by side in one picture: a contact sheet, without a ray traced again.
 *
 * Tiles stand in the order of the lights, by rows from the top left, with SHEET_GAP black pixels between them. In each
 * tile every light of the scene has that tile's spectrum; directions and shares stay. Each is exposed and adapted as
 * the scene says, from its own white.
 * Errors     those of render_picture; -ERR_RANGE a sheet of over RASTER_PIXELS_MAX pixels.
 * Checked    tests/unit/test_sheet.c
 */
#ifndef FIT_RENDER_SHEET_H
#define FIT_RENDER_SHEET_H

#include "fit/render/render.h"

#define SHEET_LIGHTS 64
#define SHEET_GAP 4 /* pixels */

struct sheet {
    int columns, rows, n;
    struct picture picture; /* clipped, out_of_gamut: of all tiles; white, max_y: of the first */
    struct {
        uint64_t clipped, out_of_gamut;
        double max_y, white[3];
        double mean_de; /* CIEDE2000 to the first tile, as difference.h has it; 0 where nothing is shown */
    } tile[SHEET_LIGHTS];
};

/* columns 0: the sheet as near to a square as it gets. */
int sheet_make(const struct scene *scene, const struct planes *planes, const struct spd *light, int n,
               int columns, struct sheet *sheet, struct err *e);
void sheet_free(struct sheet *sheet);

#endif
