#include <stdio.h>
#include <string.h>

#include "sim/ocean.h"

/* Slots of spectrometer-ocean.md 3.5. */
enum {
    SLOT_SERIAL = 0,
    SLOT_WAVELENGTH = 1,
    SLOT_STRAY = 5,
    SLOT_NONLINEARITY = 6,
    SLOT_ORDER = 14,
    SLOT_BENCH = 15,
    SLOT_CONFIG = 16,
    SLOT_SATURATION = 17,
    SLOT_BAUD = 18
};

/* Text, its NUL, and after it whatever an earlier, longer text left: readers must stop at the NUL. */
static void text(struct ocean *o, int slot, const char *value) {
    static const uint8_t garbage[OCEAN_SLOT_BYTES] = {0x33, 0x2E, 0x37, 0x00, 0xFF, 0x45, 0x2D, 0x30,
                                                      0x39, 0x00, 0x31, 0xA5, 0x5A, 0xFF, 0x37};
    size_t n = strnlen(value, OCEAN_SLOT_BYTES - 1);
    memcpy(o->eeprom[slot], garbage, OCEAN_SLOT_BYTES);
    memcpy(o->eeprom[slot], value, n);
    o->eeprom[slot][n] = 0;
}

static void number(struct ocean *o, int slot, double value) {
    char buffer[32];
    snprintf(buffer, sizeof buffer, "%.7g", value);
    text(o, slot, buffer);
}

static void saturation(struct ocean *o) {
    uint8_t *slot = o->eeprom[SLOT_SATURATION];
    memset(slot, 0, OCEAN_SLOT_BYTES);
    slot[4] = (uint8_t)o->model->saturation;
    slot[5] = (uint8_t)(o->model->saturation >> 8);
}

void ocean_eeprom_fill(struct ocean *o, const char *serial) {
    memset(o->eeprom, 0xFF, sizeof o->eeprom);
    text(o, SLOT_SERIAL, serial);
    for (int k = 0; k < 4; k++)
        number(o, SLOT_WAVELENGTH + k, o->model->wavelength[k]);
    text(o, SLOT_STRAY, "0.0005");
    for (int k = 0; k < 8; k++)
        number(o, SLOT_NONLINEARITY + k, o->model->nonlinearity[k]);
    text(o, SLOT_ORDER, "7");
    text(o, SLOT_BENCH, "03 GG2 025");
    text(o, SLOT_CONFIG, "A2L 1");
    saturation(o);
    text(o, SLOT_BAUD, "9600");
}

/* As the chip comes from its maker. */
void ocean_eeprom_blank(struct ocean *o) {
    memset(o->eeprom, 0xFF, sizeof o->eeprom);
}

/* A decimal point that has become a digit: the wavelengths run away. */
void ocean_eeprom_corrupt(struct ocean *o) {
    text(o, SLOT_WAVELENGTH + 1, "03801456");
}
