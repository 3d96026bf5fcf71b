#include "sim/spread.h"

void spread_fill(struct spread *s, double width_deg) {
    s->n = width_deg > 0 ? SPREAD_PANELS + 1 : 1;
    for (int k = 0; k < s->n; k++) {
        double weight = k == 0 || k == SPREAD_PANELS ? 1 : k % 2 ? 4 : 2;
        s->by_deg[k] = s->n > 1 ? width_deg * ((double)k / SPREAD_PANELS - 0.5) : 0;
        s->share[k] = s->n > 1 ? weight / (3 * SPREAD_PANELS) : 1;
    }
}
