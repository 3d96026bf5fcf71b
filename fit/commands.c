#include "fit/commands.h"

#include <stdio.h>

static int exit_status(int code) {
    return code == ERR_FIT || code == ERR_NOMEM ? 1 : 2;
}

int command_complain(const char *command, const struct err *e) {
    char text[1024];
    fprintf(stderr, "goniofit %s: %s\n", command, err_format(e, text, sizeof text));
    return exit_status(e->code);
}

int command_complain_all(struct err_list *errors) {
    char text[1024];
    int status = 1;
    for (size_t i = 0; i < errors->n; i++) {
        fprintf(stderr, "%s\n", err_format(&errors->item[i], text, sizeof text));
        status = exit_status(errors->item[i].code) == 2 ? 2 : status;
    }
    err_list_free(errors);
    return status;
}
