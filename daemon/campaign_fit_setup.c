/* What every question to the estimator says of job and bench. */
#include "daemon/campaign_private.h"

static double u_repeat_deg(const struct campaign *c, enum stage_axis which) {
    return instruments_u_repeat_deg(c->setup.config, which, c->instruments.profile[which]);
}

static json_t *polarisation_of(const struct config *k) {
    switch (k->optics.polarisation) {
    case POLARISATION_STATED:
        return json_pack("{s:f, s:f}", "value", k->optics.polarisation_p, "u", k->optics.u_polarisation);
    case POLARISATION_DEPOLARISED:
        return json_string("depolarised");
    default:
        return json_string("unknown");
    }
}

/* The settings of a question, which also go into the session: `goniofit fit S` asks the same. */
json_t *campaign_fit_setup(const struct campaign *c) {
    const struct config *k = c->setup.config;
    bool beam_in_view = k->optics.filling == FILLING_BEAM_IN_VIEW;
    return json_pack("{s:s, s:s, s:[i,i], s:f, s:f, s:f, s:f, s:f, s:f, s:o, s:s, s:s, s:b}", "model",
                     c->job->fit_model, "loss", material_loss_name(c->job->fit_loss), "mean_nm",
                     c->job->mean_nm[0], c->job->mean_nm[1], "u_repeat_source_deg",
                     u_repeat_deg(c, STAGE_SOURCE), "u_repeat_sample_deg", u_repeat_deg(c, STAGE_SAMPLE),
                     "u_zero_source_deg", k->source.u_zero_deg, "u_zero_sample_deg", k->sample.u_zero_deg,
                     "source_width_deg", k->optics.source_width_deg, "sensor_width_deg",
                     k->optics.sensor_width_deg, "polarisation", polarisation_of(k), "filling",
                     beam_in_view ? "beam-in-view" : "view-in-beam", "reference",
                     job_mode_name(c->job->reference.mode), "q_is_one", 0);
}
