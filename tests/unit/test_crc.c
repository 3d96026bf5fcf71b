#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "proto/crc.h"

static void published_values(void **state) {
    (void)state;
    assert_int_equal(crc32_add(0, "", 0), 0);
    assert_int_equal(crc32_add(0, "123456789", 9),
                     0xCBF43926); /* the check value of every catalogue of CRCs */
    assert_int_equal(crc32_add(0, "The quick brown fox jumps over the lazy dog", 43), 0x414FA339);
}

/* The definition, bit by bit. */
static uint32_t slowly(const uint8_t *bytes, size_t size) {
    uint32_t crc = 0xFFFFFFFF;
    for (size_t i = 0; i < size; i++)
        for (int bit = 0; bit < 8; bit++) {
            uint32_t top = (crc ^ bytes[i] >> bit) & 1;
            crc = top ? crc >> 1 ^ 0xEDB88320u : crc >> 1;
        }
    return ~crc;
}

static void every_length_and_any_cut(void **state) {
    (void)state;
    uint8_t bytes[67];
    uint32_t seed = 1;
    for (size_t i = 0; i < sizeof bytes; i++)
        bytes[i] = (uint8_t)((seed = seed * 1664525 + 1013904223) >> 24);
    for (size_t n = 0; n <= sizeof bytes; n++) {
        uint32_t whole = slowly(bytes, n);
        assert_int_equal(crc32_add(0, bytes, n), whole);
        for (size_t cut = 0; cut <= n; cut += 5)
            assert_int_equal(crc32_add(crc32_add(0, bytes, cut), bytes + cut, n - cut), whole);
    }
}

static void any_flipped_bit_shows(void **state) {
    (void)state;
    static uint8_t bytes[16384]; /* a set of four scans */
    uint32_t whole = crc32_add(0, bytes, sizeof bytes);
    for (size_t i = 0; i < sizeof bytes; i += 97)
        for (int bit = 0; bit < 8; bit++) {
            bytes[i] ^= (uint8_t)(1 << bit);
            assert_int_not_equal(crc32_add(0, bytes, sizeof bytes), whole);
            bytes[i] ^= (uint8_t)(1 << bit);
        }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(published_values),
        cmocka_unit_test(every_length_and_any_cut),
        cmocka_unit_test(any_flipped_bit_shows),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
