/*
 * request.h — a request of fit/serve.h from JSON into a fitset.
 *
 * Errors     -ERR_INPUT naming the key and what it must be; -ERR_NOMEM.
 * Checked    tests/unit/test_serve.c, tests/fuzz/fuzz_request.c
 */
#ifndef FIT_REQUEST_H
#define FIT_REQUEST_H

#include <jansson.h>

#include "fit/fitset.h"
#include "fit/reflectance.h"

struct request {
    struct fitset data; /* initialised by the caller, filled by request_read */
    int *index;         /* [n_points] of the request's point in the fitset, -1 = left out */
    size_t n_points;
    bool final;
};

int request_read(const json_t *json, struct request *request, struct err *e);
/* Model, mean_nm, axis uncertainties and switches alone; also the form of a session's text "fit_setup". */
int request_read_settings(const json_t *json, struct fitset *data, struct err *e);
void request_free(struct request *request);

#endif
