#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "daemon/reduce.h"
#include "proto/session_linearity.h"
#include "tests/support/session_rows.h"
#include "tests/support/synthetic_bench.h"
#include "tests/support/seed.h"

/* Whole little campaigns on counts that synthetic_bench forms from light, against the truth it was given. */

#define POINTS_MAX 400

struct seen {
    int n_points, n_brackets, next_id;
    struct point *point; /* [POINTS_MAX] */
    struct bracket last;
    struct linearity linearity;
};

static int see_point(void *arg, struct point *p, struct err *e) {
    (void)e;
    struct seen *s = arg;
    p->id = ++s->next_id;
    assert_true(s->n_points < POINTS_MAX);
    s->point[s->n_points++] = *p;
    return 0;
}

static int see_bracket(void *arg, const struct bracket *b, struct err *e) {
    (void)e;
    struct seen *s = arg;
    s->n_brackets++;
    s->last = *b;
    return 0;
}

static int see_linearity(void *arg, struct linearity *l, struct err *e) {
    (void)e;
    ((struct seen *)arg)->linearity = *l;
    return 0;
}

struct fixture {
    struct synthetic bench;
    struct certificate certificate;
    char *text;
    struct reduce_setup setup;
    struct reducer *r;
    struct seen seen;
    struct reduce_sink sink;
    struct session *session; /* NULL = not recorded */
    int bracket;
};

static void start(struct fixture *f, uint64_t seed, bool beam_in_view, enum job_reference_mode mode) {
    struct err_list errors = {0};
    struct err e = {0};
    memset(f, 0, sizeof *f);
    synthetic_init(&f->bench, seed);
    f->bench.beam_in_view = beam_in_view;
    f->text = synthetic_certificate(&f->bench, 0.005);
    assert_int_equal(certificate_read_text("ptfe.csv", f->text, strlen(f->text), &f->certificate, &errors),
                     0);
    f->setup = (struct reduce_setup){.calibration = f->bench.calibration,
                                     .certificate = &f->certificate,
                                     .mode = mode,
                                     .beam_in_view = beam_in_view,
                                     .mean_nm = {400, 700},
                                     .drift_rate_prior = 1e-9};
    if (reducer_new(&f->r, &f->setup, &e) < 0)
        fail_msg("%s", e.text);
    f->seen.point = calloc(POINTS_MAX, sizeof *f->seen.point);
    f->sink = (struct reduce_sink){
        .arg = &f->seen, .point = see_point, .bracket = see_bracket, .linearity = see_linearity};
}

/* A spectrometer without noise, and a reducer that knows it. */
static void silence(struct fixture *f) {
    struct err e = {0};
    f->bench.noise = false;
    f->setup.calibration.read_noise_counts = 0;
    f->setup.calibration.electrons_per_count = 1e12;
    reducer_free(f->r);
    assert_int_equal(reducer_new(&f->r, &f->setup, &e), 0);
}

static void finish(struct fixture *f) {
    reducer_free(f->r);
    certificate_free(&f->certificate);
    synthetic_free(&f->bench);
    free(f->seen.point);
    free(f->text);
}

static void give(struct fixture *f, struct exposure *x) {
    struct err e = {0};
    if (f->session && session_add_exposure(f->session, x, &e) < 0)
        fail_msg("%s", e.text);
    if (reducer_add(f->r, x, &f->sink, &e) < 0)
        fail_msg("%s", e.text);
}

static void take_dark(struct fixture *f, int exposure_us) {
    struct exposure x;
    synthetic_expose(&f->bench, EXPOSURE_DARK, 45, 0, exposure_us, &x);
    give(f, &x);
}

static void take_control(struct fixture *f, double theta_i_deg, double theta_v_deg, int closes, int opens) {
    struct exposure x;
    synthetic_expose(&f->bench, EXPOSURE_REFERENCE, theta_i_deg, theta_v_deg, 60000, &x);
    x.control = true;
    x.bracket = closes;
    x.opens = opens;
    give(f, &x);
}

