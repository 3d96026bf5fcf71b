#include "fit/render/verbs.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fit/render/albedo.h"
#include "fit/render/energy.h"
#include "fit/render/image.h"
#include "fit/render/mesh.h"
#include "fit/render/origin.h"
#include "fit/render/planes_file.h"
#include "fit/render/scene_keys.h"
#include "fit/render/spectral.h"
#include "fit/stopwatch.h"

static const char help[] =
    "usage: goniorender render SCENE.yaml -o FILE.png|FILE.tif [--report R.json] [--all-features]\n"
    "                          [--session MATERIAL=FILE]... [--planes P.exr] [--spectral S.exr]\n"
    "                          [--uncertainty U.exr] [--energy scale|report] [--threads N]\n"
    "Renders a scene of painted shapes by wavelengths, 380-780 nm every 5 nm.\n"
    "  -o FILE.png       the picture; a series of light angles becomes FILE-001.png, FILE-002.png, ...\n"
    "  --planes P.exr    a, b, c of each pixel, for goniorender recolour (not of a series)\n"
    "  --spectral S.exr  the radiance of each pixel in 81 bands, with R, G, B beside (Fichet et al. 2021)\n"
    "  --uncertainty U.exr\n"
    "                    covariance of XYZ and L*a*b* by pixel and CIEDE2000 of drawn paints, from the "
    "joint\n"
    "                    fits of the sessions; the error of the picture's own sampling (not of a series). Of "
    "several\n"
    "                    bounces it takes 2 renderings for each paint and each of its parameters\n"
    "  --session M=FILE  this session for the material M, whatever the scene names\n"
    "  --report R.json   what the picture carries as its origin, and the seconds it took\n"
    "  --energy E        a paint that returns more light than it receives: `scale` it down beyond the first\n"
    "                    bounce, or only `report` it; default: as the scene says\n"
    "  --all-features    leaves nothing out that the scene does not need\n"
    "  --threads N       default: one for each processor; the picture is the same for any number\n"
    "exit status: 0 done, 1 the work failed or was interrupted, 2 bad usage or bad input\n";

struct options {
    const char *scene, *output, *report, *planes, *spectral, *uncertainty;
    struct render_options render;
    struct scene_session session[SCENE_PAINTS];
    int n_sessions, energy; /* -1: as the scene says */
};

static int take_energy(const char *text, int *energy, struct err *e) {
    for (*energy = 0; scene_energies[*energy]; ++*energy) {
        if (strcmp(text, scene_energies[*energy]) == 0) {
            return 0;
        }
    }
    return err_set(e, ERR_USAGE, "--energy is scale or report, not '%s'", text);
}

static int take_option(int c, void *arg, struct err *e) {
    struct options *o = arg;
    switch (c) {
    case 'o':
        o->output = optarg;
        return image_known(optarg, e);
    case 'r':
        o->report = optarg;
        return 0;
    case 'a':
        o->render.all_features = true;
        return 0;
    case 'p':
        o->planes = optarg;
        return 0;
    case 'S':
        o->spectral = optarg;
        return 0;
    case 'u':
        o->uncertainty = optarg;
        return 0;
    case 'E':
        return take_energy(optarg, &o->energy, e);
    case 's':
        return verb_session(optarg, o->session, &o->n_sessions, e);
    case 't':
        return verb_threads(optarg, &o->render.threads, e);
    default:
        return 0;
    }
}

/* 1: help was asked for and printed. */
static int read_options(int argc, char **argv, struct options *o, struct err *e) {
    static const struct option known[] = {{"output", required_argument, NULL, 'o'},
                                          {"report", required_argument, NULL, 'r'},
                                          {"all-features", no_argument, NULL, 'a'},
                                          {"threads", required_argument, NULL, 't'},
                                          {"session", required_argument, NULL, 's'},
                                          {"planes", required_argument, NULL, 'p'},
                                          {"spectral", required_argument, NULL, 'S'},
                                          {"uncertainty", required_argument, NULL, 'u'},
                                          {"energy", required_argument, NULL, 'E'},
                                          {"help", no_argument, NULL, 'h'},
                                          {NULL, 0, NULL, 0}};
    int status = verb_options(argc, argv, known, help, take_option, o, e);
    if (!status && (optind + 1 != argc || !o->output)) {
        return err_set(e, ERR_USAGE,
                       "one SCENE.yaml and -o FILE.png are needed; see goniorender render --help");
    }
    o->scene = argv[optind];
    return status;
}

