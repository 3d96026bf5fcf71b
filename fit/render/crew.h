/*
 * crew.h — pieces of a picture handed out to threads, with the progress bar, until all are done or it is cancelled.
 *
 * Threads    piece may run in any order and several at once; what it writes must be its own.
 * Cancel     *options->cancel != 0 ends the work after the pieces under way.
 * Promises   a thread that cannot be had is no error: the others do its part.
 * Checked    tests/unit/test_render.c, test_render_spread.c: the same bits for any number of threads
 */
#ifndef FIT_RENDER_CREW_H
#define FIT_RENDER_CREW_H

#include "fit/render/render.h"

/* 0: one for each processor. */
int crew_threads(int wanted);
/* piece(work, 0), ... piece(work, n - 1); how many were done. */
int crew_run(int n, const struct render_options *options, void (*piece)(void *work, int index), void *work);

#endif
