#include "drivers/spectrometer.h"

#include <string.h>

/* spectrometer-ocean.md: identity 1, endpoints and sizes 2.2, pixel map 2.4 (electric dark: the intersection
 * of the sources), integration time 3.1, free-run models and read-out 4, noise 7.
 *
 * The USB4000 could integrate for 10 us, but below 3800 us its electronic shutter runs: no back-to-back
 * frames and a free-run model that no sheet states, so no start of an integration could be proved. */
static const struct spectrometer_model MODELS[] = {
    {
        .name = "usb2000plus",
        .title = "USB2000+ / Flame-S",
        .vid = 0x2457,
        .pid = 0x101e,
        .pixels = 2048,
        .dark_first = 6,
        .dark_last = 17,
        .active_first = 20,
        .active_last = 2047,
        .min_exposure_us = 1000,
        .max_exposure_us = 65535000,
        .discards = 2,
        .idle_cycles = 0,
        .readout_us = 870,
        .read_noise_counts = 50,
        .electrons_per_count = 0.99,
    },
    {
        .name = "usb4000",
        .title = "USB4000 / Flame-T",
        .vid = 0x2457,
        .pid = 0x1022,
        .pixels = 3840,
        .head_bytes = 2048,
        .dark_first = 5,
        .dark_last = 15,
        .active_first = 21,
        .active_last = 3668,
        .min_exposure_us = 3800,
        .max_exposure_us = 65535000,
        .discards = 1,
        .idle_cycles = 0.5,
        .readout_us = 3800,
        .read_noise_counts = 50,
        .electrons_per_count = 1.45,
    },
};

const struct spectrometer_model *spectrometer_models(int *n) {
    *n = sizeof MODELS / sizeof MODELS[0];
    return MODELS;
}

const struct spectrometer_model *spectrometer_model_find(const char *name) {
    for (size_t i = 0; i < sizeof MODELS / sizeof MODELS[0]; i++)
        if (strcmp(MODELS[i].name, name) == 0)
            return &MODELS[i];
    return NULL;
}
