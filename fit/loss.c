#include "fit/loss.h"

#include <math.h>

#include "proto/units.h"

#define TANGENT_BELOW 0.005

double loss_value(enum material_loss loss, double beta, double *slope) {
    const double at = fmax(beta, TANGENT_BELOW);
    double value = beta;
    *slope = 1;
    if (loss == MATERIAL_LOSS_LOG) {
        *slope = 1 / at;
        value = log(at) + (beta - at) * *slope;
    } else if (loss == MATERIAL_LOSS_CUBEROOT) {
        const double root = cbrt(at);
        *slope = root / (3 * at);
        value = root + (beta - at) * *slope;
    }
    return value;
}

bool loss_is_linear(enum material_loss loss) {
    return loss != MATERIAL_LOSS_LOG && loss != MATERIAL_LOSS_CUBEROOT;
}

double loss_weight(enum material_loss loss, double theta_i_deg, double u) {
    return loss == MATERIAL_LOSS_ML       ? 1 / u
           : loss == MATERIAL_LOSS_COSINE ? cos(rad_from_deg(theta_i_deg))
                                          : 1;
}

int loss_find(const char *name, enum material_loss *loss, struct err *e) {
    *loss = material_loss_find(name);
    if (*loss < MATERIAL_LOSSES) {
        return 0;
    }
    return err_set(e, ERR_USAGE, "there is no loss '%s'; known are ml, ols, log, cuberoot and cosine", name);
}
