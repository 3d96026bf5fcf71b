#include "fit/render/trace.h"

struct shade_abc trace_shade(unsigned features, const struct shade_paint *p, const struct shade_half *half,
                             struct vec3 n, struct vec3 l, struct vec3 v) {
    switch (features) {
#define CASE(mask)                                                                                           \
    case mask:                                                                                               \
        return shade(mask, p, half, n, l, v);
#define CASES(more)                                                                                          \
    CASE(more)                                                                                               \
    CASE((more) | SHADE_SIGMA)                                                                               \
    CASE((more) | SHADE_SPECULAR)                                                                            \
    CASE((more) | SHADE_SPECULAR | SHADE_SIGMA)
        CASES(0)
        CASES(SHADE_HOISTED)
        CASES(SHADE_HOISTED | SHADE_LOBE_CUT)
        CASES(SHADE_RELATIVES)
        CASES(SHADE_RELATIVES | SHADE_HOISTED)
        CASES(SHADE_RELATIVES | SHADE_HOISTED | SHADE_LOBE_CUT)
#undef CASES
#undef CASE
    default: /* there is no other: a lobe is only cut where its half vector is hoisted */
        return shade(SHADE_RELATIVES | SHADE_SIGMA | SHADE_SPECULAR, p, half, n, l, v);
    }
}
