#include <stdio.h>
#include <string.h>

#include "daemon/verbs.h"

static const struct verb_option SHARED[] = {
    {"--socket", 0, "PATH",
     "default: GONIOD_SOCKET, /run/goniod/goniod.sock, or $XDG_RUNTIME_DIR/goniod.sock"},
    {"--sessions", 0, "DIR", "default: GONIOD_SESSIONS, /var/lib/goniod/sessions, or $XDG_DATA_HOME/goniod"},
    {"--json", 0, NULL, "one JSON object on stdout"},
    {"--help", 'h', NULL, "this text"},
    {0}};

static const struct verb *find(const char *name) {
    const struct verb *v = VERBS;
    while (v->name && strcmp(v->name, name) != 0)
        v++;
    return v;
}

static void print_options(const struct verb_option *options) {
    for (; options && options->name; options++) {
        char left[40];
        snprintf(left, sizeof left, "%s%s%s", options->name, options->value ? " " : "",
                 options->value ? options->value : "");
        printf("  %-20s %s\n", left, options->doc);
    }
}

static int help(const char *name, const struct verb_option *options) {
    const struct verb *v = find(name);
    printf("usage: gonioctl %s %s\n%s\n\n", name, v->operands, v->doc);
    print_options(options);
    print_options(SHARED);
    return 0;
}

static int misuse(const char *verb, const char *what, const char *word) {
    fprintf(stderr, "gonioctl: %s: %s%s%s; see 'gonioctl %s --help'\n", verb, what, word ? " " : "",
            word ? word : "", verb);
    return 2;
}

static int option_find(const struct verb_option *options, const char *word) {
    for (int i = 0; options && options[i].name; i++)
        if (strcmp(options[i].name, word) == 0 ||
            (options[i].letter && word[1] == options[i].letter && !word[2]))
            return i;
    return -1;
}

static void set_shared(int which, const char *value, struct verb_args *args) {
    switch (which) {
    case 0:
        args->socket = value;
        break;
    case 1:
        args->sessions = value;
        break;
    default:
        args->json = true;
    }
}

static bool is_number(const char *word) {
    return word[0] == '-' && word[1] && strchr("0123456789.", word[1]);
}

int verb_parse(int argc, char **argv, const struct verb_option *options, int min_operands, int max_operands,
               struct verb_args *args) {
    memset(args, 0, sizeof *args);
    bool words_only = false;
    for (int i = 1; i < argc; i++) {
        char *word = argv[i];
        if (words_only || word[0] != '-' || is_number(word)) {
            if (args->n_operands == max_operands || args->n_operands == VERB_OPERANDS)
                return misuse(argv[0], "does not take", word);
            args->operand[args->n_operands++] = word;
            continue;
        }
        words_only = strcmp(word, "--") == 0;
        if (words_only)
            continue;
        int own = option_find(options, word), shared = own < 0 ? option_find(SHARED, word) : -1;
        if (own < 0 && shared < 0)
            return misuse(argv[0], "has no option", word);
        if (shared == 3)
            return help(argv[0], options);
        const struct verb_option *o = own >= 0 ? &options[own] : &SHARED[shared];
        if (o->value && i + 1 == argc)
            return misuse(argv[0], "needs a value after", word);
        const char *value = o->value ? argv[++i] : "";
        if (own >= 0)
            args->option[own] = value;
        else
            set_shared(shared, value, args);
    }
    return args->n_operands < min_operands ? misuse(argv[0], "needs", find(argv[0])->operands) : -1;
}

int verb_fail(const struct err *e, const struct err_list *errors) {
    char text[900];
    for (size_t i = 0; errors && i < errors->n; i++)
        fprintf(stderr, "%s\n", err_format(&errors->item[i], text, sizeof text));
    fprintf(stderr, "gonioctl: %s\n", err_format(e, text, sizeof text));
    return e->code == ERR_USAGE || e->code == ERR_INPUT ? 2 : 1;
}
