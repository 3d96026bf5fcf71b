/* Figures and table from two generated sessions whose truth is known: every file is there and holds what it says. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "daemon/plot.h"
#include "daemon/verbs.h"
#include "fit/aperture.h"
#include "proto/units.h"

static const double TRUTH[2][DATASET_PARAMETERS] = {{.12, .20, .20, 15.7, 1.70}, {.20, .30, .07, 7.6, 1.70}};
static char folder[64], path[2][128];

static void fill_point(struct point *p, const double *value, double theta_i_deg, double theta_v_deg) {
    const struct reflectance_optics optics = {.kappa = 1, .q = 1};
    struct reflectance_geometry g;
    double beta;
    assert_int_equal(reflectance_geometry(&g, theta_i_deg, theta_v_deg, NULL), 0);
    assert_int_equal(reflectance_eval(REFLECTANCE_COMPOSITE, 1, &g, value, &optics, &beta, NULL, NULL), 0);
    p->theta_i_udeg = udeg_from_deg(theta_i_deg);
    p->theta_v_udeg = udeg_from_deg(theta_v_deg);
    p->mean = beta;
    p->mean_u_ind = .002 * beta + 1e-4;
    for (int k = 0; k < BANDS; k++) {
        p->present[k] = true;
        p->beta[k] = beta;
        p->u_ind[k] = 4 * p->mean_u_ind;
    }
}

static struct exposure exposure_of(int n, bool mirrored) {
    static uint16_t counts[4] = {100, 200, 300, 200};
    return (struct exposure){.step = n,
                             .kind = EXPOSURE_SAMPLE,
                             .bracket = 1,
                             .mirrored = mirrored,
                             .exposure_us = 1000,
                             .n_scans = 1,
                             .pixels = 4,
                             .counts = counts,
                             .settled_us = n * US_PER_S,
                             .start_us = n * US_PER_S + 1,
                             .end_us = n * US_PER_S + 2000,
                             .temperature_c = NAN};
}

static void add_points(struct session *s, const double *value) {
    struct err e = {0};
    int n = 0;
    for (int i = 10; i <= 60; i += 10) {
        for (int v = -80; v <= 80; v += 10, n++) {
            struct exposure x = exposure_of(n, false);
            struct point p = {.bracket = 1, .scan_f = NAN};
            assert_int_equal(session_add_exposure(s, &x, &e), 0);
            p.exposure_id = x.id;
            fill_point(&p, value, i, v);
            assert_int_equal(session_add_point(s, &p, &e), 0);
        }
    }
}

static void add_estimates(struct session *s, const double *value) {
    struct err e = {0};
    for (int i = 1; i <= 3; i++) {
        struct estimate m = {.model = "composite",
                             .converged = true,
                             .n_points = 30 * i,
                             .n_parameters = 5,
                             .kappa = 1,
                             .q = 1,
                             .mean_low_nm = 400,
                             .mean_high_nm = 700};
        for (int k = 0; k < DATASET_PARAMETERS; k++) {
            double u = value[k] * .01 / i;
            m.value[k] = value[k] + u;
            m.statistical[k][k] = u * u;
        }
        assert_int_equal(session_add_estimate(s, i * 30 * US_PER_S, i * 30, &m, &e), 0);
    }
}

static void make_session(int which) {
    struct session *s;
    struct err e = {0};
    char text[300];
    const double *t = TRUTH[which];
    snprintf(path[which], sizeof path[which], "%s/water%d.gonio", folder, which);
    assert_int_equal(session_create(&s, path[which], &e), 0);
    snprintf(text, sizeof text,
             "{\"name\":\"w%d\",\"paint\":\"Hooker's \\\"Green\\\"\",\"support\":\"paper\","
             "\"water_percent\":%d}",
             which, 60 * which);
    assert_int_equal(session_set_text(s, "sample", text, &e), 0);
    snprintf(text, sizeof text, "{\"S\":%g,\"sigma\":%g,\"gamma\":%g,\"beta_prime\":%g,\"n\":%g,\"q\":1}",
             t[0], t[1], t[2], t[3], t[4]);
    assert_int_equal(session_set_text(s, "truth", text, &e), 0);
    assert_int_equal(session_begin(s, &e), 0);
    add_points(s, t);
    add_estimates(s, t);
    assert_int_equal(session_commit(s, &e), 0);
    assert_int_equal(session_close(s, &e), 0);
}

static int setup(void **state) {
    (void)state;
    snprintf(folder, sizeof folder, "/tmp/test_plot.XXXXXX");
    assert_non_null(mkdtemp(folder));
    make_session(0);
    make_session(1);
    /* The test runs beside goniofit's folder, not in it. */
    const char *build = getenv("BUILD");
    char program[512];
    snprintf(program, sizeof program, "%s/goniofit", build ? build : "build");
    setenv("GONIOFIT", access(program, X_OK) == 0 ? program : "goniofit", 1);
    return 0;
}

