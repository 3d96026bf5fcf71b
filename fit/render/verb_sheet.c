#include "fit/render/verbs.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fit/render/cie.h"
#include "fit/render/image.h"
#include "fit/render/origin.h"
#include "fit/render/planes_file.h"
#include "fit/render/sheet.h"
#include "proto/number.h"

static const char help[] =
    "usage: goniorender sheet SCENE.yaml|PLANES.exr -o FILE.png|FILE.tif [--spd SPD]... [--columns N]\n"
    "                         [--session MATERIAL=FILE]... [--report R.json] [--threads N]\n"
    "One picture under many lights side by side, from one rendering; each with how far its colours are from "
    "those\n"
    "under the first light (CIEDE2000).\n"
    "  --spd SPD         a tile under this light, in the order given: A, D50, D65, F2, F7, F11, \"5003 K\",\n"
    "                    lamp.csv; default: the six of the CIE\n"
    "  --columns N       tiles in a row; default: as near to a square as it gets\n"
    "  --session M=FILE  with a scene: this session for the material M\n"
    "  PLANES.exr        of goniorender render --planes: nothing is traced\n"
    "exit status: 0 done, 1 the work failed or was interrupted, 2 bad usage or bad input\n";

struct contact { /* one call of the command */
    const char *input, *output, *report;
    const char *name[SHEET_LIGHTS];
    int n_names, columns;
    struct scene_session session[SCENE_PAINTS];
    int n_sessions;
    struct render_options render;
    struct spd light[SHEET_LIGHTS];
    struct scene *scene;
    struct planes planes;
    struct render_report traced;
    json_t *rendered; /* the origin of planes from a file; NULL: traced here */
    char *line;
};

static int take_columns(const char *text, int *columns, struct err *e) {
    int64_t n;
    if (!number_read_int(text, &n) || n < 1 || n > SHEET_LIGHTS) {
        return err_set(e, ERR_USAGE, "--columns is 1 to %d, not '%s'", SHEET_LIGHTS, text);
    }
    *columns = (int)n;
    return 0;
}

static int take_option(int c, void *arg, struct err *e) {
    struct contact *o = arg;
    switch (c) {
    case 'o':
        o->output = optarg;
        return image_known(optarg, e);
    case 'l':
        if (o->n_names == SHEET_LIGHTS) {
            return err_set(e, ERR_USAGE, "--spd is given more than %d times", SHEET_LIGHTS);
        }
        o->name[o->n_names++] = optarg;
        return 0;
    case 'c':
        return take_columns(optarg, &o->columns, e);
    case 's':
        return verb_session(optarg, o->session, &o->n_sessions, e);
    case 'r':
        o->report = optarg;
        return 0;
    case 't':
        return verb_threads(optarg, &o->render.threads, e);
    default:
        return 0;
    }
}

/* 1: help was asked for and printed. */
static int read_options(int argc, char **argv, struct contact *o, struct err *e) {
    static const struct option known[] = {
        {"output", required_argument, NULL, 'o'},  {"spd", required_argument, NULL, 'l'},
        {"columns", required_argument, NULL, 'c'}, {"session", required_argument, NULL, 's'},
        {"report", required_argument, NULL, 'r'},  {"threads", required_argument, NULL, 't'},
        {"help", no_argument, NULL, 'h'},          {NULL, 0, NULL, 0}};
    int status = verb_options(argc, argv, known, help, take_option, o, e);
    if (!status && (optind + 1 != argc || !o->output)) {
        return err_set(e, ERR_USAGE,
                       "one scene or file of planes and -o FILE.png are needed; see goniorender "
                       "sheet --help");
    }
    o->input = argv[optind];
    return status;
}

static int find_lights(struct contact *o, struct err_list *errors, struct err *e) {
    int status = 0;
    if (o->n_names == 0) {
        for (; o->n_names < CIE_ILLUMINANTS; o->n_names++) {
            o->name[o->n_names] = cie_illuminant[o->n_names].name;
        }
    }
    for (int i = 0; i < o->n_names && !status; i++) {
        status = spd_find(&o->light[i], o->name[i], ".", errors, e);
    }
    return status;
}

static int trace_scene(struct contact *o, struct err_list *errors, struct err *e) {
    o->scene = verb_scene(o->input, o->session, o->n_sessions, "a sheet shows one", errors, e);
    return o->scene ? render_whole(o->scene, &o->render, &o->planes, &o->traced, e) : -ERR_INPUT;
}

