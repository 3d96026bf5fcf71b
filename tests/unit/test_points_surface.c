#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fit/points.h"
#include "fit/reflectance.h"
#include "proto/units.h"
#include "tests/support/goniometry.h"
#include "tests/support/skipping.h"

#define SHARED "../shared/data/brdf/"

static void ok(int status, const struct err_list *errors) {
    for (size_t i = 0; i < errors->n; i++) {
        print_error("%s:%d:%d %s\n", errors->item[i].file, errors->item[i].line, errors->item[i].column,
                    errors->item[i].text);
    }
    assert_int_equal(status, 0);
}

static int read_text(const char *text, const char *extension, const struct points_options *options,
                     struct fitset *d, struct points_report *report, struct err_list *errors) {
    char path[64];
    snprintf(path, sizeof path, "/tmp/goniod-points-XXXXXX%s", extension);
    int file = mkstemps(path, (int)strlen(extension));
    assert_true(file >= 0);
    assert_int_equal(write(file, text, strlen(text)), strlen(text));
    close(file);
    fitset_init(d);
    int status = points_read(path, options, d, report, errors);
    unlink(path);
    return status;
}

/* A made-up surface as a .brdf of two wavelengths, the second twice the first; azimuths from either side. */
static char *brdf_of(const struct goniometry *m, bool forward_zero) {
    char *text = malloc(m->input.n * 120 + 100);
    int at = sprintf(text, "# made up\n2\n500 600\n");
    for (size_t i = 0; i < m->input.n; i++) {
        bool forward = m->theta_v_deg[i] > 0;
        at += sprintf(text + at, "%.12g 0 %.12g %.12g %.12g %.12g\n", rad_from_deg(m->theta_i_deg[i]),
                      rad_from_deg(fabs(m->theta_v_deg[i])), forward != forward_zero ? M_PI : 0,
                      m->beta[i] / M_PI * 2 / 3, m->beta[i] / M_PI * 4 / 3);
    }
    return text;
}

static void the_mirror_side_is_found(void **state) {
    (void)state;
    static struct goniometry m;
    for (int set = 0; set < GONIOMETRY_SETS; set++) {
        goniometry_make(&m, goniometry_set[set], 60, 5);
        for (int zero = 0; zero < 2; zero++) {
            char *text = brdf_of(&m, zero);
            struct fitset d;
            struct points_report report;
            struct err_list errors = {0};
            ok(read_text(text, ".brdf", &(struct points_options){0}, &d, &report, &errors), &errors);
            assert_string_equal(report.format, "brdf");
            if (!strstr(report.azimuth, zero ? "phi = 0 deg (detected)" : "phi = 180 deg (detected)")) {
                fail_msg("%s: %s", goniometry_name[set], report.azimuth);
            }
            assert_int_equal(d.n, m.input.n);
            for (size_t i = 0; i < d.n; i++) {
                if (m.theta_v_deg[i] != 0) {
                    assert_float_equal(d.theta_v_deg[i], m.theta_v_deg[i], 1e-9);
                }
                assert_float_equal(d.beta[i], m.beta[i], 1e-9 * m.beta[i]);
            }
            fitset_free(&d);
            free(text);
        }
    }
}

static void a_flat_surface_leaves_the_side_open(void **state) {
    (void)state;
    struct fitset d;
    struct points_report report;
    struct err_list errors = {0};
    const char *flat = "1 550\n0.7 0 0.5 0 0.1\n0.7 0 0.5 3.14159 0.1\n",
               *one_side = "1 550\n0.7 0 0.5 0 0.1\n";
    struct points_options given = {.azimuth = AZIMUTH_FORWARD_ZERO};
    ok(read_text(flat, "", &(struct points_options){0}, &d, &report, &errors), &errors);
    assert_non_null(strstr(report.azimuth, "180 deg (assumed, for the data do not tell)"));
    fitset_free(&d);
    ok(read_text(one_side, "", &(struct points_options){0}, &d, &report, &errors), &errors);
    assert_non_null(strstr(report.azimuth, "no incidence of 25 deg or more shows both sides"));
    fitset_free(&d);
    ok(read_text(one_side, "", &given, &d, &report, &errors), &errors);
    assert_non_null(strstr(report.azimuth, "forward at delta phi = 0 deg (as given)"));
    assert_true(d.theta_v_deg[0] > 0);
    fitset_free(&d);
}