static int teardown(void **state) {
    (void)state;
    char command[128];
    snprintf(command, sizeof command, "rm -rf '%s'", folder);
    return system(command);
}

static long size_of(const char *name, const char *ending) {
    char file[300];
    struct stat info;
    snprintf(file, sizeof file, "%s/figures/%s.%s", folder, name, ending);
    return stat(file, &info) == 0 ? (long)info.st_size : -1;
}

static int rows_of(const char *name, const char *holding) {
    char file[300], line[512];
    int n = 0;
    snprintf(file, sizeof file, "%s/figures/%s.csv", folder, name);
    FILE *f = fopen(file, "r");
    assert_non_null(f);
    while (fgets(line, sizeof line, f))
        n += strstr(line, holding) != NULL;
    fclose(f);
    return n;
}

static void every_figure_is_drawn_with_its_data(void **state) {
    (void)state;
    char out[128];
    snprintf(out, sizeof out, "%s/figures", folder);
    char *argv[] = {"plot", path[0], path[1], "-o", out, NULL};
    assert_int_equal(verb_plot(5, argv), 0);
    for (const struct plot_kind *k = PLOT_KINDS; k->name; k++) {
        assert_true(size_of(k->name, "svg") > 2000);
        assert_true(size_of(k->name, "pdf") > 1000);
        assert_true(size_of(k->name, "gp") > 200);
    }
    assert_int_equal(rows_of("fit", ",measured,"), 2 * 6 * 17);
    assert_int_equal(rows_of("water_i40", "w1,60,40.000,"), 17);
    assert_int_equal(rows_of("spectra_i40", "w0,40.000,0.000,"), BANDS);
    assert_int_equal(rows_of("residual", ",lambert,"), 2 * 6 * 17);
    assert_int_equal(rows_of("residual", ",composite,"), 2 * 6 * 17);
    assert_int_equal(rows_of("parameters", ",gamma,"), 2);
    assert_int_equal(rows_of("error_time", "w0,n,"), 3);
}

static void the_truth_shows_as_error_over_time(void **state) {
    (void)state;
    struct dataset d;
    struct err e = {0};
    assert_int_equal(dataset_load(&d, path[1], &e), 0);
    assert_int_equal(d.n, 6 * 17);
    assert_int_equal(d.n_fits, 3);
    assert_true(d.has_truth && d.has_water && d.water_percent == 60);
    assert_int_equal(d.fit[1].exposures, 60);
    for (int k = 0; k < DATASET_PARAMETERS; k++) /* made one u away from the truth */
        assert_true(fabs((d.fit[2].value[k] - d.truth[k]) / d.fit[2].u[k] - 1) < 1e-9);
    struct dataset_sweep s = dataset_sweep_nearest(&d, 41);
    assert_int_equal(s.n, 17);
    assert_true(fabs(s.theta_i_deg - 40) < 1e-9);
    assert_int_equal(d.point[s.first].theta_v_udeg, -80 * UDEG_PER_DEG);
    dataset_free(&d);
}

static void the_ratio_of_the_model_carries_its_uncertainty(void **state) {
    (void)state;
    struct dataset d;
    struct err e = {0};
    double ratio, u, up, unused;
    assert_int_equal(dataset_load(&d, path[1], &e), 0);
    struct estimate m = d.estimate;
    assert_int_equal(dataset_model_ratio(&m, 40, -40, 0, &ratio, &u, &e), 0);
    double u2 = 0;
    for (int k = 0; k < DATASET_PARAMETERS; k++) { /* propagate by finite differences */
        struct estimate moved = m;
        double h = 1e-4 * dataset_u(&m, k);
        moved.value[k] += h;
        assert_int_equal(dataset_model_ratio(&moved, 40, -40, 0, &up, &unused, &e), 0);
        u2 += pow((up - ratio) / h * dataset_u(&m, k), 2);
    }
    assert_true(fabs(u / sqrt(u2) - 1) < 1e-4);
    dataset_free(&d);
}

