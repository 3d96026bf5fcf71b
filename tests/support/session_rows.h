/*
 * session_rows.h — rows for tests of the session file: every field set, different for every number n.
 */
#ifndef TESTS_SUPPORT_SESSION_ROWS_H
#define TESTS_SUPPORT_SESSION_ROWS_H

#include "proto/session.h"

#define ROW_PIXELS 64
#define ROW_SCANS 3

/* A call that must succeed; inside it, e is a struct err *. */
#define ROW_OK(call)                                                                                         \
    do {                                                                                                     \
        struct err e_ = {0}, *e = &e_;                                                                       \
        if ((call) < 0)                                                                                      \
            fail_msg("%s: %s", #call, e_.text);                                                              \
    } while (0)

/* counts: the caller's, ROW_SCANS * ROW_PIXELS. */
void row_exposure(int n, struct exposure *x, uint16_t *counts);
void row_point(int n, int64_t exposure_id, struct point *p);
void row_bracket(int n, struct bracket *b);
void row_estimate(int n, struct estimate *m);
void row_calibration(struct calibration *c);

/* A session open for writing: calibration, texts "job" and "seed", and n exposures with a provisional point each. */
struct session *row_fill(const char *path, int n_points);

/* A fresh path in a folder of its own under TMPDIR; row_remove_folder deletes both. */
void row_make_folder(char folder[64], char path[96]);
void row_remove_folder(const char *folder);

/* The same as setup and teardown of a test. */
extern char row_folder[64], row_path[96];
int row_setup(void **state);
int row_teardown(void **state);

#endif
