/* Impatient people: a pause is asked for again before it has been reached, or taken back, or falls into the
 * preparations. Whatever comes, nothing is lost and the campaign ends done. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/support/lab.h"

#define N_POINTS 4

static int count_point(void *arg, const struct point *p) {
    *(int *)arg += !p->provisional;
    return 0;
}

static void run_script(const struct lab_line *line, int n) {
    static struct lab lab;
    char dir[96], name[192], *job = lab_job_text("hasty", "[20]", "[0, 15, 30, 45]", "fixed");
    int points = 0;
    lab_make_dir(dir);
    lab_open(&lab, dir, &lab_seed1, NULL);
    for (int i = 0; i < n; i++)
        lab_script(&lab, line[i]);
    lab_job(&lab, job);
    free(job);
    lab_run(&lab);
    assert_int_equal(lab.ended, CAMPAIGN_DONE);
    assert_false(lab_session(&lab, 1, name));
    assert_true(lab_session(&lab, 0, name));
    struct session *s = lab_open_session(&lab, name);
    assert_int_equal(session_each_point(s, false, count_point, &points, NULL), 0);
    session_close(s, NULL);
    assert_int_equal(points, N_POINTS);
    lab_close(&lab);
    lab_remove_dir(dir);
}

static const enum campaign_command pauses[] = {COMMAND_PAUSE, COMMAND_PAUSE_NOW, COMMAND_STOP};

/* Each kind after each, while preparing and while measuring. */
static void asked_for_twice(void **state) {
    (void)state;
    for (int prepared = 0; prepared < 2; prepared++)
        for (int first = 0; first < 3; first++)
            for (int second = 0; second < 3; second++) {
                const struct lab_line line[] = {
                    {.steps = 3 * prepared,
                     .state = prepared ? CAMPAIGN_RUNNING : CAMPAIGN_PREPARING,
                     .command = pauses[first]},
                    {.state = CAMPAIGN_STATES, .command = pauses[second]},
                    {.state = CAMPAIGN_PAUSED, .command = COMMAND_RESUME},
                };
                run_script(line, 3);
            }
}

static void taken_back_before_it_is_reached(void **state) {
    (void)state;
    for (int first = 0; first < 3; first++) {
        const struct lab_line line[] = {
            {.steps = 3, .state = CAMPAIGN_RUNNING, .command = pauses[first]},
            {.state = CAMPAIGN_PAUSING, .command = COMMAND_RESUME},
        };
        run_script(line, 2);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(asked_for_twice),
                                       cmocka_unit_test(taken_back_before_it_is_reached)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
