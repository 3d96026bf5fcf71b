#include "fit/commands.h"

#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/aperture.h"
#include "fit/models.h"
#include "fit/joint_fit.h"
#include "fit/joint_text.h"
#include "fit/loss.h"
#include "fit/points_option.h"
#include "fit/reflectance.h"
#include "fit/solve.h"
#include "proto/number.h"

static const char help[] =
    "usage: goniofit fit FILE... [--model MODEL] [--loss LOSS] [--weights measured|none]\n"
    "                       [--paper-convention] [--json]\n"
    "Fits a reflection model to radiance factors.\n";
static const char help_of_fit[] =
    "  --model MODEL       lambert, oren-nayar, eq1, composite (default), heavy-tail, transmitted, "
    "two-lobe,\n"
    "                      or all of them, best first: which the data need, by BIC and by cross-validation\n"
    "  --loss LOSS         ml (residuals over u; default: a session's own, else this), ols (the paper's Eq. "
    "6), log, cuberoot or cosine\n"
    "  --weights none      every point counts alike: ml becomes ols; default: measured, by their u\n"
    "  --joint             also one fit of all bands together: shared shape parameters, S of each band\n"
    "  --beta-prime-per-band  the same with one beta' for each band\n"
    "  --paper-convention  refit of the paper's printed form: kappa = pi, q = 1; S_paper = pi S is given "
    "too\n"
    "  --source-width DEG, --sensor-width DEG\n"
    "                      full angular widths in the plane of incidence; default: a session's own, else 0\n"
    "  --polarisation P    unknown (default), depolarised, a value, or a value with its u: 0.02,0.01; "
    "default: a\n"
    "                      session's own\n"
    "  --mirror-offset W   free (default: fitted where the zeros of the axes have a u) or held\n"
    "  --json              one object on stdout (an array with several models or files)\n"
    "exit status: 0 done, 1 a fit was refused or failed, 2 bad usage or bad input\n";

struct options {
    const char *model; /* NULL: all */
    enum material_loss loss;
    bool loss_given;
    const char *weights; /* NULL: not said */
    bool paper, json, joint, per_band;
    double source_width_deg, sensor_width_deg; /* NAN: as the file says */
    bool polarisation_given, polarisation_unknown, hold_offset;
    double polarisation, u_polarisation;
    struct points_options points;
};

enum { POINTS_OPTION = 'P' }; /* any of POINTS_OPTIONS */

static int take_model(const char *name, struct options *o, struct err *e) {
    enum reflectance_model found;
    if (strcmp(name, "all") == 0) {
        o->model = NULL;
        return 0;
    }
    o->model = name;
    return reflectance_find(name, &found, e);
}

static int take_weights(const char *name, struct options *o, struct err *e) {
    o->weights = name;
    return strcmp(name, "none") == 0 || strcmp(name, "measured") == 0
               ? 0
               : err_set(e, ERR_USAGE, "--weights is measured or none, not '%s'", name);
}

/* Only ml knows the points' u. */
static int settle_loss(struct options *o, struct err *e) {
    const bool none = o->weights && strcmp(o->weights, "none") == 0;
    o->loss_given = o->loss_given || o->weights;
    if (none && o->loss == MATERIAL_LOSS_ML) {
        o->loss = MATERIAL_LOSS_OLS;
    }
    if (o->weights && !none && o->loss != MATERIAL_LOSS_ML) {
        return err_set(e, ERR_USAGE,
                       "the loss %s does not weigh points by their u; leave --weights measured out",
                       material_loss_name(o->loss));
    }
    return 0;
}

static int take_width(const char *text, double *width_deg, struct err *e) {
    bool good =
        number_read_double(text, width_deg) && *width_deg >= 0 && *width_deg <= APERTURE_WIDTH_MAX_DEG;
    return !good ? err_set(e, ERR_USAGE, "an angular width is 0 to %g deg, not '%s'", APERTURE_WIDTH_MAX_DEG,
                           text)
                 : 0;
}