static void forms_are_recognised(void **state) {
    (void)state;
    static const struct {
        const char *text, *extension, *format;
    } files[] = {
        {"theta_i_deg,theta_v_deg,beta\n40,30,0.1\n", ".txt", "csv"},
        {"NUM_POINTS 1\nVARS theta_i,phi_i,theta_s,phi_s,R\n0.5,0,0.5,0,1\n", ".txt", "astm"},
        {"#DIM 3 1\n#PARAM_IN ISOTROPIC_TV_TL_DPHI\n#PARAM_OUT INV_STERADIAN\n0.5 0.5 0 1\n", ".csv", "alta"},
        {"lambda,thetai,phi,thetar,phir,f_r11\n0.55,-45,0,20,0,1\n", ".csv", "nist"},
        {"# paint\n1\n550\n0.5 0 0.5 0 1\n", ".txt", "brdf"}};
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        struct fitset d;
        struct points_report report;
        struct err_list errors = {0};
        ok(read_text(files[i].text, files[i].extension, &(struct points_options){0}, &d, &report, &errors),
           &errors);
        assert_string_equal(report.format, files[i].format);
        assert_int_equal(d.n, 1);
        fitset_free(&d);
    }
    struct fitset d;
    struct points_report report;
    struct err_list errors = {0};
    struct points_options named = {.format = "brdf"};
    assert_int_equal(read_text("theta_i_deg\n", ".csv", &named, &d, &report, &errors), -ERR_INPUT);
    assert_string_equal(report.format, "brdf");
    assert_int_equal(read_text("", ".brdf", &(struct points_options){0}, &d, &report, &errors), -ERR_INPUT);
    assert_string_equal(report.format, "brdf"); /* nothing in it: its name decides */
    err_list_free(&errors);
    fitset_free(&d);
}

static void masks_count_what_they_leave_out(void **state) {
    (void)state;
    static struct goniometry m;
    goniometry_make(&m, goniometry_set[0], 60, 5);
    char *text = brdf_of(&m, false);
    struct points_options o = {.mask = {.max_theta_i_deg = 40, .max_theta_v_deg = 70, .blind_deg = 10}};
    struct fitset d;
    struct points_report report;
    struct err_list errors = {0};
    ok(read_text(text, ".brdf", &o, &d, &report, &errors), &errors);
    size_t n_i = 0, n_v = 0, n_blind = 0;
    for (size_t i = 0; i < m.input.n; i++) {
        double theta_i = m.theta_i_deg[i], theta_v = m.theta_v_deg[i];
        n_i += theta_i > 40;
        n_v += theta_i <= 40 && fabs(theta_v) > 70;
        n_blind += theta_i <= 40 && fabs(theta_v) <= 70 && fabs(theta_i + theta_v) < 10;
    }
    assert_int_equal(d.mask.left_out[MASK_THETA_I], n_i);
    assert_int_equal(d.mask.left_out[MASK_THETA_V], n_v);
    assert_int_equal(d.mask.left_out[MASK_BLIND], n_blind);
    assert_int_equal(d.n, m.input.n - n_i - n_v - n_blind);
    assert_true(n_i && n_v && n_blind);
    fitset_free(&d);
    free(text);
    ok(read_text("1 550\n0.5 0 1.55 0 1\n0.5 0 0.5 1.5 1\n0.5 0 0.5 0 1\n", "",
                 &(struct points_options){.mask.in_plane = true}, &d, &report, &errors),
       &errors);
    assert_int_equal(d.n, 1);
    assert_int_equal(d.mask.left_out[MASK_GRAZING], 1);
    assert_int_equal(d.mask.left_out[MASK_OUT_OF_PLANE], 1);
    fitset_free(&d);
}

