#include <stdio.h>
#include <string.h>

#include "fit/render/verbs.h"
#include "fit/render/scene_keys.h"
#include "proto/output.h"

static const char help[] =
    "usage: goniorender render SCENE.yaml -o FILE.png | recolour PLANES.exr -o FILE.png |\n"
    "       goniorender diff SCENE.yaml [OTHER.yaml] [-o FILE.png] | bench | stability\n"
    "  render             renders a scene of painted shapes\n"
    "  recolour           another light, observer or paint for planes that were rendered\n"
    "  diff               how different two materials, lights or scenes look (CIEDE2000)\n"
    "  sheet              one rendering under many lights, side by side\n"
    "  bench              error against run time, on this machine\n"
    "  stability          what becomes of extreme inputs\n"
    "  --scene-reference  prints every key of a scene file\n"
    "  goniorender COMMAND --help tells more; --version prints the version\n"
    "exit status: 0 done, 1 the work failed, 2 bad usage or bad input\n";

static int command_help(int argc, char **argv) {
    (void)argc;
    (void)argv;
    fputs(help, stdout);
    return 0;
}

static int command_version(int argc, char **argv) {
    (void)argc;
    (void)argv;
    puts("goniorender " GONIOD_VERSION);
    return 0;
}

static int command_reference(int argc, char **argv) {
    (void)argc;
    (void)argv;
    yaml_print_reference(stdout, "scene.yaml", scene_keys);
    return 0;
}

static const struct {
    const char *name;
    int (*run)(int argc, char **argv);
} commands[] = {
    {"render", verb_render},
    {"recolour", verb_recolour},
    {"diff", verb_diff},
    {"sheet", verb_sheet},
    {"bench", verb_bench},
    {"stability", verb_stability},
    {"--scene-reference", command_reference},
    {"--help", command_help},
    {"--version", command_version},
};

int main(int argc, char **argv) {
    for (size_t i = 0; argc > 1 && i < sizeof commands / sizeof *commands; i++) {
        if (strcmp(argv[1], commands[i].name) == 0) {
            return output_end("goniorender", commands[i].run(argc - 1, argv + 1));
        }
    }
    fprintf(stderr, "%s%s%s",
            argc > 1 ? "goniorender: unknown command '" : "goniorender: no command is given",
            argc > 1 ? argv[1] : "", argc > 1 ? "'\n" : "\n");
    fputs(help, stderr);
    return 2;
}