/* "unknown", "depolarised", "P" or "P,U" */
static int take_polarisation(const char *text, struct options *o, struct err *e) {
    char value[32];
    size_t n = strcspn(text, ",");
    o->polarisation_given = true;
    o->polarisation_unknown = strcmp(text, "unknown") == 0;
    if (o->polarisation_unknown || strcmp(text, "depolarised") == 0) {
        return 0;
    }
    snprintf(value, sizeof value, "%.*s", (int)(n < sizeof value ? n : 0), text);
    bool good = number_read_double(value, &o->polarisation) &&
                (text[n] == 0 || number_read_double(text + n + 1, &o->u_polarisation));
    return good && fabs(o->polarisation) <= 1 && o->u_polarisation >= 0 && o->u_polarisation <= 1
               ? 0
               : err_set(e, ERR_USAGE,
                         "--polarisation is unknown, depolarised, or P or P,U with P in -1 to 1 and U in 0 "
                         "to 1, not "
                         "'%s'",
                         text);
}

static int take_offset(const char *word, struct options *o, struct err *e) {
    o->hold_offset = strcmp(word, "held") == 0;
    return o->hold_offset || strcmp(word, "free") == 0
               ? 0
               : err_set(e, ERR_USAGE, "--mirror-offset is free or held, not '%s'", word);
}

/* 1: help was asked for and printed. */
static int read_options(int argc, char **argv, struct options *o, struct err *e) {
    static const struct option known[] = {{"model", required_argument, NULL, 'm'},
                                          {"loss", required_argument, NULL, 'l'},
                                          {"weights", required_argument, NULL, 'w'},
                                          {"paper-convention", no_argument, NULL, 'p'},
                                          {"source-width", required_argument, NULL, 's'},
                                          {"sensor-width", required_argument, NULL, 'v'},
                                          {"joint", no_argument, NULL, 'J'},
                                          {"beta-prime-per-band", no_argument, NULL, 'b'},
                                          {"polarisation", required_argument, NULL, 'z'},
                                          {"mirror-offset", required_argument, NULL, 'd'},
                                          {"json", no_argument, NULL, 'j'},
                                          {"help", no_argument, NULL, 'h'},
                                          POINTS_OPTIONS(POINTS_OPTION),
                                          {NULL, 0, NULL, 0}};
    int status = 0, at = 0;
    optind = 1;
    for (int c; !status && (c = getopt_long(argc, argv, "", known, &at)) != -1;) {
        switch (c) {
        case 'm':
            status = take_model(optarg, o, e);
            break;
        case 'l':
            status = loss_find(optarg, &o->loss, e);
            o->loss_given = true;
            break;
        case 'w':
            status = take_weights(optarg, o, e);
            break;
        case 'p':
            o->paper = true;
            break;
        case 's':
            status = take_width(optarg, &o->source_width_deg, e);
            break;
        case 'v':
            status = take_width(optarg, &o->sensor_width_deg, e);
            break;
        case 'b':
            o->per_band = true;
            o->joint = true;
            break;
        case 'J':
            o->joint = true;
            break;
        case 'z':
            status = take_polarisation(optarg, o, e);
            break;
        case 'd':
            status = take_offset(optarg, o, e);
            break;
        case 'j':
            o->json = true;
            break;
        case 'h':
            printf("%s%s%s", help, points_option_help, help_of_fit);
            return 1;
        case POINTS_OPTION:
            status = points_option_take(known[at].name, optarg, &o->points, e);
            break;
        default:
            return err_set(e, ERR_USAGE, "see goniofit fit --help");
        }
    }
    if (!status && optind == argc) {
        return err_set(e, ERR_USAGE, "no FILE is given; see goniofit fit --help");
    }
    return status ? status : settle_loss(o, e);
}

struct result {
    struct estimate estimate;
    struct estimate_trace trace;
    struct joint joint;
    bool has_joint;
    const char *file;
    struct points_report report;
    struct mask mask;
    struct choice choice; /* of several models; its text is empty for one alone */
};

