#include "sim/diffuser.h"

#include <math.h>

#include "proto/output.h"
#include "proto/units.h"
#include "sim/sim.h"

enum {
    I_NODES = 6,
    I_STEP = 15,
    V_NODES = 33,
    V_STEP = 5,
    V_FIRST = -80,
    L_NODES = 5,
    L_STEP = 100,
    L_FIRST = 380
};

/* PTFE is a little darker at both ends of the visible range. */
static const double colour[L_NODES] = {0.988, 0.997, 1.000, 0.999, 0.996};

static double node(int i, int v) {
    double si = sin(rad_from_deg(I_STEP * i)), sv = sin(rad_from_deg(V_FIRST + V_STEP * v));
    double s = si * si + sv * sv, f = si * sv, f4 = f * f * f * f;
    double beta = 1.055 - 0.13 * s + 0.10 * f + (f > 0 ? 0.717 : 0.26) * f4;
    return round(beta * 1e5) / 1e5; /* as the certificate prints it */
}

static double clamp(double x, double low, double high) {
    return x < low ? low : x > high ? high : x;
}

static double certified_white(double theta_i_deg, double theta_v_deg) {
    double i = clamp(theta_i_deg / I_STEP, 0, I_NODES - 1);
    double v = clamp((theta_v_deg - V_FIRST) / V_STEP, 0, V_NODES - 1);
    int i0 = i >= I_NODES - 1 ? I_NODES - 2 : (int)i, v0 = v >= V_NODES - 1 ? V_NODES - 2 : (int)v;
    double fi = i - i0, fv = v - v0;
    return (1 - fi) * ((1 - fv) * node(i0, v0) + fv * node(i0, v0 + 1)) +
           fi * ((1 - fv) * node(i0 + 1, v0) + fv * node(i0 + 1, v0 + 1));
}

void diffuser_certified(double theta_i_deg, double theta_v_deg, double beta[BANDS]) {
    double white = certified_white(theta_i_deg, theta_v_deg);
    for (int k = 0; k < BANDS; k++) {
        int l = (band_nm(k) - L_FIRST) / L_STEP;
        if (l == L_NODES - 1)
            l--;
        double f = (band_nm(k) - L_FIRST - l * L_STEP) / (double)L_STEP;
        beta[k] = white * ((1 - f) * colour[l] + f * colour[l + 1]);
    }
}

static void write_rows(FILE *out, double u_rel) {
    for (int i = 0; i < I_NODES; i++)
        for (int v = 0; v < V_NODES; v++)
            for (int l = 0; l < L_NODES; l++) {
                double beta = node(i, v) * colour[l];
                fprintf(out, "%d,%.8f,%.8f,%d,%d\n", L_FIRST + L_STEP * l, beta, u_rel * beta, I_STEP * i,
                        V_FIRST + V_STEP * v);
            }
}

int sim_certificate_write(const struct sim_config *config, const char *path, struct err *e) {
    FILE *out = output_open(path, e);
    if (!out)
        return -e->code;
    fputs("# geometry: in-plane table\n# k: 1\n# serial: SIM-PTFE-1\n# date: 2025-11-03\n"
          "# valid_until: 2030-11-03\nlambda_nm,beta,u,theta_i_deg,theta_v_deg\n",
          out);
    write_rows(out, config->certificate_u_rel);
    return output_close(out, path, 0, e);
}