static void take(struct fixture *f, enum exposure_kind kind, double theta_i_deg, double theta_v_deg,
                 int exposure_us) {
    struct exposure x;
    synthetic_wait(&f->bench, 20);
    synthetic_expose(&f->bench, kind, theta_i_deg, theta_v_deg, exposure_us, &x);
    x.bracket = f->bracket;
    give(f, &x);
}

static const double GRID[][2] = {{15, -60}, {15, 30}, {45, -30}, {45, 0}, {45, 60}, {60, -75}, {60, 30}};
#define GRID_POINTS (int)(sizeof GRID / sizeof GRID[0])

/* One campaign over the grid in any of the modes; the lamp drifts meanwhile. */
static void run_grid(struct fixture *f) {
    take_dark(f, 60000);
    take_dark(f, 150000);
    double incidence = f->setup.mode == REFERENCE_PER_INCIDENCE ? GRID[0][0] : 45;
    take_control(f, incidence, 0, 0, f->bracket = 1);
    for (int k = 0; k < GRID_POINTS; k++) {
        if (f->setup.mode == REFERENCE_PER_INCIDENCE && GRID[k][0] != incidence) {
            take_control(f, incidence, 0, f->bracket, 0);
            incidence = GRID[k][0];
            take_control(f, incidence, 0, 0, ++f->bracket);
        }
        if (f->setup.mode == REFERENCE_EVERY_GEOMETRY)
            take(f, EXPOSURE_REFERENCE, GRID[k][0], GRID[k][1], 60000);
        take(f, EXPOSURE_SAMPLE, GRID[k][0], GRID[k][1], 150000);
    }
    synthetic_wait(&f->bench, 20);
    take_control(f, incidence, 0, f->bracket, 0);
}

static const struct point *final_of(const struct fixture *f, int grid) {
    int found = 0;
    for (int k = 0; k < f->seen.n_points; k++)
        if (!f->seen.point[k].provisional && found++ == grid)
            return &f->seen.point[k];
    fail_msg("point %d has no final value", grid);
    return NULL;
}

static double true_mean(const struct fixture *f, double theta_i_deg, double theta_v_deg) {
    double sum = 0;
    for (int nm = 400; nm <= 700; nm += 5)
        sum += synthetic_sample_beta(&f->bench, theta_i_deg, theta_v_deg, nm);
    return sum / 61;
}

/* Without noise what is left are rounding of counts and the lamp's curvature against a straight line: none here. */
static void four_modes_agree_in_both_fillings(void **state) {
    (void)state;
    for (int mode = REFERENCE_FIXED; mode <= REFERENCE_START_END; mode++)
        for (int beam_in_view = 0; beam_in_view < 2; beam_in_view++) {
            struct fixture f;
            start(&f, 1, beam_in_view, (enum job_reference_mode)mode);
            silence(&f);
            f.bench.slope_per_s = 1e-5;
            run_grid(&f);
            for (int k = 0; k < GRID_POINTS; k++) {
                double mean = final_of(&f, k)->mean, truth = true_mean(&f, GRID[k][0], GRID[k][1]);
                if (!(fabs(mean / truth - 1) < 1e-4))
                    fail_msg("mode %d, beam in view %d, %g:%g: %.6f instead of %.6f", mode, beam_in_view,
                             GRID[k][0], GRID[k][1], mean, truth);
            }
            finish(&f);
        }
}

static double common_variance(const struct point *p, int band, const char *prefix) {
    double sum = 0;
    for (int k = 0; k < p->n_common; k++)
        if (strncmp(p->common[k].name, prefix, strlen(prefix)) == 0)
            sum += band < 0 ? p->common[k].mean * p->common[k].mean
                            : p->common[k].sensitivity[band] * p->common[k].sensitivity[band];
    return sum;
}

struct pulls {
    int n;
    double sum, sum2;
};

static void add_pull(struct pulls *p, double pull) {
    p->n++;
    p->sum += pull;
    p->sum2 += pull * pull;
}

