#include "fit/render/light.h"
#include "proto/units.h"

void light_beam_aim(struct light *light, int picture) {
    double theta = rad_from_deg(light->theta_deg[light->n_theta > 1 ? picture : 0]);
    double azimuth = rad_from_deg(light->azimuth_deg);
    light->direction = (struct vec3){sin(theta) * cos(azimuth), sin(theta) * sin(azimuth), cos(theta)};
}
