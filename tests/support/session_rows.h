/*
 * session_rows.h — rows for tests of the session file: every field set, different for every number n.
 */
#ifndef TESTS_SUPPORT_SESSION_ROWS_H
#define TESTS_SUPPORT_SESSION_ROWS_H

#include "proto/session.h"

#define ROW_PIXELS 64
#define ROW_SCANS 3

/* counts: the caller's, ROW_SCANS * ROW_PIXELS. */
void row_exposure(int n, struct exposure *x, uint16_t *counts);
void row_point(int n, int64_t exposure_id, struct point *p);
void row_bracket(int n, struct bracket *b);
void row_estimate(int n, struct estimate *m);
void row_calibration(struct calibration *c);

/* A fresh path in a folder of its own under TMPDIR; row_remove_folder deletes both. */
void row_make_folder(char folder[64], char path[96]);
void row_remove_folder(const char *folder);

#endif
