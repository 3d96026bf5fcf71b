#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "fit/request.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* Every index of an accepted request lies inside the points it brought. */
static void judge(struct fitset *set) {
    const struct estimate_input *in;
    if (fitset_input(set, &in, NULL) != 0)
        return;
    for (size_t i = 0; i < in->n; i++)
        if (isnan(in->beta[i]))
            abort();
    for (size_t c = 0; c < in->n_common; c++)
        for (size_t i = 0; i < in->common[c].n; i++)
            if (in->common[c].point[i] < 0 || (size_t)in->common[c].point[i] >= in->n)
                abort();
    for (size_t b = 0; b < in->n_bracket; b++)
        for (size_t i = 0; i < in->bracket[b].n; i++)
            if (in->bracket[b].point[i] < 0 || (size_t)in->bracket[b].point[i] >= in->n)
                abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct request request = {0};
    struct err e = {0};
    json_t *json = json_loadb((const char *)data, size, 0, NULL);
    fitset_init(&request.data);
    int rc = json ? request_read(json, &request, &e) : -ERR_INPUT;
    if (json && (rc == 0) != (e.code == 0))
        abort();
    if (rc == 0)
        judge(&request.data);
    request_free(&request);
    json_decref(json);
    return 0;
}