static void print_limit(const struct estimate *m, int p) {
    printf("  %-11s at its bound %.6g, 95 %% limit %.6g\n", material_parameter_name(m->model, p), m->value[p],
           m->limit_95[p]);
}

static void print_instrument(const struct estimate *m) {
    if (m->source_width_deg > 0 || m->sensor_width_deg > 0) {
        printf("  seen through widths of %g deg (source) and %g deg (sensor)\n", m->source_width_deg,
               m->sensor_width_deg);
    }
    if (m->u_mirror_offset_deg > 0) {
        printf("  mirror direction off by %.4f deg, u %.4f\n", m->mirror_offset_deg, m->u_mirror_offset_deg);
    }
    if (m->polarisation != 0 || m->u_polarisation > 0) {
        printf("  polarisation %.4f, u %.4f\n", m->polarisation, m->u_polarisation);
    }
}

/* Of an estimate this stands among its warnings; a refusal has none. */
static void print_left_out(const struct mask *mask) {
    for (int rule = 0; rule < MASK_RULES; rule++) {
        if (mask->left_out[rule] > 0) {
            printf("  left out: %zu points %s\n", mask->left_out[rule], mask_words((enum mask_rule)rule));
        }
    }
}

static void print_text(const struct result *r, bool paper) {
    const struct estimate *m = &r->estimate;
    printf("%s: %s, %d points (%s)\n", r->file, m->model, m->n_points, r->report.format);
    if (r->report.azimuth[0]) {
        printf("  azimuth: %s\n", r->report.azimuth);
    }
    for (int i = 0; i < r->report.n_notes; i++) {
        printf("  note: %s\n", r->report.note[i]);
    }
    if (!m->converged) {
        print_left_out(&r->mask);
        printf("  no estimate: %s\n", m->refusal);
        return;
    }
    printf("  %-11s %14s %12s %12s %12s\n", "", "value", "u", "statistical", "common");
    for (int p = 0; p < MATERIAL_PARAMETERS; p++) {
        const char *name = material_parameter_name(m->model, p);
        double statistical = m->statistical[p][p], common = m->common[p][p];
        if (name && m->at_bound[p]) {
            print_limit(m, p);
        } else if (name && m->not_identifiable[p] && statistical + common == 0) {
            printf("  %-11s %14.8g %12s %12s %12s  not identifiable\n", name, m->value[p], "-", "-", "-");
        } else if (name) {
            printf("  %-11s %14.8g %12.3g %12.3g %12.3g%s\n", name, m->value[p], sqrt(statistical + common),
                   sqrt(statistical), sqrt(common), m->not_identifiable[p] ? "  not identifiable" : "");
        }
    }
    if (paper) {
        printf("  S_paper = pi S = %.8g\n", M_PI * m->value[MATERIAL_S]);
    }
    printf("  kappa %.10g, q %.6g, mean of %d-%d nm\n", m->kappa, m->q, m->mean_low_nm, m->mean_high_nm);
    print_instrument(m);
    printf("  chi-square %.5g, BIC %.5g, R2 %.6f, median relative error %.3g, specular energy %.3g\n",
           m->chi2, m->bic, m->r2, m->median_relative_error, m->specular_energy);
    printf("  losses:");
    for (int i = 0; i < MATERIAL_LOSSES; i++) {
        printf(" %s %.5g%s", material_loss_name((enum material_loss)i), m->loss[i],
               i == (int)m->minimised ? " (minimised)" : "");
    }
    printf("\n");
    for (int i = 0; i < m->n_warnings; i++) {
        printf("  warning: %s\n", m->warning[i]);
    }
}

/* How the file was read: what a reader of the numbers must know of it. */
static json_t *input_to_json(const struct result *r) {
    json_t *left_out = json_object(), *notes = json_array();
    for (int rule = 0; rule < MASK_RULES; rule++) {
        json_object_set_new(left_out, mask_key((enum mask_rule)rule),
                            json_integer((json_int_t)r->mask.left_out[rule]));
    }
    for (int i = 0; i < r->report.n_notes; i++) {
        json_array_append_new(notes, json_string(r->report.note[i]));
    }
    return json_pack("{s:s,s:s,s:o,s:o}", "format", r->report.format, "azimuth", r->report.azimuth,
                     "left_out", left_out, "notes", notes);
}

