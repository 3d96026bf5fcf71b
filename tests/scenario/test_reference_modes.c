/* The four reference modes of measurement.md 1, through the whole chain and for both filling cases: each against the
 * truth with everything drawn, and against each other where zeros and certificate are as stated. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/support/lab.h"
#include "tests/support/truth_check.h"

#define MODES 4
#define SEEDS 2
#define INCIDENCES "[15, 45, 60]"
#define VIEWS "{from: -60, to: 60, step: 15}"
#define U_REPEAT_DEG 0.002 /* as sim_config_default and the profile om-az state them */
#define U_ZERO_DEG 0.01
#define SAME_UDEG 20000

static const char *const MODE[MODES] = {"fixed", "per_incidence", "every_geometry", "start_end"};

struct tally {
    int n;
    double sum, sum2, worst;
};

static void count(struct tally *t, double pull) {
    t->n++;
    t->sum += pull;
    t->sum2 += pull * pull;
    t->worst = fmax(t->worst, fabs(pull));
}

static void print_tally(const char *what, const char *which, const struct tally *t) {
    print_message("# %s %s: %d values, mean %.2f, rms %.2f, worst %.1f\n", what, which, t->n, t->sum / t->n,
                  sqrt(t->sum2 / t->n), t->worst);
}

/* ---- one campaign ---- */

static char *bench_text(bool beam_in_view) {
    static const char turned[] = "beam_mm: 3, view_mm: 20, filling: beam-in-view";
    char *text = lab_bare_bench_text();
    char *optics = strstr(text, "beam_mm: 20, view_mm: 3, filling: view-in-beam");
    assert_non_null(optics);
    if (beam_in_view)
        memcpy(optics, turned, strlen(turned));
    return text;
}

/* The estimation has to know how K depends on the angles. */
static void check_fit_setup(struct session *s, bool beam_in_view, int mode) {
    char *text = NULL;
    assert_int_equal(session_get_text(s, "fit_setup", &text, NULL), 0);
    assert_non_null(strstr(text, beam_in_view ? "\"beam-in-view\"" : "\"view-in-beam\""));
    assert_non_null(strstr(text, MODE[mode]));
    free(text);
}

static void measure_with(struct truth_check *c, int mode, const struct simulate_options *options) {
    static struct lab lab;
    char dir[96], name[192];
    char *config = bench_text(c->beam_in_view), *job = lab_job_text("modes", INCIDENCES, VIEWS, MODE[mode]);
    c->own_reference = mode == 2;
    c->u_source_deg = c->u_sample_deg = c->nominal ? U_REPEAT_DEG : hypot(U_REPEAT_DEG, U_ZERO_DEG);
    lab_make_dir(dir);
    lab_open(&lab, dir, options, config);
    lab_job(&lab, job);
    lab_run(&lab);
    assert_int_equal(lab.ended, CAMPAIGN_DONE);
    assert_true(lab_session(&lab, 0, name));
    struct session *s = lab_open_session(&lab, name);
    check_fit_setup(s, c->beam_in_view, mode);
    truth_check_load(c, s);
    session_close(s, NULL);
    lab_close(&lab);
    lab_remove_dir(dir);
    free(config);
    free(job);
}

static void measure(struct truth_check *c, int mode, int seed) {
    measure_with(c, mode, &(struct simulate_options){.seed = (uint64_t)seed, .nominal = c->nominal});
}

static const struct sim_surface *truth(void) {
    static struct sim_surface surface;
    assert_int_equal(sim_paint_find("Hooker's Green", "acrylic board", 0, &surface, NULL), 0);
    return &surface;
}

/* ---- against the truth ---- */

static void check_truth(bool beam_in_view) {
    static struct truth_check c;
    for (int mode = 0; mode < MODES; mode++) {
        struct tally t = {0};
        for (int seed = 1; seed <= SEEDS; seed++) {
            c = (struct truth_check){.truth = truth(), .beam_in_view = beam_in_view};
            measure(&c, mode, seed);
            assert_true(c.n_points >= 22);
            for (int i = 0; i < c.n_points; i++)
                count(&t, truth_check_pull(&c, &c.point[i], TRUTH_MEAN));
        }
        print_tally(beam_in_view ? "beam in view" : "view in beam", MODE[mode], &t);
        /* the certificate's factor moves all values of a seed together: few draws, not hundreds */
        assert_true(fabs(t.sum / t.n) < 4 / sqrt(SEEDS) && t.worst < 5);
    }
}

