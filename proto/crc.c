#include "proto/crc.h"

#include <pthread.h>

#define REFLECTED 0xEDB88320u
#define LANES 8

/* table[k][byte]: what a byte does to the checksum k bytes later; eight at a time. */
static uint32_t table[LANES][256];

static void fill(void) {
    for (uint32_t byte = 0; byte < 256; byte++) {
        uint32_t crc = byte;
        for (int bit = 0; bit < 8; bit++)
            crc = crc & 1 ? crc >> 1 ^ REFLECTED : crc >> 1;
        table[0][byte] = crc;
    }
    for (int lane = 1; lane < LANES; lane++)
        for (int byte = 0; byte < 256; byte++) {
            uint32_t before = table[lane - 1][byte];
            table[lane][byte] = before >> 8 ^ table[0][before & 255];
        }
}

uint32_t crc32_add(uint32_t crc, const void *bytes, size_t size) {
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    pthread_once(&once, fill);
    const uint8_t *b = bytes;
    crc = ~crc;
    for (; size >= LANES; size -= LANES, b += LANES)
        crc = table[7][(crc ^ b[0]) & 255] ^ table[6][(crc >> 8 ^ b[1]) & 255] ^
              table[5][(crc >> 16 ^ b[2]) & 255] ^ table[4][crc >> 24 ^ b[3]] ^ table[3][b[4]] ^
              table[2][b[5]] ^ table[1][b[6]] ^ table[0][b[7]];
    for (; size > 0; size--, b++)
        crc = crc >> 8 ^ table[0][(crc ^ *b) & 255];
    return ~crc;
}
