#include "sim/sim.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sim/draw.h"
#include "sim/sim_bench.h"

void sim_config_default(struct sim_config *config) {
    *config = (struct sim_config){.seed = 1,
                                  .spectrometer = "usb2000plus",
                                  .serial = "USB2+SIM001",
                                  .filling = SIM_VIEW_IN_BEAM,
                                  .beam_mm = 20,
                                  .view_mm = 3,
                                  .lamp_drift_rate = 1e-9, /* 0.1 % in 1000 s */
                                  .lamp_warm_up_min = 30,
                                  .stray_light = 5e-4, /* spectrometer-ocean.md 7: < 0.05 % at 600 nm */
                                  .certificate_u_rel = 0.005, /* reflection-model.md 5.2 */
                                  .n_axes = TRUTH_ROLES,
                                  .n_positions = 3,
                                  .position = {{"sample", 0}, {"reference", 90}, {"trap", 180}}};
    for (int r = 0; r < TRUTH_ROLES; r++) {
        struct sim_axis_config *a = &config->axis[r];
        /* repeatability and lost motion of a DGII stage: stage-modbus.md 1.8 */
        *a = (struct sim_axis_config){.unit = r + 1,
                                      .direction = 1,
                                      .u_zero_deg = 0.01,
                                      .u_repeat_deg = 0.002,
                                      .lost_motion_deg = 0.033,
                                      .speed_deg_s = 20,
                                      .accel_deg_s2 = 40,
                                      .watchdog_ms = 1000};
        strcpy(a->role, truth_roles[r]);
    }
}

static int find_role(const char *role) {
    int r = 0;
    while (r < TRUTH_ROLES && strcmp(truth_roles[r], role) != 0)
        r++;
    return r;
}

static int check(const struct sim_config *c, struct err *e) {
    if (c->n_axes < 0 || c->n_axes > SIM_AXES || c->n_positions < 0 || c->n_positions > SIM_POSITIONS)
        return err_set(e, ERR_INPUT, "the simulated bench takes at most %d axes and %d holder positions",
                       SIM_AXES, SIM_POSITIONS);
    if (!(c->beam_mm > 0) || !(c->view_mm > 0))
        return err_set(e, ERR_INPUT, "the simulated beam and view need diameters above 0, not %g and %g mm",
                       c->beam_mm, c->view_mm);
    if ((c->filling == SIM_VIEW_IN_BEAM) != (c->view_mm <= c->beam_mm))
        return err_set(e, ERR_INPUT, "a view of %g mm and a beam of %g mm do not fill as the config says",
                       c->view_mm, c->beam_mm);
    for (int i = 0; i < c->n_axes; i++)
        if (find_role(c->axis[i].role) == TRUTH_ROLES)
            return err_set(e, ERR_INPUT, "a simulated axis is source, sample or holder, not %s",
                           c->axis[i].role);
    return 0;
}

static void add_unit(struct sim_bench *b, const struct sim_axis_config *a) {
    const struct truth_axis *axis = &b->truth.axis[find_role(a->role)];
    struct az_config config = {.unit = a->unit,
                               .home_speed = a->speed_deg_s * PLANT_STEPS_PER_DEG,
                               .home_accel = a->accel_deg_s2 * PLANT_STEPS_PER_DEG,
                               .hard_low = a->switch_low_deg * PLANT_STEPS_PER_DEG,
                               .hard_high = a->switch_high_deg * PLANT_STEPS_PER_DEG,
                               .watchdog_ms = a->watchdog_ms,
                               .mute = a->mute,
                               .no_coordinates = a->no_coordinates,
                               .at_steps =
                                   (int32_t)lround(axis->direction * a->zero_deg * PLANT_STEPS_PER_DEG)};
    struct az_unit *unit = &b->unit[b->n_units++];
    az_init(unit, &config, draw_fold(draw_fold(b->config.seed, draw_word("repeat")), draw_word(a->role)),
            b->config.quiet ? 0 : a->u_repeat_deg, a->lost_motion_deg);
    b->truth.axis[find_role(a->role)].unit = unit;
}

static void frame(void *self, const struct ocean_window *w, uint16_t *counts) {
    struct sim_bench *b = self;
    truth_frame(&b->truth, w->from_us, w->to_us, w->exposure_us, counts);
}

static void lamp(void *self, int64_t now_us, bool on) {
    struct sim_bench *b = self;
    if (!b->config.shutter_by_hand)
        lamp_switch(&b->truth.lamp, now_us, on);
}

void sim_bench_shutter(struct sim_bench *bench, bool open) {
    lamp_switch(&bench->truth.lamp, clock_now_us(bench->clock), open);
}

