/*
 * exposure.h — one set of scans in one state of the bench: counts, times, readbacks.
 *
 * Counts     raw, as the instrument sent them, n_scans * pixels, scan by scan.
 * Times      microseconds of the session's clock; settled < start < end < next move (a dark needs no settled stage).
 * Angles     microdegrees; theta_v > 0 on the mirror side.
 * Checked    tests/unit/test_session.c
 */
#ifndef PROTO_EXPOSURE_H
#define PROTO_EXPOSURE_H

#include <stdbool.h>
#include <stdint.h>

enum exposure_kind {
    EXPOSURE_SAMPLE,
    EXPOSURE_REFERENCE,
    EXPOSURE_DARK,
    EXPOSURE_TRAP,
    EXPOSURE_OVERLAP, /* the diffuser at one of two exposure times (session_linearity.h) */
    EXPOSURE_KINDS
};

struct exposure { /* one set of scans in one state of the bench */
    int64_t id;   /* given by session_add_exposure, counts from 1 */
    int step;     /* index into the plan */
    int attempt;  /* 0 first; a shorter repeat of a saturated set is the next */
    enum exposure_kind kind;
    int bracket; /* counts from 1; 0 = belongs to none; of a control reading: the one it closes */
    int opens; /* a control reading: the bracket it opens, 0 = none; the reading between n and n + 1 does both
                */
    bool control;                                  /* a reading of the brackets' control geometry */
    int32_t theta_i_udeg, theta_v_udeg;            /* nominal; theta_v > 0 on the mirror side */
    bool mirrored;                                 /* measured with both axes negated */
    int32_t source_udeg, sample_udeg, holder_udeg; /* readbacks */
    int64_t settled_us, start_us, end_us;          /* settled < start < end < next move */
    int64_t utc_us;
    int exposure_us, n_scans, pixels;
    int saturated_pixels; /* the worst scan's; > 0 marks the whole set */
    bool lamp;
    double temperature_c; /* NaN = not read */
    uint16_t *counts;     /* n_scans * pixels, scan by scan; the caller's memory */
};

#endif
