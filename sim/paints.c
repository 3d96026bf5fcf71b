#include <math.h>
#include <string.h>

#include "sim/sim.h"

/* Published sets (paper-nishi-tominaga.md, Experimental results): Hooker's Green; water in per cent by
 * weight. The paper prints no set for the other two paints: they stand on the same ones. */
struct published {
    int water_percent;
    double sigma, gamma, beta_prime, n;
};

static const struct published ACRYLIC = {0, 0.35, 0.05, 126.0, 1.40};
static const struct published PAPER[] = {
    {0, 0.2, 0.2, 15.7, 1.70}, {60, 0.3, 0.07, 7.6, 1.70}, {90, 0.5, 0.08, 1.6, 2.42}};

/* Colours of our own making: S = low + (high - low) * shape^p. A peak and an edge make the shape. */
struct colour {
    const char *name;
    double peak_nm, peak_width_nm, peak; /* peak = 0: none */
    double edge_nm, edge_width_nm, edge; /* height of the rise towards the red */
};

static const struct colour COLOURS[] = {
    {"Cadmium Red", 0, 1, 0, 602, 13, 1},
    {"Hooker's Green", 522, 42, 1, 752, 14, 0.7},
    {"Cobalt Blue Hue", 458, 46, 1, 728, 14, 0.8},
};

#define S_LOW 0.038
#define WATER_MAX 90

static double mix(double a, double b, double f) {
    return a + f * (b - a);
}

static double shape(const struct colour *c, double nm) {
    double x = (nm - c->peak_nm) / c->peak_width_nm;
    double y = c->peak * exp(-x * x) + c->edge / (1 + exp((c->edge_nm - nm) / c->edge_width_nm));
    return fmin(y, 1);
}

/* More water leaves a paler, less saturated layer on paper (paper, Figures 5 and 8); a black board stays
 * dark. */
static void set_colour(const struct colour *c, bool paper, double water, struct sim_surface *s) {
    double high = paper ? mix(0.48, 0.62, water) : mix(0.46, 0.40, water);
    double power = mix(1, 0.65, water);
    for (int k = 0; k < BANDS; k++)
        s->s_lambda[k] = S_LOW + (high - S_LOW) * pow(shape(c, band_nm(k)), power);
}

/* Between published sets: roughness and index linear in the amount of water, the height of the lobe in its
 * log. */
static void set_roughness(int water_percent, struct sim_surface *s) {
    const struct published *a = PAPER;
    while (a[1].water_percent < water_percent)
        a++;
    double f = (water_percent - a->water_percent) / (double)(a[1].water_percent - a->water_percent);
    s->sigma = mix(a->sigma, a[1].sigma, f);
    s->gamma = mix(a->gamma, a[1].gamma, f);
    s->n = mix(a->n, a[1].n, f);
    s->beta_prime = f == 0   ? a->beta_prime
                    : f == 1 ? a[1].beta_prime
                             : exp(mix(log(a->beta_prime), log(a[1].beta_prime), f));
}

static const struct colour *find_colour(const char *paint) {
    for (size_t i = 0; i < sizeof COLOURS / sizeof *COLOURS; i++)
        if (strcasecmp(COLOURS[i].name, paint) == 0)
            return &COLOURS[i];
    return NULL;
}

int sim_paint_find(const char *paint, const char *support, int water_percent, struct sim_surface *surface,
                   struct err *e) {
    const struct colour *colour = find_colour(paint);
    bool paper = strcasestr(support, "paper") != NULL;
    if (!colour)
        return err_set(e, ERR_INPUT,
                       "no simulated paint is called '%s': write paint: Cadmium Red, Hooker's Green or "
                       "Cobalt Blue Hue",
                       paint);
    if (!paper && !strcasestr(support, "acrylic"))
        return err_set(e, ERR_INPUT,
                       "no simulated support is called '%s': write support: acrylic board or drawing paper",
                       support);
    if (water_percent < 0 || water_percent > WATER_MAX)
        return err_set(e, ERR_INPUT, "the simulated paints hold 0 to %d %% of water, not %d %%", WATER_MAX,
                       water_percent);
    *surface = (struct sim_surface){
        .sigma = ACRYLIC.sigma, .gamma = ACRYLIC.gamma, .beta_prime = ACRYLIC.beta_prime, .n = ACRYLIC.n};
    strncpy(surface->name, colour->name, sizeof surface->name - 1);
    if (paper)
        set_roughness(water_percent, surface);
    set_colour(colour, paper, water_percent / (double)WATER_MAX, surface);
    return 0;
}
