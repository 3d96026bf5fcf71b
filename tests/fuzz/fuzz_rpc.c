#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "proto/rpc.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* A line of a client is answered, whatever it is, by one line of JSON. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct rpc_request rq;
    struct err e = {0};
    int code = rpc_parse((const char *)data, size, &rq, &e);
    if ((code == 0) != (e.code == ERR_NONE))
        abort();
    char *answer = code == 0 ? rpc_reply_text(rq.id, rq.params) : rpc_error_text(rq.id, code, &e, NULL);
    if (answer && (strchr(answer, '\n') != answer + strlen(answer) - 1))
        abort();
    free(answer);
    rpc_request_free(&rq);
    return 0;
}
