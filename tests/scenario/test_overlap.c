/* The overlap geometry of a campaign: a straight light path passes, a bent one is found, warned of and paid for. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "proto/session_linearity.h"
#include "tests/support/lab.h"

#define BEND 0.01

struct found {
    int n, warnings;
    struct linearity l;
    double part; /* the largest linearity part of a final point, over its beta */
};

static int see_linearity(void *arg, const struct linearity *l) {
    struct found *f = arg;
    f->l = *l;
    f->n++;
    return 0;
}

static int see_event(void *arg, int64_t us, const char *kind, const char *json) {
    struct found *f = arg;
    (void)us;
    f->warnings += !strcmp(kind, "warning") && strstr(json, "not linear") != NULL;
    return 0;
}

static int see_point(void *arg, const struct point *p) {
    struct found *f = arg;
    for (int k = 0; k < p->n_common; k++)
        if (!strcmp(p->common[k].name, "linearity"))
            f->part = fmax(f->part, fabs(p->common[k].mean / p->mean));
    return 0;
}

static void measure(const char *exposure, const struct simulate_options *truth, struct found *f) {
    struct lab lab;
    char dir[96], name[192], text[600];
    memset(f, 0, sizeof *f);
    lab_make_dir(dir);
    snprintf(
        text, sizeof text,
        "name: overlap\nsamples:\n  - {name: hg, holder: sample, paint: Hooker's Green, support: acrylic "
        "board,\n"
        "     size_mm: [120, 80]}\n  - {name: cr, holder: trap, paint: Cadmium Red, support: acrylic board,\n"
        "     size_mm: [120, 80]}\ngeometry: {theta_i_deg: [30], theta_v_deg: [-60, 0, 60]}\n"
        "exposure: {%s}\nreference: {certificate: ptfe.csv}\n",
        exposure);
    lab_open(&lab, dir, truth, NULL);
    lab_job(&lab, text);
    lab_run(&lab);
    assert_int_equal(lab.ended, CAMPAIGN_DONE);
    for (int n = 0; n < 2; n++) { /* the diffuser is shared: each session holds its readings, and the row */
        assert_true(lab_session(&lab, n, name));
        struct session *s = lab_open_session(&lab, name);
        assert_int_equal(session_each_linearity(s, see_linearity, f, NULL), 0);
        assert_int_equal(session_each_event(s, see_event, f, NULL), 0);
        assert_int_equal(session_each_point(s, false, see_point, f, NULL), 0);
        session_close(s, NULL);
    }
    lab_close(&lab);
    lab_remove_dir(dir);
    print_message("# %s: ratio %.5f, u %.5f; error %.5f of full scale, u %.5f; pull %.1f; taken %.2g\n",
                  exposure, f->l.ratio, f->l.u_ratio, f->l.error_rel, f->l.u_error_rel, f->l.pull,
                  f->l.used_rel);
}

static void a_straight_path_passes(void **state) {
    (void)state;
    struct found f;
    measure("min_ms: 4, max_ms: 5000", &(struct simulate_options){.seed = 1}, &f);
    assert_int_equal(f.n, 2);
    assert_int_equal(f.warnings, 0);
    assert_false(f.l.beyond);
    assert_true(f.l.long_us >= 4 * f.l.short_us);
    assert_true(f.l.u_ratio < 1e-3);
}

static void a_bent_path_is_found(void **state) {
    (void)state;
    struct found straight, bent;
    measure("min_ms: 4, max_ms: 5000", &(struct simulate_options){.seed = 1}, &straight);
    measure("min_ms: 4, max_ms: 5000", &(struct simulate_options){.seed = 1, .bend = BEND}, &bent);
    assert_true(bent.l.beyond);
    assert_int_equal(bent.warnings, 2); /* told once, written into both sessions */
    assert_true(fabs(bent.l.error_rel - BEND) < 4 * bent.l.u_error_rel);
    assert_true(bent.part > 10 * straight.part);
}

static void exposures_that_do_not_span_are_not_tested(void **state) {
    (void)state;
    struct found f;
    measure("min_ms: 60, max_ms: 200", &(struct simulate_options){.seed = 1}, &f);
    assert_int_equal(f.n, 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_straight_path_passes),
        cmocka_unit_test(a_bent_path_is_found),
        cmocka_unit_test(exposures_that_do_not_span_are_not_tested),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
