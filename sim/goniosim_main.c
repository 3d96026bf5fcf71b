#include <getopt.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/goniosim_config.h"
#include "sim/serve.h"

static const char HELP[] =
    "usage: goniosim [--config FILE]\n"
    "Serves a simulated goniometer on this machine's wires: Modbus TCP and RTU (a pty), a spectrometer over\n"
    "usbredir. Prints its endpoints as one line of JSON, as goniod.yaml takes them, and serves until "
    "SIGTERM.\n"
    "  --config FILE       the bench (YAML); without it: the bench of goniod --simulate\n"
    "  --certificate FILE  writes the certificate of the bench's reference diffuser and ends\n"
    "  --reference         prints the keys of the config file as Markdown and ends\n"
    "  --help, --version\n"
    "Exit status: 0 ended by a signal, 1 it could not serve, 2 bad usage or bad config.\n";

struct options {
    const char *config, *certificate;
    bool done; /* printed what was asked for */
};

static int parse(int argc, char **argv, struct options *o) {
    static const struct option longs[] = {
        {"config", required_argument, NULL, 'c'}, {"certificate", required_argument, NULL, 'C'},
        {"reference", no_argument, NULL, 'r'},    {"help", no_argument, NULL, 'h'},
        {"version", no_argument, NULL, 'v'},      {0}};
    for (int c; (c = getopt_long(argc, argv, "", longs, NULL)) != -1;) {
        if (c == 'c') {
            o->config = optarg;
        } else if (c == 'C') {
            o->certificate = optarg;
        } else if (c == '?') {
            return 2;
        } else {
            o->done = true;
            if (c == 'r')
                goniosim_config_print_reference(stdout);
            else
                fputs(c == 'h' ? HELP : "goniosim " GONIOD_VERSION "\n", stdout);
        }
    }
    if (optind < argc) {
        fprintf(stderr, "goniosim: unexpected argument %s; see goniosim --help\n", argv[optind]);
        return 2;
    }
    return 0;
}

static int failed(const struct err *e) {
    char text[1024];
    fprintf(stderr, "goniosim: %s\n", err_format(e, text, sizeof text));
    return 1;
}

static int mount(struct sim_bench *bench, const struct goniosim_config *c, struct err *e) {
    for (int i = 0; i < c->n_places; i++)
        if (c->place[i].has_surface && sim_bench_mount(bench, c->place[i].name, &c->place[i].surface, e) != 0)
            return -e->code;
    return 0;
}

static int listen_bus(const struct serve *s, const char *bus, json_t *list, struct err *e) {
    char endpoint[160];
    int rc = strncmp(bus, "tcp:", 4) == 0
                 ? serve_modbus_tcp(s, (int)strtol(bus + 4, NULL, 10), endpoint, sizeof endpoint, e)
                 : serve_modbus_rtu(s, bus[3] == ':' ? bus + 4 : NULL, endpoint, sizeof endpoint, e);
    if (rc == 0)
        json_array_append_new(list, json_string(endpoint));
    return rc;
}

static int listen_all(const struct serve *s, const struct goniosim_config *c, json_t *endpoints,
                      struct err *e) {
    char endpoint[160];
    json_t *buses = json_array();
    json_object_set_new(endpoints, "modbus", buses);
    for (int i = 0; i < c->n_buses; i++) {
        int rc = listen_bus(s, c->bus[i], buses, e);
        if (rc)
            return rc;
    }
    if (strcmp(c->usb_listen, "none") == 0)
        return 0;
    int rc = serve_usbredir(s, c->usb_listen, endpoint, sizeof endpoint, e);
    if (rc == 0)
        json_object_set_new(endpoints, "spectrometer", json_string(endpoint));
    return rc;
}

static void print_endpoints(json_t *endpoints) {
    json_object_set_new(endpoints, "pid", json_integer(getpid()));
    json_dumpf(endpoints, stdout, JSON_COMPACT);
    putchar('\n');
    fflush(stdout);
}

static void remove_paths(const struct goniosim_config *c) {
    for (int i = 0; i < c->n_buses; i++)
        if (strncmp(c->bus[i], "rtu:", 4) == 0)
            unlink(c->bus[i] + 4);
    if (strncmp(c->usb_listen, "unix:", 5) == 0)
        unlink(c->usb_listen + 5);
}

static int serve(const struct goniosim_config *c, struct err *e) {
    static struct reactor *reactor; /* lives to the end of the process, with all that listens in it */
    static struct clock clock;
    struct sim_bench *bench;
    clock_init_real(&clock);
    int rc = reactor_new(&reactor, e);
    if (rc == 0)
        rc = sim_bench_new(&bench, &c->bench, &clock, e);
    if (rc)
        return rc;
    struct serve s = {bench, reactor, (int64_t)(c->reply_delay_ms * 1000)};
    json_t *endpoints = json_object();
    rc = mount(bench, c, e);
    if (rc == 0)
        rc = listen_all(&s, c, endpoints, e);
    if (rc == 0) {
        print_endpoints(endpoints);
        rc = reactor_run(reactor, e);
        remove_paths(c);
    }
    json_decref(endpoints);
    sim_bench_free(bench);
    return rc;
}

int main(int argc, char **argv) {
    static struct goniosim_config config;
    struct options o = {0};
    struct err_list errors = {0};
    struct err e = {0};
    int status = parse(argc, argv, &o);
    if (status || o.done)
        return status;
    if (goniosim_config_read(o.config, &config, &errors) != 0) {
        for (size_t i = 0; i < errors.n; i++)
            failed(&errors.item[i]);
        err_list_free(&errors);
        return 2;
    }
    int rc = o.certificate ? sim_certificate_write(&config.bench, o.certificate, &e) : serve(&config, &e);
    goniosim_config_free(&config);
    return rc ? failed(&e) : 0;
}
