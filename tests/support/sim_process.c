#include "tests/support/sim_process.h"

#include <jansson.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

extern char **environ;

static bool spawn(struct sim_process *p, char *config, int out) {
    const char *build = getenv("BUILD");
    char program[256];
    snprintf(program, sizeof program, "%s/goniosim", build ? build : "build");
    char *argv[] = {program, "--config", config, NULL};
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, out, STDOUT_FILENO);
    int rc = posix_spawn(&p->pid, program, &actions, NULL, argv, environ);
    posix_spawn_file_actions_destroy(&actions);
    return rc == 0;
}

static bool read_endpoints(struct sim_process *p, int in) {
    char line[1024];
    FILE *f = fdopen(in, "r");
    json_t *endpoints = fgets(line, sizeof line, f) ? json_loads(line, 0, NULL) : NULL;
    const char *target = json_string_value(json_object_get(endpoints, "spectrometer"));
    snprintf(p->spectrometer, sizeof p->spectrometer, "%s", target ? target : "");
    json_t *buses = json_object_get(endpoints, "modbus");
    for (size_t i = 0; i < 2; i++) {
        const char *bus = json_string_value(json_array_get(buses, i));
        snprintf(p->modbus[i], sizeof p->modbus[i], "%s", bus ? bus : "");
    }
    json_decref(endpoints);
    fclose(f);
    return p->spectrometer[0] != '\0';
}

bool sim_process_start(struct sim_process *p, const char *yaml) {
    char config[] = "/tmp/goniosim-XXXXXX";
    int fd = mkstemp(config), ends[2];
    memset(p, 0, sizeof *p);
    bool ok = fd >= 0 && write(fd, yaml, strlen(yaml)) == (ssize_t)strlen(yaml) && pipe(ends) == 0;
    close(fd);
    ok = ok && spawn(p, config, ends[1]);
    if (ok) {
        close(ends[1]);
        ok = read_endpoints(p, ends[0]);
    }
    unlink(config);
    return ok;
}

int sim_process_stop(struct sim_process *p, int signal) {
    int status = 0;
    if (p->pid == 0)
        return 0;
    kill(p->pid, signal);
    waitpid(p->pid, &status, 0);
    p->pid = 0;
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}
