/* goniod: reads its config, takes what must be its alone, then measures until it is told to end. */
#include <ctype.h>
#include <errno.h>
#include <fcntl.h>
#include <getopt.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/vfs.h>
#include <unistd.h>

#include "daemon/campaign.h"
#include "daemon/control.h"
#include "daemon/simulate.h"
#include "daemon/verb_session.h"
#include "proto/file.h"
#include "proto/session.h"
#include "proto/yaml.h"

#define CONFIG_DEFAULT "/etc/goniod/goniod.yaml"
#define DIR_MODE 0750

struct options {
    const char *config, *bench, *socket, *sessions;
    bool simulate, seeded, check_config;
    uint64_t seed;
};

struct daemon {
    struct options options;
    char *config_text;
    struct config config;
    char socket[256], sessions[256];
    int lock_fd;
    struct clock clock;
    struct bench bench;
    struct simulate_bench *truth;
    struct simulate *simulate;
    struct wiring wiring;
    struct desk *desk;
    struct campaign *campaign;
    struct control *control;
};

static const char usage[] =
    "usage: goniod [--config FILE] [--simulate [--seed N] [--bench FILE]] [--socket PATH] [--sessions DIR]\n"
    "              [--check-config]\n"
    "Runs a goniospectrometer unattended, and serves gonioctl, until SIGTERM.\n"
    "  --config FILE    the instruments of the bench (default " CONFIG_DEFAULT ")\n"
    "  --simulate       a simulated bench in virtual time; without --config a built-in one\n"
    "  --seed N         of the simulated bench's draws and noise (default 1)\n"
    "  --bench FILE     what stands on the simulated bench and what is wrong with it, as goniosim takes it\n"
    "  --socket PATH    default: GONIOD_SOCKET, /run/goniod/goniod.sock, or $XDG_RUNTIME_DIR/goniod.sock\n"
    "  --sessions DIR   default: GONIOD_SESSIONS, /var/lib/goniod/sessions, or $XDG_DATA_HOME/goniod\n"
    "  --check-config   reads the config, says what is wrong with it, and ends\n"
    "  --help, --version\n"
    "Exit status: 0 ended by a signal, 1 it could not serve, 2 bad usage or bad config.\n";

/* ---- options ---- */

static int bad_usage(const char *what) {
    fprintf(stderr, "goniod: %s\n%s", what, usage);
    return 2;
}

/* -1 to go on, else the exit status. */
static int read_options(int argc, char **argv, struct options *o) {
    static const struct option table[] = {
        {"config", required_argument, NULL, 'c'}, {"simulate", no_argument, NULL, 's'},
        {"seed", required_argument, NULL, 'n'},   {"bench", required_argument, NULL, 'b'},
        {"socket", required_argument, NULL, 'k'}, {"sessions", required_argument, NULL, 'd'},
        {"check-config", no_argument, NULL, 'x'}, {"help", no_argument, NULL, 'h'},
        {"version", no_argument, NULL, 'v'},      {NULL, 0, NULL, 0}};
    char *end = "";
    for (int c; (c = getopt_long(argc, argv, "", table, NULL)) != -1;) {
        switch (c) {
        case 'c':
            o->config = optarg;
            break;
        case 's':
            o->simulate = true;
            break;
        case 'n':
            o->seeded = true;
            o->seed = strtoull(optarg, &end, 10);
            if (*end || !isdigit((unsigned char)*optarg))
                return bad_usage("--seed takes a whole number from 0 on");
            break;
        case 'b':
            o->bench = optarg;
            break;
        case 'k':
            o->socket = optarg;
            break;
        case 'd':
            o->sessions = optarg;
            break;
        case 'x':
            o->check_config = true;
            break;
        case 'h':
            fputs(usage, stdout);
            return 0;
        case 'v':
            puts("goniod " GONIOD_VERSION);
            return 0;
        default:
            fputs(usage, stderr); /* getopt has said what is wrong */
            return 2;
        }
    }
    if (optind < argc)
        return bad_usage("goniod takes options only");
    if (o->bench && !o->simulate)
        return bad_usage("--bench belongs to --simulate");
    return o->seeded && !o->simulate ? bad_usage("--seed belongs to --simulate") : -1;
}

