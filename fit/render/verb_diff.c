#include "fit/render/verbs.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fit/render/difference.h"
#include "fit/render/image.h"
#include "fit/render/origin.h"
#include "proto/number.h"

static const char help[] =
    "usage: goniorender diff SCENE.yaml [OTHER.yaml] [-o FILE.png|FILE.tif] [--values V.exr] [--report "
    "R.json]\n"
    "                        [--session MATERIAL=FILE]... [--other-session MATERIAL=FILE]...\n"
    "                        [--spd SPD]... [--other-spd SPD]... [--top X] [--threads N]\n"
    "How different two renderings look, pixel by pixel: CIEDE2000, in units of about one just visible step.\n"
    "The second is OTHER.yaml, or SCENE.yaml once more with what --other-... changes in it.\n"
    "  -o FILE.png            the differences in colours from 0 to --top\n"
    "  --values V.exr         differences and both L*a*b* as numbers\n"
    "  --report R.json        what is printed, with the origin of both\n"
    "  --session M=FILE       this session for the material M in the first, --other-session in the second\n"
    "  --spd SPD              the spectrum of the first's first light, given again of its second, ...\n"
    "  --top X                the difference shown brightest; default: the next of 1, 2, 5 above the "
    "largest\n"
    "Both are seen under the white of the first, adapted as its scene says (adaptation: none leaves the "
    "second\n"
    "light's own colour in the comparison).\n"
    "exit status: 0 done, 1 the work failed or was interrupted, 2 bad usage or bad input\n";

struct half { /* the first or the second of what is compared */
    const char *file;
    struct scene_session session[SCENE_PAINTS];
    const char *spd[SCENE_LIGHTS];
    int n_sessions, n_spds;
    struct scene *scene;
    struct planes planes;
    struct render_report report;
};

struct comparison { /* one call of the command */
    struct half half[2];
    const char *output, *values, *report;
    double top;
    struct render_options render;
    bool same_planes; /* only the light's spectrum differs: traced once */
    char *line;
};

static int take_top(const char *text, double *top, struct err *e) {
    return number_read_double(text, top) && *top > 0
               ? 0
               : err_set(e, ERR_USAGE, "--top is a number above 0, not '%s'", text);
}

static int take_option(int c, void *arg, struct err *e) {
    struct comparison *o = arg;
    struct half *half = &o->half[c == 'S' || c == 'L'];
    switch (c) {
    case 'o':
        o->output = optarg;
        return image_known(optarg, e);
    case 'v':
        o->values = optarg;
        return 0;
    case 'r':
        o->report = optarg;
        return 0;
    case 's':
    case 'S':
        return verb_session(optarg, half->session, &half->n_sessions, e);
    case 'l':
    case 'L':
        return verb_spd(optarg, half->spd, &half->n_spds, e);
    case 'm':
        return take_top(optarg, &o->top, e);
    case 't':
        return verb_threads(optarg, &o->render.threads, e);
    default:
        return 0;
    }
}

/* 1: help was asked for and printed. */
static int read_options(int argc, char **argv, struct comparison *o, struct err *e) {
    static const struct option known[] = {{"output", required_argument, NULL, 'o'},
                                          {"values", required_argument, NULL, 'v'},
                                          {"report", required_argument, NULL, 'r'},
                                          {"session", required_argument, NULL, 's'},
                                          {"other-session", required_argument, NULL, 'S'},
                                          {"spd", required_argument, NULL, 'l'},
                                          {"other-spd", required_argument, NULL, 'L'},
                                          {"top", required_argument, NULL, 'm'},
                                          {"threads", required_argument, NULL, 't'},
                                          {"help", no_argument, NULL, 'h'},
                                          {NULL, 0, NULL, 0}};
    int status = verb_options(argc, argv, known, help, take_option, o, e);
    int files = argc - optind;
    if (!status && files != 1 && files != 2) {
        return err_set(e, ERR_USAGE, "one or two scenes are needed; see goniorender diff --help");
    }
    o->half[0].file = argv[optind];
    o->half[1].file = files == 2 ? argv[optind + 1] : argv[optind];
    o->same_planes = files == 1 && o->half[1].n_sessions == 0;
    return status;
}

/* Without sessions of its own the second has the first's, so that --other-... alone says what differs. */
static void inherit(struct comparison *o) {
    const struct half *first = &o->half[0];
    struct half *second = &o->half[1];
    for (int i = 0; i < first->n_sessions; i++) {
        bool changed = false;
        for (int j = 0; j < second->n_sessions; j++) {
            changed = changed || strcmp(first->session[i].material, second->session[j].material) == 0;
        }
        if (!changed && second->n_sessions < SCENE_PAINTS) {
            second->session[second->n_sessions++] = first->session[i];
        }
    }
    if (second->n_spds == 0) {
        memcpy(second->spd, first->spd, sizeof second->spd);
        second->n_spds = first->n_spds;
    }
}

static int check_outputs(const struct comparison *o, struct err *e) {
    int status = verb_output(o->output, e);
    status = status ? status : verb_output(o->values, e);
    return status ? status : verb_output(o->report, e);
}

static int read_half(struct half *h, struct err_list *errors, struct err *e) {
    h->scene = verb_scene(h->file, h->session, h->n_sessions, "single pictures are compared", errors, e);
    return h->scene ? verb_lights(h->scene, h->spd, h->n_spds, errors, e) : -ERR_INPUT;
}

