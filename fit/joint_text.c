#include "fit/joint_text.h"

#include <math.h>
#include <stdio.h>

/* Of the bench, as rows among the shared parameters: as all bands tell it, or P as stated where they do not. */
static void print_found(const struct joint *j) {
    if (j->u_mirror_offset_deg > 0) {
        printf("  %-11s %14.8g %12.3g\n", "offset, deg", j->mirror_offset_deg, j->u_mirror_offset_deg);
    }
    if (j->u_polarisation > 0) {
        printf("  %-11s %14.8g %12.3g\n", "P", j->polarisation, j->u_polarisation);
    }
}

static void print_shared(const struct joint *j) {
    for (int p = 0; p < MATERIAL_PARAMETERS; p++) {
        const char *name = material_parameter_name(j->model, p);
        if (name && isfinite(j->value[p]) && joint_row(j, p, -1) < 0) {
            printf("  %-11s %14.8g %12s  %s\n", name, j->value[p], "-",
                   j->at_bound[p] ? "at its bound" : "not identifiable: no lobe shows it");
        } else if (name && isfinite(j->value[p])) {
            printf("  %-11s %14.8g %12.3g\n", name, j->value[p], joint_u(j, p, -1));
        }
    }
}

void joint_text_print(const struct joint *j) {
    printf("  joint fit of %d bands, %d values: chi-square %.5g, expected %.5g%s\n", j->n_bands, j->n_values,
           j->chi2, j->chi2_expected, j->misfit ? ": the model does not fit, u from sweep scatter" : "");
    print_shared(j);
    print_found(j);
    for (int b = 0; b < BANDS; b++) {
        if (!isfinite(j->s_lambda[b])) {
            continue;
        }
        printf("  S(%d nm)   %14.8g %12.3g", band_nm(b), j->s_lambda[b], joint_u(j, MATERIAL_S, b));
        if (j->beta_prime_per_band) {
            printf("  beta' %12.8g %10.3g", j->beta_prime[b], joint_u(j, MATERIAL_BETA_PRIME, b));
        }
        putchar('\n');
    }
}