static void print_materials(const struct scene *scene) {
    for (int i = 0; i < scene->n_paints; i++) {
        const struct paint *p = &scene->paint[i];
        double share = origin_held_share(scene, p);
        int held = 0;
        for (int k = 0; k < BANDS; k++) {
            held += p->held[k];
        }
        printf("material: %s from %s, %s; %d of %d bands not measured but held, %.2g %% of its X, Y or Z\n",
               p->name, p->source, p->estimate.model, held, BANDS, 100 * share);
        double highest, above_deg = albedo_above_one_deg(p, &highest);
        printf("energy:   %s returns at most %.3g of the light", p->name, highest);
        if (above_deg >= 0) {
            bool scaled = scene->image.bounces > 1 && scene->image.energy == ENERGY_SCALE;
            printf(": more than it receives from %g deg on, rendered as fitted%s", above_deg,
                   scaled ? ", beyond the first bounce scaled to what it receives" : "");
        }
        putchar('\n');
        if (share > PAINT_HELD_WARNING) {
            fprintf(stderr,
                    "warning: material %s: %.2g %% of its X, Y or Z rests on bands that were not measured\n",
                    p->name, 100 * share);
        }
    }
}

static void print_meshes(const struct scene *scene) {
    for (int i = 0; i < scene->n_shapes; i++) {
        const struct mesh *m = shape_mesh(&scene->shape[i]);
        if (m) {
            struct vec3 size = vec3_sub(m->high, m->low);
            printf("mesh:     %s, %zu triangles%s, %.4g x %.4g x %.4g mm", scene->shape[i].mesh.file,
                   m->n_triangles, m->n_normals ? "" : " without normals", size.x, size.y, size.z);
            printf("; %zu of no area left out, %zu turned to their normals\n", m->no_area, m->turned);
        }
    }
}

static void warn_of_lights(const struct scene *scene) {
    for (int j = 0; j < scene->n_spds; j++) {
        if (scene->spd[j].n_missing > 0) {
            fprintf(stderr,
                    "warning: light %s: its file does not cover %d of %d bands; it has no power there\n",
                    scene->spd[j].name, scene->spd[j].n_missing, BANDS);
        }
    }
}

static void print_picture(const struct scene *scene, const struct picture *p, const struct render_report *r) {
    printf("exposure: Y = %g of the perfect diffuser at normal incidence; highest Y %.4g\n",
           scene->image.exposure, p->max_y * scene->image.exposure);
    printf("colours:  %s, %s, adaptation %s; %llu pixels clipped, %llu out of gamut\n",
           colour_observer_name((enum colour_observer)scene->image.observer), colour_space_name(p->space),
           colour_adaptation_name((enum colour_adaptation)scene->image.adaptation),
           (unsigned long long)p->clipped, (unsigned long long)p->out_of_gamut);
    if (r->counts.indirect_rays) {
        printf("paths:    %llu rays beyond the first bounce, %llu of them to another surface\n",
               (unsigned long long)r->counts.indirect_rays, (unsigned long long)r->counts.indirect_hits);
    }
    if (r->samples) {
        printf("noise:    %d random samples a pixel; Y +- %.2g (root mean square); %llu pixels with a sample "
               "over "
               "%d times the mean around\n",
               r->samples, r->noise_y, (unsigned long long)r->counts.fireflies, RENDER_FIREFLY);
    }
    if (r->counts.negative_diffuse) {
        printf("negative diffuse terms, set to 0: %llu of %llu\n",
               (unsigned long long)r->counts.negative_diffuse,
               (unsigned long long)(r->counts.hits + r->counts.indirect_hits + r->counts.drawn));
    }
}

struct job { /* one call of the command */
    struct options options;
    struct scene *scene;
    char *line;
    double parse_s;
    json_t *reports;
};

static json_t *times_json(const struct job *job, const struct render_report *report, double colour_s,
                          double write_s) {
    printf("time:     scene %.3f s, trace %.3f s with %d threads, colour %.3f s, file %.3f s\n", job->parse_s,
           report->trace_s, report->threads, colour_s, write_s);
    return json_pack("{s:f,s:f,s:f,s:f,s:f}", "parse", job->parse_s, "trace", report->trace_s, "trace_cpu",
                     report->trace_cpu_s, "colour", colour_s, "write", write_s);
}

static int write_picture(const struct job *job, const char *path, const struct render_report *report,
                         const struct planes *planes, const struct picture *picture, double colour_s,
                         struct err *e) {
    double started = stopwatch_s();
    json_t *origin = origin_make(job->scene, report, picture, job->line);
    char *text = origin ? json_dumps(origin, JSON_COMPACT) : NULL;
    int status =
        text ? image_write(path, picture, text, e) : err_set(e, ERR_NOMEM, "no memory for the origin");
    if (!status && job->options.planes) {
        status = planes_save(job->options.planes, job->scene, planes, origin, e);
    }
    if (!status && job->options.spectral) {
        status = spectral_save(job->options.spectral, job->scene, planes, text, e);
    }
    if (!status && job->options.uncertainty) {
        status = verb_uncertainty(job->options.uncertainty, job->scene, &job->options.render, origin, e);
    }
    json_t *times = times_json(job, report, colour_s, stopwatch_s() - started);
    if (origin) {
        json_object_set(origin, "seconds", times);
        json_object_set_new(origin, "threads", json_integer(report->threads));
        json_object_set_new(origin, "picture", json_string(path));
        json_array_append_new(job->reports, origin);
    }
    json_decref(times);
    free(text);
    return status;
}

