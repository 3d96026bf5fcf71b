/*
 * az_registers.h — an AZ drive as its bus sees it: Modbus PDUs in, PDUs out, over the plant of one axis.
 *
 * Function codes 03, 06, 08 (echo), 10h and 17h; exceptions 01 function, 02 address, 03 count, 04 value or not
 * executable. 32-bit items, even address = high word. Modelled: direct data operation (types 1 to 3, every
 * trigger), driver input command (START is ignored; ZHOME, STOP, FREE, ALM-RST), output status, positions and
 * speeds, alarms with history, alarm reset edge, P-PRESET, software limits, temperatures, internal outputs at
 * 0x0178. Other addresses below AZ_SPACE read as 0, as reserved ones do; above it exception 02. Transactions
 * take no time of their own.
 *
 * ZHOME stands for whichever home the site has wired to bit 4 and gives coordinates to a unit without any.
 * Bits at 0x0178 in the order of the sheet: 0 FW-SLS, 1 RV-SLS, 2 ORGN-STLD, 3 PRST-STLD, 4 ABSPEN (no source
 * gives their places).
 *
 * Source     stage-modbus.md 1; no profile is read, so that an error in a profile shows against it.
 * Checked    tests/unit/test_sim_axis.c
 */
#ifndef SIM_AZ_REGISTERS_H
#define SIM_AZ_REGISTERS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sim/axis_plant.h"

#define AZ_SPACE 0x0400
#define AZ_PDU_MAX 253
#define AZ_HISTORY 10

struct az_config {
    int unit;
    double home_speed, home_accel; /* steps/s, steps/s^2 */
    double hard_low, hard_high;    /* limit switches in steps; equal = none */
    int watchdog_ms;               /* communication timeout, 0 = off */
    bool mute;
    bool no_coordinates; /* home was never set: absolute moves end in alarm 4Ah */
    int32_t at_steps;
};

struct az_unit {
    struct az_config config;
    struct plant plant;
    uint16_t image[AZ_SPACE]; /* what was written */
    bool coordinates;
    int alarm; /* present once alarm_us has come */
    int64_t alarm_us;
    int history[AZ_HISTORY];
    int64_t fed_us; /* last valid message on the bus; INT64_MAX before the first */
    int64_t order_us;
};

void az_init(struct az_unit *u, const struct az_config *config, uint64_t key, double u_repeat_deg,
             double lost_motion_deg);
/* A valid message has passed on the bus, for whichever unit. */
void az_feed(struct az_unit *u, int64_t now_us);
/* Brings what has happened by itself up to now: the expiry of the watchdog. */
void az_update(struct az_unit *u, int64_t now_us);
/* Returns the length of the reply, 0 for none. */
size_t az_reply(struct az_unit *u, int64_t now_us, const uint8_t *pdu, size_t size,
                uint8_t reply[AZ_PDU_MAX]);

#endif
