#include "tests/fuzz/mesh.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    return judge_mesh(mesh_read_obj, data, size);
}