static json_t *result_to_json(const struct result *r, bool paper) {
    json_t *json = estimate_to_json(&r->estimate), *trace = json_array();
    for (size_t i = 0; i < r->trace.n; i++) {
        json_array_append_new(
            trace, json_pack("{s:f,s:f}", "t_us", r->trace.step[i].t_us, "cost", r->trace.step[i].cost));
    }
    json_object_set_new(json, "trace", trace);
    json_object_set_new(json, "solver", json_string(solve_name(SOLVE_TINY)));
    json_object_set_new(json, "file", json_string(r->file));
    json_object_set_new(json, "input", input_to_json(r));
    if (r->has_joint) {
        json_object_set_new(json, "joint", joint_to_json(&r->joint));
    }
    if (r->choice.text[0]) {
        json_object_set_new(json, "choice", json_string(r->choice.text));
        json_object_set_new(json, "recommended", json_boolean(r->choice.recommended));
    }
    if (paper) {
        json_object_set_new(json, "S_paper", json_real(M_PI * r->estimate.value[MATERIAL_S]));
    }
    return json;
}

static int fit_joint(struct fitset *data, const struct options *o, struct result *r, struct err *e) {
    const struct estimate_input *input;
    const bool has_lobe = material_parameter_name(r->estimate.model, MATERIAL_BETA_PRIME) != NULL;
    int status = fitset_input(data, &input, e);
    status = status ? status : joint_fit(input, &r->estimate, o->per_band && has_lobe, &r->joint, e);
    r->has_joint = status == 0;
    return status;
}

/* What the command line says goes before what a session says. */
static void take_given(struct estimate_input *in, const struct options *o) {
    in->loss = o->loss_given ? o->loss : in->loss;
    in->unweighted = in->unweighted || (o->weights && strcmp(o->weights, "none") == 0); /* the bands, too */
    if (o->paper) {
        in->kappa = M_PI;
        in->q_is_one = true;
    }
    in->source_width_deg = isnan(o->source_width_deg) ? in->source_width_deg : o->source_width_deg;
    in->sensor_width_deg = isnan(o->sensor_width_deg) ? in->sensor_width_deg : o->sensor_width_deg;
    in->hold_offset = in->hold_offset || o->hold_offset;
    if (o->polarisation_given) {
        in->polarisation_unknown = o->polarisation_unknown;
        in->polarisation = o->polarisation;
        in->u_polarisation = o->u_polarisation;
    }
}

/* The joint fit of a model that the bands defeat says so; it does not take the others along. */
static int add_joint(struct fitset *data, const struct options *o, struct result *r, struct err *e) {
    struct err failure = {0};
    data->input.model = r->estimate.model;
    data->input.trace = NULL;
    int status = fit_joint(data, o, r, &failure);
    if (status == -ERR_FIT) {
        r->estimate.converged = false;
        snprintf(r->estimate.refusal, sizeof r->estimate.refusal, "%.255s", failure.text);
        return 0;
    }
    if (status) {
        *e = failure;
    }
    return status;
}

static int fit_models(const char *path, const struct options *o, struct result *results, int *n,
                      struct err_list *errors) {
    struct fitset data;
    struct points_report report;
    struct model_fit *fit = calloc(REFLECTANCE_MODELS, sizeof *fit);
    struct err e = {0};
    size_t count = 0;
    fitset_init(&data);
    int status = fit ? points_read(path, &o->points, &data, &report, errors)
                     : err_set(&e, ERR_NOMEM, "no memory to fit %s", path);
    take_given(&data.input, o);
    if (!status) {
        status = models_fit(&data, o->model, fit, &count, &e);
    }
    for (size_t i = 0; i < count && !status; i++) {
        struct result *r = &results[(*n)++];
        *r = (struct result){.estimate = fit[i].estimate,
                             .trace = fit[i].trace,
                             .choice = fit[i].choice,
                             .file = path,
                             .report = report,
                             .mask = data.mask};
        status = o->joint ? add_joint(&data, o, r, &e) : 0;
    }
    if (e.code) {
        err_list_add(errors, &e);
    }
    free(fit);
    fitset_free(&data);
    return status;
}

