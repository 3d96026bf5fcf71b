#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <locale.h>
#include <string.h>

#include "drivers/spectrometer_eeprom.h"
#include "tests/support/fake_usb.h"

static struct fake_usb f;
static struct calibration c;
static struct err e;

static int decode(const char *model) {
    err_clear(&e);
    return spectrometer_eeprom_decode((const uint8_t(*)[15])f.slot, spectrometer_model_find(model), &c, &e);
}

static void start(void) {
    fake_usb_init(&f, "usb2000plus", true);
}

static void text_ends_at_the_nul_and_numbers_know_no_locale(void **state) {
    (void)state;
    start();
    setlocale(LC_ALL, "de_DE.UTF-8"); /* where it is installed, the decimal sign is a comma */
    fake_usb_slot(&f, 1, "  340.3  ");
    fake_usb_slot(&f, 3, "-1.5E-005");
    assert_int_equal(decode("usb2000plus"), 0);
    setlocale(LC_ALL, "C");
    assert_string_equal(c.serial, "USB2+F01234");
    assert_string_equal(c.model, "usb2000plus");
    assert_true(c.wavelength[0] == 340.3 && c.wavelength[2] == -1.5e-5 && c.wavelength[3] == -2.1e-9);
    assert_true(c.nonlinearity_used);
    assert_int_equal(c.nonlinearity_order, 7);
    assert_true(c.nonlinearity[0] == 0.9 && c.nonlinearity[1] == 3.5e-6);
    assert_int_equal(c.saturation, 60000);
    assert_int_equal(c.pixels, 2048);
    memcpy(f.slot[0], "USB2+F012345678", 15); /* all 15 bytes, no NUL */
    assert_int_equal(decode("usb2000plus"), 0);
    assert_string_equal(c.serial, "USB2+F012345678");
}

static void a_blank_or_damaged_wavelength_is_refused(void **state) {
    static const char *const BAD[] = {"", "nan", "inf", "0x10", "1,5", "12 34", "-0.1", "0", "1e300", "9"};
    (void)state;
    for (size_t i = 0; i < sizeof BAD / sizeof BAD[0]; i++) {
        start();
        fake_usb_slot(&f, 2, BAD[i]);
        assert_int_equal(decode("usb2000plus"), -ERR_DEVICE);
        assert_non_null(strstr(e.text, "calibration"));
    }
    start();
    memset(f.slot, 0xff, sizeof f.slot);
    assert_int_equal(decode("usb2000plus"), -ERR_DEVICE);
    assert_non_null(strstr(e.text, "slot 1 "));
}

static void an_absurd_polynomial_is_replaced_and_said(void **state) {
    static const struct {
        int slot;
        const char *text;
    } BAD[] = {{14, ""},   {14, "8"},    {14, "2.5"}, {14, "-1"}, {6, "0"},
               {6, "1.6"}, {7, "-1e-4"}, {9, "x"},    {13, "nan"}};
    (void)state;
    for (size_t i = 0; i < sizeof BAD / sizeof BAD[0]; i++) {
        start();
        fake_usb_slot(&f, BAD[i].slot, BAD[i].text);
        assert_int_equal(decode("usb2000plus"), 0);
        assert_false(c.nonlinearity_used);
        assert_int_equal(c.nonlinearity_order, 0);
        assert_true(c.nonlinearity[0] == 1 && c.nonlinearity[1] == 0);
    }
    start();
    fake_usb_slot(&f, 14, "1"); /* what lies beyond the order is not used */
    fake_usb_slot(&f, 13, "nan");
    assert_int_equal(decode("usb2000plus"), 0);
    assert_true(c.nonlinearity_used);
    assert_true(c.nonlinearity[2] == 0);
}

static void saturation_is_binary(void **state) {
    static const struct {
        int stored, meant;
    } CASE[] = {{0, 65535}, {0xffff, 65535}, {4096, 4096}, {0x55f0, 0x55f0}, {4095, 0}, {1, 0}};
    (void)state;
    for (size_t i = 0; i < sizeof CASE / sizeof CASE[0]; i++) {
        start();
        f.slot[17][4] = CASE[i].stored & 0xff;
        f.slot[17][5] = CASE[i].stored >> 8;
        assert_int_equal(decode("usb2000plus"), CASE[i].meant ? 0 : -ERR_DEVICE);
        if (CASE[i].meant)
            assert_int_equal(c.saturation, CASE[i].meant);
    }
}

static void a_serial_that_is_no_text_is_empty(void **state) {
    (void)state;
    start();
    memset(f.slot[0], 0xff, 15);
    assert_int_equal(decode("usb2000plus"), 0);
    assert_string_equal(c.serial, "");
    memcpy(f.slot[0], "USB\x01", 5);
    assert_int_equal(decode("usb2000plus"), 0);
    assert_string_equal(c.serial, "");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(text_ends_at_the_nul_and_numbers_know_no_locale),
        cmocka_unit_test(a_blank_or_damaged_wavelength_is_refused),
        cmocka_unit_test(an_absurd_polynomial_is_replaced_and_said),
        cmocka_unit_test(saturation_is_binary),
        cmocka_unit_test(a_serial_that_is_no_text_is_empty),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
