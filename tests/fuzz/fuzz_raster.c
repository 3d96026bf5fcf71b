/* A mask or a height map as a stranger may send it. */
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#include "fit/render/raster.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* What is accepted can be read to its last pixel; what is not has a sentence. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct raster raster;
    struct err e = {0};
    char path[64];
    unsigned sum = 0;
    int file = memfd_create("raster", 0);
    if (file < 0 || write(file, data, size) != (ssize_t)size)
        abort();
    snprintf(path, sizeof path, "/proc/self/fd/%d", file);
    int rc = raster_read(path, &raster, &e);
    if ((rc == 0) != (e.code == ERR_NONE))
        abort();
    if (rc == 0) {
        for (size_t i = 0; i < 3 * (size_t)raster.width * (size_t)raster.height; i++)
            sum += raster.rgb[i];
        if (raster.width < 1 || raster.height < 1 || sum == 1u << 31)
            abort();
        raster_free(&raster);
    }
    close(file);
    return 0;
}
