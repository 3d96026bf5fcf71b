/* plot and compare: figures and a table of one or several sessions. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "daemon/plot.h"
#include "daemon/verb_session.h"

#define SESSIONS_MAX 64

struct loaded {
    int n;
    char path[SESSIONS_MAX][512];
    const char *path_of[SESSIONS_MAX];
    struct dataset data[SESSIONS_MAX];
};

static void unload(struct loaded *l) {
    for (int i = 0; i < l->n; i++)
        dataset_free(&l->data[i]);
    free(l);
}

static struct loaded *load(const struct verb_args *args, struct err *e) {
    struct loaded *l = calloc(1, sizeof *l);
    int rc = l ? 0 : err_set(e, ERR_NOMEM, "no memory for the sessions");
    for (int i = 0; rc == 0 && i < args->n_operands; i++) {
        rc = verb_session_path(args, args->operand[i], l->path[i], sizeof l->path[i], e);
        if (rc == 0)
            rc = dataset_load(&l->data[i], l->path[i], e);
        l->path_of[i] = l->path[i];
        l->n += rc == 0;
    }
    if (rc != 0 && l)
        unload(l);
    return rc == 0 ? l : NULL;
}

int verb_plot(int argc, char **argv) {
    static const struct verb_option OPTIONS[] = {
        {"--output", 'o', "DIR", "folder for the figures (default .)"}, {0}};
    struct verb_args args;
    struct err e = {0};
    int done = verb_parse(argc, argv, OPTIONS, 1, SESSIONS_MAX, &args);
    if (done >= 0)
        return done;
    const char *dir = args.option[0] ? args.option[0] : ".";
    if (mkdir(dir, 0777) != 0 && errno != EEXIST) {
        err_errno(&e, ERR_USAGE, errno, "cannot make the folder %s", dir);
        return verb_fail(&e, NULL);
    }
    struct loaded *l = load(&args, &e);
    if (!l)
        return verb_fail(&e, NULL);
    struct plot_set set = {.dir = dir, .path = l->path_of, .data = l->data, .n = l->n};
    int worst = 0;
    for (const struct plot_kind *k = PLOT_KINDS; k->name; k++) {
        bool drawn = false;
        err_clear(&e);
        if (k->draw(&set, &drawn, &e) != 0)
            worst = verb_fail(&e, NULL);
        else if (drawn)
            printf("%s/%s.svg\n", dir, k->name);
        else
            fprintf(stderr, "gonioctl: plot: %s left out: these sessions hold no fit for it\n", k->name);
    }
    unload(l);
    return worst;
}

/* ---- compare ---- */

static bool has_truth(const struct dataset *d, int k) {
    return d->has_truth && k < DATASET_PARAMETERS;
}

static json_t *parameters_json(const struct dataset *d) {
    json_t *list = json_object();
    for (int k = 0; k < MATERIAL_PARAMETERS; k++) {
        const struct estimate *m = &d->estimate;
        const char *name = material_parameter_name(m->model, k);
        if (!name)
            continue;
        json_t *one = json_pack("{s:f, s:f}", "value", m->value[k], "u", dataset_u(m, k));
        if (has_truth(d, k)) {
            json_object_set_new(one, "true", json_real(d->truth[k]));
            json_object_set_new(one, "pull", json_real((m->value[k] - d->truth[k]) / dataset_u(m, k)));
        }
        json_object_set_new(list, name, one);
    }
    return list;
}

static void put_found(json_t *row, const char *key, double value, double u) {
    if (value != 0 || u > 0)
        json_object_set_new(row, key, json_pack("{s:f, s:f}", "value", value, "u", u));
}

static json_t *compare_json(const struct loaded *l) {
    json_t *rows = json_array();
    for (int i = 0; i < l->n; i++) {
        const struct dataset *d = &l->data[i];
        json_t *row = json_pack("{s:s, s:s, s:s, s:s, s:i}", "session", d->name, "sample", d->sample, "paint",
                                d->paint, "support", d->support, "points", d->n);
        if (d->has_water)
            json_object_set_new(row, "water_percent", json_real(d->water_percent));
        if (d->has_estimate) {
            const struct estimate *m = &d->estimate;
            json_object_set_new(row, "model", json_string(m->model));
            json_object_set_new(row, "parameters", parameters_json(d));
            put_found(row, "mirror_offset_deg", m->mirror_offset_deg, m->u_mirror_offset_deg);
            put_found(row, "polarisation", m->polarisation, m->u_polarisation);
        }
        json_array_append_new(rows, row);
    }
    return rows;
}

static void print_parameter(const struct dataset *d, int k) {
    const struct estimate *m = &d->estimate;
    double u = dataset_u(m, k);
    printf("  %-13s%12.5g", material_parameter_name(m->model, k), m->value[k]);
    if (m->at_bound[k])
        printf("  at its bound, 95 %% limit %.4g\n", m->limit_95[k]);
    else if (m->not_identifiable[k])
        printf("  not identifiable from these angles\n");
    else if (has_truth(d, k))
        printf("%12.2g%12.5g%8.2f\n", u, d->truth[k], (m->value[k] - d->truth[k]) / u);
    else
        printf("%12.2g\n", u);
}

static void print_found(const struct estimate *m) {
    if (m->u_mirror_offset_deg > 0)
        printf("  mirror direction off by %.4f deg, u %.4f\n", m->mirror_offset_deg, m->u_mirror_offset_deg);
    if (m->polarisation != 0 || m->u_polarisation > 0)
        printf("  polarisation %.4f, u %.4f\n", m->polarisation, m->u_polarisation);
}

static void print_one(const struct dataset *d) {
    char title[300];
    const struct estimate *m = &d->estimate;
    printf("%s (%s), %d points\n", plot_title(d, title, sizeof title), d->name, d->n);
    if (!d->has_estimate) {
        puts("  no fit yet");
        return;
    }
    printf("  %-13s%12s%12s%s\n", m->model, "fitted", "u", d->has_truth ? "        true    pull" : "");
    for (int k = 0; k < MATERIAL_PARAMETERS; k++)
        if (material_parameter_name(m->model, k))
            print_parameter(d, k);
    printf("  q %.4f, kappa %g, mean of %d to %d nm, median relative error %.2g %%\n", m->q, m->kappa,
           m->mean_low_nm, m->mean_high_nm, 100 * m->median_relative_error);
    print_found(m);
    for (int i = 0; i < m->n_warnings; i++)
        printf("  note: %s\n", m->warning[i]);
}

int verb_compare(int argc, char **argv) {
    struct verb_args args;
    struct err e = {0};
    int done = verb_parse(argc, argv, NULL, 1, SESSIONS_MAX, &args);
    if (done >= 0)
        return done;
    struct loaded *l = load(&args, &e);
    if (!l)
        return verb_fail(&e, NULL);
    if (args.json) {
        json_t *rows = compare_json(l);
        json_dumpf(rows, stdout, JSON_COMPACT);
        putchar('\n');
        json_decref(rows);
    } else {
        for (int i = 0; i < l->n; i++)
            print_one(&l->data[i]);
    }
    unload(l);
    return 0;
}
