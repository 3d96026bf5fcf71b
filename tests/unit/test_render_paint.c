#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <unistd.h>

#include "fit/render/colour.h"
#include "fit/render/paint.h"
#include "fit/render/sha256.h"
#include "proto/session.h"
#include "sim/sim.h"

static void the_examples_of_fips_180(void **state) {
    (void)state;
    char hex[65];
    sha256_of_bytes("abc", 3, hex);
    assert_string_equal(hex, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    sha256_of_bytes("", 0, hex);
    assert_string_equal(hex, "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
    sha256_of_bytes("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq", 56, hex);
    assert_string_equal(hex, "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
    char *million = malloc(1000000);
    memset(million, 'a', 1000000);
    sha256_of_bytes(million, 1000000, hex);
    assert_string_equal(hex, "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
    free(million);
}

static struct estimate estimate_of(void) {
    struct estimate m = {.model = "composite", .converged = true, .has_spectrum = true, .kappa = 1};
    double value[] = {.3, .35, .05, 126, 1.4};
    memcpy(m.value, value, sizeof value);
    for (int k = 0; k < BANDS; k++)
        m.s_lambda[k] = k < 4 || k > 60 || k == 20 ? NAN : 0.1 + 0.01 * k;
    m.band_first = 4;
    m.band_last = 60;
    return m;
}

static void bands_that_were_not_measured_are_held(void **state) {
    (void)state;
    struct paint p = {.estimate = estimate_of()};
    double even[BANDS], share = 0, whole = 0;
    assert_int_equal(paint_prepare(&p, NULL), 0);
    assert_true(p.s[0] == p.estimate.s_lambda[4] && p.held[0] && p.held[3] && !p.held[4]);
    assert_true(p.s[80] == p.estimate.s_lambda[60] && p.held[61] && !p.held[60]);
    assert_true(fabs(p.s[20] - 0.3) < 1e-15 && p.held[20]);
    const double(*cmf)[3] = colour_cmf(COLOUR_2DEG);
    for (int k = 0; k < BANDS; k++) {
        even[k] = 1;
        whole += p.s[k] * cmf[k][2];
        share += p.held[k] ? p.s[k] * cmf[k][2] : 0;
    }
    assert_true(fabs(paint_held_share(&p, even, cmf) - share / whole) < 1e-15); /* Z is the worst here */
    assert_true(share / whole > PAINT_HELD_WARNING);
}

static void what_is_no_material_is_refused(void **state) {
    (void)state;
    struct err e = {0};
    struct paint p = {.name = "x", .estimate = estimate_of()};
    p.estimate.value[MATERIAL_N] = 0.9;
    assert_int_equal(paint_prepare(&p, &e), -ERR_RANGE);
    assert_non_null(strstr(e.text, "n is 0.9"));
    p.estimate = estimate_of();
    p.estimate.value[MATERIAL_GAMMA] = NAN;
    assert_int_equal(paint_prepare(&p, NULL), -ERR_RANGE);
    p.estimate = estimate_of();
    for (int k = 0; k < BANDS; k++)
        p.estimate.s_lambda[k] = NAN;
    assert_int_equal(paint_prepare(&p, NULL), -ERR_STATE);
    p.estimate = estimate_of();
    snprintf(p.estimate.model, sizeof p.estimate.model, "unheard");
    assert_true(paint_prepare(&p, NULL) < 0);
}

static void a_session_gives_its_last_estimate(void **state) {
    (void)state;
    char path[] = "/tmp/goniod-paint-XXXXXX";
    struct session *s;
    struct paint p = {0};
    struct err e = {0};
    struct estimate m = estimate_of();
    close(mkstemp(path));
    unlink(path);
    if (session_create(&s, path, &e))
        fail_msg("%s", e.text);
    m.value[MATERIAL_SIGMA] = 0.1;
    assert_int_equal(session_add_estimate(s, 1, 0, &m, &e), 0);
    m.value[MATERIAL_SIGMA] = 0.2;
    assert_int_equal(session_add_estimate(s, 2, 0, &m, &e), 0);
    assert_int_equal(session_close(s, &e), 0);
    if (paint_from_session(&p, path, &e))
        fail_msg("%s", e.text);
    assert_true(p.estimate.value[MATERIAL_SIGMA] == 0.2 && p.s[10] == m.s_lambda[10]);
    assert_int_equal(strlen(p.sha256), 64);
    unlink(path);
    assert_true(paint_from_session(&p, path, NULL) < 0);
}

static void a_session_without_a_spectrum_is_refused(void **state) {
    (void)state;
    char path[] = "/tmp/goniod-paint-XXXXXX";
    struct session *s;
    struct paint p = {0};
    struct err e = {0};
    struct estimate m = estimate_of();
    close(mkstemp(path));
    unlink(path);
    m.has_spectrum = false;
    assert_int_equal(session_create(&s, path, &e), 0);
    assert_int_equal(session_add_estimate(s, 1, 0, &m, &e), 0);
    assert_int_equal(session_close(s, &e), 0);
    assert_int_equal(paint_from_session(&p, path, &e), -ERR_STATE);
    assert_non_null(strstr(e.text, "no S(lambda)"));
    unlink(path);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_examples_of_fips_180),
        cmocka_unit_test(bands_that_were_not_measured_are_held),
        cmocka_unit_test(what_is_no_material_is_refused),
        cmocka_unit_test(a_session_gives_its_last_estimate),
        cmocka_unit_test(a_session_without_a_spectrum_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
