/*
 * verb_export.h — a session in the forms of other programs.
 *
 * csv        the form that goniofit reads: theta_i_deg,theta_v_deg,beta,u_beta,u_ind,u_common_rel of the visible
 *            mean; with --spectrum beta_380nm,u_380nm,... instead. u is the total, drift included; u_common_rel the
 *            certificate's share, one scale for all. Final points only; points without a mean are left out, and so
 *            are bands that any point lacks.
 * astm       ASTM E1392-style: angles in radians, phi_s = pi on the mirror side, BRDF in 1/sr = beta / pi, a column
 *            for each band that every point has.
 * pcapng     the Modbus exchanges as RTU frames (CRC added) on link type 147 (USER0), for Wireshark's mbrtu
 *            dissector: -o 'uat:user_dlts:"User 0 (DLT=147)","mbrtu","0","","0",""'. An exchange without reply is
 *            one packet.
 * Errors     -ERR_STATE nothing to export; -ERR_BUSY the file exists already; -ERR_IO, -ERR_FULL the file.
 * Checked    tests/unit/test_verbs_offline.c, tests/wire/test_pcapng.py (tshark)
 */
#ifndef DAEMON_VERB_EXPORT_H
#define DAEMON_VERB_EXPORT_H

#include <stdio.h>

#include "proto/session.h"

int export_csv(struct session *s, bool spectrum, FILE *out, struct err *e);
int export_astm(struct session *s, FILE *out, struct err *e);
int export_pcapng(struct session *s, FILE *out, struct err *e);

#endif
