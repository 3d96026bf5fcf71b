#include "fit/render/verbs.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/render/image.h"
#include "fit/render/origin.h"
#include "fit/render/planes_file.h"
#include "fit/render/scene_keys.h"
#include "proto/number.h"

static const char help[] =
    "usage: goniorender recolour PLANES.exr -o FILE.png [--spd SPD]... [--session MATERIAL=FILE]...\n"
    "                            [--observer O] [--space S] [--adaptation A] [--exposure X] [--bits 8|16]\n"
    "Colours planes that `render --planes` wrote, without tracing a ray.\n"
    "  --spd SPD         the first light's spectrum, given again the second's, ...: A, D50, \"5003 K\", "
    "lamp.csv, ...\n"
    "  --session M=FILE  S(lambda) of the material M from this session; its roughness and gloss stay as "
    "rendered (not of several bounces)\n"
    "  --observer, --space, --adaptation, --exposure, --bits   as in a scene file\n"
    "exit status: 0 done, 1 the work failed, 2 bad usage or bad input\n";

struct recolour {
    const char *planes, *output;
    const char *spd[SCENE_LIGHTS];
    struct scene_session session[SCENE_PAINTS];
    int n_spds, n_sessions;
    int observer, space, adaptation, bits; /* -1: as rendered */
    double exposure;                       /* 0: as rendered */
};

static int take_choice(const char *text, const char *const *choices, const char *what, int *value,
                       struct err *e) {
    for (*value = 0; choices[*value]; ++*value) {
        if (strcmp(text, choices[*value]) == 0) {
            return 0;
        }
    }
    return err_set(e, ERR_USAGE, "there is no %s '%s'; see docs/scene-file.md", what, text);
}

static int take_exposure(const char *text, struct recolour *o, struct err *e) {
    return number_read_double(text, &o->exposure) && o->exposure > 0
               ? 0
               : err_set(e, ERR_USAGE, "--exposure is a number above 0, not '%s'", text);
}

static int take_option(int c, void *arg, struct err *e) {
    struct recolour *o = arg;
    static const char *const bits[] = {"8", "16", NULL};
    int status = 0, index;
    switch (c) {
    case 'o':
        o->output = optarg;
        return image_known(optarg, e);
    case 'l':
        return verb_spd(optarg, o->spd, &o->n_spds, e);
    case 's':
        return verb_session(optarg, o->session, &o->n_sessions, e);
    case 'b':
        status = take_choice(optarg, bits, "number of bits", &index, e);
        o->bits = index == 0 ? 8 : 16;
        return status;
    case 'v':
        return take_choice(optarg, scene_observers, "observer", &o->observer, e);
    case 'r':
        return take_choice(optarg, scene_spaces, "space", &o->space, e);
    case 'a':
        return take_choice(optarg, scene_adaptations, "adaptation", &o->adaptation, e);
    case 'x':
        return take_exposure(optarg, o, e);
    default:
        return 0;
    }
}

/* 1: help was asked for and printed. */
static int read_options(int argc, char **argv, struct recolour *o, struct err *e) {
    static const struct option known[] = {
        {"output", required_argument, NULL, 'o'},   {"spd", required_argument, NULL, 'l'},
        {"session", required_argument, NULL, 's'},  {"observer", required_argument, NULL, 'v'},
        {"space", required_argument, NULL, 'r'},    {"adaptation", required_argument, NULL, 'a'},
        {"exposure", required_argument, NULL, 'x'}, {"bits", required_argument, NULL, 'b'},
        {"help", no_argument, NULL, 'h'},           {NULL, 0, NULL, 0}};
    int status = verb_options(argc, argv, known, help, take_option, o, e);
    if (!status && (optind + 1 != argc || !o->output)) {
        return err_set(e, ERR_USAGE,
                       "one PLANES.exr and -o FILE.png are needed; see goniorender recolour --help");
    }
    o->planes = argv[optind];
    return status;
}

