/* show: what a session holds, for a person, as one JSON object, or every row of it. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/session_text.h"
#include "daemon/verb_session.h"
#include "proto/file.h"
#include "proto/session_linearity.h"

struct shown {
    struct session *s;
    const char *path;
    struct session_summary summary;
    json_t *sample; /* may be NULL */
    char *version, *seed,
        *bench; /* seed: "" of a real bench; bench: of the simulated one's file; each may be NULL */
    char state[32];
    bool has_estimate, has_joint;
    json_t *models; /* of the estimate, or NULL */
    struct joint joint;
    struct estimate estimate;
    int64_t saturated;
    bool has_linearity;
    struct linearity linearity; /* the last */
};

static int count_saturated(void *arg, const struct exposure *x) {
    ((struct shown *)arg)->saturated += x->saturated_pixels > 0;
    return 0;
}

static int take_linearity(void *arg, const struct linearity *l) {
    struct shown *w = arg;
    w->linearity = *l;
    w->has_linearity = true;
    return 0;
}

/* What is no list is no comparison: damage, which verify finds. */
static int load_models(struct shown *w, struct err *e) {
    char *text = NULL;
    int rc = session_last_models(w->s, &text, e);
    w->models = text ? json_loads(text, 0, NULL) : NULL;
    free(text);
    return rc;
}

static int load(struct shown *w, struct err *e) {
    int rc = session_get_summary(w->s, &w->summary, e);
    if (rc == 0)
        rc = session_each_exposure(w->s, count_saturated, w, e);
    if (rc == 0)
        rc = session_each_linearity(w->s, take_linearity, w, e);
    if (rc == 0)
        rc = session_text_state(w->s, w->state, sizeof w->state, e);
    if (rc == 0)
        rc = session_text_json(w->s, "sample", &w->sample, e);
    if (rc == 0)
        rc = session_get_text(w->s, "goniod_version", &w->version, e);
    if (rc == 0)
        rc = session_get_text(w->s, "seed", &w->seed, e);
    if (rc == 0)
        rc = session_get_text(w->s, "bench", &w->bench, e);
    if (rc == 0 && w->summary.n_estimates) {
        rc = session_last_estimate(w->s, &w->estimate, e);
        w->has_estimate = rc == 0;
    }
    if (rc == 0)
        rc = load_models(w, e);
    if (rc == 0)
        w->has_joint = session_last_joint(w->s, &w->joint, NULL) == 0;
    return rc;
}

static const char *member(const json_t *object, const char *key) {
    const char *text = json_string_value(json_object_get(object, key));
    return text ? text : "";
}

static void print_sample(const struct shown *w) {
    const json_t *water = json_object_get(w->sample, "water_percent");
    printf("  sample     %s", member(w->sample, "name"));
    if (*member(w->sample, "paint"))
        printf(": %s on %s", member(w->sample, "paint"), member(w->sample, "support"));
    if (water)
        printf(", %g %% water", json_number_value(water));
    putchar('\n');
}

static bool simulated(const struct shown *w) {
    return w->seed && *w->seed;
}

static void print_origin(const struct shown *w) {
    char hash[17];
    printf("  origin     goniod %s", w->version ? w->version : "of unknown version");
    if (simulated(w))
        printf(", simulated bench of seed %s", w->seed);
    if (w->bench) {
        file_hash(w->bench, strlen(w->bench), hash);
        printf(", as its file says (fnv1a %s)", hash);
    }
    putchar('\n');
}

static json_t *origin_json(const struct shown *w) {
    char hash[17];
    json_t *origin = json_pack("{s:s?, s:b}", "goniod_version", w->version, "simulated", simulated(w));
    if (simulated(w))
        json_object_set_new(origin, "seed", json_string(w->seed));
    if (w->bench) {
        file_hash(w->bench, strlen(w->bench), hash);
        json_object_set_new(origin, "bench", json_string(w->bench));
        json_object_set_new(origin, "bench_fnv1a", json_string(hash));
    }
    return origin;
}

static void print_counts(const struct shown *w) {
    const struct session_summary *m = &w->summary;
    char begun[40];
    printf("  state      %s\n", w->state);
    if (m->n_exposures)
        printf("  measured   %s UTC, %.2f h\n", session_text_utc(m->first_utc_us, begun, sizeof begun),
               (double)(m->last_us - m->first_us) / 3.6e9);
    printf("  exposures  %lld sets, %lld of them saturated; %lld exchanges on the buses\n",
           (long long)m->n_exposures, (long long)w->saturated, (long long)m->n_exchanges);
    printf("  points     %lld final", (long long)m->n_final);
    if (m->n_provisional)
        printf(", %lld provisional (their bracket is not closed)", (long long)m->n_provisional);
    printf("; %lld bracket%s\n", (long long)m->n_brackets, m->n_brackets == 1 ? "" : "s");
}

