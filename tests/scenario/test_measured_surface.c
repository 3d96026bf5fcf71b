/* A measured surface as truth, measured at its own in-plane pairs of angles through the whole chain: its spectral
 * radiance factors from 400 to 700 nm against those of the file.
 *
 *   SEEDS=20 FIRST=1 DRAWS=1 build/tests/scenario/test_measured_surface     (make measured)
 *
 * DRAWS=1: certificate and axis zeros are drawn, and count in u. Without it (the default) they are as stated
 * and only what differs from point to point counts. At least 93 % of the values lie within 2 u, none beyond 6 u. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "proto/brdf.h"
#include "sim/measured.h"
#include "tests/support/lab.h"
#include "tests/support/truth_check.h"
#include "tests/support/skipping.h"

#define GARNET "../shared/data/brdf/painted/garnet_red.brdf"
#define WITHIN_2U 0.93
#define SEEDS_DEFAULT                                                                                        \
    4 /* values of a bracket share its reference readings: one seed alone scatters by 1.5 % */
#define U_REPEAT_DEG 0.002 /* as sim_config_default and the profile om-az state them */
#define U_ZERO_DEG 0.01

struct tally {
    int n, within, points;
    double worst, sum, sum2;
};

static int number_of(const char *name, int otherwise) {
    const char *text = getenv(name);
    return text ? atoi(text) : otherwise;
}

/* ---- the job ---- */

static void put_pairs(FILE *out, const struct brdf *brdf) {
    const char *comma = "";
    for (size_t i = 0; i < brdf->n; i++) {
        const struct brdf_geometry *g = &brdf->geometry[i];
        if (!g->in_plane)
            continue;
        fprintf(out, "%s[%.2f, %.2f]", comma, g->theta_i_deg, g->theta_v_deg);
        comma = ", ";
    }
}

static char *job_of(const struct brdf *brdf) {
    char *text = NULL;
    size_t size;
    FILE *out = open_memstream(&text, &size);
    fputs("name: measured\n"
          "samples:\n"
          "  - {name: patch, holder: sample, paint: unknown, support: unknown, size_mm: [150, 80]}\n"
          "geometry: {pairs: [",
          out);
    put_pairs(out, brdf);
    fputs("]}\n"
          "mean_nm: [400, 700]\n"
          "exposure: {target: 0.8, min_ms: 4, max_ms: 5000, average: 4, dark_every_min: 10}\n"
          "reference: {mode: fixed, geometry: {theta_i_deg: 45, theta_v_deg: 0}, holder: reference,\n"
          "            certificate: ptfe.csv, bracket_min: 15}\n"
          "fit: {model: composite}\n",
          out);
    fclose(out);
    return text;
}

/* ---- measuring and judging ---- */

static void judge(struct tally *t, const struct truth_check *c) {
    for (int i = 0; i < c->n_points; i++)
        for (int band = TRUTH_FIRST; band <= TRUTH_LAST; band++) {
            const struct point *p = &c->point[i];
            assert_true(p->present[band]);
            double pull = truth_check_pull(c, p, band);
            t->n++;
            t->within += fabs(pull) <= 2;
            t->worst = fabs(pull) > fabs(t->worst) ? pull : t->worst;
            t->sum += pull;
            t->sum2 += pull * pull;
        }
    t->points += c->n_points;
}

static void measure(struct tally *t, const struct brdf *brdf, const struct measured *surface, int seed,
                    bool draws) {
    static struct lab lab;
    static struct truth_check check;
    const struct sim_surface truth = {.measured = surface};
    char dir[96], name[192];
    char *job = job_of(brdf), *bench = lab_bare_bench_text();
    lab_make_dir(dir);
    lab_open(&lab, dir, &(struct simulate_options){.seed = (uint64_t)seed, .nominal = !draws}, bench);
    assert_int_equal(simulate_mount_measured(lab.simulate, "patch", surface, NULL), 0);
    lab_job(&lab, job);
    lab_run(&lab);
    assert_int_equal(lab.ended, CAMPAIGN_DONE);
    assert_true(lab_session(&lab, 0, name));
    struct session *s = lab_open_session(&lab, name);
    check = (struct truth_check){.truth = &truth, .nominal = !draws};
    check.u_source_deg = check.u_sample_deg = draws ? hypot(U_REPEAT_DEG, U_ZERO_DEG) : U_REPEAT_DEG;
    truth_check_load(&check, s);
    session_close(s, NULL);
    lab_close(&lab);
    lab_remove_dir(dir);
    free(job);
    free(bench);
    judge(t, &check);
}