/* The models of one file side by side, ahead of their parameters. */
static void print_comparison(const struct result *results, int n) {
    printf("%s: %d models compared\n  %-11s %2s %10s %10s %9s\n", results->file, n, "", "k", "BIC",
           "left out", "median");
    for (int i = 0; i < n; i++) {
        const struct estimate *m = &results[i].estimate;
        if (m->converged) {
            printf("  %-11s %2d %10.1f %10.3g %8.2f%%  %s\n", m->model, m->n_parameters,
                   results[i].choice.bic, m->loio, 100 * m->median_relative_error, results[i].choice.text);
        } else {
            printf("  %-11s %2d  no estimate: %s\n", m->model, m->n_parameters, m->refusal);
        }
    }
    printf("  BIC counts %.0f of %d points as independent; left out: rms error of an incidence that the fit "
           "has not "
           "seen\n\n",
           results->estimate.n_effective, results->estimate.n_points);
}

/* Of several models only the best is shown in full as text; JSON has them all. */
static void print_file(const struct result *results, int n, bool paper, json_t *all) {
    for (int i = 0; i < n && all; i++) {
        json_array_append_new(all, result_to_json(&results[i], paper));
    }
    if (!all && n > 1) {
        print_comparison(results, n);
    }
    if (!all) {
        print_text(results, paper);
        if (results->has_joint && results->joint.converged) {
            joint_text_print(&results->joint);
        }
    }
    for (int i = 0; i < n; i++) {
        if (results[i].has_joint && !results[i].joint.converged) {
            fprintf(stderr, "goniofit fit: %s: %s: no joint fit: %s\n", results[i].file,
                    results[i].estimate.model, results[i].joint.refusal);
        }
        if (!results[i].estimate.converged) {
            fprintf(stderr, "goniofit fit: %s: %s: %s\n", results[i].file, results[i].estimate.model,
                    results[i].estimate.refusal);
        }
    }
}

/* n results, of each file per_file; 1 where a file has no estimate. */
static int print_results(const struct result *results, int n, int per_file, const struct options *o) {
    int status = 0;
    json_t *all = o->json ? json_array() : NULL;
    for (int i = 0; i < n; i += per_file) {
        print_file(&results[i], per_file, o->paper, all);
        bool whole = results[i].estimate.converged && (!results[i].has_joint || results[i].joint.converged);
        status = whole ? status : 1;
    }
    if (all) {
        json_dumpf(n == 1 ? json_array_get(all, 0) : all, stdout, JSON_INDENT(1) | JSON_REAL_PRECISION(17));
        putchar('\n');
    }
    json_decref(all);
    return status;
}

int command_fit(int argc, char **argv) {
    struct options options = {.model = "composite", .source_width_deg = NAN, .sensor_width_deg = NAN};
    struct err e = {0};
    struct err_list errors = {0};
    int n = 0, status = read_options(argc, argv, &options, &e);
    if (status) {
        return status > 0 ? 0 : command_complain("fit", &e);
    }
    struct result *results = calloc((size_t)(argc - optind) * REFLECTANCE_MODELS, sizeof *results);
    if (!results) {
        err_set(&e, ERR_NOMEM, "no memory for %d files", argc - optind);
        return command_complain("fit", &e);
    }
    for (int i = optind; i < argc; i++) {
        fit_models(argv[i], &options, results, &n, &errors);
    }
    status = errors.n ? command_complain_all(&errors)
                      : print_results(results, n, options.model ? 1 : REFLECTANCE_MODELS, &options);
    for (int i = 0; i < n; i++) {
        joint_free(&results[i].joint);
    }
    free(results);
    return status;
}