static void print_linearity(const struct linearity *l) {
    printf("  linearity  the diffuser in %g ms over %g ms: ratio %.5f, u %.5f, pull %.1f%s\n",
           l->long_us / 1e3, l->short_us / 1e3, l->ratio, l->u_ratio, l->pull,
           l->beyond ? "; NOT LINEAR as far as stated" : "");
    printf("             u of the counts at full scale: %.2g (stated %.2g)\n", l->used_rel, l->prior_rel);
}

static void print_parameter(const struct estimate *m, int k) {
    const char *name = material_parameter_name(m->model, k);
    if (!name)
        return;
    double statistical = m->statistical[k][k], common = m->common[k][k];
    printf("    %-12s %12.6g", name, m->value[k]);
    if (m->at_bound[k])
        printf("   at its bound; 95 %% limit %.4g\n", m->limit_95[k]);
    else if (m->not_identifiable[k])
        printf("   not identifiable: %s\n", m->gap[k].why);
    else
        printf("   u %.2g (statistical %.2g, common %.2g)\n", sqrt(statistical + common), sqrt(statistical),
               sqrt(common));
}

static void print_bench(double offset_deg, double u_offset_deg, double p, double u_p) {
    if (u_offset_deg > 0)
        printf("    mirror       off by %.4f deg, u %.4f\n", offset_deg, u_offset_deg);
    if (p != 0 || u_p > 0)
        printf("    polarisation %12.4f   u %.4f\n", p, u_p);
}

static void print_found(const struct estimate *m) {
    if (m->minimised != MATERIAL_LOSS_ML)
        printf("    minimised    %s\n", material_loss_name(m->minimised));
    print_bench(m->mirror_offset_deg, m->u_mirror_offset_deg, m->polarisation, m->u_polarisation);
}

static void print_estimate(const struct estimate *m) {
    if (!m->converged) {
        printf("  estimate   none: %s\n", m->refusal);
        return;
    }
    printf("  estimate   %s%s of %d points, mean of %d to %d nm, kappa %g, q %.5g\n",
           m->provisional ? "provisional, " : "", m->model, m->n_points, m->mean_low_nm, m->mean_high_nm,
           m->kappa, m->q);
    for (int k = 0; k < MATERIAL_PARAMETERS; k++)
        print_parameter(m, k);
    print_found(m);
    for (int i = 0; i < m->n_warnings; i++)
        printf("    note: %s\n", m->warning[i]);
}

static void print_models(const json_t *models) {
    size_t i;
    const json_t *one;
    printf("  models     %zu compared%24s %10s %9s\n", json_array_size(models), "BIC", "left out", "median");
    json_array_foreach(models, i, one) {
        const json_t *m = json_object_get(one, "estimate");
        if (json_is_true(json_object_get(m, "converged")))
            printf("    %-12s %s%23.1f %10.3g %8.2f%%  %s\n", member(m, "model"),
                   json_is_true(json_object_get(one, "recommended")) ? "*" : " ",
                   json_number_value(json_object_get(m, "bic")),
                   json_number_value(json_object_get(m, "loio")),
                   100 * json_number_value(json_object_get(m, "median_relative_error")), member(one, "why"));
        else
            printf("    %-12s   no estimate: %s\n", member(m, "model"), member(m, "refusal"));
    }
}

static void print_joint(const struct joint *j) {
    double worst = 0;
    if (!j->converged) {
        printf("  joint fit  none: %s\n", j->refusal);
        return;
    }
    printf("  joint fit  %d bands at %d points%s\n", j->n_bands, j->n_points,
           j->misfit ? "; the model does not fit: u from sweep scatter" : "");
    for (int p = 0; p < MATERIAL_PARAMETERS; p++) {
        const char *name = material_parameter_name(j->model, p);
        if (name && isfinite(j->value[p]) && j->at_bound[p])
            printf("    %-12s %12.6g   at its bound\n", name, j->value[p]);
        else if (name && isfinite(j->value[p]))
            printf("    %-12s %12.6g   u %.2g\n", name, j->value[p], joint_u(j, p, -1));
    }
    print_bench(j->mirror_offset_deg, j->u_mirror_offset_deg, j->polarisation, j->u_polarisation);
    for (int b = 0; b < BANDS; b++)
        if (isfinite(j->s_lambda[b]))
            worst = fmax(worst, joint_u(j, MATERIAL_S, b));
    printf("    S(lambda)    of every band, u at most %.2g; beta' %s\n", worst,
           j->beta_prime_per_band ? "of every band" : "shared");
}