static void wavelengths_make_bands_and_means(void **state) {
    (void)state;
    const char *text = "5 380 501 503 700 1064\n0.5 0 0.5 0 1 2 4 7 9\n";
    struct fitset d;
    struct points_report report;
    struct err_list errors = {0};
    ok(read_text(text, "", &(struct points_options){.u_relative = 0.1, .has_u = true}, &d, &report, &errors),
       &errors);
    assert_float_equal(d.beta[0], M_PI * (2 + 4 + 7) / 3, 1e-12); /* 501 and 503 nm are two bands */
    assert_float_equal(d.u_ind[0], 0.1 * d.beta[0], 1e-12);
    assert_true(d.has_bands && d.has_u && !d.has_bands_u);
    assert_float_equal(d.bands[0], M_PI, 1e-12);
    fitset_free(&d);
    struct points_options one_band = {.mean_low_nm = 499, .mean_high_nm = 502},
                          infrared = {.mean_low_nm = 1000, .mean_high_nm = 1100},
                          nothing = {.mean_low_nm = 800, .mean_high_nm = 900};
    ok(read_text(text, "", &one_band, &d, &report, &errors), &errors);
    assert_float_equal(d.beta[0], 2 * M_PI, 1e-12);
    assert_int_equal(d.input.mean_high_nm, 502);
    fitset_free(&d);
    ok(read_text(text, "", &infrared, &d, &report, &errors), &errors);
    assert_float_equal(d.beta[0], 9 * M_PI, 1e-12);
    assert_false(d.has_bands);
    fitset_free(&d);
    assert_int_equal(read_text(text, "", &nothing, &d, &report, &errors), -ERR_INPUT);
    assert_non_null(strstr(errors.item[0].text, "it has 5 from 380 to 1064 nm"));
    err_list_free(&errors);
    fitset_free(&d);
    errors = (struct err_list){0};
    assert_int_equal(
        read_text("theta_i_deg,theta_v_deg,beta\n10,20,0.5\n", "", &nothing, &d, &report, &errors),
        -ERR_INPUT);
    assert_non_null(strstr(errors.item[0].text, "this file holds means alone"));
    err_list_free(&errors);
    fitset_free(&d);
}

static void points_without_bands_may_stand_before_points_with(void **state) {
    (void)state;
    struct fitset d;
    double bands[BANDS];
    fitset_init(&d);
    for (int b = 0; b < BANDS; b++) {
        bands[b] = b;
    }
    for (int i = 0; i < 40; i++) {
        struct fitset_point p = {.beta = 1, .bands = i > 20 ? bands : NULL, .bands_u = i > 20 ? bands : NULL};
        assert_int_equal(fitset_add_point(&d, &p, NULL), 0);
    }
    assert_true(isnan(d.bands[0]) && isnan(d.bands[20 * BANDS + 80]) && isnan(d.bands_u[20 * BANDS]));
    assert_true(d.bands[21 * BANDS + 7] == 7 && d.bands_u[39 * BANDS + 80] == 80);
    fitset_free(&d);
}