static void check_surface(const char *what, const struct brdf *brdf, int least_points) {
    struct tally t = {0};
    struct measured *surface;
    int first = number_of("FIRST", 1), seeds = number_of("SEEDS", SEEDS_DEFAULT);
    bool draws = number_of("DRAWS", 0) != 0;
    assert_int_equal(measured_new(&surface, brdf, NULL), 0);
    for (int s = 0; s < seeds; s++) {
        struct tally one = {0};
        measure(&one, brdf, surface, first + s, draws);
        print_message("# %s, seed %d%s: %d points, %d values, %.2f %% within 2 u, worst %.1f u, mean %.2f, "
                      "rms %.2f\n",
                      what, first + s, draws ? " with draws" : "", one.points, one.n,
                      100.0 * one.within / one.n, one.worst, one.sum / one.n, sqrt(one.sum2 / one.n));
        assert_true(one.points >= least_points);
        t.n += one.n;
        t.within += one.within;
        t.worst = fmax(t.worst, fabs(one.worst));
    }
    measured_free(surface);
    print_message("# %s: %.2f %% of %d values within 2 u, worst %.1f u\n", what, 100.0 * t.within / t.n, t.n,
                  t.worst);
    assert_true(t.within >= WITHIN_2U * t.n);
    assert_true(t.worst <= 6);
}

static void garnet_red(void **state) {
    (void)state;
    struct brdf brdf;
    skip_without_file(GARNET);
    assert_int_equal(brdf_read_file(GARNET, &brdf, NULL), 0);
    check_surface("garnet_red", &brdf, 100);
    brdf_free(&brdf);
}

/* A surface of the same kind, of our own making: every tenth degree of incidence, uneven views, a lobe much narrower
 * than the steps, a body that rises steeply towards the red, and one geometry that is black. */
static void synthetic_twin(void **state) {
    (void)state;
    enum { INCIDENCES = 7, VIEWS = 16, LAMBDAS = 31, N = INCIDENCES * VIEWS };
    static double lambda_nm[LAMBDAS], beta[N * LAMBDAS];
    static struct brdf_geometry geometry[N];
    for (int n = 0; n < N; n++) {
        double i = 10 * (n / VIEWS + 1), v = -79.3 + 10.13 * (n % VIEWS) + 0.37 * (n % 3);
        double off = v - i, lobe = 6 * exp(-off * off / 60) / cos(i * M_PI / 180);
        geometry[n] = (struct brdf_geometry){
            .theta_i_deg = i, .theta_s_deg = fabs(v), .in_plane = true, .theta_v_deg = round(v * 100) / 100};
        for (int k = 0; k < LAMBDAS; k++) {
            lambda_nm[k] = 400 + 10 * k;
            beta[n * LAMBDAS + k] =
                n == 5 ? 0 : 0.03 + 0.3 / (1 + exp((600 - lambda_nm[k]) / 12)) * cos(v * M_PI / 180) + lobe;
        }
    }
    struct brdf brdf = {
        .n = N, .n_lambda = LAMBDAS, .lambda_nm = lambda_nm, .geometry = geometry, .beta = beta};
    check_surface("synthetic twin", &brdf, 90);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(synthetic_twin),
        cmocka_unit_test(garnet_red),
    };
    return cmocka_run_group_tests_name("measured_surface", tests, NULL, NULL);
}
