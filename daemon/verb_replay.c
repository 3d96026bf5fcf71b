/* replay: does a session agree, point by point, with the simulated bench that holds its own estimate or truth? */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

#include "daemon/replay.h"
#include "daemon/verb_session.h"

#define WORST 10

enum { AGAINST, SURFACE, SEED };

static const char *const CAUSES[] = {"agrees", "missing", "factor", "model", "points", "scatter"};

/* ---- what is said ---- */

static const struct replay_sweep *worst_sweep(const struct replay *r) {
    const struct replay_sweep *worst = r->sweep;
    for (int i = 1; i < r->n_sweeps; i++)
        if (r->sweep[i].chi2 * worst->n > worst->chi2 * r->sweep[i].n)
            worst = &r->sweep[i];
    return worst;
}

static int by_size(const void *a, const void *b) {
    const struct replay_point *p = *(const struct replay_point *const *)a;
    const struct replay_point *q = *(const struct replay_point *const *)b;
    double x = fmax(fabs(p->z), fabs(p->t)), y = fmax(fabs(q->z), fabs(q->t));
    return (x < y) - (x > y);
}

/* The worst points first; NULL when out of memory. */
static const struct replay_point **worst_points(const struct replay *r) {
    const struct replay_point **list = calloc(r->n, sizeof *list);
    for (int i = 0; list && i < r->n; i++)
        list[i] = &r->point[i];
    if (list)
        qsort(list, r->n, sizeof *list, by_size);
    return list;
}

static void sentence(const struct replay *r, const struct replay_point *worst, char *text, size_t size) {
    char at[160];
    snprintf(at, sizeof at, "at %g:%g deg (step %d, exposure %lld), %+.1f u (%+.1f against its neighbours)",
             worst->theta_i_deg, worst->theta_v_deg, worst->step, (long long)worst->exposure_id, worst->z,
             worst->t);
    switch (r->cause) {
    case REPLAY_AGREES:
        snprintf(text, size, r->identical ? "the same, to the last bit" : "agrees within its uncertainties");
        break;
    case REPLAY_MISSING:
        snprintf(text, size,
                 "differs: %d measured point%s no counterpart, so the plan is not the one that was run",
                 r->n_missing, r->n_missing == 1 ? " has" : "s have");
        break;
    case REPLAY_FACTOR:
        snprintf(text, size, "differs by one factor, %.5f, on all points: lamp, reference or certificate",
                 r->factor);
        break;
    case REPLAY_MODEL:
        snprintf(text, size,
                 "differs along the sweeps, most at theta_i = %g deg: the surface is not what was mounted; "
                 "worst %s",
                 worst_sweep(r)->theta_i_deg, at);
        break;
    case REPLAY_POINTS:
        snprintf(text, size, "differs at %d point%s alone, while the rest agrees: worst %s", r->n_beyond,
                 r->n_beyond == 1 ? "" : "s", at);
        break;
    case REPLAY_SCATTER:
        snprintf(text, size, "differs without order by more than u says: worst %s", at);
        break;
    }
}

/* ---- as a table ---- */

static void print_summary(const struct replay *r, bool truth) {
    printf("%d points against the simulated bench, surface: %s, seed %llu\n", r->n,
           truth ? "recorded truth" : "fitted estimate", (unsigned long long)r->seed);
    printf("median difference  %8.2f u, %.2f %% of the measured\n", r->median_z, 100 * r->median_relative);
    printf("within 2 u         %8.1f %%\n", 100 * r->within_2u);
    printf("chi2 per point     %8.2f    differs above %.2f\n", r->chi2 / r->n, r->chi2_limit / r->n);
    printf("along the sweeps   %8.2f    of 1; the difference goes on from view to view above %.2f\n",
           r->along, r->along_limit);
    printf("measured/simulated %8.5f\n", r->factor);
}

static void print_points(const struct replay *r, const struct replay_point **worst) {
    printf("\nworst points\n%8s %8s %6s %9s %11s %11s %11s %8s %10s\n", "theta_i", "theta_v", "step",
           "exposure", "measured", "simulated", "u", "in u", "neighbours");
    for (int i = 0; i < r->n && i < WORST; i++)
        printf("%8.3f %8.3f %6d %9lld %11.6f %11.6f %11.6f %+8.2f %+10.2f\n", worst[i]->theta_i_deg,
               worst[i]->theta_v_deg, worst[i]->step, (long long)worst[i]->exposure_id, worst[i]->measured,
               worst[i]->simulated, worst[i]->u, worst[i]->z, worst[i]->t);
}

static void print_sweeps(const struct replay *r) {
    printf("\nby incidence\n%8s %8s %12s %14s\n", "theta_i", "points", "mean in u", "chi2 per point");
    for (int i = 0; i < r->n_sweeps; i++)
        printf("%8.3f %8d %+12.2f %14.2f\n", r->sweep[i].theta_i_deg, r->sweep[i].n, r->sweep[i].mean_z,
               r->sweep[i].chi2 / r->sweep[i].n);
}

/* ---- as JSON ---- */

