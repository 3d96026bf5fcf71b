/* Nanoseconds a point of the model with all its derivatives: plain, and each width of the kernel that this processor has.
 * The least of many runs over the paper's grid of 198 points. */
#include <stdio.h>
#include <time.h>

#include "fit/reflectance_wide.h"

#define N 198
#define ROOM 200
#define CALLS 50
#define RUNS 400

static struct reflectance_geometry geometry[N];
static struct reflectance_batch batch;
static double memory[(ROOM + 16) * REFLECTANCE_BATCH_COLUMNS], beta[ROOM], slope[MATERIAL_PARAMETERS * ROOM];
static const struct reflectance_optics optics = {.kappa = 1, .q = 1};

static double now_ns(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

static void once(int width, enum reflectance_model model, const double *value) {
    if (width < 0) {
        reflectance_eval(model, N, geometry, value, &optics, beta, slope, NULL);
    } else {
        reflectance_batch_eval_with((enum reflectance_width)width, &batch, 0, N, model, value, &optics, beta,
                                    slope, ROOM, NULL);
    }
}

static double measure(int width, enum reflectance_model model, const double *value) {
    double least = 1e300;
    for (int run = 0; run < RUNS; run++) {
        double start_ns = now_ns();
        for (int call = 0; call < CALLS; call++) {
            once(width, model, value);
        }
        double each_ns = (now_ns() - start_ns) / (CALLS * N);
        least = each_ns < least ? each_ns : least;
    }
    return least;
}

int main(void) {
    static const char *const names[] = {"plain", "SSE2", "AVX2", "AVX-512"};
    for (int i = 0; i < N; i++) {
        reflectance_geometry(&geometry[i], 10 + 10 * (i / 33), -80 + 5 * (i % 33), NULL);
    }
    reflectance_batch_fill(&batch, N, geometry, memory);
    for (int m = 0; m < REFLECTANCE_MODELS; m++) {
        enum reflectance_model model = (enum reflectance_model)m;
        double value[MATERIAL_PARAMETERS] = {0.2, 0.3, 0.07, 7.6, 1.7, 0.7, 0.5};
        value[MATERIAL_EXTRA_1] = model == REFLECTANCE_TRANSMITTED ? 1.5 : value[MATERIAL_EXTRA_1];
        printf("| model %s with all derivatives, ns a point |  |", reflectance_name(model));
        for (int width = -1; width <= (int)reflectance_batch_width(); width++) {
            printf("%s %s %.1f", width < 0 ? "" : ",", names[width + 1], measure(width, model, value));
        }
        printf(" |  |\n");
    }
    return 0;
}
