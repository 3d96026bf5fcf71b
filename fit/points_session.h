/*
 * points_session.h — the final points of a session file into a fitset, with their common parts and drift.
 *
 * Settings (model, mean_nm, axis uncertainties) from the session's text "fit_setup" where it is there. Provisional
 * points that no final one has replaced are used only where the session has no final point at all.
 * Errors     those of proto/session.h; -ERR_INPUT for a broken fit_setup.
 * Checked    tests/unit/test_points.c
 */
#ifndef FIT_POINTS_SESSION_H
#define FIT_POINTS_SESSION_H

#include "fit/fitset.h"

int points_session_read(const char *path, struct fitset *data, struct err *e);

#endif
