/* A recorded session against the simulated bench. What must be equal with its own truth and seed: every row of point,
 * point_band, point_common and bracket, derived from the counts of both, to the last bit. What was altered must be
 * found, and called by its name. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <sqlite3.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/replay.h"
#include "tests/support/lab.h"

#define INCIDENCES "[20, 40]"
#define VIEWS "{from: -60, to: 60, step: 6}"
#define N_POINTS_MIN 38

struct fixture {
    char dir[96];
    char path[320];
    struct lab lab;
};

static void record(struct fixture *f, uint64_t seed, const char *mode, int interrupt_at) {
    const struct simulate_options truth = {.seed = seed};
    char name[192], *text = lab_job_text("replayed", INCIDENCES, VIEWS, mode);
    lab_make_dir(f->dir);
    lab_open(&f->lab, f->dir, &truth, NULL);
    if (interrupt_at)
        lab_script(&f->lab, (struct lab_line){.steps = interrupt_at,
                                              .state = CAMPAIGN_RUNNING,
                                              .command = COMMAND_INTERRUPT});
    lab_job(&f->lab, text);
    lab_run(&f->lab);
    lab_close(&f->lab);
    free(text);
    assert_true(lab_session(&f->lab, 0, name));
    snprintf(f->path, sizeof f->path, "%s/%s.gonio", f->dir, name);
    if (!interrupt_at)
        return;
    lab_open(&f->lab, f->dir, &truth, NULL);
    lab_resume(&f->lab, name);
    lab_run(&f->lab);
    lab_close(&f->lab);
}

static void replay(struct fixture *f, enum replay_surface surface, struct replay *r) {
    const struct replay_options options = {.surface = surface};
    struct err e = {0};
    if (replay_run(r, f->path, &options, &e) < 0)
        fail_msg("%s", e.text);
    print_message(
        "# %d points, chi2 per point %.2f (limit %.2f), median %.2f u, along %.2f, factor %.5f, cause %d\n",
        r->n, r->chi2 / r->n, r->chi2_limit / r->n, r->median_z, r->along, r->factor, r->cause);
    assert_true(r->n >= N_POINTS_MIN);
    assert_int_equal(r->n_missing, 0);
}

static int remove_fixture(void **state) {
    struct fixture *f = *state;
    lab_remove_dir(f->dir);
    return 0;
}

static int make_fixture(void **state) {
    static struct fixture f;
    memset(&f, 0, sizeof f);
    record(&f, 1, "fixed", 0);
    *state = &f;
    return 0;
}

static int make_every_geometry(void **state) {
    static struct fixture f;
    memset(&f, 0, sizeof f);
    record(&f, 4, "every_geometry", 0);
    *state = &f;
    return 0;
}

static int make_resumed(void **state) {
    static struct fixture f;
    memset(&f, 0, sizeof f);
    record(&f, 2, "fixed", 21);
    *state = &f;
    return 0;
}

/* ---- tampering ---- */

static sqlite3 *unlock(const struct fixture *f) {
    static const char guards[] =
        "DROP TRIGGER IF EXISTS exposure_no_update; DROP TRIGGER IF EXISTS fact_no_update";
    sqlite3 *db;
    assert_int_equal(sqlite3_open(f->path, &db), SQLITE_OK);
    assert_int_equal(sqlite3_exec(db, guards, NULL, NULL, NULL), SQLITE_OK);
    return db;
}

static void scale_counts(sqlite3 *db, sqlite3_int64 id, double factor) {
    sqlite3_blob *blob;
    assert_int_equal(sqlite3_blob_open(db, "main", "exposure", "counts", id, 1, &blob), SQLITE_OK);
    int size = sqlite3_blob_bytes(blob);
    uint16_t *counts = malloc(size);
    assert_int_equal(sqlite3_blob_read(blob, counts, size, 0), SQLITE_OK);
    for (int i = 0; i < size / 2; i++)
        counts[i] = (uint16_t)lround(counts[i] * factor);
    assert_int_equal(sqlite3_blob_write(blob, counts, size, 0), SQLITE_OK);
    assert_int_equal(sqlite3_blob_close(blob), SQLITE_OK);
    free(counts);
}

/* Of the sample readings that are not saturated: the n-th alone, or (n < 0) all. Returns the last id. */
static sqlite3_int64 scale_samples(const struct fixture *f, int n, double factor) {
    sqlite3 *db = unlock(f);
    sqlite3_stmt *rows;
    sqlite3_int64 id = 0;
    assert_int_equal(sqlite3_prepare_v2(
                         db,
                         "SELECT id FROM exposure WHERE kind = 'sample' AND saturated_pixels = 0 ORDER BY id",
                         -1, &rows, NULL),
                     SQLITE_OK);
    for (int i = 0; sqlite3_step(rows) == SQLITE_ROW; i++)
        if (n < 0 || i == n)
            scale_counts(db, id = sqlite3_column_int64(rows, 0), factor);
    sqlite3_finalize(rows);
    assert_int_equal(sqlite3_close(db), SQLITE_OK);
    return id;
}

static void edit_facts(const struct fixture *f, const char *sql) {
    sqlite3 *db = unlock(f);
    assert_int_equal(sqlite3_exec(db, sql, NULL, NULL, NULL), SQLITE_OK);
    assert_int_equal(sqlite3_close(db), SQLITE_OK);
}

