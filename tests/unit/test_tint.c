#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "fit/render/tint.h"

#define N 1003

/* The wide kernel has the bits of the plain one, from any place and for any number of pixels. */
static void the_width_changes_no_bit(void **state) {
    (void)state;
    unsigned short dice[3] = {5, 5, 6};
    static double a[N], b[N], c[N], wide[3][N], plain[3][N];
    struct colour_matrix m;
    for (int i = 0; i < 9; i++)
        m.m[i / 3][i % 3] = erand48(dice) - 0.3;
    for (int i = 0; i < N; i++) {
        a[i] = erand48(dice);
        b[i] = erand48(dice);
        c[i] = 100 * erand48(dice);
    }
    for (size_t n = 0; n < N; n += n < 20 ? 1 : 97) {
        for (int missing = 0; missing < 4; missing++) {
            size_t from = n % 3;
            const double *pb = missing & 1 ? NULL : b, *pc = missing & 2 ? NULL : c;
            memset(wide, 0, sizeof wide);
            memset(plain, 0, sizeof plain);
            tint_add(&m, n - (n ? from : 0), a, pb, pc, (double *const[]){wide[0] + from, wide[1], wide[2]});
            tint_add_plain(&m, n - (n ? from : 0), a, pb, pc,
                           (double *const[]){plain[0] + from, plain[1], plain[2]});
            assert_memory_equal(wide, plain, sizeof wide);
            double abc[3] = {a[0], pb ? b[0] : 0, pc ? c[0] : 0}, one[3];
            colour_apply(&m, abc, one);
            if (n > 2)
                assert_true(wide[0][from] == one[0] && wide[1][0] == one[1] && wide[2][0] == one[2]);
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(the_width_changes_no_bit)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
