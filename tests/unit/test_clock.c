#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <time.h>

#include "drivers/clock.h"
#include "tests/support/kept.h"

static void virtual_time_moves_only_by_advance(void **state) {
    (void)state;
    struct clock c;
    clock_init_virtual(&c);
    assert_int_equal(clock_now_us(&c), 0);
    clock_gap(&c, 3000);
    assert_int_equal(clock_stamp(&c), 0);
    clock_advance(&c, 42);
    clock_advance(&c, 42);
    assert_int_equal(clock_stamp(&c), 42);
    assert_true(clock_utc_us(&c) == CLOCK_VIRTUAL_EPOCH_S * 1000000LL + 42);
}

static void real_time_is_read_at_a_stamp_only(void **state) {
    (void)state;
    struct clock c;
    clock_init_real(&c);
    int64_t took_us;
    int tries = 0;
    do {
        int64_t before = clock_stamp(&c);
        clock_gap(&c, 3000);
        assert_true(clock_now_us(&c) == before);
        took_us = clock_stamp(&c) - before;
        assert_true(took_us >= 3000);
    } while (!kept(&tries, "a gap of 3 ms", took_us, 2000000));
}

static void real_utc_is_the_time_of_day(void **state) {
    (void)state;
    struct clock c;
    clock_init_real(&c);
    clock_gap(&c, 2000);
    int64_t before_s = time(NULL);
    clock_stamp(&c);
    int64_t utc_s = clock_utc_us(&c) / 1000000;
    assert_in_range(utc_s, before_s - 2, time(NULL) + 2);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(virtual_time_moves_only_by_advance),
        cmocka_unit_test(real_time_is_read_at_a_stamp_only),
        cmocka_unit_test(real_utc_is_the_time_of_day),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