static int change_paints(const struct recolour *o, struct scene *scene, struct err *e) {
    int status = 0;
    for (int i = 0; i < o->n_sessions && !status; i++) {
        int p = 0;
        while (p < scene->n_paints && strcmp(scene->paint[p].name, o->session[i].material) != 0) {
            p++;
        }
        if (p == scene->n_paints) {
            return err_set(e, ERR_USAGE, "the planes show no material '%s'", o->session[i].material);
        }
        status = paint_from_session(&scene->paint[p], o->session[i].path, e);
    }
    return status;
}

/* The light between surfaces holds products of their S. */
static int may_change_paints(const struct recolour *o, const struct planes *planes, struct err *e) {
    return o->n_sessions > 0 && planes_have_indirect(planes)
               ? err_set(
                     e, ERR_USAGE,
                     "%s holds several bounces, in which another S(lambda) is another picture: render the "
                     "scene again with --session; --spd still only colours",
                     o->planes)
               : 0;
}

static void change_image(const struct recolour *o, struct scene_image *image) {
    image->observer = o->observer >= 0 ? o->observer : image->observer;
    image->space = o->space >= 0 ? o->space : image->space;
    image->adaptation = o->adaptation >= 0 ? o->adaptation : image->adaptation;
    image->bits = o->bits >= 0 ? o->bits : image->bits;
    image->exposure = o->exposure > 0 ? o->exposure : image->exposure;
}

static int write_recoloured(const struct recolour *o, const struct scene *scene, const struct planes *planes,
                            json_t *rendered, const char *line, struct err *e) {
    struct picture picture;
    int status = render_picture(scene, planes, false, &picture, e);
    if (status) {
        return status;
    }
    json_t *origin = origin_recoloured(scene, rendered, &picture, line);
    json_object_set_new(origin, "planes", json_string(o->planes));
    char *text = origin ? json_dumps(origin, JSON_COMPACT) : NULL;
    status =
        text ? image_write(o->output, &picture, text, e) : err_set(e, ERR_NOMEM, "no memory for the origin");
    if (!status) {
        printf("picture:  %s from %s, %d x %d pixels of %d bits; highest Y %.4g; %llu clipped, %llu out of "
               "gamut\n",
               o->output, o->planes, picture.width, picture.height, picture.bits,
               picture.max_y * scene->image.exposure, (unsigned long long)picture.clipped,
               (unsigned long long)picture.out_of_gamut);
    }
    json_decref(origin);
    free(text);
    picture_free(&picture);
    return status;
}

int verb_recolour(int argc, char **argv) {
    struct recolour o = {.observer = -1, .space = -1, .adaptation = -1, .bits = -1};
    struct scene *scene = NULL;
    struct planes planes = {0};
    json_t *rendered = NULL;
    struct err e = {0};
    struct err_list errors = {0};
    char *line = verb_line(argc, argv); /* before any word is cut */
    int status = read_options(argc, argv, &o, &e);
    if (status == 0) {
        status = verb_output(o.output, &e);
        status = status ? status : planes_load(o.planes, &scene, &planes, &rendered, &e);
        status = status ? status : verb_lights(scene, o.spd, o.n_spds, &errors, &e);
        status = status ? status : may_change_paints(&o, &planes, &e);
        status = status ? status : change_paints(&o, scene, &e);
        if (!status) {
            change_image(&o, &scene->image);
            status = line ? write_recoloured(&o, scene, &planes, rendered, line, &e)
                          : err_set(&e, ERR_NOMEM, "no memory");
        }
    } else if (status > 0) {
        free(line);
        return 0;
    }
    free(line);
    json_decref(rendered);
    planes_free(&planes);
    scene_free(scene);
    if (errors.n) {
        return verb_complain_all(&errors);
    }
    return status ? verb_complain("recolour", &e) : 0;
}
