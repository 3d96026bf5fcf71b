#include "fit/render/trace.h"

#include <math.h>
#include <float.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "fit/render/crew.h"

struct drawn { /* of one pixel: the mean and the largest Y of what was drawn */
    double mean, brightest;
};

struct tile {
    struct render_counts counts;
    struct planes_extra *extra;
    size_t n_extra, capacity;
};

struct work { /* one picture, shared by all threads */
    const struct trace *trace;
    trace_integrator *integrator;
    struct planes *planes;
    struct tile *tile;
    int n_tiles;
    atomic_bool out_of_memory;
};

struct pixel { /* sums over its samples, one entry for each paint it shows */
    int n;
    double y[TRACE_GROUPS], brightest; /* of all paints */
    struct trace_sample sum[SCENE_PAINTS];
    double indirect[PLANES_SETS][BANDS]; /* of all paints */
};

void trace_count(const struct trace *t, int repeat, double y, struct trace_sample *sample,
                 struct render_counts *counts) {
    sample->y[repeat % TRACE_GROUPS] += y * TRACE_GROUPS / t->repeats;
    counts->drawn++;
    sample->brightest = y > sample->brightest ? y : sample->brightest;
}

static void add_sample(struct pixel *pixel, const struct trace_sample *sample, int sets) {
    int i = 0;
    while (i < pixel->n && pixel->sum[i].paint != sample->paint) {
        i++;
    }
    if (i == pixel->n) {
        pixel->sum[pixel->n].paint = sample->paint;
        memset(pixel->sum[pixel->n].set, 0, (size_t)sets * sizeof sample->set[0]);
        pixel->n++;
    }
    for (int j = 0; j < sets; j++) {
        pixel->sum[i].set[j].a += sample->set[j].a;
        pixel->sum[i].set[j].b += sample->set[j].b;
        pixel->sum[i].set[j].c += sample->set[j].c;
    }
}

static struct shade_abc mean_of(const struct shade_abc *sum, double part) {
    return (struct shade_abc){sum->a * part, sum->b * part, sum->c * part};
}

static void add_drawn(struct pixel *pixel, const struct trace_sample *sample) {
    pixel->brightest = sample->brightest > pixel->brightest ? sample->brightest : pixel->brightest;
    for (int g = 0; g < TRACE_GROUPS; g++) {
        pixel->y[g] += sample->y[g];
    }
}

static bool keep_extra(struct tile *tile, const struct planes_extra *extra) {
    if (tile->n_extra == tile->capacity) {
        size_t capacity = tile->capacity ? 2 * tile->capacity : 64;
        struct planes_extra *grown = realloc(tile->extra, capacity * sizeof *grown);
        if (!grown) {
            return false;
        }
        tile->extra = grown;
        tile->capacity = capacity;
    }
    tile->extra[tile->n_extra++] = *extra;
    return true;
}

static void store_indirect(struct planes *p, size_t at, const struct pixel *pixel, double part) {
    for (int j = 0; j < p->n_sets && p->set[j].indirect; j++) {
        for (int k = 0; k < BANDS; k++) {
            double mean = part * pixel->indirect[j][k];
            /* Unscaled bounces (energy.h) may grow beyond any number. */
            p->set[j].indirect[at * BANDS + (size_t)k] = mean < FLT_MAX ? (float)mean : FLT_MAX;
        }
    }
}

static double mean_y(const struct pixel *pixel, double part) {
    double mean = 0;
    for (int g = 0; g < TRACE_GROUPS; g++) {
        mean += pixel->y[g] * part / TRACE_GROUPS;
    }
    return mean;
}

/* Of the mean of the groups: their scatter around it, over how many they are. */
static double noise_of(const struct pixel *pixel, double part) {
    double mean = mean_y(pixel, part), sum = 0;
    for (int g = 0; g < TRACE_GROUPS; g++) {
        double apart = pixel->y[g] * part - mean;
        sum += apart * apart;
    }
    return sum / (TRACE_GROUPS * (TRACE_GROUPS - 1));
}

static bool store_pixel(struct work *w, struct tile *tile, size_t at, const struct pixel *pixel,
                        double part) {
    struct planes *p = w->planes;
    bool kept = true;
    store_indirect(p, at, pixel, part);
    if (pixel->n > 0) {
        p->paint[at] = (int16_t)pixel->sum[0].paint;
        if (p->noise) {
            p->noise[at] = noise_of(pixel, part);
        }
        for (int j = 0; j < p->n_sets; j++) {
            struct shade_abc mean = mean_of(&pixel->sum[0].set[j], part);
            p->set[j].a[at] = mean.a;
            if (p->set[j].b) {
                p->set[j].b[at] = mean.b;
            }
            if (p->set[j].c) {
                p->set[j].c[at] = mean.c;
            }
        }
    }
    for (int i = 1; i < pixel->n && kept; i++) {
        for (int j = 0; j < p->n_sets && kept; j++) {
            struct planes_extra extra = {(uint32_t)at, (int16_t)pixel->sum[i].paint, (int16_t)j,
                                         mean_of(&pixel->sum[i].set[j], part)};
            kept = keep_extra(tile, &extra);
        }
    }
    return kept;
}

