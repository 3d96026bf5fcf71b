/*
 * optics.h — how much light of a surface reaches the fibre, from irradiance, spots and etendue.
 *
 * A parallel beam of diameter beam_mm carries a flux of 1; on the surface it lights an ellipse beam / cos theta_i
 * long. Irradiance E = cos theta_i / (pi beam^2 / 4) inside it. The sensor sees an ellipse view / cos theta_v long;
 * radiance L = beta E / pi there; the light it takes is L x overlap area of both ellipses x cos theta_v x its solid
 * angle (the same at every angle). Either spot may be the inner one, or neither: the overlap of two ellipses with
 * one centre and one direction of axes is exact in all three cases.
 *
 * optics_throughput is that light for beta = 1, relative to the same at theta_i = theta_v = 0; 0 beyond grazing.
 *
 * Angles     signed degrees.
 * Source     geometry alone; the normalisation formula of measurement.md 1 is not used.
 * Checked    tests/unit/test_sim_light.c against cases worked out by hand
 */
#ifndef SIM_OPTICS_H
#define SIM_OPTICS_H

struct optics {
    double beam_mm, view_mm;
};

double optics_overlap_mm2(const struct optics *o, double theta_i_deg, double theta_v_deg);
double optics_throughput(const struct optics *o, double theta_i_deg, double theta_v_deg);

#endif
