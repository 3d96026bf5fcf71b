/*
 * points_csv.h — radiance factors from a CSV file into a fitset.
 *
 * Columns    theta_i_deg,theta_v_deg, then either beta[,u_beta][,u_ind][,u_common_rel] (total; independent; one
 *            fully correlated scale), or by wavelength beta_550nm[,u_550nm],...: the visible mean is then that of
 *            the columns within mean_nm. With u_beta and u_ind what u_ind leaves of u_beta is taken as one common
 *            cause; u_beta alone is taken as independent, and the estimate says so.
 * Domain     |theta| < 90 deg; wavelengths 380..780 nm, at most one column to each 5 nm band.
 * Errors     -ERR_INPUT, all of them in errors with file:line:column.
 * Checked    tests/unit/test_points.c, tests/fuzz/fuzz_points.c
 */
#ifndef FIT_POINTS_CSV_H
#define FIT_POINTS_CSV_H

#include "fit/fitset.h"

int points_csv_read(const char *file, const char *text, size_t size, struct fitset *data,
                    struct err_list *errors);

#endif
