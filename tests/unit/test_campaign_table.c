/* Walks states x commands whole: every cell is filled in, and the promises of design 4 hold in each. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <string.h>

#include "daemon/campaign_table.h"

static const struct campaign_rule *rule(int state, int command) {
    return &campaign_table[state][command];
}

static void every_cell_answers(void **state) {
    (void)state;
    for (int s = 0; s < CAMPAIGN_STATES; s++)
        for (int c = 0; c < COMMANDS; c++) {
            const struct campaign_rule *r = rule(s, c);
            if (r->allowed)
                assert_in_range(r->next, 0, CAMPAIGN_STATES - 1);
            else if (!r->why || strlen(r->why) < 20)
                fail_msg("%s in %s is refused without a sentence", campaign_command_name(c),
                         campaign_state_name(s));
        }
}

static void names_are_unique(void **state) {
    (void)state;
    for (int a = 0; a < CAMPAIGN_STATES; a++)
        for (int b = 0; b < a; b++)
            assert_string_not_equal(campaign_state_name(a), campaign_state_name(b));
    for (int a = 0; a < COMMANDS; a++)
        for (int b = 0; b < a; b++)
            assert_string_not_equal(campaign_command_name(a), campaign_command_name(b));
}

/* Abort, interrupt and stop are never refused: a person at the bench must always be able to end a movement.
 */
static void the_bench_can_always_be_stopped(void **state) {
    (void)state;
    for (int s = 0; s < CAMPAIGN_STATES; s++) {
        assert_true(rule(s, COMMAND_ABORT)->allowed);
        assert_true(rule(s, COMMAND_INTERRUPT)->allowed);
        assert_true(rule(s, COMMAND_STOP)->allowed);
        if (!campaign_state_is_rest(s))
            assert_int_equal(rule(s, COMMAND_ABORT)->next, CAMPAIGN_ABORTING);
    }
}

static void hands_off_while_a_campaign_holds_the_bench(void **state) {
    (void)state;
    for (int s = 0; s < CAMPAIGN_STATES; s++)
        if (rule(s, COMMAND_MANUAL)->allowed)
            assert_true(campaign_state_is_rest(s));
}

static void a_job_queues_unless_goniod_ends(void **state) {
    (void)state;
    for (int s = 0; s < CAMPAIGN_STATES; s++)
        assert_int_equal(rule(s, COMMAND_RUN)->allowed, s != CAMPAIGN_INTERRUPTED);
}

static void pause_and_resume_are_a_pair(void **state) {
    (void)state;
    assert_int_equal(rule(CAMPAIGN_RUNNING, COMMAND_PAUSE)->next, CAMPAIGN_PAUSING);
    assert_int_equal(rule(CAMPAIGN_PAUSED, COMMAND_RESUME)->next, CAMPAIGN_RUNNING);
    assert_int_equal(rule(CAMPAIGN_PAUSING, COMMAND_RESUME)->next, CAMPAIGN_RUNNING);
    assert_int_equal(rule(CAMPAIGN_HELD, COMMAND_CONTINUE)->next, CAMPAIGN_RUNNING);
    for (int s = 0; s < CAMPAIGN_STATES; s++)
        assert_int_equal(rule(s, COMMAND_RESUME)->allowed, s == CAMPAIGN_PAUSED || s == CAMPAIGN_PAUSING);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_cell_answers),
        cmocka_unit_test(names_are_unique),
        cmocka_unit_test(the_bench_can_always_be_stopped),
        cmocka_unit_test(hands_off_while_a_campaign_holds_the_bench),
        cmocka_unit_test(a_job_queues_unless_goniod_ends),
        cmocka_unit_test(pause_and_resume_are_a_pair),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