int sim_bench_new(struct sim_bench **bench, const struct sim_config *config, struct clock *clock,
                  struct err *e) {
    const struct detector_model *model = detector_model(config->spectrometer);
    if (!model)
        return err_set(e, ERR_INPUT,
                       "no simulated spectrometer is called %s; there are usb2000plus and usb4000",
                       config->spectrometer);
    int rc = check(config, e);
    if (rc)
        return rc;
    struct sim_bench *b = calloc(1, sizeof *b);
    if (!b)
        return err_set(e, ERR_NOMEM, "no memory for the simulated bench");
    b->config = *config;
    b->clock = clock;
    rc = truth_init(&b->truth, config, model, e);
    if (rc) {
        free(b);
        return rc;
    }
    for (int i = 0; i < config->n_axes; i++)
        add_unit(b, &config->axis[i]);
    ocean_init(&b->ocean, model, config->serial, &(struct ocean_bench){b, frame, lamp});
    if (config->eeprom == SIM_EEPROM_BLANK)
        ocean_eeprom_blank(&b->ocean);
    else if (config->eeprom == SIM_EEPROM_CORRUPT)
        ocean_eeprom_corrupt(&b->ocean);
    *bench = b;
    return 0;
}

void sim_bench_free(struct sim_bench *bench) {
    if (!bench)
        return;
    truth_free(&bench->truth);
    free(bench);
}

static struct truth_mount *position(struct sim_bench *bench, const char *name, struct err *e) {
    struct truth_mount *m = (struct truth_mount *)truth_mount_find(&bench->truth, name);
    if (!m)
        err_set(e, ERR_INPUT, "the simulated holder has no position called %s", name);
    return m;
}

int sim_bench_mount(struct sim_bench *bench, const char *holder_position, const struct sim_surface *surface,
                    struct err *e) {
    struct truth_mount *m = position(bench, holder_position, e);
    if (!m)
        return -ERR_INPUT;
    bench->truth.sight.mount = NULL;
    m->kind = TRUTH_SURFACE;
    m->surface = *surface;
    surface_spline(surface->s_lambda, m->spline);
    return 0;
}

int sim_bench_hold(struct sim_bench *bench, const char *holder_position, struct err *e) {
    struct truth_mount *m = position(bench, holder_position, e);
    if (!m)
        return -ERR_INPUT;
    bench->truth.held = (int)(m - bench->truth.mount);
    return 0;
}

int sim_bench_turn(struct sim_bench *bench, const char *role, double user_deg, struct err *e) {
    int r = find_role(role);
    if (r == TRUTH_ROLES || bench->truth.axis[r].unit)
        return err_set(e, ERR_INPUT, "no axis called %s of the simulated bench is turned by hand", role);
    bench->truth.axis[r].manual_deg = user_deg;
    return 0;
}

double sim_bench_true_deg(const struct sim_bench *bench, const char *role) {
    int r = find_role(role);
    return r < TRUTH_ROLES ? truth_axis_deg(&bench->truth, r, clock_now_us(bench->clock)) : NAN;
}

void sim_bench_set_visits(struct sim_bench *bench, const char *holder_position, int32_t source_udeg,
                          int32_t sample_udeg, int exposure_us, bool lamp_on, int visits) {
    struct truth *t = &bench->truth;
    const struct truth_mount *m = truth_mount_find(t, holder_position);
    int32_t steps[TRUTH_ROLES] = {truth_raw_steps(t, TRUTH_SOURCE, source_udeg * 1e-6),
                                  truth_raw_steps(t, TRUTH_SAMPLE, sample_udeg * 1e-6)};
    if (m && t->axis[TRUTH_HOLDER].unit)
        steps[TRUTH_HOLDER] = truth_raw_steps(t, TRUTH_HOLDER, m->position.deg);
    else if (m)
        steps[TRUTH_HOLDER] = truth_raw_steps(t, TRUTH_HOLDER, (double)(m - t->mount));
    uint64_t state = truth_state(t, steps, lamp_on, (uint32_t)exposure_us);
    int more = visits - truth_add_visits(t, state, 0);
    truth_add_visits(t, state, more);
    for (int r = 0; r < TRUTH_ROLES;
         r++) /* each visit of a state is at most one arrival: no draw comes twice */
        if (t->axis[r].unit)
            plant_add_visits(&t->axis[r].unit->plant, steps[r], more);
}

void sim_bench_update(struct sim_bench *bench, int64_t now_us) {
    for (int i = 0; i < bench->n_units; i++)
        az_update(&bench->unit[i], now_us);
}

size_t sim_bench_bus(struct sim_bench *bench, int64_t now_us, int unit, const uint8_t *pdu, size_t size,
                     uint8_t reply[AZ_PDU_MAX]) {
    size_t n = 0;
    for (int i = 0; i < bench->n_units; i++)
        az_feed(&bench->unit[i], now_us);
    for (int i = 0; i < bench->n_units; i++)
        if (bench->unit[i].config.unit == unit)
            n = az_reply(&bench->unit[i], now_us, pdu, size, reply);
    return n;
}
