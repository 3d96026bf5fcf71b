/*
 * tap.h — a Modbus TCP wire between goniod and goniosim on which a test can look, and lose replies.
 *
 * A relay on loopback in a thread of its own, one client at a time, frame by frame. Every request is noted with the
 * time at which it came out at the simulator's side; replies can be swallowed, as from a mute unit. A patient
 * tap's clock goes on only while the tap itself is served by the machine: one that stands still makes nobody late.
 */
#ifndef TESTS_SUPPORT_TAP_H
#define TESTS_SUPPORT_TAP_H

#include <stdbool.h>
#include <stdint.h>

struct tap;

/* target: "tcp:HOST:PORT"; link: room for the tap's own. */
struct tap *tap_open(const char *target, char link[96]);
void tap_patient(struct tap *t); /* for tests; a figure of a bench is in real time */
void tap_close(struct tap *t);
#define TAP_NOBODY 0
#define TAP_EVERYBODY (-1)
void tap_mute(struct tap *t, int unit); /* whose replies are swallowed from now on */
int64_t tap_now_us(struct tap *t);
/* The longest time without a request between these two times of the tap. */
int64_t tap_silence_us(struct tap *t, int64_t from_us, int64_t to_us);
/* The first stop order (om-az: bit 5 of the command word at 7Ch) to this unit at or after since_us; -1: none. */
int64_t tap_stop_us(struct tap *t, int unit, int64_t since_us);

#endif
