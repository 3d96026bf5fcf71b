#include "proto/process.h"

#include <errno.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

extern char **environ;

static pid_t wait_for(pid_t pid, int *state) {
    pid_t got;
    do {
        got = waitpid(pid, state, 0);
    } while (got < 0 && errno == EINTR);
    return got;
}

int process_run(const char *const *argv, int out_fd, struct err *e) {
    posix_spawn_file_actions_t actions;
    pid_t pid;
    int state = 0;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, out_fd, STDOUT_FILENO);
    int failed = posix_spawnp(&pid, argv[0], &actions, NULL, (char *const *)argv, environ);
    posix_spawn_file_actions_destroy(&actions);
    if (failed) {
        return err_errno(e, ERR_IO, failed, "cannot run %s", argv[0]);
    }
    if (wait_for(pid, &state) != pid || !WIFEXITED(state) || WEXITSTATUS(state) != 0) {
        return err_set(e, ERR_IO, "%s did not end well", argv[0]);
    }
    return 0;
}