/* A heavy-tailed surface, seen through widths by polarised light, at readbacks that are off. */
static const struct estimate SEEN = {.model = "heavy-tail",
                                     .converged = true,
                                     .n_points = 102,
                                     .n_parameters = 6,
                                     .value = {.2, .3, .07, 7.6, 1.7, .4},
                                     .kappa = 1,
                                     .q = 1,
                                     .mean_low_nm = 400,
                                     .mean_high_nm = 700,
                                     .source_width_deg = 2,
                                     .sensor_width_deg = 1,
                                     .mirror_offset_deg = .25,
                                     .u_mirror_offset_deg = .01,
                                     .zero_source_deg = .1,
                                     .zero_sample_deg = -.2,
                                     .polarisation = .2,
                                     .u_polarisation = .01};

static void add_seen_points(struct session *s) {
    const struct reflectance_optics optics = {1, 1, SEEN.polarisation};
    const struct aperture_form form = {SEEN.source_width_deg, SEEN.sensor_width_deg, false};
    struct err e = {0};
    for (int n = 0; n < 6 * 17; n++) {
        struct exposure x = exposure_of(n, n % 2);
        struct point p = {.bracket = 1, .scan_f = NAN, .mean_u_ind = 1e-4};
        const double i_deg = 10 * (n / 17 + 1), v_deg = 10 * (n % 17) - 80, side = x.mirrored ? -1 : 1;
        assert_int_equal(session_add_exposure(s, &x, &e), 0);
        p.exposure_id = x.id;
        p.theta_i_udeg = udeg_from_deg(i_deg);
        p.theta_v_udeg = udeg_from_deg(v_deg);
        assert_int_equal(aperture_at(&form, i_deg + side * .3, v_deg - side * .2, REFLECTANCE_HEAVY_TAIL,
                                     SEEN.value, &optics, &p.mean, NULL, &e),
                         0);
        assert_int_equal(session_add_point(s, &p, &e), 0);
    }
}

static void curves_use_what_the_fit_used(void **state) {
    (void)state;
    struct session *s;
    struct err e = {0};
    char seen[128], out[128], file[160], line[512];
    snprintf(seen, sizeof seen, "%s/seen.gonio", folder);
    snprintf(out, sizeof out, "%s/figures", folder);
    assert_int_equal(session_create(&s, seen, &e), 0);
    assert_int_equal(session_set_text(s, "sample", "{\"name\":\"seen\",\"water_percent\":0}", &e), 0);
    assert_int_equal(session_begin(s, &e), 0);
    add_seen_points(s);
    for (int i = 1; i <= 2; i++) {
        struct estimate m = SEEN;
        for (int k = 0; k < m.n_parameters; k++)
            m.statistical[k][k] = pow(.01 * m.value[k] / i, 2);
        assert_int_equal(session_add_estimate(s, i * 50 * US_PER_S, i * 50, &m, &e), 0);
    }
    assert_int_equal(session_commit(s, &e), 0);
    assert_int_equal(session_close(s, &e), 0);
    char *argv[] = {"plot", seen, "-o", out, NULL};
    assert_int_equal(verb_plot(4, argv), 0);
    snprintf(file, sizeof file, "%s/fit.csv", out);
    FILE *f = fopen(file, "r");
    int n = 0;
    while (fgets(line, sizeof line, f)) {
        double i_deg, v_deg, beta, u, model;
        if (sscanf(line, "seen,measured,%lf,%lf,%lf,%lf,%lf", &i_deg, &v_deg, &beta, &u, &model) != 5)
            continue;
        assert_true(fabs(model / beta - 1) < 1e-7);
        n++;
    }
    fclose(f);
    assert_int_equal(n, 6 * 17);
    assert_int_equal(rows_of("parameters", "seen,,0,tail,0.4,"), 1);
    assert_int_equal(rows_of("error_time", "seen,tail,"), 2);
    assert_int_equal(rows_of("residual", "seen,heavy-tail,"), 6 * 17);
    char *words[] = {"compare", seen, NULL};
    assert_int_equal(verb_compare(2, words), 0);
}

static void bad_use_is_answered(void **state) {
    (void)state;
    char *none[] = {"plot", NULL};
    char *absent[] = {"compare", "/nowhere/at-all.gonio", NULL};
    char *unknown[] = {"compare", "--jsn", path[0], NULL};
    assert_int_equal(verb_plot(1, none), 2);
    assert_int_equal(verb_compare(2, absent), 2);
    assert_int_equal(verb_compare(3, unknown), 2);
    char *good[] = {"compare", path[0], path[1], NULL};
    assert_int_equal(verb_compare(3, good), 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_figure_is_drawn_with_its_data),
        cmocka_unit_test(the_truth_shows_as_error_over_time),
        cmocka_unit_test(the_ratio_of_the_model_carries_its_uncertainty),
        cmocka_unit_test(curves_use_what_the_fit_used),
        cmocka_unit_test(bad_use_is_answered),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
