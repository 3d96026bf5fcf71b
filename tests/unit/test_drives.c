/* What is recorded of a drive: by unit, for one text of its profile, and through a crash of the writer. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/drives.h"

static const struct config_axis unit1 = {.link = "rtu:/dev/ttyUSB0", .unit = 1};
static const struct config_axis unit2 = {.link = "rtu:/dev/ttyUSB0", .unit = 2};
static const struct profile before = {.id = "om-az", .hash = "0123456789abcdef"};
static const struct profile edited = {.id = "om-az", .hash = "fedcba9876543210"};

static int set_up(void **state) {
    static char dir[32];
    strcpy(dir, "/tmp/goniod-drives-XXXXXX");
    *state = mkdtemp(dir);
    return *state ? 0 : -1;
}

static int tear_down(void **state) {
    char command[64];
    snprintf(command, sizeof command, "rm -rf %s", (char *)*state);
    return system(command);
}

static void nothing_is_known_at_first(void **state) {
    assert_false(drives_commissioned(*state, &unit1, &before));
    assert_false(drives_position_valid(*state, &unit1, &before));
}

static void a_record_holds_for_its_unit_and_profile_only(void **state) {
    struct drive_record commissioned = {.commissioned = true, .position_valid = true, .utc_us = 1};
    assert_int_equal(drives_record(*state, &unit1, &before, &commissioned, NULL), 0);
    assert_true(drives_commissioned(*state, &unit1, &before));
    assert_true(drives_position_valid(*state, &unit1, &before));
    assert_false(drives_commissioned(*state, &unit2, &before));
    assert_false(drives_commissioned(*state, &unit1, &edited));
    assert_false(drives_position_valid(*state, &unit1, &edited));
}

static void losing_the_position_keeps_the_commissioning(void **state) {
    struct drive_record commissioned = {.commissioned = true, .position_valid = true}, lost = {0};
    assert_int_equal(drives_record(*state, &unit1, &before, &commissioned, NULL), 0);
    assert_int_equal(drives_record(*state, &unit1, &before, &lost, NULL), 0);
    assert_true(drives_commissioned(*state, &unit1, &before));
    assert_false(drives_position_valid(*state, &unit1, &before));
}

static void a_spoilt_file_counts_as_none(void **state) {
    char path[64];
    struct drive_record commissioned = {.commissioned = true};
    snprintf(path, sizeof path, "%s/drives.json", (char *)*state);
    FILE *f = fopen(path, "w");
    fputs("{\"rtu:/dev/ttyUSB0#1\": {\"hash\"", f);
    fclose(f);
    assert_false(drives_commissioned(*state, &unit1, &before));
    assert_int_equal(drives_record(*state, &unit1, &before, &commissioned, NULL), 0);
    assert_true(drives_commissioned(*state, &unit1, &before));
}

static void an_unwritable_folder_is_said(void **state) {
    (void)state;
    struct err e = {0};
    struct drive_record record = {0};
    assert_int_equal(drives_record("/nowhere/at/all", &unit1, &before, &record, &e), -ERR_IO);
    assert_non_null(strstr(e.text, "/nowhere/at/all/drives.json"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(nothing_is_known_at_first, set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_record_holds_for_its_unit_and_profile_only, set_up, tear_down),
        cmocka_unit_test_setup_teardown(losing_the_position_keeps_the_commissioning, set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_spoilt_file_counts_as_none, set_up, tear_down),
        cmocka_unit_test(an_unwritable_folder_is_said),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
