/* gonioctl: hands its words to one row of the table in verbs.c. */
#include <stdio.h>
#include <string.h>

#include "daemon/verbs.h"
#include "proto/output.h"
#include "proto/yaml.h"

static int help(FILE *out) {
    fprintf(
        out,
        "usage: gonioctl VERB [OPTION...]\nCommands goniod over its socket, and looks into sessions.\n\n");
    for (const struct verb *v = VERBS; v->name; v++)
        fprintf(out, "  %-11s%-46s%s\n", v->name, v->operands, v->doc);
    fprintf(
        out,
        "\n'gonioctl VERB --help' lists the options of a verb; --version prints the version. A SESSION is a\n"
        "name or a path.\n"
        "Exit status: 0 done, 1 the work failed, 2 bad usage or bad input.\n");
    return out == stdout ? 0 : 2;
}

static int unknown(const char *name) {
    const char *names[64] = {0};
    for (size_t i = 0; VERBS[i].name && i < 63; i++)
        names[i] = VERBS[i].name;
    const char *near = yaml_nearest(name, names);
    fprintf(stderr, "gonioctl: there is no verb '%s'%s%s%s; 'gonioctl --help' lists them\n", name,
            near ? ", did you mean '" : "", near ? near : "", near ? "'?" : "");
    return 2;
}

static int run(int argc, char **argv) {
    if (argc < 2)
        return help(stderr);
    if (strcmp(argv[1], "--help") == 0 || strcmp(argv[1], "-h") == 0 || strcmp(argv[1], "help") == 0)
        return help(stdout);
    if (strcmp(argv[1], "--version") == 0)
        return printf("gonioctl %s\n", GONIOD_VERSION) < 0;
    for (const struct verb *v = VERBS; v->name; v++)
        if (strcmp(v->name, argv[1]) == 0)
            return v->run(argc - 1, argv + 1);
    return unknown(argv[1]);
}

int main(int argc, char **argv) {
    return output_end("gonioctl", run(argc, argv));
}
