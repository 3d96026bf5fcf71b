/*
 * redir_host.h — a USB redirection host of one toy device, in a thread of the test, for the client in
 * usb_link_redir.c.
 *
 * The toy takes orders as OUT transfers on 01: 'D' lo hi = send that many bytes (0, 1, 2, ... mod 251) on 82;
 * 'R' = reply "ok!" on 81; 'S' = stall the next read of 82; 'B' = send more on 82 than the read asks for; 'K'
 * = hang up; 'X' = say that the device was unplugged; 'H' = read nothing more. Reads are held per endpoint.
 */
#ifndef TESTS_SUPPORT_REDIR_HOST_H
#define TESTS_SUPPORT_REDIR_HOST_H

#include <stdbool.h>
#include <stdint.h>

struct redir_host;

enum redir_host_manner { REDIR_HOST_PROPER, REDIR_HOST_HANGS_UP, REDIR_HOST_NO_DEVICE, REDIR_HOST_SILENT };

/* where: "unix:PATH", or "tcp:" (a free port of 127.0.0.1). NULL if it cannot listen. */
struct redir_host *redir_host_start(const char *where, uint16_t vid, uint16_t pid,
                                    enum redir_host_manner manner);
const char *redir_host_target(const struct redir_host *host); /* for usb_link_open */
int redir_host_cleared(const struct redir_host *host);        /* CLEAR_FEATURE requests seen */
int redir_host_resets(const struct redir_host *host);
void redir_host_stop(struct redir_host *host);

#endif