static void trace_pixel(const struct work *w, int x, int y, struct pixel *pixel,
                        struct render_counts *counts) {
    const struct scene *scene = w->trace->scene;
    int grid = scene->image.grid;
    bool drawn = w->trace->repeats > 0;
    struct trace_sample sample; /* large: only what is read is set */
    sample.pixel = (uint32_t)(y * w->planes->width + x);
    sample.indirect = pixel->indirect;
    pixel->n = 0;
    if (planes_have_indirect(w->planes)) {
        memset(pixel->indirect, 0, (size_t)w->planes->n_sets * sizeof *pixel->indirect);
    }
    if (drawn) {
        pixel->brightest = 0;
        memset(pixel->y, 0, sizeof pixel->y);
    }
    for (int j = 0; j < grid; j++) {
        for (int i = 0; i < grid; i++) {
            struct ray ray = camera_ray(&scene->camera, x + (i + 0.5) / grid, y + (j + 0.5) / grid);
            sample.index = j * grid + i;
            w->integrator(w->trace, &ray, &sample, counts);
            if (sample.paint >= 0) {
                add_sample(pixel, &sample, w->planes->n_sets);
                if (drawn) {
                    add_drawn(pixel, &sample);
                }
            }
        }
    }
}

/* A sample far above its surroundings is a pixel that many more samples would show otherwise. The surroundings are a
 * square of pixels, so that a highlight of one pixel is none; nor is what is dimmer than the perfect diffuser, which
 * enters a deep shadow by a gap. */
static uint64_t count_fireflies(const struct drawn *drawn, int width, int rows) {
    uint64_t n = 0;
    for (int left = 0; left < width; left += TRACE_TILE_ROWS) {
        int right = left + TRACE_TILE_ROWS < width ? left + TRACE_TILE_ROWS : width;
        double sum = 0;
        for (int i = 0; i < rows * (right - left); i++) {
            sum += drawn[i / (right - left) * width + left + i % (right - left)].mean;
        }
        double limit = fmax(RENDER_FIREFLY * sum / (rows * (right - left)), 1);
        for (int i = 0; i < rows * (right - left); i++) {
            n += drawn[i / (right - left) * width + left + i % (right - left)].brightest > limit;
        }
    }
    return n;
}

/* drawn: [TRACE_TILE_ROWS * width]; NULL: nothing is. */
static bool trace_rows(struct work *w, struct tile *tile, struct drawn *drawn, int first, int last) {
    int width = w->planes->width;
    double part = 1.0 / (w->trace->scene->image.grid * w->trace->scene->image.grid);
    struct render_counts counts = {
        0}; /* of its own: tiles lie side by side in cache lines of several threads */
    struct pixel pixel;
    for (int y = first; y < last; y++) {
        for (int x = 0; x < width; x++) {
            trace_pixel(w, x, y, &pixel, &counts);
            if (!store_pixel(w, tile, (size_t)y * (size_t)width + (size_t)x, &pixel, part)) {
                return false;
            }
            if (drawn) {
                drawn[(y - first) * width + x] = (struct drawn){mean_y(&pixel, part), pixel.brightest};
            }
        }
    }
    tile->counts = counts;
    return true;
}

static void trace_tile(void *work, int index) {
    struct work *w = work;
    struct tile *tile = &w->tile[index];
    int first = index * TRACE_TILE_ROWS, last = first + TRACE_TILE_ROWS, width = w->planes->width;
    bool random = w->trace->repeats > 0;
    last = last < w->planes->height ? last : w->planes->height;
    struct drawn *drawn = random ? malloc(TRACE_TILE_ROWS * (size_t)width * sizeof *drawn) : NULL;
    if ((random && !drawn) || !trace_rows(w, tile, drawn, first, last)) {
        atomic_store(&w->out_of_memory, true);
    } else {
        tile->counts.rows_done = last - first;
        tile->counts.fireflies = random ? count_fireflies(drawn, width, last - first) : 0;
    }
    free(drawn);
}

/* In the order of tiles, whoever did them. */
static int gather(struct work *w, struct render_counts *counts, struct err *e) {
    int status = 0;
    *counts = (struct render_counts){0};
    for (int i = 0; i < w->n_tiles; i++) {
        const struct tile *tile = &w->tile[i];
        counts->camera_rays += tile->counts.camera_rays;
        counts->hits += tile->counts.hits;
        counts->shadow_rays += tile->counts.shadow_rays;
        counts->negative_diffuse += tile->counts.negative_diffuse;
        counts->indirect_rays += tile->counts.indirect_rays;
        counts->indirect_hits += tile->counts.indirect_hits;
        counts->drawn += tile->counts.drawn;
        counts->fireflies += tile->counts.fireflies;
        counts->rows_done += tile->counts.rows_done;
        status = status ? status : planes_add_extra(w->planes, tile->extra, tile->n_extra, e);
        free(tile->extra);
    }
    if (!status && atomic_load(&w->out_of_memory)) {
        status = err_set(e, ERR_NOMEM, "no memory for pixels that show several paints");
    }
    return status;
}

int trace_run(const struct trace *trace, trace_integrator *integrator, const struct render_options *options,
              struct planes *planes, struct render_counts *counts, struct err *e) {
    struct work w = {.trace = trace, .integrator = integrator, .planes = planes};
    w.n_tiles = (planes->height + TRACE_TILE_ROWS - 1) / TRACE_TILE_ROWS;
    w.tile = calloc((size_t)w.n_tiles, sizeof *w.tile);
    if (!w.tile) {
        return err_set(e, ERR_NOMEM, "no memory for %d tiles", w.n_tiles);
    }
    crew_run(w.n_tiles, options, trace_tile, &w);
    int status = gather(&w, counts, e);
    free(w.tile);
    return status;
}
