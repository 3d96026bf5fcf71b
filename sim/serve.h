/*
 * serve.h — the simulated bench on real wires: Modbus TCP, Modbus RTU on a pty, a spectrometer over usbredir.
 *
 * Each server is a listener in the reactor's loop; all share one bench and the real clock. They listen on
 * 127.0.0.1, on a unix socket or on a pty of this machine, never further. Endpoints come out in the form that
 * goniod.yaml takes as a link. Every Modbus bus reaches every drive, as if each had two ports.
 *
 * Replies    leave reply_delay_us after their request, in order; a request that comes meanwhile is answered
 *            after it, so that a host which gave up too early meets a late reply.
 * Errors     -ERR_IO, -ERR_BUSY (port or path in use), -ERR_NOMEM.
 * Checked    tests/wire/
 */
#ifndef SIM_SERVE_H
#define SIM_SERVE_H

#include <stdint.h>

#include "sim/reactor.h"
#include "sim/sim_bench.h"

struct serve {
    struct sim_bench *bench;
    struct reactor *reactor;
    int64_t reply_delay_us;
};

/* port 0: any. */
int serve_modbus_tcp(const struct serve *s, int port, char *endpoint, size_t size, struct err *e);
/* link_path: a symbolic link to make to the pty, or NULL. */
int serve_modbus_rtu(const struct serve *s, const char *link_path, char *endpoint, size_t size,
                     struct err *e);
/* where: "tcp:PORT" (0: any) or "unix:PATH". */
int serve_usbredir(const struct serve *s, const char *where, char *endpoint, size_t size, struct err *e);

/* serve_socket.c: listening sockets on this machine. */
int serve_listen_tcp(int port, int *fd, int *bound_port, struct err *e);
int serve_listen_unix(const char *path, int *fd, struct err *e);
int serve_accept(int listener); /* non-blocking, no delay; -1: nobody there */

#endif
