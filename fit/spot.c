#include "fit/spot.h"

#include <math.h>
#include <string.h>

#define PER_DEG (M_PI / 180)

static double tangent(double theta_deg) {
    return tan(theta_deg * PER_DEG);
}

void spot_at(const struct estimate_input *in, size_t i, struct spot *s) {
    double sign = in->mirrored && in->mirrored[i] ? -1 : 1;
    *s = (struct spot){.own_reference = in->reference == ESTIMATE_REFERENCE_OWN};
    s->zeros_cancel = s->own_reference ||
                      (in->filling == ESTIMATE_VIEW_IN_BEAM && in->reference == ESTIMATE_REFERENCE_INCIDENCE);
    if (in->filling == ESTIMATE_VIEW_IN_BEAM) { /* theta_i = source - sample */
        s->source = -sign * tangent(in->theta_i_deg[i]) * PER_DEG;
        s->sample = -s->source;
    } else if (in->filling == ESTIMATE_BEAM_IN_VIEW) {
        s->sample = -sign * tangent(in->theta_v_deg[i]) * PER_DEG;
    }
}

int spot_find_filling(const char *name, enum estimate_filling *filling, struct err *e) {
    bool view = strcmp(name, "view-in-beam") == 0;
    if (!view && strcmp(name, "beam-in-view") != 0) {
        return err_set(e, ERR_USAGE, "no filling is called %s; there are view-in-beam and beam-in-view",
                       name);
    }
    *filling = view ? ESTIMATE_VIEW_IN_BEAM : ESTIMATE_BEAM_IN_VIEW;
    return 0;
}

int spot_find_reference(const char *mode, enum estimate_reference *reference, struct err *e) {
    static const struct {
        const char *name;
        enum estimate_reference reference;
    } known[] = {{"fixed", ESTIMATE_REFERENCE_FIXED},
                 {"start_end", ESTIMATE_REFERENCE_FIXED},
                 {"per_incidence", ESTIMATE_REFERENCE_INCIDENCE},
                 {"every_geometry", ESTIMATE_REFERENCE_OWN}};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++) {
        if (strcmp(mode, known[i].name) == 0) {
            *reference = known[i].reference;
            return 0;
        }
    }
    return err_set(e, ERR_USAGE,
                   "no reference mode is called %s; there are fixed, per_incidence, every_geometry and "
                   "start_end",
                   mode);
}
