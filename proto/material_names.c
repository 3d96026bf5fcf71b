/* What the parameters of each model and the losses are called. */
#include "proto/material.h"

#include <string.h>

static const struct {
    const char *model;
    const char *name[MATERIAL_PARAMETERS];
} models[] = {
    {"lambert", {[MATERIAL_S] = "S"}},
    {"oren-nayar", {[MATERIAL_S] = "S", [MATERIAL_SIGMA] = "sigma"}},
    {"eq1",
     {[MATERIAL_S] = "S",
      [MATERIAL_GAMMA] = "gamma",
      [MATERIAL_BETA_PRIME] = "beta_prime",
      [MATERIAL_N] = "n"}},
    {"composite", {"S", "sigma", "gamma", "beta_prime", "n"}},
    {"heavy-tail", {"S", "sigma", "gamma", "beta_prime", "n", "tail"}},
    {"transmitted", {"S", "sigma", "gamma", "beta_prime", "n", "n_d"}},
    {"two-lobe", {"S", "sigma", "gamma", "beta_prime", "n", "gamma_2", "beta_prime_2"}},
};

const char *const material_losses[MATERIAL_LOSSES + 1] = {"ml", "ols", "log", "cuberoot", "cosine", NULL};

const char *material_loss_name(enum material_loss loss) {
    return material_losses[loss];
}

enum material_loss material_loss_find(const char *name) {
    int loss = 0;
    while (loss < MATERIAL_LOSSES && strcmp(name, material_loss_name((enum material_loss)loss)) != 0)
        loss++;
    return (enum material_loss)loss;
}

const char *material_parameter_name(const char *model, int index) {
    if (index < 0 || index >= MATERIAL_PARAMETERS)
        return NULL;
    for (size_t i = 0; i < sizeof models / sizeof *models; i++)
        if (strcmp(models[i].model, model) == 0)
            return models[i].name[index];
    return NULL;
}

int material_parameter_find(const char *model, const char *name) {
    for (int i = 0; name && i < MATERIAL_PARAMETERS; i++) {
        const char *known = material_parameter_name(model, i);
        if (known && strcmp(known, name) == 0)
            return i;
    }
    return -1;
}
