/*
 * modbus_peer.h — a Modbus unit made of raw bytes, for what no library would send: late, lost, doubled,
 * garbled replies, over a pty (RTU) or a TCP socket, answered by a thread.
 *
 * Register N holds the value N until it is written. Request number n (from 0) is treated by act[n % n_act].
 */
#ifndef TESTS_SUPPORT_MODBUS_PEER_H
#define TESTS_SUPPORT_MODBUS_PEER_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

enum {
    PEER_DROP = 1,
    PEER_TWICE = 2,
    PEER_BAD_CRC = 4,
    PEER_REFUSE = 8,
    PEER_OTHER_UNIT = 16,
    PEER_HANG_UP = 32
};

struct peer_act {
    int delay_ms;
    int flags;
};

struct peer_reply {
    int64_t due_ms;
    int size;
    uint8_t bytes[300];
};

struct modbus_peer {
    bool tcp;
    int fd, listen_fd;
    char target[96]; /* for modbus_link_config */
    const struct peer_act *act;
    int n_act;
    atomic_int requests;
    atomic_bool end;
    pthread_t thread;
    uint16_t reg[65536];
    struct peer_reply pending[16];
    int n_pending;
    int last_function, last_addr;
};

void modbus_peer_start(struct modbus_peer *peer, bool tcp, const struct peer_act *act, int n_act);
void modbus_peer_stop(struct modbus_peer *peer);

#endif
