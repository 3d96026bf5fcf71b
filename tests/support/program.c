#include "tests/support/program.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#define LOOK_MS 5

extern char **environ;

int64_t real_us(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000 + t.tv_nsec / 1000;
}

void real_sleep_ms(int ms) {
    struct timespec t = {.tv_sec = ms / 1000, .tv_nsec = ms % 1000 * 1000000L};
    nanosleep(&t, NULL);
}

static FILE *input_file(const char *text) {
    FILE *f = text ? tmpfile() : fopen("/dev/null", "r");
    if (f && text) {
        fputs(text, f);
        rewind(f);
    }
    return f;
}

bool program_start(struct program *p, const char *const *words, const char *input) {
    const char *build = getenv("BUILD");
    char path[256], *argv[PROGRAM_WORDS + 1] = {path};
    snprintf(path, sizeof path, "%s/%s", build ? build : "build", words[0]);
    for (int i = 1; i < PROGRAM_WORDS && words[i]; i++)
        argv[i] = (char *)words[i];
    FILE *in = input_file(input);
    *p = (struct program){.out = tmpfile(), .err = tmpfile()};
    if (!in || !p->out || !p->err)
        return false;
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, fileno(in), STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&actions, fileno(p->out), STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&actions, fileno(p->err), STDERR_FILENO);
    int rc = posix_spawn(&p->pid, path, &actions, NULL, argv, environ);
    posix_spawn_file_actions_destroy(&actions);
    fclose(in);
    if (rc != 0)
        p->pid = 0;
    return rc == 0;
}

bool program_runs(struct program *p) {
    siginfo_t info = {0};
    return p->pid && waitid(P_PID, (id_t)p->pid, &info, WEXITED | WNOHANG | WNOWAIT) == 0 && info.si_pid == 0;
}

static char *all_of(FILE *f) {
    fseek(f, 0, SEEK_END);
    long size = ftell(f);
    rewind(f);
    char *text = calloc((size_t)size + 1, 1);
    size_t got = text ? fread(text, 1, (size_t)size, f) : 0;
    if (text)
        text[got] = 0;
    fclose(f);
    return text;
}

void program_wait(struct program *p, int limit_ms, struct said *said) {
    int status = 0;
    int64_t until_us = real_us() + limit_ms * INT64_C(1000);
    while (program_runs(p) && real_us() < until_us)
        real_sleep_ms(LOOK_MS);
    bool late = program_runs(p);
    if (late)
        kill(p->pid, SIGKILL);
    if (p->pid)
        waitpid(p->pid, &status, 0);
    said->status = late ? -1 : WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    said->out = all_of(p->out);
    said->err = all_of(p->err);
    *p = (struct program){0};
}

void program_run(const char *const *words, const char *input, int limit_ms, struct said *said) {
    struct program p;
    *said = (struct said){.status = -1};
    if (program_start(&p, words, input))
        program_wait(&p, limit_ms, said);
}

void said_free(struct said *said) {
    free(said->out);
    free(said->err);
    *said = (struct said){0};
}
