#include "fit/published.h"

const struct published published[PUBLISHED_SETS] = {
    {"acrylic", "on an acrylic board", {0.10, 0.35, 0.05, 126, 1.40}},
    {"0 %", "on drawing paper, no water", {0.12, 0.2, 0.2, 15.7, 1.70}},
    {"60 %", "on drawing paper, 60 % of water", {0.20, 0.3, 0.07, 7.6, 1.70}},
    {"90 %", "on drawing paper, 90 % of water", {0.30, 0.5, 0.08, 1.6, 2.42}},
};
