/*
 * diffuser.h — the white reference diffuser, which is not Lambertian, and the certificate that came with it.
 *
 * f = 1.055 - 0.13 s + 0.10 F + c F^4, s = sin^2 theta_i + sin^2 theta_v, F = sin theta_i sin theta_v (> 0 on the
 * mirror side), c = 0.717 forwards and 0.26 backwards: reciprocal, 0.85..1.49 in the plane, shaped after sintered
 * PTFE. Tabulated at theta_i 0..75 by 15, theta_v -80..80 by 5, 380..780 nm by 100, and linear between the nodes:
 * that table is the certificate, and the truth is the same table times one factor drawn from the certificate's u.
 *
 * Domain     theta_i 0..75, |theta_v| <= 80; beyond it the nearest value of the table.
 * Source     reflection-model.md 5.2: 0.86 at 75:-30, 1.06 near normal, 1.49 at 75:64.
 * Checked    tests/unit/test_sim_light.c
 */
#ifndef SIM_DIFFUSER_H
#define SIM_DIFFUSER_H

#include "proto/bands.h"

/* As certified, for all bands; theta_i_deg >= 0, theta_v_deg > 0 on the mirror side. */
void diffuser_certified(double theta_i_deg, double theta_v_deg, double beta[BANDS]);

#endif
