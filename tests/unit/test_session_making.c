/* How a session comes to its name, and what is left where it does not. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <dirent.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/support/session_rows.h"

/* Files in the folder whose names begin like this; hidden ones count. */
static int files_named(const char *beginning) {
    int n = 0;
    DIR *dir = opendir(row_folder);
    for (const struct dirent *d; (d = readdir(dir));)
        n += strncmp(d->d_name, beginning, strlen(beginning)) == 0;
    closedir(dir);
    return n;
}

static void a_session_gets_its_name_with_its_first_commit(void **state) {
    (void)state;
    struct session *s, *other;
    ROW_OK(session_create(&s, row_path, e));
    assert_int_not_equal(access(row_path, F_OK), 0);
    assert_int_equal(session_create(&other, row_path, NULL), -ERR_BUSY); /* two that make the same */
    ROW_OK(session_begin(s, e));
    ROW_OK(session_set_text(s, "seed", "1", e));
    assert_int_not_equal(access(row_path, F_OK), 0);
    ROW_OK(session_commit(s, e));
    assert_int_equal(access(row_path, F_OK), 0);
    assert_int_equal(files_named(".test"), 0);
    ROW_OK(session_set_text(s, "job", "x", e));
    ROW_OK(session_close(s, e));
    assert_int_equal(files_named("test.gonio"), 1);
    ROW_OK(session_open(&s, row_path, true, e));
    char *text;
    ROW_OK(session_get_text(s, "seed", &text, e));
    assert_string_equal(text, "1");
    free(text);
    ROW_OK(session_close(s, e));
}

static void a_session_without_a_commit_has_never_been(void **state) {
    (void)state;
    struct session *s;
    ROW_OK(session_create(&s, row_path, e));
    ROW_OK(session_begin(s, e));
    ROW_OK(session_set_text(s, "seed", "1", e));
    session_rollback(s);
    ROW_OK(session_close(s, e));
    assert_int_equal(files_named("test"), 0);
    assert_int_equal(files_named(".test"), 0);
}

/* Somebody takes the name while the session is being made: nothing is overwritten. */
static void a_name_taken_meanwhile_is_kept(void **state) {
    (void)state;
    struct session *s;
    ROW_OK(session_create(&s, row_path, e));
    int fd = open(row_path, O_WRONLY | O_CREAT, 0600);
    assert_int_equal(write(fd, "mine", 4), 4);
    close(fd);
    assert_int_equal(session_set_text(s, "seed", "1", NULL), -ERR_BUSY);
    session_close(s, NULL);
    struct stat st;
    assert_int_equal(stat(row_path, &st), 0);
    assert_int_equal(st.st_size, 4);
    assert_int_equal(files_named(".test"), 0);
}

static void what_a_kill_left_half_made_is_swept_away(void **state) {
    (void)state;
    struct session *live;
    char other[120];
    snprintf(other, sizeof other, "%s/live.gonio", row_folder);
    ROW_OK(session_create(&live, other, e));
    pid_t child = fork();
    if (child == 0) {
        struct session *s;
        session_create(&s, row_path, NULL);
        session_begin(s, NULL);
        session_set_text(s, "seed", "1", NULL);
        kill(getpid(), SIGKILL);
    }
    waitpid(child, NULL, 0);
    assert_true(files_named(".test.gonio.part") > 0);
    assert_int_not_equal(access(row_path, F_OK), 0);
    session_sweep(row_folder);
    assert_int_equal(files_named(".test"), 0);
    assert_true(files_named(".live.gonio.part") > 0);
    ROW_OK(session_set_text(live, "seed", "1", e));
    ROW_OK(session_close(live, e));
    ROW_OK(session_close(row_fill(row_path, 1), e)); /* the name is free again */
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, row_setup, row_teardown)

int main(void) {
    const struct CMUnitTest tests[] = {
        TEST(a_session_gets_its_name_with_its_first_commit),
        TEST(a_session_without_a_commit_has_never_been),
        TEST(a_name_taken_meanwhile_is_kept),
        TEST(what_a_kill_left_half_made_is_swept_away),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