static int render_half(struct comparison *o, int which, struct err *e) {
    struct half *h = &o->half[which];
    if (which == 1 && o->same_planes) {
        h->planes = o->half[0].planes; /* borrowed */
        h->report = o->half[0].report;
        return 0;
    }
    return render_whole(h->scene, &o->render, &h->planes, &h->report, e);
}

static json_t *half_json(const struct half *h, const char *line) {
    struct picture none = {.white = {0}};
    json_t *json = origin_make(h->scene, &h->report, &none, line);
    /* They belong to a picture, and none was made. */
    static const char *const keys[] = {"clipped", "out_of_gamut", "max_y", "white", "command"};
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++) {
        json_object_del(json, keys[i]);
    }
    return json;
}

static json_t *difference_json(const struct comparison *o, const struct difference *d) {
    const double *first = d->mean_lab[0], *second = d->mean_lab[1];
    return json_pack(
        "{s:s,s:s,s:s,s:I,s:[I,I],s:f,s:f,s:f,s:f,s:[i,i],s:[f,f,f],s:[f,f,f],s:[f,f,f],s:o,s:o}", "program",
        "goniorender " GONIOD_VERSION, "command", o->line, "formula", "CIEDE2000", "pixels", (json_int_t)d->n,
        "pixels_in_one_only", (json_int_t)d->only[0], (json_int_t)d->only[1], "mean", d->mean, "median",
        d->median, "p95", d->p95, "max", d->max, "max_at", d->max_x, d->max_y, "mean_lab_first", first[0],
        first[1], first[2], "mean_lab_second", second[0], second[1], second[2], "white", d->white[0],
        d->white[1], d->white[2], "first", half_json(&o->half[0], o->line), "second",
        half_json(&o->half[1], o->line));
}

static void print_difference(const struct comparison *o, const struct difference *d) {
    const struct scene *scene = o->half[0].scene;
    printf("compared: %llu pixels; %llu only in the first, %llu only in the second\n",
           (unsigned long long)d->n, (unsigned long long)d->only[0], (unsigned long long)d->only[1]);
    printf("CIEDE2000: mean %.3g, median %.3g, 95 %% at most %.3g, largest %.3g at pixel %d, %d\n", d->mean,
           d->median, d->p95, d->max, d->max_x, d->max_y);
    for (int i = 0; i < 2; i++) {
        printf("mean L*a*b* of the %s: %.2f %.2f %.2f\n", i ? "second" : "first", d->mean_lab[i][0],
               d->mean_lab[i][1], d->mean_lab[i][2]);
    }
    printf("seen under the white X %.4f Y %.4f Z %.4f, adaptation %s, %s\n", d->white[0], d->white[1],
           d->white[2], colour_adaptation_name((enum colour_adaptation)scene->image.adaptation),
           colour_observer_name((enum colour_observer)scene->image.observer));
}

static int write_picture(const struct comparison *o, const struct difference *d, const char *origin,
                         struct err *e) {
    struct picture picture;
    double top = o->top > 0 ? o->top : difference_top(d);
    int status = difference_picture(d, top, &picture, e);
    if (!status) {
        status = image_write(o->output, &picture, origin, e);
        printf("picture:  %s, CIEDE2000 from 0 to %g; %llu pixels above\n", o->output, top,
               (unsigned long long)picture.clipped);
        picture_free(&picture);
    }
    return status;
}

static int write_all(const struct comparison *o, const struct difference *d, struct err *e) {
    json_t *json = difference_json(o, d);
    char *origin = json ? json_dumps(json, JSON_COMPACT) : NULL;
    int status = origin ? 0 : err_set(e, ERR_NOMEM, "no memory for the report");
    if (!status && o->output) {
        status = write_picture(o, d, origin, e);
    }
    if (!status && o->values) {
        status = difference_values(o->values, d, origin, e);
    }
    if (!status && o->report) {
        status = verb_report(o->report, json, e);
    }
    free(origin);
    json_decref(json);
    return status;
}

static int compare(struct comparison *o, struct err *e) {
    struct difference difference;
    int status = render_half(o, 0, e);
    if (status) {
        return status;
    }
    status = render_half(o, 1, e);
    if (!status) {
        const struct difference_side side[2] = {{o->half[0].scene, &o->half[0].planes},
                                                {o->half[1].scene, &o->half[1].planes}};
        status = difference_make(side, &difference, e);
        if (!status) {
            print_difference(o, &difference);
            status = write_all(o, &difference, e);
            difference_free(&difference);
        }
        if (!o->same_planes) {
            planes_free(&o->half[1].planes);
        }
    }
    planes_free(&o->half[0].planes);
    return status;
}

int verb_diff(int argc, char **argv) {
    struct comparison *o = calloc(1, sizeof *o);
    struct err e = {0};
    struct err_list errors = {0};
    int status = o ? 0 : err_set(&e, ERR_NOMEM, "no memory for the command");
    if (status) {
        return verb_complain("diff", &e);
    }
    o->line = verb_line(argc, argv); /* before any word is cut */
    status = read_options(argc, argv, o, &e);
    if (status == 0) {
        inherit(o);
        status = check_outputs(o, &e);
        status = status ? status : read_half(&o->half[0], &errors, &e);
        status = status ? status : read_half(&o->half[1], &errors, &e);
        o->render.cancel = verb_cancel();
        o->render.progress = isatty(STDERR_FILENO);
        status = status ? status : compare(o, &e);
    }
    for (int i = 0; i < 2; i++) {
        scene_free(o->half[i].scene);
    }
    free(o->line);
    free(o);
    if (errors.n > 0) {
        return verb_complain_all(&errors);
    }
    return status < 0 ? verb_complain("diff", &e) : 0;
}
