#include <stdint.h>
#include <stdlib.h>

#include "proto/material.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* Whatever is accepted goes through JSON once more, unchanged. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct estimate first, second;
    struct err e = {0};
    json_t *json = json_loadb((const char *)data, size, 0, NULL);
    if (json && estimate_from_json(json, &first, &e) == 0) {
        json_t *again = estimate_to_json(&first), *back;
        if (estimate_from_json(again, &second, &e) != 0)
            abort();
        back = estimate_to_json(&second);
        if (!json_equal(again, back))
            abort();
        json_decref(again);
        json_decref(back);
    }
    json_decref(json);
    return 0;
}
