/* export: a session in the forms of other programs. */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "daemon/verb_export.h"
#include "daemon/verb_session.h"

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
    FILE *out = fopen(name, "wb");
    if (!out) {
        int saved_errno = errno;
        return err_errno(e, ERR_IO, saved_errno, "cannot write %s", name);
    }
    int rc = write_as(s, args, out, e);
    bool failed = ferror(out) != 0;
    if (fclose(out) != 0 || failed) {
        int saved_errno = errno;
        rc = err_errno(e, saved_errno == ENOSPC ? ERR_FULL : ERR_IO, saved_errno,
                       "%s could not be written whole", name);
    }
    if (rc < 0)
        remove(name);
    return rc;
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
    session_close(s, NULL);
    return rc < 0 ? verb_fail(&e, NULL) : 0;
}
