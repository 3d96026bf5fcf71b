#include "fit/render/sheet.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/render/difference.h"
#include "fit/render/raster.h"

static void shine(struct scene *scene, const struct spd *light) {
    for (int j = 0; j < scene->n_spds; j++) {
        scene->spd[j] = *light;
    }
}

static int begin(struct sheet *s, const struct scene *scene, const struct planes *planes, int columns,
                 struct err *e) {
    s->columns = columns > 0 ? columns : (int)ceil(sqrt(s->n));
    s->columns = s->columns < s->n ? s->columns : s->n;
    s->rows = (s->n + s->columns - 1) / s->columns;
    int64_t width = (int64_t)s->columns * (planes->width + SHEET_GAP) - SHEET_GAP;
    int64_t height = (int64_t)s->rows * (planes->height + SHEET_GAP) - SHEET_GAP;
    if (width * height > RASTER_PIXELS_MAX) {
        return err_set(e, ERR_RANGE, "a sheet of %d x %d pictures has over %d pixels; render smaller ones",
                       s->columns, s->rows, RASTER_PIXELS_MAX);
    }
    s->picture = (struct picture){.width = (int)width,
                                  .height = (int)height,
                                  .bits = scene->image.bits,
                                  .space = (enum colour_space)scene->image.space,
                                  .rgb = calloc(3 * (size_t)(width * height), sizeof *s->picture.rgb)};
    return s->picture.rgb ? 0 : err_set(e, ERR_NOMEM, "no memory for the sheet");
}

static void paste(struct sheet *s, int index, const struct picture *tile) {
    size_t x = (size_t)(index % s->columns) * (size_t)(tile->width + SHEET_GAP);
    size_t y = (size_t)(index / s->columns) * (size_t)(tile->height + SHEET_GAP),
           row = 3 * (size_t)tile->width;
    for (size_t i = 0; i < (size_t)tile->height; i++) {
        memcpy(s->picture.rgb + 3 * ((y + i) * (size_t)s->picture.width + x), tile->rgb + i * row,
               row * sizeof *tile->rgb);
    }
    s->tile[index].clipped = tile->clipped;
    s->tile[index].out_of_gamut = tile->out_of_gamut;
    s->tile[index].max_y = tile->max_y;
    memcpy(s->tile[index].white, tile->white, sizeof tile->white);
    s->picture.clipped += tile->clipped;
    s->picture.out_of_gamut += tile->out_of_gamut;
    if (index == 0) {
        s->picture.max_y = tile->max_y;
        memcpy(s->picture.white, tile->white, sizeof tile->white);
    }
}

static int compare(struct sheet *s, int index, const struct scene *first, const struct scene *own,
                   const struct planes *planes, struct err *e) {
    const struct difference_side side[2] = {{first, planes}, {own, planes}};
    struct difference d;
    struct err unused = {0};
    int status = difference_make(side, &d, &unused);
    if (status == -ERR_STATE) { /* nothing is shown, so nothing differs */
        return 0;
    }
    if (status) {
        return err_set(e, (enum err_code) - status, "%s", unused.text);
    }
    s->tile[index].mean_de = d.mean;
    difference_free(&d);
    return 0;
}

int sheet_make(const struct scene *scene, const struct planes *planes, const struct spd *light, int n,
               int columns, struct sheet *sheet, struct err *e) {
    struct scene *lit = malloc(2 * sizeof *lit); /* the first light's and the present one's */
    *sheet = (struct sheet){.n = n};
    int status =
        lit ? begin(sheet, scene, planes, columns, e) : err_set(e, ERR_NOMEM, "no memory for the sheet");
    for (int i = 0; i < n && !status; i++) {
        struct picture tile;
        memcpy(&lit[1], scene, sizeof *lit);
        shine(&lit[1], &light[i]);
        if (i == 0) {
            memcpy(&lit[0], &lit[1], sizeof *lit);
        }
        status = render_picture(&lit[1], planes, false, &tile, e);
        if (!status) {
            paste(sheet, i, &tile);
            picture_free(&tile);
            status = compare(sheet, i, &lit[0], &lit[1], planes, e);
        }
    }
    free(lit);
    if (status) {
        sheet_free(sheet);
    }
    return status;
}

void sheet_free(struct sheet *sheet) {
    picture_free(&sheet->picture);
}
