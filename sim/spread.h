/*
 * spread.h — the directions that a source or a sensor of finite width takes up, each with its share of the light.
 *
 * An even share for every angle of the width, by Simpson's rule over SPREAD_PANELS panels: nine directions, for an
 * average that is finer than any fit's. A width of 0 is one direction.
 * Checked    tests/unit/test_sim_aperture.c
 */
#ifndef SIM_SPREAD_H
#define SIM_SPREAD_H

#define SPREAD_PANELS 8 /* even */

struct spread {
    int n;
    double by_deg[SPREAD_PANELS + 1]; /* from the middle */
    double share[SPREAD_PANELS + 1];  /* sum 1 */
};

void spread_fill(struct spread *spread, double width_deg);

#endif
