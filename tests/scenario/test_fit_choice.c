/* A job that asks for all models, and for another loss: what is measured, fitted, stored and shown of it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/verbs.h"
#include "tests/support/lab.h"

static char dir[96], name[192];

/* One small campaign with this as its last line. */
static struct session *measured(const char *fit) {
    static struct lab lab;
    char *job = lab_job_text("choice", "[20, 40, 60]", "{from: -60, to: 75, step: 15}", "every_geometry");
    char *line = strstr(job, "fit: {model: composite}");
    char whole[2000];
    assert_non_null(line);
    snprintf(whole, sizeof whole, "%.*s%s\n", (int)(line - job), job, fit);
    lab_make_dir(dir);
    lab_open(&lab, dir, &(struct simulate_options){.seed = 1}, NULL);
    lab_job(&lab, whole);
    lab_run(&lab);
    assert_int_equal(lab.ended, CAMPAIGN_DONE);
    assert_true(lab_session(&lab, 0, name));
    struct session *s = lab_open_session(&lab, name);
    lab_close(&lab);
    free(job);
    return s;
}

static void show(const char *option) {
    char path[320];
    snprintf(path, sizeof path, "%s/%s.gonio", dir, name);
    char *text[] = {"show", path, (char *)option, NULL};
    assert_int_equal(verb_show(option ? 3 : 2, text), 0);
}

static int take_model(void *arg, int64_t us, int64_t last_point_id, const struct estimate *m) {
    int *composite = arg;
    (void)us;
    (void)last_point_id;
    *composite += strcmp(m->model, "composite") == 0;
    return 0;
}

static void all_models_are_compared_at_the_end(void **state) {
    (void)state;
    struct session *s = measured("fit: {model: all}");
    struct estimate last, first;
    struct err e = {0};
    struct session_summary summary;
    char *text;
    int composite = 0;
    assert_int_equal(session_last_models(s, &text, &e), 0);
    assert_non_null(text);
    json_t *models = json_loads(text, 0, NULL);
    assert_int_equal(json_array_size(models), 7);
    const json_t *best = json_array_get(models, 0);
    assert_true(json_is_true(json_object_get(best, "recommended")));
    assert_int_equal(session_last_estimate(s, &last, &e), 0);
    assert_int_equal(estimate_from_json(json_object_get(best, "estimate"), &first, &e), 0);
    assert_string_equal(first.model, last.model);
    assert_string_equal(last.model, "composite"); /* what the simulated paint is */
    assert_memory_equal(first.value, last.value, sizeof first.value);
    assert_true(last.loio > 0);
    assert_int_equal(session_each_estimate(s, take_model, &composite, &e), 0);
    assert_int_equal(session_get_summary(s, &summary, &e), 0);
    assert_int_equal(composite, summary.n_estimates); /* while measuring too */
    for (size_t i = 0; i < 7; i++)
        assert_true(*json_string_value(json_object_get(json_array_get(models, i), "why")) ||
                    !json_is_true(json_object_get(json_object_get(json_array_get(models, i), "estimate"),
                                                  "converged")));
    session_close(s, NULL);
    show(NULL);
    json_decref(models);
    free(text);
    lab_remove_dir(dir);
}

static void the_loss_of_the_job_is_minimised(void **state) {
    (void)state;
    struct session *s = measured("fit: {model: composite, loss: log}");
    struct estimate m;
    struct err e = {0};
    char *text;
    assert_int_equal(session_last_estimate(s, &m, &e), 0);
    assert_true(m.converged);
    assert_int_equal(m.minimised, MATERIAL_LOSS_LOG);
    assert_int_equal(session_last_models(s, &text, &e), 0);
    assert_null(text);
    session_close(s, NULL);
    show("--json");
    lab_remove_dir(dir);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_models_are_compared_at_the_end),
        cmocka_unit_test(the_loss_of_the_job_is_minimised),
    };
    return cmocka_run_group_tests_name("fit_choice", tests, NULL, NULL);
}
