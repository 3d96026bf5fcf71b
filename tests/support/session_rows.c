#include "tests/support/session_rows.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

void row_exposure(int n, struct exposure *x, uint16_t *counts) {
    int64_t at = 1000000LL * n;
    *x = (struct exposure){.step = n,
                           .attempt = n % 3,
                           .kind = EXPOSURE_SAMPLE,
                           .bracket = 1 + n / 10,
                           .opens = n % 4,
                           .control = n % 2,
                           .theta_i_udeg = 10000000 + n,
                           .theta_v_udeg = -20000000 - n,
                           .mirrored = n % 2,
                           .source_udeg = -10000000 + n,
                           .sample_udeg = -20000000 - n,
                           .holder_udeg = 90000000,
                           .settled_us = at,
                           .start_us = at + 10,
                           .end_us = at + 500000,
                           .utc_us = 1767225600000000LL + at,
                           .exposure_us = 100000,
                           .n_scans = ROW_SCANS,
                           .pixels = ROW_PIXELS,
                           .saturated_pixels = n % 5,
                           .lamp = true,
                           .temperature_c = n % 4 ? 21.5 + n : NAN,
                           .counts = counts};
    for (int i = 0; i < ROW_SCANS * ROW_PIXELS; i++)
        counts[i] = (uint16_t)(i * 331 + n * 7);
}

void row_point(int n, int64_t exposure_id, struct point *p) {
    *p = (struct point){.exposure_id = exposure_id,
                        .provisional = true,
                        .bracket = 1,
                        .tau_us = 1.5e6 * n,
                        .tau_r_us = 0.1 * n,
                        .theta_i_udeg = 30000000 + n,
                        .theta_v_udeg = -5000000 + n,
                        .scan_f = 1.0 / 3.0 + n,
                        .noisy = n % 2,
                        .mean = 0.1 / (n + 1),
                        .mean_u_ind = 1e-5 / 3,
                        .n_common = 3};
    for (int band = 0; band < BANDS; band++) {
        p->present[band] = band % 7 != 5;
        p->beta[band] = p->present[band] ? (band - 3) / 7.0 + n : NAN;
        p->u_ind[band] = p->present[band] ? 1e-3 / (band + 1) : NAN;
        p->cov_next[band] = p->present[band] ? -1e-9 * (band + 1) : 0;
    }
    for (int k = 0; k < p->n_common; k++) {
        snprintf(p->common[k].name, sizeof p->common[k].name, "cause/%d", n + k);
        p->common[k].mean = -0.01 * (k + 1) / 3;
        for (int band = 0; band < BANDS; band++)
            p->common[k].sensitivity[band] = band / 3.0 - k;
    }
}

void row_bracket(int n, struct bracket *b) {
    *b = (struct bracket){
        .number = n, .open_us = 1000 + n, .close_us = 900000000LL + n, .mean_rate = 1e-9 / 3};
    for (int band = 0; band < BANDS; band++)
        b->rate[band] = 1e-9 / (band + 3);
    snprintf(b->ended_by, sizeof b->ended_by, "reference");
    b->last_exposure_id = 10 + n;
}