static void view_in_beam_tells_the_truth(void **state) {
    (void)state;
    check_truth(false);
}

static void beam_in_view_tells_the_truth(void **state) {
    (void)state;
    check_truth(true);
}

/* Without noise, drift and draws only the spectrometer's stray light is left, to its last share: also on the flanks of
 * the paint's colour, where the lamp's own slope inside a band would show (1 % at 445 nm if nothing took it off). */
static void a_quiet_bench_leaves_stray_light_alone(void **state) {
    (void)state;
    static struct truth_check c;
    double worst = 0;
    c = (struct truth_check){.truth = truth(), .nominal = true};
    measure_with(&c, 2, &(struct simulate_options){.seed = 1, .quiet = true});
    for (int i = 0; i < c.n_points; i++)
        for (int band = TRUTH_FIRST; band <= TRUTH_LAST; band++) {
            const struct point *p = &c.point[i];
            double off = p->beta[band] - truth_check_true(&c, p, band), beta = p->beta[band];
            for (int k = 0; k < p->n_common; k++)
                if (!strcmp(p->common[k].name, "stray"))
                    off -= p->common[k].sensitivity[band];
            worst = fmax(worst, fabs(off) / (3e-4 * beta + 3e-5)); /* counts are rounded */
        }
    print_message("# worst rest: %.2f of what is allowed\n", worst);
    assert_true(worst > 0 && worst < 1);
}

/* ---- against each other ---- */

static const struct point *same_geometry(const struct truth_check *c, const struct point *p) {
    for (int i = 0; i < c->n_points; i++)
        if (abs(c->point[i].theta_i_udeg - p->theta_i_udeg) < SAME_UDEG &&
            abs(c->point[i].theta_v_udeg - p->theta_v_udeg) < SAME_UDEG)
            return &c->point[i];
    return NULL;
}

/* Readbacks differ by a step or so: each value is taken relative to the truth at its own. No two campaigns have the
 * seed in common, so that nothing they share can hide a difference. */
static void compare(struct tally *t, const struct truth_check *a, const struct truth_check *b) {
    for (int i = 0; i < a->n_points; i++) {
        const struct point *p = &a->point[i], *q = same_geometry(b, p);
        assert_non_null(q);
        double d =
            p->mean / truth_check_true(a, p, TRUTH_MEAN) - q->mean / truth_check_true(b, q, TRUTH_MEAN);
        double u2 = truth_check_variance(a, p, TRUTH_MEAN) / (p->mean * p->mean) +
                    truth_check_variance(b, q, TRUTH_MEAN) / (q->mean * q->mean);
        count(t, d / sqrt(u2));
    }
}

static void check_agreement(bool beam_in_view) {
    static struct truth_check c[MODES];
    struct tally of[MODES][MODES] = {0};
    for (int seed = 1; seed <= SEEDS; seed++) {
        for (int mode = 0; mode < MODES; mode++) {
            c[mode] = (struct truth_check){.truth = truth(), .beam_in_view = beam_in_view, .nominal = true};
            measure(&c[mode], mode, MODES * seed + mode);
        }
        for (int a = 0; a < MODES; a++)
            for (int b = 0; b < a; b++)
                compare(&of[a][b], &c[a], &c[b]);
    }
    for (int a = 0; a < MODES; a++)
        for (int b = 0; b < a; b++) {
            char which[64];
            snprintf(which, sizeof which, "%s - %s", MODE[a], MODE[b]);
            print_tally(beam_in_view ? "beam in view" : "view in beam", which, &of[a][b]);
            assert_true(of[a][b].worst < 5 && of[a][b].sum2 / of[a][b].n < 1.5 * 1.5);
        }
}

static void modes_agree_with_the_view_in_the_beam(void **state) {
    (void)state;
    check_agreement(false);
}

static void modes_agree_with_the_beam_in_the_view(void **state) {
    (void)state;
    check_agreement(true);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(view_in_beam_tells_the_truth),
        cmocka_unit_test(beam_in_view_tells_the_truth),
        cmocka_unit_test(a_quiet_bench_leaves_stray_light_alone),
        cmocka_unit_test(modes_agree_with_the_view_in_the_beam),
        cmocka_unit_test(modes_agree_with_the_beam_in_the_view),
    };
    return cmocka_run_group_tests_name("reference_modes", tests, NULL, NULL);
}
