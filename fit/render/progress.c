#include "fit/render/progress.h"

#include <stdio.h>

#include "fit/stopwatch.h"

#define CELLS 40
#define REDRAW_S 0.1

void progress_start(struct progress *p, bool on) {
    p->on = on;
    p->started_s = p->shown_s = on ? stopwatch_s() : 0;
}

void progress_show(struct progress *p, double done) {
    if (!p->on) {
        return;
    }
    double now = stopwatch_s();
    if (now - p->shown_s < REDRAW_S || !(done > 0)) {
        return;
    }
    int cells = (int)(done * CELLS);
    p->shown_s = now;
    fprintf(stderr, "\r[%.*s%*s] %3.0f %%, %.0f s left ", cells, "########################################",
            CELLS - cells, "", 100 * done, (now - p->started_s) * (1 - done) / done);
    fflush(stderr);
}

void progress_end(struct progress *p) {
    if (p->on && p->shown_s > p->started_s) {
        fprintf(stderr, "\r%*s\r", CELLS + 24, "");
    }
}