void row_estimate(int n, struct estimate *m) {
    memset(m, 0, sizeof *m);
    snprintf(m->model, sizeof m->model, "composite");
    snprintf(m->refusal, sizeof m->refusal, "the mirror side's peak is not measured yet");
    m->converged = n % 2;
    m->provisional = n % 3 == 0;
    m->n_points = 10 + n;
    m->n_parameters = 5;
    for (int i = 0; i < MATERIAL_PARAMETERS; i++) {
        m->value[i] = (i + 1) / 3.0;
        m->at_bound[i] = i == 3;
        m->limit_95[i] = i == 3 ? 0.7 : NAN;
        m->not_identifiable[i] = i == 4;
        for (int j = 0; j < MATERIAL_PARAMETERS; j++) {
            m->statistical[i][j] = i == j ? 1e-4 / (i + 3) : 1e-6;
            m->common[i][j] = i == j ? 1e-5 / (i + 3) : -1e-7;
        }
    }
    m->gap[4] = (struct material_gap){"n needs grazing angles", true, 60, 75.5};
    m->kappa = 1;
    m->q = 1.1 / 3;
    m->mean_low_nm = 400;
    m->mean_high_nm = 700;
    m->chi2 = 100.0 / 3;
    m->bic = -7;
    m->r2 = 0.999;
    m->median_relative_error = 0.01;
    m->specular_energy = NAN;
    m->has_spectrum = n % 2;
    m->band_first = 1;
    m->band_last = 80;
    for (int band = 0; m->has_spectrum && band < BANDS; band++) {
        m->s_lambda[band] = band == 0 ? NAN : band / 81.0;
        m->u_s_lambda[band] = 1e-3 * band;
    }
    m->theta_i_low_deg = 10;
    m->theta_i_high_deg = 60;
    m->theta_v_low_deg = -80;
    m->theta_v_high_deg = 79.5;
    m->iterations = 17 * n;
    m->condition = 3.25;
    m->n_effective = 31.5;
    m->loio = 1.125;
    m->minimised = MATERIAL_LOSS_LOG;
    for (int i = 0; i < MATERIAL_LOSSES; i++)
        m->loss[i] = i == 2 ? NAN : i / 7.0;
    m->source_width_deg = 1;
    m->sensor_width_deg = 0.5;
    m->beam_in_view = n % 2;
    m->mirror_offset_deg = 0.0125;
    m->u_mirror_offset_deg = 0.001;
    m->zero_source_deg = 0.005;
    m->zero_sample_deg = -0.01;
    m->polarisation = 0.03;
    m->u_polarisation = 0.004;
    m->polarisation_span = (struct material_span){0.1, {1.5, 1.75}, {6, 9}};
    m->n_warnings = 2;
    snprintf(m->warning[0], sizeof m->warning[0], "the model does not fit");
    snprintf(m->warning[1], sizeof m->warning[1], "specular energy above 1");
}

void row_calibration(struct calibration *c) {
    *c = (struct calibration){.model = "usb2000plus",
                              .serial = "USB2+F01234",
                              .pixels = ROW_PIXELS,
                              .dark_first = 6,
                              .dark_last = 17,
                              .active_first = 20,
                              .active_last = ROW_PIXELS - 1,
                              .wavelength = {340.3, 0.377, -1e-5 / 3, 1e-9},
                              .nonlinearity = {0.9, 1e-6, 0, 0, 0, 0, 0, 1e-33},
                              .nonlinearity_order = 7,
                              .nonlinearity_used = true,
                              .saturation = 60000,
                              .read_noise_counts = 50,
                              .electrons_per_count = 0.99};
}

struct session *row_fill(const char *path, int n_points) {
    struct session *s;
    struct calibration c;
    uint16_t counts[ROW_SCANS * ROW_PIXELS];
    ROW_OK(session_create(&s, path, e));
    row_calibration(&c);
    ROW_OK(session_set_calibration(s, &c, e));
    ROW_OK(session_set_text(s, "job", "name: test\nsamples: []\t# tab\n", e));
    ROW_OK(session_set_text(s, "seed", "17", e));
    for (int n = 1; n <= n_points; n++) {
        struct exposure x;
        struct point p;
        row_exposure(n, &x, counts);
        ROW_OK(session_add_exposure(s, &x, e));
        assert_int_equal(x.id, n);
        row_point(n, x.id, &p);
        ROW_OK(session_add_point(s, &p, e));
        assert_int_equal(p.id, n);
    }
    return s;
}

void row_make_folder(char folder[64], char path[96]) {
    const char *base = getenv("TMPDIR");
    snprintf(folder, 64, "%s/goniod-XXXXXX", base && strlen(base) < 40 ? base : "/tmp");
    if (!mkdtemp(folder))
        abort();
    snprintf(path, 96, "%s/test.gonio", folder);
}

void row_remove_folder(const char *folder) {
    DIR *dir = opendir(folder);
    struct dirent *entry;
    char path[400];
    while (dir && (entry = readdir(dir))) {
        snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
        if (entry->d_name[0] != '.')
            unlink(path);
    }
    if (dir)
        closedir(dir);
    rmdir(folder);
}

char row_folder[64], row_path[96];

int row_setup(void **state) {
    (void)state;
    row_make_folder(row_folder, row_path);
    return 0;
}

int row_teardown(void **state) {
    (void)state;
    row_remove_folder(row_folder);
    return 0;
}
