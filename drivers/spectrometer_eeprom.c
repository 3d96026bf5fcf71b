#include "drivers/spectrometer_eeprom.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "proto/number.h"

#define SLOT_SERIAL 0 /* spectrometer-ocean.md 3.5 */
#define SLOT_WAVELENGTH 1
#define SLOT_NONLINEARITY 6
#define SLOT_ORDER 14
#define SLOT_SATURATION 17
#define FULL_SCALE 65535
#define SATURATION_MIN 4096 /* under it not even the dark level of these units would fit (section 7) */
#define LAMBDA_MIN_NM 150   /* the widest silicon benches: 200-1100 nm (section 7) */
#define LAMBDA_MAX_NM 1200

int spectrometer_eeprom_read(struct spectrometer_wire *w, spectrometer_eeprom_slots slots,
                             const struct cancel *cancel, struct err *e) {
    static const uint8_t USED[] = {0, 1, 2, 3, 4, 6, 7, 8, 9, 10, 11, 12, 13, 14, 17};
    memset(slots, 0xff, SPECTROMETER_EEPROM_SLOTS * SPECTROMETER_WIRE_SLOT);
    for (size_t i = 0; i < sizeof USED; i++) {
        int rc = spectrometer_wire_slot(w, USED[i], slots[USED[i]], cancel, e);
        if (rc)
            return rc;
    }
    return 0;
}

/* The slot's text without blanks around it; empty if the slot was never written or holds no text. */
static void slot_text(const uint8_t slot[SPECTROMETER_WIRE_SLOT], char text[SPECTROMETER_WIRE_SLOT + 1]) {
    int n = 0;
    for (int i = 0; i < SPECTROMETER_WIRE_SLOT && slot[i]; i++) {
        if (slot[i] < ' ' || slot[i] > '~') {
            n = 0;
            break;
        }
        if (n || slot[i] != ' ')
            text[n++] = (char)slot[i];
    }
    while (n && text[n - 1] == ' ')
        n--;
    text[n] = '\0';
}

static bool slot_number(const uint8_t slot[SPECTROMETER_WIRE_SLOT], double *value) {
    char text[SPECTROMETER_WIRE_SLOT + 1];
    slot_text(slot, text);
    return number_read_double(text, value);
}

static int decode_wavelengths(const spectrometer_eeprom_slots slots, struct calibration *c, struct err *e) {
    for (int k = 0; k < 4; k++) {
        if (slot_number(slots[SLOT_WAVELENGTH + k], &c->wavelength[k]))
            continue;
        char text[SPECTROMETER_WIRE_SLOT + 1];
        slot_text(slots[SLOT_WAVELENGTH + k], text);
        return err_set(
            e, ERR_DEVICE,
            "EEPROM slot %d of the spectrometer holds '%s', expected a wavelength coefficient: its "
            "calibration is blank or damaged, have it written again by the maker",
            SLOT_WAVELENGTH + k, text);
    }
    double last = LAMBDA_MIN_NM;
    for (int p = c->active_first; p <= c->active_last; p++) {
        double nm = calibration_lambda_nm(c, p);
        if (!(nm > last && nm < LAMBDA_MAX_NM))
            return err_set(
                e, ERR_DEVICE,
                "the wavelengths in the spectrometer's EEPROM reach %g nm at pixel %d, expected to "
                "ascend within %d..%d nm: its calibration is damaged",
                nm, p, LAMBDA_MIN_NM, LAMBDA_MAX_NM);
        last = nm;
    }
    return 0;
}

static void decode_nonlinearity(const spectrometer_eeprom_slots slots, struct calibration *c) {
    double order;
    bool good = slot_number(slots[SLOT_ORDER], &order) && order >= 0 && order <= 7 && order == floor(order);
    c->nonlinearity_order = good ? (int)order : 0;
    for (int k = 0; good && k <= c->nonlinearity_order; k++)
        good = slot_number(slots[SLOT_NONLINEARITY + k], &c->nonlinearity[k]);
    c->nonlinearity_used = false;
    if (good)
        calibration_judge_nonlinearity(c);
    if (c->nonlinearity_used)
        return;
    memset(c->nonlinearity, 0, sizeof c->nonlinearity);
    c->nonlinearity[0] = 1;
    c->nonlinearity_order = 0;
}

static int decode_saturation(const uint8_t slot[SPECTROMETER_WIRE_SLOT], struct calibration *c,
                             struct err *e) {
    c->saturation = slot[4] | slot[5] << 8; /* spectrometer-ocean.md 2.3 */
    if (c->saturation == 0)
        c->saturation = FULL_SCALE;
    if (c->saturation < SATURATION_MIN)
        return err_set(
            e, ERR_DEVICE,
            "EEPROM slot %d of the spectrometer puts saturation at %d counts, expected %d..%d: its "
            "calibration is damaged",
            SLOT_SATURATION, c->saturation, SATURATION_MIN, FULL_SCALE);
    return 0;
}

int spectrometer_eeprom_decode(const spectrometer_eeprom_slots slots, const struct spectrometer_model *model,
                               struct calibration *calibration, struct err *e) {
    *calibration = (struct calibration){
        .pixels = model->pixels,
        .dark_first = model->dark_first,
        .dark_last = model->dark_last,
        .active_first = model->active_first,
        .active_last = model->active_last,
        .read_noise_counts = model->read_noise_counts,
        .electrons_per_count = model->electrons_per_count,
    };
    snprintf(calibration->model, sizeof calibration->model, "%s", model->name);
    slot_text(slots[SLOT_SERIAL], calibration->serial);
    decode_nonlinearity(slots, calibration);
    int rc = decode_wavelengths(slots, calibration, e);
    return rc ? rc : decode_saturation(slots[SLOT_SATURATION], calibration, e);
}