static int render_one(const struct job *job, const char *path, struct err *e) {
    struct planes planes = {0};
    struct picture picture = {0};
    struct render_report report = {0};
    int status = render_planes(job->scene, &job->options.render, &planes, &report, e);
    if (status) {
        return status;
    }
    double started = stopwatch_s();
    bool by_wavelength = report.features.line[FEATURE_WAVELENGTHS].kept;
    status = render_picture(job->scene, &planes, by_wavelength, &picture, e);
    double colour_s = stopwatch_s() - started;
    if (!status) {
        printf("picture:  %s, %d x %d pixels of %d bits\n", path, picture.width, picture.height,
               picture.bits);
        features_print(&report.features, stdout);
        if (!job->options.render.all_features) {
            features_print_facets(job->scene, stdout);
        }
        print_picture(job->scene, &picture, &report);
        status = write_picture(job, path, &report, &planes, &picture, colour_s, e);
    }
    if (!status && report.counts.rows_done < planes.height) {
        status = err_set(e, ERR_CANCELLED, "interrupted: %s holds %d of %d rows", path,
                         report.counts.rows_done, planes.height);
    }
    picture_free(&picture);
    planes_free(&planes);
    return status;
}

static void name_picture(const struct job *job, int k, char *path, size_t size) {
    if (job->scene->n_pictures == 1) {
        snprintf(path, size, "%s", job->options.output);
    } else {
        verb_numbered(job->options.output, k + 1, path, size);
    }
}

static int render_series(struct job *job, struct err *e) {
    int status = 0;
    struct render_hits hits = {0};
    job->options.render.hits = job->scene->n_pictures > 1 ? &hits : NULL;
    for (int k = 0; k < job->scene->n_pictures && !status; k++) {
        char path[4096];
        scene_aim(job->scene, k);
        name_picture(job, k, path, sizeof path);
        status = render_one(job, path, e);
    }
    render_hits_free(&hits);
    size_t n = json_array_size(job->reports);
    if (job->options.report && n > 0) {
        int written =
            verb_report(job->options.report, n == 1 ? json_array_get(job->reports, 0) : job->reports, e);
        status = status ? status : written;
    }
    return status;
}

static int check_outputs(const struct job *job, struct err *e) {
    const struct options *o = &job->options;
    const char *const beside[] = {o->planes, o->spectral, o->uncertainty, o->report};
    int status = 0;
    for (int k = 0; k < job->scene->n_pictures && !status; k++) {
        char path[4096];
        name_picture(job, k, path, sizeof path);
        status = verb_output(path, e);
    }
    for (size_t i = 0; i < sizeof beside / sizeof *beside && !status; i++) {
        status = verb_output(beside[i], e);
    }
    return status;
}

static int check_wishes(const struct job *job, struct err *e) {
    const struct options *o = &job->options;
    if (job->scene->n_pictures > 1 && (o->planes || o->spectral || o->uncertainty)) {
        return err_set(
            e, ERR_USAGE,
            "--planes, --spectral and --uncertainty hold one picture; this scene is a series of %d",
            job->scene->n_pictures);
    }
    return check_outputs(job, e);
}

int verb_render(int argc, char **argv) {
    struct job job = {.options.energy = -1};
    struct err e = {0};
    struct err_list errors = {0};
    double started = stopwatch_s();
    job.line = verb_line(argc, argv); /* before any word is cut */
    int status = read_options(argc, argv, &job.options, &e);
    if (status) {
        free(job.line);
        return status > 0 ? 0 : verb_complain("render", &e);
    }
    job.scene = scene_read(job.options.scene, job.options.session, job.options.n_sessions, &errors);
    if (!job.scene) {
        free(job.line);
        return verb_complain_all(&errors);
    }
    if (check_wishes(&job, &e)) {
        free(job.line);
        scene_free(job.scene);
        return verb_complain("render", &e);
    }
    job.scene->image.energy = job.options.energy < 0 ? job.scene->image.energy : job.options.energy;
    job.parse_s = stopwatch_s() - started;
    job.options.render.cancel = verb_cancel();
    job.options.render.progress = isatty(STDERR_FILENO);
    job.reports = json_array();
    print_materials(job.scene);
    print_meshes(job.scene);
    warn_of_lights(job.scene);
    status = job.line && job.reports ? render_series(&job, &e)
                                     : err_set(&e, ERR_NOMEM, "no memory for the command");
    json_decref(job.reports);
    free(job.line);
    scene_free(job.scene);
    return status ? verb_complain("render", &e) : 0;
}
