/*
 * stopwatch.h — how long a part of the work took, for reports and the progress bar; nothing is decided by it.
 */
#ifndef FIT_RENDER_STOPWATCH_H
#define FIT_RENDER_STOPWATCH_H

double stopwatch_s(void); /* CLOCK_MONOTONIC */

#endif
