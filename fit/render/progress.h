/*
 * progress.h — a bar with the time left, on stderr, redrawn at most ten times a second.
 *
 * progress_show may be called from any thread, one at a time. Nothing tests what it draws.
 */
#ifndef FIT_RENDER_PROGRESS_H
#define FIT_RENDER_PROGRESS_H

#include <stdbool.h>

struct progress {
    bool on;
    double started_s, shown_s;
};

void progress_start(struct progress *p, bool on);
void progress_show(struct progress *p, double done); /* 0..1 */
void progress_end(struct progress *p);               /* wipes the bar */

#endif