static int complain(const struct err *e) {
    char buffer[1024];
    fprintf(stderr, "goniod: %s\n", err_format(e, buffer, sizeof buffer));
    return e->code == ERR_USAGE || e->code == ERR_INPUT ? 2 : 1;
}

static int complain_all(const struct err_list *errors) {
    int status = 1;
    for (size_t i = 0; i < errors->n; i++)
        status = complain(&errors->item[i]);
    return status;
}

/* ---- config ---- */

static int read_config(struct daemon *d) {
    struct err_list errors = {0};
    struct err e = {0};
    const char *file = d->options.config ? d->options.config : CONFIG_DEFAULT;
    size_t size = 0;
    if (d->options.simulate && !d->options.config) {
        file = "built-in config";
        d->config_text = strdup(config_builtin_text());
        size = strlen(d->config_text);
    } else if (file_read(file, YAML_BYTES_MAX, &d->config_text, &size, &e) < 0) {
        complain(&e);
        if (!d->options.config)
            fputs("goniod: name the config of your bench with --config, or try a simulated one with "
                  "--simulate\n",
                  stderr);
        return 2;
    }
    int status = config_read_text(file, d->config_text, size, &d->config, &errors) < 0 ? 2 : 0;
    complain_all(&errors);
    err_list_free(&errors);
    return status;
}

static int read_bench(struct daemon *d) {
    struct err_list errors = {0};
    if (!d->options.bench)
        return 0;
    int status = simulate_bench_read(&d->truth, d->options.bench, &errors) < 0 ? 2 : 0;
    complain_all(&errors);
    err_list_free(&errors);
    if (status == 0 && !d->options.seeded)
        d->options.seed = simulate_bench_seed(d->truth);
    return status;
}

/* What the config names must be there too: profiles, the model of the spectrometer. */
static int check_config(struct daemon *d) {
    static struct instruments named;
    struct err_list errors = {0};
    int status = instruments_load(&named, &d->bench, &d->config, &d->wiring, "", &errors) < 0 ? 2 : 0;
    complain_all(&errors);
    err_list_free(&errors);
    instruments_free(&named);
    if (status == 0)
        fputs(d->config_text, stdout);
    return status;
}

/* ---- what must be this daemon's alone ---- */

static void default_socket(char *path, size_t size) {
    const char *set = getenv("GONIOD_SOCKET"), *runtime = getenv("XDG_RUNTIME_DIR");
    if (set && *set)
        snprintf(path, size, "%s", set);
    else if (access("/run/goniod", W_OK) == 0 || !runtime)
        snprintf(path, size, "/run/goniod/goniod.sock");
    else
        snprintf(path, size, "%s/goniod.sock", runtime);
}

static void choose_paths(struct daemon *d) {
    const struct options *o = &d->options;
    if (o->socket)
        snprintf(d->socket, sizeof d->socket, "%s", o->socket);
    else
        default_socket(d->socket, sizeof d->socket);
    verb_sessions_folder(o->sessions, W_OK, d->sessions, sizeof d->sessions);
}

static int lock_sessions(struct daemon *d, struct err *e) {
    char path[300];
    struct statfs fs;
    snprintf(path, sizeof path, "%s/.goniod.lock", d->sessions);
    int made = mkdir(d->sessions, DIR_MODE);
    int saved = errno;
    if (made < 0 && saved != EEXIST)
        return err_errno(e, ERR_IO, saved,
                         "cannot make the folder of sessions %s (the folder above it must be there)",
                         d->sessions);
    if (statfs(d->sessions, &fs) == 0 && session_network_filesystem(fs.f_type))
        return err_set(
            e, ERR_INPUT,
            "%s lies on %s: sessions need a local disk, since their log is shared memory; use --sessions",
            d->sessions, session_network_filesystem(fs.f_type));
    d->lock_fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0640);
    saved = errno;
    if (d->lock_fd < 0)
        return err_errno(e, ERR_IO, saved, "cannot write in the folder of sessions %s", d->sessions);
    if (flock(d->lock_fd, LOCK_EX | LOCK_NB) < 0)
        return err_set(e, ERR_BUSY, "another goniod measures into %s: end it, or use --sessions",
                       d->sessions);
    return 0;
}