/* A paint seen from all azimuths: what general directions hold, the fit finds; in plane alone, it finds too. */
static void points_out_of_plane_are_fitted(void **state) {
    (void)state;
    const double truth[MATERIAL_PARAMETERS] = {0.2, 0.3, 0.07, 7.6, 1.7};
    const struct reflectance_optics optics = {.kappa = 1, .q = 1};
    char *text = malloc(400000);
    int at = sprintf(text, "1 550\n"), n_plane = 0, n = 0;
    for (double i = 10; i <= 60; i += 10) {
        for (double r = 5; r <= 80; r += 5) {
            for (double phi = 0; phi <= 180; phi += 20) {
                struct reflectance_geometry g;
                double beta;
                assert_int_equal(reflectance_geometry_general(&g, i, r, phi, NULL), 0);
                assert_int_equal(
                    reflectance_eval(REFLECTANCE_COMPOSITE, 1, &g, truth, &optics, &beta, NULL, NULL), 0);
                at += sprintf(text + at, "%.12g 0 %.12g %.12g %.12g\n", rad_from_deg(i), rad_from_deg(r),
                              rad_from_deg(phi), beta / M_PI);
                n++;
                n_plane += phi == 0 || phi == 180;
            }
        }
    }
    for (int plane = 0; plane < 2; plane++) {
        struct points_options o = {
            .mask.in_plane = plane, .has_u = true, .u_relative = 0.005, .u_absolute = 0.001};
        struct fitset d;
        struct points_report report;
        struct err_list errors = {0};
        struct estimate estimate;
        ok(read_text(text, ".brdf", &o, &d, &report, &errors), &errors);
        assert_int_equal(d.n, plane ? n_plane : n);
        assert_int_equal(d.mask.left_out[MASK_OUT_OF_PLANE], n - (int)d.n);
        assert_int_equal(fitset_fit(&d, &estimate, NULL), 0);
        assert_true(estimate.converged);
        for (int p = 0; p <= MATERIAL_N; p++) {
            assert_float_equal(estimate.value[p], truth[p], 1e-6 * truth[p]);
        }
        const double gamma =
            estimate.value[MATERIAL_GAMMA]; /* the surface's lobe, as far as it is not the width */
        d.input.source_width_deg = d.input.sensor_width_deg = 2;
        assert_int_equal(fitset_fit(&d, &estimate, NULL), 0);
        assert_true(estimate.converged && estimate.value[MATERIAL_GAMMA] < gamma * 0.999);
        fitset_free(&d);
    }
    free(text);
}

struct expected {
    const char *path, *azimuth;
    struct points_options options;
    size_t n;
    double r2, median; /* of the paper's model: reflection-model.md 6 */
};

static void check_measured(const struct expected *x) {
    struct fitset d;
    struct points_report report;
    struct err_list errors = {0};
    struct estimate estimate;
    skip_without_file(x->path);
    fitset_init(&d);
    ok(points_read(x->path, &x->options, &d, &report, &errors), &errors);
    print_message("# %s\n", report.azimuth);
    assert_non_null(strstr(report.azimuth, x->azimuth));
    assert_int_equal(d.n, x->n);
    d.input.q_is_one = true;
    assert_int_equal(fitset_fit(&d, &estimate, NULL), 0);
    assert_true(estimate.converged);
    assert_float_equal(estimate.median_relative_error, x->median, 0.15 * x->median);
    d.input.unweighted = true;
    assert_int_equal(fitset_fit(&d, &estimate, NULL), 0);
    assert_true(estimate.r2 >= x->r2);
    fitset_free(&d);
}

static void measured_paints(void **state) {
    (void)state;
    struct points_options o = {.mask = {.max_theta_i_deg = 65, .max_theta_v_deg = 75, .in_plane = true},
                               .has_u = true,
                               .u_relative = 0.05,
                               .u_absolute = 0.005};
    check_measured(
        &(struct expected){SHARED "painted/garnet_red.brdf", "180 deg (detected)", o, 80, 0.995, 0.118});
    check_measured(
        &(struct expected){SHARED "painted/krylon_blue.brdf", "180 deg (detected)", o, 80, 0.982, 0.113});
}

static void measured_ptfe(void **state) {
    (void)state;
    struct points_options o = {.mask = {.in_plane = true},
                               .mean_low_nm = 532,
                               .mean_high_nm = 532,
                               .has_u = true,
                               .u_relative = 0.01};
    check_measured(
        &(struct expected){SHARED "nist-ptfe/PTFE.data.csv", "180 deg (detected)", o, 108, 0, 0.028});
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_mirror_side_is_found),
        cmocka_unit_test(a_flat_surface_leaves_the_side_open),
        cmocka_unit_test(forms_are_recognised),
        cmocka_unit_test(masks_count_what_they_leave_out),
        cmocka_unit_test(wavelengths_make_bands_and_means),
        cmocka_unit_test(points_without_bands_may_stand_before_points_with),
        cmocka_unit_test(points_out_of_plane_are_fitted),
        cmocka_unit_test(measured_paints),
        cmocka_unit_test(measured_ptfe),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
