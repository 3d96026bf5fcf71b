/* Tells the outside: each program of the config's `notify` is started with the event as JSON on its stdin, and left
 * alone. It cannot delay the campaign: its input fits into the pipe, nobody waits for its end. */
#include "daemon/campaign_private.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "proto/process.h"

#define NOTIFY_MAX 4 /* of one program that have not ended; more are not started */

static pid_t running[CONFIG_NAMES][NOTIFY_MAX]; /* one that hangs must not keep the others from being told */

void campaign_notify_reap(void) {
    for (int n = 0; n < CONFIG_NAMES; n++)
        for (int i = 0; i < NOTIFY_MAX; i++)
            if (running[n][i] > 0 && waitpid(running[n][i], NULL, WNOHANG) != 0)
                running[n][i] = 0;
}

static pid_t *free_place(int program) {
    campaign_notify_reap();
    for (int i = 0; i < NOTIFY_MAX; i++)
        if (!running[program][i])
            return &running[program][i];
    return NULL;
}

static void tell(int number, const char *program, const char *text) {
    pid_t *place = free_place(number);
    int end[2];
    if (!place || pipe2(end, O_CLOEXEC) < 0)
        return;
    /* An event is far smaller than a pipe, so this is one write that would not block; the program's end must block. */
    fcntl(end[1], F_SETFL, O_NONBLOCK);
    bool written = write(end[1], text, strlen(text)) == (ssize_t)strlen(text);
    const char *const argv[] = {program, NULL};
    if (!written || process_start(argv, end[0], -1, place) != 0)
        *place = 0;
    close(end[0]);
    close(end[1]);
}

void campaign_notify(struct campaign *c, const char *kind, const json_t *json) {
    const struct config *config = c->setup.config;
    if (config->n_notify == 0)
        return;
    json_t *event =
        json_pack("{s:s, s:s, s:O}", "event", kind, "job", c->job ? c->job->name : "", "detail", json);
    char *text = json_dumps(event, JSON_COMPACT);
    for (int i = 0; text && i < config->n_notify; i++)
        tell(i, config->notify[i], text);
    free(text);
    json_decref(event);
}