/* ---- parts ---- */

static int wire_up(struct daemon *d, struct err *e) {
    const struct simulate_options truth = {.seed = d->options.seed, .file = d->truth};
    if (!d->options.simulate) {
        clock_init_real(&d->clock);
        wiring_real(&d->wiring, &d->clock);
        return 0;
    }
    clock_init_virtual(&d->clock);
    int result = simulate_new(&d->simulate, &truth, &d->config, &d->clock, e);
    if (result == 0)
        simulate_wiring(d->simulate, &d->wiring);
    return result;
}

static int start_campaign(struct daemon *d, struct err_list *errors) {
    const struct campaign_setup setup = {.config = &d->config,
                                         .config_text = d->config_text,
                                         .bench_text = simulate_bench_text(d->truth),
                                         .sessions_dir = d->sessions,
                                         .state_dir = d->sessions,
                                         .desk = d->desk,
                                         .bench = &d->bench,
                                         .wiring = &d->wiring,
                                         .seed = d->options.seed};
    return campaign_new(&d->campaign, &setup, errors);
}

/* In the control thread. */
static void end_by_signal(void *arg, int signal_number) {
    struct daemon *d = arg;
    struct desk_order order = {.command = COMMAND_INTERRUPT};
    (void)signal_number;
    desk_post(d->desk, &order, NULL, NULL);
}

/* In a worker thread of the control socket. */
static struct json_t *check(void *arg, const struct desk_run *job, struct err_list *errors) {
    const struct daemon *d = arg;
    return campaign_check(d->campaign, job, errors);
}

static int start_control(struct daemon *d, struct err *e) {
    const struct control_options options = {.socket_path = d->socket,
                                            .config = &d->config,
                                            .desk = d->desk,
                                            .check = check,
                                            .on_signal = end_by_signal,
                                            .arg = d};
    return control_start(&d->control, &options, e);
}

static void stop(struct daemon *d) {
    control_stop(d->control);
    campaign_free(d->campaign);
    desk_free(d->desk);
    simulate_free(d->simulate);
    simulate_bench_free(d->truth);
    if (d->lock_fd >= 0)
        close(d->lock_fd);
    free(d->config_text);
}

static int run(struct daemon *d) {
    struct err_list errors = {0};
    struct err e = {0};
    choose_paths(d);
    signal(SIGPIPE, SIG_IGN);
    signal(SIGXFSZ, SIG_IGN); /* a limit on files is reported like a full disk */
    int result = lock_sessions(d, &e);
    if (result == 0)
        session_sweep(d->sessions);
    if (result == 0)
        result = wire_up(d, &e);
    bench_init(&d->bench, &d->clock);
    if (result == 0)
        result = desk_new(&d->desk, &e);
    if (result == 0)
        result = start_campaign(d, &errors);
    if (result == 0)
        result = start_control(d, &e);
    if (result == 0)
        result = campaign_serve(d->campaign);
    int status = errors.n ? complain_all(&errors) : e.code ? complain(&e) : result < 0;
    err_list_free(&errors);
    return status;
}

int main(int argc, char **argv) {
    static struct daemon d = {.lock_fd = -1, .options = {.seed = 1}};
    int status = read_options(argc, argv, &d.options);
    if (status >= 0)
        return status;
    status = read_config(&d);
    if (status == 0)
        status = read_bench(&d);
    if (status == 0 && d.options.check_config)
        status = check_config(&d);
    else if (status == 0)
        status = run(&d);
    stop(&d);
    return status;
}