/* The seed is another in every run: 5.6 sigma for either moment of normal pulls, in 13 judgements, are a false alarm in
 * one run of 3 million. The variance is a chi square over n, whose cube root is normal to far in its tails (Wilson and
 * Hilferty 1931); taken as normal itself, it would be too high far more often. */
#define SIGMAS 5.6

static void judge(const struct pulls *p, const char *name) {
    double mean = p->sum / p->n, var = p->sum2 / p->n, narrow = 2 / (9.0 * p->n);
    printf("# %s: mean pull %.3f, variance %.3f of %d\n", name, mean, var, p->n);
    assert_true(fabs(mean) < SIGMAS / sqrt(p->n));
    assert_true(fabs(cbrt(var) - (1 - narrow)) < SIGMAS * sqrt(narrow));
}

#define CAMPAIGNS 380 /* a variance of 1.4 stands out as it would by 5 sigma of 300 */

/* Each campaign: one dark for both, open, sample, close; noise alone, so all that may differ is in the budget. */
static void noise_is_what_the_budget_says(void **state) {
    (void)state;
    uint64_t seed = test_seed((uint64_t)time(NULL));
    struct pulls mean = {0}, blue = {0}, green = {0}, pair = {0};
    double f_sum = 0;
    int noisy = 0;
    for (int c = 0; c < CAMPAIGNS; c++) {
        struct fixture f;
        start(&f, seed + 1000003u * (uint64_t)c, false, REFERENCE_FIXED);
        f.bench.sample_level = 0.1;
        take_dark(&f, 60000);
        take_control(&f, 45, 0, 0, f.bracket = 1);
        take(&f, EXPOSURE_SAMPLE, 45, 30, 60000);
        synthetic_wait(&f.bench, 20);
        take_control(&f, 45, 0, 1, 0);
        const struct point *p = final_of(&f, 0);
        double var = p->mean_u_ind * p->mean_u_ind + common_variance(p, -1, "reference") +
                     common_variance(p, -1, "dark");
        add_pull(&mean, (p->mean - true_mean(&f, 45, 30)) / sqrt(var));
        double away[BANDS];
        for (int b = 0; b < BANDS; b++)
            away[b] = p->beta[b] - synthetic_sample_beta(&f.bench, 45, 30, band_nm(b));
        add_pull(&blue, away[6] / sqrt(p->u_ind[6] * p->u_ind[6] + common_variance(p, 6, "reference") +
                                       common_variance(p, 6, "dark")));
        double v34 = p->u_ind[34] * p->u_ind[34], v35 = p->u_ind[35] * p->u_ind[35];
        add_pull(&green,
                 away[34] / sqrt(v34 + common_variance(p, 34, "reference") + common_variance(p, 34, "dark")));
        /* The sum of neighbours feels cov_next: leave it out and this variance is 1.4. The dark and the reference are
         * resampled as the sample is, so that their bands go together as far as its bands do. */
        double commons = common_variance(p, 34, "reference") + common_variance(p, 35, "reference") +
                         common_variance(p, 34, "dark") + common_variance(p, 35, "dark");
        double together = p->cov_next[34] / sqrt(v34 * v35);
        add_pull(&pair,
                 (away[34] + away[35]) / sqrt((v34 + v35) + 2 * p->cov_next[34] + commons * (1 + together)));
        f_sum += p->scan_f;
        noisy += p->noisy;
        finish(&f);
    }
    judge(&mean, "visible mean");
    judge(&blue, "410 nm");
    judge(&green, "550 nm");
    judge(&pair, "550 + 555 nm");
    printf("# mean F %.4f, %d of %d sets judged noisy\n", f_sum / CAMPAIGNS, noisy, CAMPAIGNS);
    assert_true(fabs(f_sum / CAMPAIGNS - 1) < 0.01); /* scatters by 0.0013 */
    assert_true(noisy <= 6); /* one in 1,000: Poisson with 0.38 has more in one run of 6 million */
}