static int show_text(struct shown *w) {
    puts(w->path);
    if (w->sample)
        print_sample(w);
    print_origin(w);
    print_counts(w);
    if (w->has_linearity)
        print_linearity(&w->linearity);
    if (w->has_estimate)
        print_estimate(&w->estimate);
    if (w->models)
        print_models(w->models);
    if (w->has_joint)
        print_joint(&w->joint);
    return 0;
}

static json_t *real_or_null(double value) {
    return isfinite(value) ? json_real(value) : json_null();
}

static int add_point(void *arg, const struct point *p) {
    json_t *one =
        json_pack("{s:I, s:f, s:f, s:b}", "point", (json_int_t)p->id, "theta_i_deg", p->theta_i_udeg / 1e6,
                  "theta_v_deg", p->theta_v_udeg / 1e6, "provisional", p->provisional);
    json_object_set_new(one, "beta", real_or_null(p->mean));
    json_object_set_new(one, "u_ind", real_or_null(p->mean_u_ind));
    json_object_set_new(one, "u_common", real_or_null(session_common_mean(p)));
    return json_array_append_new(arg, one) == 0 ? 0 : -ERR_NOMEM;
}

static json_t *linearity_json(const struct linearity *l) {
    return json_pack("{s:f, s:f, s:f, s:b, s:i, s:i, s:f, s:f, s:f, s:f}", "ratio", l->ratio, "u_ratio",
                     l->u_ratio, "pull", l->pull, "beyond", l->beyond, "long_us", l->long_us, "short_us",
                     l->short_us, "error_rel", l->error_rel, "u_error_rel", l->u_error_rel, "prior_rel",
                     l->prior_rel, "used_rel", l->used_rel);
}

static int show_json(struct shown *w, struct err *e) {
    const struct session_summary *m = &w->summary;
    char begun[40];
    json_t *points = json_array();
    int rc = session_each_point(w->s, false, add_point, points, e);
    json_t *all =
        json_pack("{s:s, s:s, s:I, s:I, s:I, s:I, s:I, s:I, s:I}", "session", w->path, "state", w->state,
                  "exposures", (json_int_t)m->n_exposures, "saturated", (json_int_t)w->saturated, "exchanges",
                  (json_int_t)m->n_exchanges, "brackets", (json_int_t)m->n_brackets, "points_final",
                  (json_int_t)m->n_final, "points_stored", (json_int_t)m->n_points, "estimates",
                  (json_int_t)m->n_estimates);
    if (m->n_exposures)
        json_object_set_new(all, "begun_utc",
                            json_string(session_text_utc(m->first_utc_us, begun, sizeof begun)));
    json_object_set_new(all, "elapsed_s", json_real((double)(m->last_us - m->first_us) / 1e6));
    if (w->sample)
        json_object_set(all, "sample", w->sample);
    json_object_set_new(all, "origin", origin_json(w));
    if (w->has_linearity)
        json_object_set_new(all, "linearity", linearity_json(&w->linearity));
    json_object_set_new(all, "points", points);
    if (w->has_estimate)
        json_object_set_new(all, "estimate", estimate_to_json(&w->estimate));
    if (w->models)
        json_object_set(all, "models", w->models);
    if (w->has_joint)
        json_object_set_new(all, "joint", joint_to_json(&w->joint));
    if (rc == 0) {
        json_dumpf(all, stdout, JSON_COMPACT);
        putchar('\n');
    }
    json_decref(all);
    return rc;
}

static int show(struct shown *w, const struct verb_args *args, struct err *e) {
    if (args->option[0])
        return session_dump(w->s, stdout, e);
    int rc = load(w, e);
    if (rc == 0)
        rc = args->json ? show_json(w, e) : show_text(w);
    json_decref(w->sample);
    free(w->version);
    free(w->seed);
    free(w->bench);
    json_decref(w->models);
    joint_free(&w->joint);
    return rc;
}

int verb_show(int argc, char **argv) {
    static const struct verb_option OPTIONS[] = {{"--dump", 0, NULL, "every table in key order, as text"},
                                                 {0}};
    struct verb_args args;
    struct err e = {0};
    char path[600];
    int done = verb_parse(argc, argv, OPTIONS, 1, 1, &args);
    if (done >= 0)
        return done;
    struct shown w = {.path = path};
    int rc = verb_session_path(&args, args.operand[0], path, sizeof path, &e);
    if (rc == 0)
        rc = session_open(&w.s, path, true, &e);
    if (rc == 0)
        rc = show(&w, &args, &e);
    session_close(w.s, NULL);
    return rc < 0 ? verb_fail(&e, NULL) : 0;
}
