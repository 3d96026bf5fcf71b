#include "fit/commands.h"

#include <getopt.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/stability.h"
#include "proto/number.h"

#define LIMIT_S 60
#define LIMIT_LARGE_S 600

static const char help[] =
    "usage: goniofit stability [--json | --csv] [--seed N] [--only WORD] [--large]\n"
    "Estimates made-up measurements that are stiff, extreme or broken, and compares with the truth.\n"
    "  --only WORD  the cases with this word in their group or name\n"
    "  --large      the last case has a million points\n"
    "  --seed N     of the noise; default 1\n"
    "The verdict on a case: good; refused, with the reason; LIES: an identifiable parameter is more than 5 "
    "of its\n"
    "stated u from the truth, or a limit excludes it; HANGS; CRASHES.\n"
    "exit status: 0 done, 1 a case lies, hangs or crashes, 2 bad usage\n";

struct options {
    bool json, csv, large;
    uint64_t seed;
    const char *only;
};

/* 1: help was asked for and printed. */
static int read_options(int argc, char **argv, struct options *o, struct err *e) {
    static const struct option known[] = {{"json", no_argument, NULL, 'j'},
                                          {"csv", no_argument, NULL, 'c'},
                                          {"seed", required_argument, NULL, 's'},
                                          {"only", required_argument, NULL, 'o'},
                                          {"large", no_argument, NULL, 'l'},
                                          {"help", no_argument, NULL, 'h'},
                                          {NULL, 0, NULL, 0}};
    int64_t seed = 1;
    optind = 1;
    for (int c; (c = getopt_long(argc, argv, "", known, NULL)) != -1;) {
        switch (c) {
        case 'j':
            o->json = true;
            break;
        case 'c':
            o->csv = true;
            break;
        case 'l':
            o->large = true;
            break;
        case 'o':
            o->only = optarg;
            break;
        case 's':
            if (!number_read_int(optarg, &seed)) {
                return err_set(e, ERR_USAGE, "--seed is a whole number, not '%.40s'", optarg);
            }
            break;
        case 'h':
            fputs(help, stdout);
            return 1;
        default:
            return err_set(e, ERR_USAGE, "see goniofit stability --help");
        }
    }
    o->seed = (uint64_t)seed;
    return optind == argc ? 0 : err_set(e, ERR_USAGE, "'%.40s' is too much; see --help", argv[optind]);
}

/* JSON knows no infinity and no NaN. */
static json_t *number(double x) {
    return isfinite(x) ? json_real(x) : json_null();
}

static const char *worst_name(const struct stability_result *r) {
    const char *name = r->worst < 0 ? NULL : material_parameter_name("composite", r->worst);
    return name ? name : "";
}

static json_t *parameters_to_json(const struct stability_case *c, const struct stability_result *r) {
    const struct estimate *m = &r->estimate;
    json_t *all = json_object();
    for (int p = MATERIAL_S; p <= MATERIAL_N && m->converged; p++) {
        double u = sqrt(m->statistical[p][p] + m->common[p][p]);
        json_object_set_new(all, material_parameter_name(m->model, p),
                            json_pack("{s:o,s:o,s:o,s:b,s:o,s:b}", "truth", number(c->truth[p]), "value",
                                      number(m->value[p]), "u", number(u), "at_bound", m->at_bound[p],
                                      "limit_95", number(m->at_bound[p] ? m->limit_95[p] : NAN),
                                      "not_identifiable", m->not_identifiable[p]));
    }
    return all;
}

static json_t *row_to_json(const struct stability_case *c, const struct stability_result *r) {
    const struct estimate *m = &r->estimate;
    json_t *warnings = json_array();
    for (int i = 0; i < m->n_warnings; i++) {
        json_array_append_new(warnings, json_string(m->warning[i]));
    }
    return json_pack("{s:s,s:s,s:i,s:o,s:i,s:s,s:s,s:o,s:s,s:o,s:o,s:o}", "group", c->group, "case", c->name,
                     "n_points", (int)r->n, "condition", number(m->condition), "iterations", m->iterations,
                     "verdict", stability_word(r->verdict), "why", r->why, "worst_u", number(r->worst_u),
                     "worst", worst_name(r), "solvers_apart_u", number(r->apart_u), "parameters",
                     parameters_to_json(c, r), "warnings", warnings);
}