static int find_planes(struct contact *o, struct err_list *errors, struct err *e) {
    const char *dot = strrchr(o->input, '.');
    if (!dot || strcmp(dot, ".exr") != 0) {
        return trace_scene(o, errors, e);
    }
    if (o->n_sessions > 0) {
        return err_set(e, ERR_USAGE, "--session goes with a scene; for planes see goniorender recolour");
    }
    return planes_load(o->input, &o->scene, &o->planes, &o->rendered, e);
}

static json_t *sheet_json(const struct contact *o, const struct sheet *s) {
    json_t *json = o->rendered ? json_pack("{s:s,s:s,s:O}", "program", "goniorender " GONIOD_VERSION,
                                           "command", o->line, "rendered", o->rendered)
                               : origin_make(o->scene, &o->traced, &s->picture, o->line);
    json_t *tiles = json_array();
    for (int i = 0; i < s->n; i++) {
        json_t *tile =
            json_pack("{s:s,s:f,s:[f,f,f],s:f,s:I,s:I}", "spd", o->name[i], "mean_ciede2000_to_first",
                      s->tile[i].mean_de, "white", s->tile[i].white[0], s->tile[i].white[1],
                      s->tile[i].white[2], "max_y", s->tile[i].max_y, "clipped",
                      (json_int_t)s->tile[i].clipped, "out_of_gamut", (json_int_t)s->tile[i].out_of_gamut);
        if (o->light[i].sha256[0]) {
            json_object_set_new(tile, "spd_sha256", json_string(o->light[i].sha256));
        }
        json_array_append_new(tiles, tile);
    }
    json_object_set_new(json, "sheet",
                        json_pack("{s:i,s:i,s:o}", "columns", s->columns, "rows", s->rows, "tiles", tiles));
    return json;
}

static int write_sheet(const struct contact *o, const struct sheet *s, struct err *e) {
    json_t *json = sheet_json(o, s);
    char *origin = json ? json_dumps(json, JSON_COMPACT) : NULL;
    int status = origin ? image_write(o->output, &s->picture, origin, e)
                        : err_set(e, ERR_NOMEM, "no memory for the origin");
    if (!status && o->report) {
        status = verb_report(o->report, json, e);
    }
    if (!status) {
        printf("sheet:    %s, %d columns, %d rows\n", o->output, s->columns, s->rows);
    }
    for (int i = 0; i < s->n && !status; i++) {
        printf("row %d, column %d: %s; CIEDE2000 to %s %.3g on average; %llu pixels clipped, %llu out of "
               "gamut\n",
               i / s->columns + 1, i % s->columns + 1, o->name[i], o->name[0], s->tile[i].mean_de,
               (unsigned long long)s->tile[i].clipped, (unsigned long long)s->tile[i].out_of_gamut);
    }
    free(origin);
    json_decref(json);
    return status;
}

int verb_sheet(int argc, char **argv) {
    struct contact *o = calloc(1, sizeof *o);
    struct sheet sheet;
    struct err e = {0};
    struct err_list errors = {0};
    if (!o) {
        err_set(&e, ERR_NOMEM, "no memory for the command");
        return verb_complain("sheet", &e);
    }
    o->line = verb_line(argc, argv); /* before any word is cut */
    int status = read_options(argc, argv, o, &e);
    if (status == 0) {
        o->render.cancel = verb_cancel();
        o->render.progress = isatty(STDERR_FILENO);
        status = verb_output(o->output, &e);
        status = status ? status : verb_output(o->report, &e);
        status = status ? status : find_lights(o, &errors, &e);
        status = status ? status : find_planes(o, &errors, &e);
        status =
            status ? status : sheet_make(o->scene, &o->planes, o->light, o->n_names, o->columns, &sheet, &e);
        if (!status) {
            status = write_sheet(o, &sheet, &e);
            sheet_free(&sheet);
        }
    }
    planes_free(&o->planes);
    scene_free(o->scene);
    json_decref(o->rendered);
    free(o->line);
    free(o);
    if (errors.n > 0) {
        return verb_complain_all(&errors);
    }
    return status < 0 ? verb_complain("sheet", &e) : 0;
}