/* Two exposure times, noise and a lamp that wanders in between: the error found scatters about 0 by its u. */
static void the_overlap_scatters_as_its_u_says(void **state) {
    (void)state;
    uint64_t seed = test_seed((uint64_t)time(NULL));
    struct pulls pulls = {0};
    double u = 0;
    for (int c = 0; c < CAMPAIGNS; c++) {
        struct fixture f;
        start(&f, seed + 7919u * (uint64_t)c, false, REFERENCE_FIXED);
        f.bench.lamp_rate = f.setup.drift_rate_prior;
        take_dark(&f, 100000);
        take_dark(&f, 25000);
        for (int k = 0; k < 2; k++) {
            struct exposure x;
            synthetic_expose(&f.bench, EXPOSURE_OVERLAP, 45, 0, k ? 25000 : 100000, &x);
            x.step = 1;
            give(&f, &x);
            synthetic_wait(&f.bench, 5);
        }
        add_pull(&pulls, f.seen.linearity.error_rel / f.seen.linearity.u_error_rel);
        u += f.seen.linearity.u_error_rel / CAMPAIGNS;
        finish(&f);
    }
    judge(&pulls, "linearity");
    printf("# u of the error at full scale: %.2g\n", u);
    assert_true(u > 0);
}

static void scatter_beyond_the_model_is_told_and_paid_for(void **state) {
    (void)state;
    struct fixture quiet, noisy;
    for (int k = 0; k < 2; k++) {
        struct fixture *f = k ? &noisy : &quiet;
        start(f, 5, false, REFERENCE_FIXED);
        f->bench.extra_noise = k ? 1.5 : 1;
        run_grid(f);
    }
    const struct point *a = final_of(&quiet, 2), *b = final_of(&noisy, 2);
    assert_false(a->noisy);
    assert_true(b->noisy);
    assert_true(fabs(b->scan_f / 2.25 - 1) < 0.1);
    assert_true(fabs(b->u_ind[40] / a->u_ind[40] / 1.5 - 1) < 0.1);
    finish(&quiet);
    finish(&noisy);
}

/* What the reduction makes of the sample where nothing drifts: the truth but for bands and rounding, 4e-5 here. */
static double still_mean(void) {
    struct fixture f;
    start(&f, 1, false, REFERENCE_FIXED);
    silence(&f);
    f.bench.n_scans = 1;
    take_dark(&f, 60000);
    take_control(&f, 45, 0, 0, f.bracket = 1);
    take(&f, EXPOSURE_SAMPLE, 45, 30, 60000);
    take_control(&f, 45, 0, 1, 0);
    double mean = final_of(&f, 0)->mean;
    finish(&f);
    return mean;
}

/* Drift alone, many brackets: the rate is found, and the bridge's variance is what final points scatter by. */
static void drift_is_what_the_bridge_says(void **state) {
    (void)state;
    uint64_t seed = test_seed((uint64_t)time(NULL));
    const double rate = 4e-8, still = still_mean();
    struct pulls bridged = {0};
    double rates = 0;
    for (int c = 0; c < 20; c++) {
        struct fixture f;
        start(&f, seed + 77u * (uint64_t)c, false, REFERENCE_FIXED);
        silence(&f);
        f.bench.lamp_rate = rate;
        f.bench.n_scans = 1;
        take_dark(&f, 60000);
        take_control(&f, 45, 0, 0, f.bracket = 1);
        for (int k = 0; k < 25; k++) {
            take(&f, EXPOSURE_SAMPLE, 45, 30, 60000);
            synthetic_wait(&f.bench, 40);
            take_control(&f, 45, 0, f.bracket, f.bracket + 1);
            const struct point *p = final_of(&f, k);
            double t = (double)(f.seen.last.close_us - f.seen.last.open_us) * 1e-6, tau = p->tau_us * 1e-6;
            add_pull(&bridged, (p->mean / still - 1) / sqrt(rate * tau * (t - tau) / t));
            f.bracket++;
        }
        rates += f.seen.last.mean_rate / 20;
        finish(&f);
    }
    judge(&bridged, "bridge");
    printf("# rate %.3g, true %.3g\n", rates, rate);
    /* 25 intervals with 2 of a small prior: 25/27 of the truth, spread sqrt(2/25)/sqrt(20) = 6.3 %, as a chi square
     * of 500 degrees of freedom. */
    double narrow = 2 / (9.0 * 500);
    assert_true(fabs(cbrt(rates / (rate * 25 / 27)) - (1 - narrow)) < SIGMAS * sqrt(narrow));
}

