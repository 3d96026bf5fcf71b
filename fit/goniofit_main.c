#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "fit/commands.h"
#include "fit/serve.h"
#include "proto/output.h"

static const char help[] =
    "usage: goniofit fit FILE... | eval --params P.json --points G.csv | bench | stability | --serve\n"
    "  fit      fits a reflection model to measured radiance factors\n"
    "  eval     prints the model and its derivatives at given points\n"
    "  bench      error against run time, beside other libraries\n"
    "  stability  stiff, extreme and broken measurements against their truth\n"
    "  --serve  answers length-prefixed JSON requests on stdin until its end\n"
    "  goniofit COMMAND --help tells more; --version prints the version\n"
    "exit status: 0 done, 1 the work failed, 2 bad usage or bad input\n";

static int command_serve(int argc, char **argv) {
    struct err e = {0};
    (void)argv;
    if (argc > 1) {
        fputs("goniofit --serve takes no arguments\n", stderr);
        return 2;
    }
    return serve_run(STDIN_FILENO, STDOUT_FILENO, &e) ? command_complain("--serve", &e) : 0;
}

static int command_help(int argc, char **argv) {
    (void)argc;
    (void)argv;
    fputs(help, stdout);
    return 0;
}

static int command_version(int argc, char **argv) {
    (void)argc;
    (void)argv;
    puts("goniofit " GONIOD_VERSION);
    return 0;
}

static const struct {
    const char *name;
    int (*run)(int argc, char **argv);
} commands[] = {
    {"fit", command_fit},           {"eval", command_eval},
    {"bench", command_bench},       {"stability", command_stability},
    {"--serve", command_serve},     {"--help", command_help},
    {"--version", command_version},
};

static int run(int argc, char **argv) {
    for (size_t i = 0; argc > 1 && i < sizeof commands / sizeof *commands; i++) {
        if (strcmp(argv[1], commands[i].name) == 0) {
            return commands[i].run(argc - 1, argv + 1);
        }
    }
    fprintf(stderr, "%s%s%s", argc > 1 ? "goniofit: unknown command '" : "goniofit: no command is given",
            argc > 1 ? argv[1] : "", argc > 1 ? "'\n" : "\n");
    fputs(help, stderr);
    return 2;
}

int main(int argc, char **argv) {
    return output_end("goniofit", run(argc, argv));
}