static void print_csv(const struct stability_case *c, const struct stability_result *r) {
    char why[256];
    size_t n = 0;
    for (const char *from = r->why; *from && n < sizeof why - 1; from++) {
        why[n++] = *from == '"' ? '\'' : *from;
    }
    why[n] = '\0';
    printf("%s,\"%s\",%zu,%.4g,%d,%s,%.3g,%s,%.3g,\"%s\"\n", c->group, c->name, r->n, r->estimate.condition,
           r->estimate.iterations, stability_word(r->verdict), r->worst_u, worst_name(r), r->apart_u, why);
}

static void print_row(const struct stability_case *c, const struct stability_result *r) {
    char claims[160] = "";
    size_t at = 0;
    for (int p = MATERIAL_S; p <= MATERIAL_N && r->estimate.converged; p++) {
        const char *state = r->estimate.not_identifiable[p] ? "?" : r->estimate.at_bound[p] ? "|" : NULL;
        if (state && at < sizeof claims - 16) {
            at += (size_t)snprintf(claims + at, sizeof claims - at, " %s%s",
                                   material_parameter_name(r->estimate.model, p), state);
        }
    }
    printf("%-40s %8zu %9.2e %5d  %-8s", c->name, r->n, r->estimate.condition, r->estimate.iterations,
           stability_word(r->verdict));
    if (r->worst >= 0) {
        printf(" %5.2f u (%s), solvers %.0e u apart", r->worst_u, worst_name(r), r->apart_u);
    }
    printf("%s%s%s\n", claims, r->why[0] ? "  " : "", r->why);
}

static bool wanted(const struct stability_case *c, const struct options *o) {
    return !o->only || strstr(c->group, o->only) || strstr(c->name, o->only);
}

struct counts {
    size_t all, good, refused;
};

static int run_all(const struct stability_case *cases, size_t n, const struct options *o, json_t *rows,
                   struct counts *counts, struct err *e) {
    const char *group = "";
    for (size_t i = 0; i < n; i++) {
        struct stability_result r;
        if (!wanted(&cases[i], o)) {
            continue;
        }
        int status = stability_run(&cases[i], o->seed, o->large ? LIMIT_LARGE_S : LIMIT_S, &r, e);
        if (status) {
            return status;
        }
        counts->all++;
        counts->good += r.verdict == STABILITY_GOOD;
        counts->refused += r.verdict == STABILITY_REFUSED;
        if (o->json) {
            json_array_append_new(rows, row_to_json(&cases[i], &r));
        } else if (o->csv) {
            print_csv(&cases[i], &r);
        } else {
            if (strcmp(group, cases[i].group) != 0) {
                printf("-- %s\n", group = cases[i].group);
            }
            print_row(&cases[i], &r);
        }
    }
    return 0;
}

static void print_head(const struct options *o) {
    if (o->csv) {
        puts("group,case,n_points,condition,iterations,verdict,worst_u,worst,solvers_apart_u,why");
    } else if (!o->json) {
        printf("%-40s %8s %9s %5s  %-8s error; ? not identifiable, | at its bound\n", "case", "points",
               "condition", "steps", "verdict");
    }
}

int command_stability(int argc, char **argv) {
    struct options o = {0};
    struct err e = {0};
    struct stability_case *cases = NULL;
    struct counts counts = {0};
    size_t n = 0;
    int status = read_options(argc, argv, &o, &e);
    if (status) {
        return status > 0 ? 0 : command_complain("stability", &e);
    }
    json_t *rows = json_array();
    print_head(&o);
    status = stability_cases(o.large, &cases, &n, &e);
    if (!status) {
        status = run_all(cases, n, &o, rows, &counts, &e);
    }
    free(cases);
    size_t bad = counts.all - counts.good - counts.refused;
    if (o.json && !status) {
        json_t *all =
            json_pack("{s:I,s:I,s:I,s:I,s:O}", "seed", (json_int_t)o.seed, "good", (json_int_t)counts.good,
                      "refused", (json_int_t)counts.refused, "bad", (json_int_t)bad, "rows", rows);
        json_dumpf(all, stdout, JSON_INDENT(1) | JSON_REAL_PRECISION(9));
        putchar('\n');
        json_decref(all);
    } else if (!o.csv && !status) {
        printf("%zu cases: %zu good, %zu refused, %zu lie, hang or crash\n", counts.all, counts.good,
               counts.refused, bad);
    }
    json_decref(rows);
    return status ? command_complain("stability", &e) : bad > 0;
}