/* NaN is a value here: the same bits. */
static bool same_bits(const double *a, const double *b, int n) {
    uint64_t x, y;
    for (int i = 0; i < n; i++) {
        memcpy(&x, &a[i], sizeof x);
        memcpy(&y, &b[i], sizeof y);
        if (x != y)
            return false;
    }
    return true;
}

static bool same_point(const struct point *a, const struct point *b) {
    bool same = a->id == b->id && a->supersedes == b->supersedes && a->n_common == b->n_common &&
                same_bits(a->u_ind, b->u_ind, BANDS) && same_bits(a->beta, b->beta, BANDS) &&
                same_bits(a->cov_next, b->cov_next, BANDS) && same_bits(&a->mean, &b->mean, 1) &&
                same_bits(&a->mean_u_ind, &b->mean_u_ind, 1) && a->tau_us == b->tau_us &&
                same_bits(&a->scan_f, &b->scan_f, 1);
    for (int k = 0; same && k < a->n_common; k++)
        same = same_bits(a->common[k].sensitivity, b->common[k].sensitivity, BANDS) &&
               same_bits(&a->common[k].mean, &b->common[k].mean, 1) &&
               strcmp(a->common[k].name, b->common[k].name) == 0;
    return same;
}

/* The stored rows through the same reducer: the same bytes, ended brackets included. */
static void a_replay_gives_the_same_bytes(void **state) {
    (void)state;
    char folder[64], path[96];
    struct err e = {0};
    struct fixture f, again;
    row_make_folder(folder, path);
    start(&f, 9, false, REFERENCE_FIXED);
    start(&again, 9, false, REFERENCE_FIXED);
    assert_int_equal(session_create(&f.session, path, &e), 0);
    f.bench.lamp_rate = 1e-8;
    run_grid(&f);
    take_control(&f, 45, 0, 0, ++f.bracket);
    take(&f, EXPOSURE_SAMPLE, 45, 30, 150000);
    assert_int_equal(reducer_end_bracket(f.r, "pause", &f.sink, NULL, NULL, &e), 0);
    assert_int_equal(session_add_bracket(f.session, &f.seen.last, &e), 0);
    take_dark(&f, 60000);
    take_control(&f, 45, 0, 0, ++f.bracket);
    take(&f, EXPOSURE_SAMPLE, 45, 30, 150000);
    take_control(&f, 45, 0, f.bracket, 0);
    if (reduce_replay(f.session, again.r, &again.sink, &e) < 0)
        fail_msg("%s", e.text);
    assert_int_equal(again.seen.n_points, f.seen.n_points);
    assert_int_equal(again.seen.n_points, 2 * GRID_POINTS + 3);
    for (int k = 0; k < f.seen.n_points; k++)
        if (!same_point(&f.seen.point[k], &again.seen.point[k]))
            fail_msg("point %d differs", k + 1);
    assert_int_equal(session_close(f.session, &e), 0);
    finish(&f);
    finish(&again);
    row_remove_folder(folder);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(four_modes_agree_in_both_fillings),
        cmocka_unit_test(noise_is_what_the_budget_says),
        cmocka_unit_test(the_overlap_scatters_as_its_u_says),
        cmocka_unit_test(scatter_beyond_the_model_is_told_and_paid_for),
        cmocka_unit_test(drift_is_what_the_bridge_says),
        cmocka_unit_test(a_replay_gives_the_same_bytes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
