/*
 * stopwatch.h — how long a part of the work took, for reports and the progress bar; nothing is decided by it.
 */
#ifndef FIT_STOPWATCH_H
#define FIT_STOPWATCH_H

#ifdef __cplusplus
extern "C" {
#endif

double stopwatch_s(void);     /* CLOCK_MONOTONIC */
double stopwatch_cpu_s(void); /* of this process, all threads, user and system */

#ifdef __cplusplus
}
#endif

#endif