/* ---- tests ---- */

static void own_truth_and_seed_give_the_same_bytes(void **state) {
    struct replay r;
    replay(*state, REPLAY_TRUTH, &r);
    assert_true(r.identical);
    assert_int_equal(r.cause, REPLAY_AGREES);
    for (int i = 0; i < r.n; i++)
        assert_true(r.point[i].measured == r.point[i].simulated);
    replay_free(&r);
}

static void another_seed_agrees_but_is_not_the_same(void **state) {
    struct fixture *f = *state;
    for (uint64_t seed = 11; seed < 13; seed++) {
        const struct replay_options options = {.surface = REPLAY_ESTIMATE, .has_seed = true, .seed = seed};
        struct replay r;
        assert_int_equal(replay_run(&r, f->path, &options, NULL), 0);
        assert_int_equal(r.cause, REPLAY_AGREES);
        assert_false(r.identical);
        assert_true(r.chi2 > 0.3 * r.n && r.within_2u > 0.8);
        replay_free(&r);
    }
}

static void the_estimate_agrees(void **state) {
    struct replay r;
    replay(*state, REPLAY_ESTIMATE, &r);
    assert_false(r.identical);
    assert_int_equal(r.cause, REPLAY_AGREES);
    replay_free(&r);
}

static void a_resumed_session_agrees(void **state) {
    struct replay r;
    replay(*state, REPLAY_TRUTH, &r);
    assert_int_equal(r.cause, REPLAY_AGREES);
    replay_free(&r);
    replay(*state, REPLAY_ESTIMATE, &r);
    assert_int_equal(r.cause, REPLAY_AGREES);
    replay_free(&r);
}

static void an_altered_point_is_found(void **state) {
    static const enum replay_surface surface[] = {REPLAY_TRUTH, REPLAY_ESTIMATE};
    sqlite3_int64 id = scale_samples(*state, 9, 1.03);
    for (int i = 0; i < 2; i++) {
        struct replay r;
        int worst = 0;
        replay(*state, surface[i], &r);
        assert_int_equal(r.cause, REPLAY_POINTS);
        assert_int_equal(r.n_beyond, 1);
        assert_false(r.identical);
        for (int k = 1; k < r.n; k++)
            if (fabs(r.point[k].t) > fabs(r.point[worst].t))
                worst = k;
        assert_int_equal(r.point[worst].exposure_id, id);
        assert_true(r.point[worst].t > REPLAY_Z_MAX);
        replay_free(&r);
    }
}

static void a_common_factor_is_called_one(void **state) {
    struct replay r;
    scale_samples(*state, -1, 1.02);
    replay(*state, REPLAY_TRUTH, &r);
    assert_int_equal(r.cause, REPLAY_FACTOR);
    assert_true(fabs(r.factor - 1.02) < 0.003);
    replay_free(&r);
}

static void another_surface_is_called_a_model_error(void **state) {
    struct replay r;
    edit_facts(*state, "UPDATE fact SET value = json_set(value, '$.sigma', 0.5) WHERE key = 'truth'");
    replay(*state, REPLAY_TRUTH, &r);
    assert_int_equal(r.cause, REPLAY_MODEL);
    assert_true(r.along > r.along_limit);
    replay_free(&r);
}

static void what_is_not_recorded_cannot_be_replayed(void **state) {
    static const char *const key[] = {"truth", "job", "config", "certificate", "fit_setup"};
    struct fixture *f = *state;
    const struct replay_options options = {.surface = REPLAY_TRUTH};
    for (size_t i = 0; i < sizeof key / sizeof *key; i++) {
        struct replay r;
        struct err e = {0};
        char sql[120];
        snprintf(sql, sizeof sql, "UPDATE fact SET key = 'gone' WHERE key = '%s'", key[i]);
        edit_facts(f, sql);
        assert_int_equal(replay_run(&r, f->path, &options, &e), -ERR_INPUT);
        assert_non_null(strstr(e.text, key[i]));
        replay_free(&r);
        snprintf(sql, sizeof sql, "UPDATE fact SET key = '%s' WHERE key = 'gone'", key[i]);
        edit_facts(f, sql);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(own_truth_and_seed_give_the_same_bytes, make_fixture, remove_fixture),
        cmocka_unit_test_setup_teardown(own_truth_and_seed_give_the_same_bytes, make_every_geometry,
                                        remove_fixture),
        cmocka_unit_test_setup_teardown(another_seed_agrees_but_is_not_the_same, make_fixture,
                                        remove_fixture),
        cmocka_unit_test_setup_teardown(the_estimate_agrees, make_every_geometry, remove_fixture),
        cmocka_unit_test_setup_teardown(a_resumed_session_agrees, make_resumed, remove_fixture),
        cmocka_unit_test_setup_teardown(an_altered_point_is_found, make_fixture, remove_fixture),
        cmocka_unit_test_setup_teardown(a_common_factor_is_called_one, make_fixture, remove_fixture),
        cmocka_unit_test_setup_teardown(another_surface_is_called_a_model_error, make_fixture,
                                        remove_fixture),
        cmocka_unit_test_setup_teardown(what_is_not_recorded_cannot_be_replayed, make_fixture,
                                        remove_fixture),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
