/* export: a session in the forms of other programs. */
#include <stdio.h>
#include <string.h>

#include "daemon/verb_export.h"
#include "daemon/verb_session.h"
#include "proto/output.h"

enum { FORMAT, OUTPUT, SPECTRUM };

static int write_as(struct session *s, const struct verb_args *args, FILE *out, struct err *e) {
    const char *format = args->option[FORMAT];
    if (strcmp(format, "csv") == 0)
        return export_csv(s, args->option[SPECTRUM] != NULL, out, e);
    if (strcmp(format, "astm") == 0)
        return export_astm(s, out, e);
    return export_pcapng(s, out, e);
}

static int check_arguments(const struct verb_args *args, struct err *e) {
    static const char *const formats[] = {"csv", "astm", "pcapng"};
    if (!args->option[OUTPUT])
        return err_set(e, ERR_USAGE, "export needs -o FILE");
    for (int i = 0; args->option[FORMAT] && i < 3; i++)
        if (strcmp(args->option[FORMAT], formats[i]) == 0)
            return 0;
    return err_set(e, ERR_USAGE, "export needs --format csv, astm or pcapng");
}

static int export(struct session *s, const struct verb_args *args, struct err *e) {
    const char *name = args->option[OUTPUT];
    FILE *out = output_open(name, e);
    return out ? output_close(out, name, write_as(s, args, out, e), e) : -e->code;
}

/* Means of a coloured sample fit only with its q, which their file has no place for. */
static void say_q(struct session *s) {
    struct estimate estimate;
    if (session_last_estimate(s, &estimate, NULL) == 0 && estimate.converged && estimate.q != 1)
        fprintf(stderr, "gonioctl: export: to fit these means: goniofit fit --q %.6g\n", estimate.q);
}

int verb_export(int argc, char **argv) {
    static const struct verb_option OPTIONS[] = {
        {"--format", 0, "F", "csv (for goniofit), astm (E1392 style), pcapng (the exchanges, for Wireshark)"},
        {"--output", 'o', "FILE", "where to write it"},
        {"--spectrum", 0, NULL, "csv: every wavelength band instead of the visible mean"},
        {0}};
    struct verb_args args;
    struct err e = {0};
    struct session *s = NULL;
    char path[600];
    int done = verb_parse(argc, argv, OPTIONS, 1, 1, &args);
    if (done >= 0)
        return done;
    int rc = check_arguments(&args, &e);
    if (rc == 0)
        rc = verb_session_path(&args, args.operand[0], path, sizeof path, &e);
    if (rc == 0)
        rc = session_open(&s, path, true, &e);
    if (rc == 0)
        rc = export(s, &args, &e);
    if (rc == 0 && strcmp(args.option[FORMAT], "csv") == 0 && !args.option[SPECTRUM])
        say_q(s);
    session_close(s, NULL);
    return rc < 0 ? verb_fail(&e, NULL) : 0;
}