static json_t *points_json(const struct replay *r, const struct replay_point **worst) {
    json_t *list = json_array();
    for (int i = 0; i < r->n && i < WORST; i++)
        json_array_append_new(
            list, json_pack("{s:f, s:f, s:i, s:I, s:f, s:f, s:f, s:f, s:f}", "theta_i_deg",
                            worst[i]->theta_i_deg, "theta_v_deg", worst[i]->theta_v_deg, "step",
                            worst[i]->step, "exposure", (json_int_t)worst[i]->exposure_id, "measured",
                            worst[i]->measured, "simulated", worst[i]->simulated, "u", worst[i]->u,
                            "difference_u", worst[i]->z, "against_neighbours", worst[i]->t));
    return list;
}

static json_t *sweeps_json(const struct replay *r) {
    json_t *list = json_array();
    for (int i = 0; i < r->n_sweeps; i++)
        json_array_append_new(list, json_pack("{s:f, s:i, s:f, s:f}", "theta_i_deg", r->sweep[i].theta_i_deg,
                                              "points", r->sweep[i].n, "mean_u", r->sweep[i].mean_z,
                                              "chi2_per_point", r->sweep[i].chi2 / r->sweep[i].n));
    return list;
}

static void print_json(const struct replay *r, const char *path, bool truth, const char *text,
                       const struct replay_point **worst) {
    json_t *json =
        json_pack("{s:s, s:s, s:s, s:I, s:b, s:b, s:s, s:s, s:i, s:i, s:f, s:f, s:f, s:f, s:f, s:f, s:f, "
                  "s:f, s:o, s:o}",
                  "session", path, "against", "physics", "surface", truth ? "truth" : "estimate", "seed",
                  (json_int_t)r->seed, "agrees", r->cause == REPLAY_AGREES, "identical", r->identical,
                  "cause", CAUSES[r->cause], "text", text, "points", r->n, "missing", r->n_missing,
                  "median_difference_u", r->median_z, "median_relative", r->median_relative,
                  "share_within_2u", r->within_2u, "chi2_per_point", r->chi2 / r->n, "chi2_per_point_limit",
                  r->chi2_limit / r->n, "along_sweeps", r->along, "along_sweeps_limit", r->along_limit,
                  "factor", r->factor, "worst", points_json(r, worst), "sweeps", sweeps_json(r));
    json_dumpf(json, stdout, JSON_COMPACT);
    putchar('\n');
    json_decref(json);
}

/* ---- the verb ---- */

static int read_options(const struct verb_args *args, struct replay_options *o, struct err *e) {
    const char *against = args->option[AGAINST], *surface = args->option[SURFACE], *seed = args->option[SEED];
    char *end = "";
    if (against && strcmp(against, "recording") == 0)
        return err_set(e, ERR_USAGE,
                       "replay --against recording is not there yet: this goniod replays against physics");
    if (against && strcmp(against, "physics") != 0)
        return err_set(e, ERR_USAGE, "replay --against takes physics, not %s", against);
    if (surface && strcmp(surface, "estimate") != 0 && strcmp(surface, "truth") != 0)
        return err_set(e, ERR_USAGE, "replay --surface takes estimate or truth, not %s", surface);
    o->surface = surface && strcmp(surface, "truth") == 0 ? REPLAY_TRUTH : REPLAY_ESTIMATE;
    o->has_seed = seed != NULL;
    o->seed = seed ? strtoull(seed, &end, 10) : 0;
    return *end || (seed && !*seed) ? err_set(e, ERR_USAGE, "replay --seed takes a whole number") : 0;
}

static int report(const struct replay *r, const char *path, bool truth, bool json, struct err *e) {
    const struct replay_point **worst = worst_points(r);
    char text[400];
    if (!worst)
        return err_set(e, ERR_NOMEM, "no memory for %d points", r->n);
    sentence(r, worst[0], text, sizeof text);
    if (json) {
        print_json(r, path, truth, text, worst);
    } else {
        print_summary(r, truth);
        print_points(r, worst);
        print_sweeps(r);
        printf("\n%s\n", text);
    }
    free(worst);
    return 0;
}

int verb_replay(int argc, char **argv) {
    static const struct verb_option OPTIONS[] = {
        {"--against", 0, "WHAT", "physics: the simulated bench (default)"},
        {"--surface", 0, "WHICH",
         "estimate: what was fitted (default); truth: what a simulated session records"},
        {"--seed", 0, "N", "of the bench (default: truth, the session's own; estimate, another)"},
        {0}};
    struct verb_args args;
    struct replay_options options;
    struct replay r = {0};
    struct err e = {0};
    char path[600];
    int done = verb_parse(argc, argv, OPTIONS, 1, 1, &args);
    if (done >= 0)
        return done;
    int rc = read_options(&args, &options, &e);
    if (rc == 0)
        rc = verb_session_path(&args, args.operand[0], path, sizeof path, &e);
    if (rc == 0)
        rc = replay_run(&r, path, &options, &e);
    if (rc == 0)
        rc = report(&r, path, options.surface == REPLAY_TRUTH, args.json, &e);
    replay_free(&r);
    return rc < 0 ? verb_fail(&e, NULL) : r.cause != REPLAY_AGREES;
}
