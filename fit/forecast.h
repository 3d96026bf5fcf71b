/*
 * forecast.h — what a fit will know of a surface, from the angles alone, before anything is measured.
 *
 * Covariance H V H^T (measurement.md 8) of the model's parameters at assumed values, its weights and slopes those of
 * struct problem: independent are the noise of a reading, that of a reference reading of its own, and the axis
 * repeatability; in common the certificate (one scale), each dark, each control reading, what linearisation leaves, the axis
 * zeros and the polarisation; statistical, too, the lamp's drift between the control readings. Mirror offset and P are free
 * with their priors, as they are in the fit (fit/nuisance.h). A parameter is named as not identifiable where its u passes
 * half its size (of n: of n - 1), as in the verdict of a fit; or where another one takes its part so closely (correlation
 * beyond 0.9995) that its u rests on a model without error, which no paint obeys. Such a one comes with the geometry that
 * would tell the most about it (fit/suggest.h).
 *
 * Left out   stray light, of the spectrometer and of the bench: of a grey surface it cancels, and a spectrum is not known;
 *            the light of each band (a lamp's blue is dim, so that the reference's noise and the darks weigh more there);
 *            what the exposures find on their way (a ladder, a dark kept too long); a model that does not fit.
 * Noise      u of a visible mean of a reading at its exposure's target, of counting and of reading out; what is dimmer than
 *            1 / span of the brightest geometry stays below the target, for its exposure is at its longest.
 * Darks      one for each exposure time, of a ladder of quarter octaves, and for each interval: points share it that have
 *            both in common. The darks of reference readings, at their target, are shared by an interval.
 * Units      degrees; u of the parameters' own units; certificate_rel relative.
 * Errors     -ERR_RANGE an angle; -ERR_NOMEM. Too few geometries, or angles that tell nothing, are an answer: every u is
 *            infinite then.
 * Source     measurement.md 6, 8; reflection-model.md 3.
 * Checked    tests/unit/test_forecast.c: figures of reflection-model.md 3.1 and 3.2; against estimate_fit;
 *            tests/scenario/test_forecast_campaign.py: against what simulated campaigns state
 */
#ifndef FIT_FORECAST_H
#define FIT_FORECAST_H

#include "fit/suggest.h"
#include "fit/published.h"

#ifdef __cplusplus
extern "C" {
#endif

struct forecast_noise { /* what is 0 does not occur; span is never below 1 */
    double relative;    /* counting, at the target */
    double read;        /* reading out, as a part of the reading at the target */
    double reference;   /* of a reference reading of the point's own, relative */
    double absolute;    /* as a radiance factor, whatever the exposure */
    double span;        /* longest over shortest exposure; infinite: every geometry reaches its target */
    double colour; /* mean of the diffuse part over its brightest band, which sets the exposure; 0: white */
    double dark;   /* one dark, of a sample or reference reading, as a part of the reading at the target */
    double linearity;    /* what linearisation leaves at the target, relative */
    const int *interval; /* [n] of darks; NULL: one */
    size_t n_controls;
    const double *control; /* [n_controls * n] relative change of beta by one u of each control reading */
};

struct forecast {
    double u[MATERIAL_PARAMETERS], statistical[MATERIAL_PARAMETERS],
        common[MATERIAL_PARAMETERS]; /* standard */
    bool not_identifiable[MATERIAL_PARAMETERS];
    char why[MATERIAL_PARAMETERS][160];
    struct suggestion next[MATERIAL_PARAMETERS]; /* where not identifiable */
};

/* angles: n, theta_i_deg, theta_v_deg, mirrored, the uncertainties of the axes, polarisation, hold_offset, filling,
 * reference, widths, brackets and model of a fit's input; the rest is not read. */
int forecast_make(const struct estimate_input *angles, const struct forecast_noise *noise,
                  double certificate_rel, const double *value, struct forecast *forecast, struct err *e);

#ifdef __cplusplus
}
#endif

#endif
