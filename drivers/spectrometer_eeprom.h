/*
 * spectrometer_eeprom.h — the calibration that a classic Ocean spectrometer carries in its EEPROM slots.
 *
 * Slots 0 serial, 1-4 wavelength, 6-13 and 14 non-linearity, 17 saturation (spectrometer-ocean.md 3.5, 2.3).
 * Text ends at the first NUL; what follows is garbage; a slot of FF was never written. Numbers are decimals
 * with a point, whatever the locale.
 *
 * Errors     -ERR_DEVICE where no honest calibration can be made: wavelengths blank, not ascending over the
 *            active pixels or outside 150..1200 nm; a saturation level below 4096 counts. A blank serial is
 *            empty; a blank saturation is 65535; a blank or absurd polynomial is replaced by 1, and says so.
 * Checked    tests/unit/test_spectrometer_eeprom.c
 */
#ifndef DRIVERS_SPECTROMETER_EEPROM_H
#define DRIVERS_SPECTROMETER_EEPROM_H

#include <stdint.h>

#include "drivers/spectrometer.h"
#include "drivers/spectrometer_wire.h"

#define SPECTROMETER_EEPROM_SLOTS 18

typedef uint8_t spectrometer_eeprom_slots[SPECTROMETER_EEPROM_SLOTS][SPECTROMETER_WIRE_SLOT];

int spectrometer_eeprom_read(struct spectrometer_wire *w, spectrometer_eeprom_slots slots,
                             const struct cancel *cancel, struct err *e);
int spectrometer_eeprom_decode(const spectrometer_eeprom_slots slots, const struct spectrometer_model *model,
                               struct calibration *calibration, struct err *e);

#endif
