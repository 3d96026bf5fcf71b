/* Work by hand between campaigns: where, home, move, spectrum, devices, commission. One order at a time; `stop` ends it. */
#include "daemon/campaign_private.h"

#include <string.h>

#define SPECTRUM_SCANS_MAX 1000
#define MOVE_MAX_DEG 1000
#define BUS_TRIES 2
#define BUS_PAUSE_US (700 * US_PER_MS) /* longer than the first pause before a link is opened again */
#define GUESS_US (100 * US_PER_MS)
#define TRIES 8
#define TARGET 0.8 /* of saturation, as the job's default */
#define ANSWER_TEXT 600

static int open_axis(struct campaign *c, const char *name, int *which, struct err *e) {
    *which = stage_axis_find(name);
    if (*which < 0)
        return err_set(e, ERR_USAGE, "there is no axis \"%s\": source, sample or holder", name);
    if (instruments_axis(c->setup.config, *which)->kind == CONFIG_AXIS_ABSENT)
        return err_set(e, ERR_USAGE, "this bench has no %s axis (config)", name);
    bool uses[STAGE_AXES] = {false};
    uses[*which] = true;
    return instruments_open_stage(&c->instruments, uses, e);
}

static bool has_answered(void *axis) {
    struct axis_status s;
    axis_status(axis, &s);
    return axis_config(axis)->kind != AXIS_MOTOR || (s.connected && s.read_us != INT64_MIN);
}

static int await_answer(struct campaign *c, int which, struct err *e) {
    struct axis *axis = c->instruments.stage.axis[which];
    int result = bench_wait(c->bench, clock_now_us(c->clock) + 5 * US_PER_S, has_answered, axis, &c->cancel);
    if (result == BENCH_UNTIL)
        return err_set(e, ERR_LINK,
                       "the %s axis does not answer within 5 s: is it powered, and its number right?",
                       stage_axis_name(which));
    return result < 0 ? err_set(e, -result, "stopped") : 0;
}

/* An order of a person to an axis in alarm is the word to reset it. */
static int ready_axis(struct campaign *c, int which, struct err *e) {
    struct axis_status s;
    int result = await_answer(c, which, e);
    axis_status(c->instruments.stage.axis[which], &s);
    return result == 0 && s.alarm ? stage_reset_alarms(&c->instruments.stage, &c->cancel, e) : result;
}

static int where(struct campaign *c, json_t **out, struct err *e) {
    bool uses[STAGE_AXES];
    for (int a = 0; a < STAGE_AXES; a++)
        uses[a] = instruments_axis(c->setup.config, a)->kind != CONFIG_AXIS_ABSENT;
    int result = instruments_open_stage(&c->instruments, uses, e);
    for (int a = 0; a < STAGE_AXES && result == 0; a++)
        if (c->instruments.stage.axis[a]) {
            struct err silent = {0};
            result = await_answer(c, a, &silent) == -ERR_CANCELLED ? -ERR_CANCELLED : 0;
        }
    if (result == 0)
        *out = json_pack("{s:o}", "axes", campaign_stage_json(c));
    return result;
}

static int home(struct campaign *c, const struct desk_manual *m, json_t **out, struct err *e) {
    int which;
    int result = open_axis(c, m->axis, &which, e);
    if (result == 0)
        result = ready_axis(c, which, e);
    if (result == 0)
        result = stage_home(&c->instruments.stage, which, &c->cancel, e);
    if (result == 0)
        result = instruments_record_drive(&c->instruments, which, true, false, e);
    return result < 0 ? result : where(c, out, e);
}

/* What the config alone can tell is a mistake of the order: no link is opened for it. */
static int check_angle(const struct campaign *c, const struct desk_manual *m, struct err *e) {
    int which = stage_axis_find(m->axis);
    const struct config_axis *axis = which < 0 ? NULL : instruments_axis(c->setup.config, which);
    if (!(fabs(m->deg) <= MOVE_MAX_DEG)) /* beyond it, it could not be counted in microdegrees either */
        return err_set(e, ERR_USAGE, "%g deg is no angle of an axis: at most %d deg to either side", m->deg,
                       MOVE_MAX_DEG);
    if (axis && axis->has_limits && !(m->deg >= axis->limits_deg[0] && m->deg <= axis->limits_deg[1]))
        return err_set(
            e, ERR_USAGE,
            "%g deg is outside the limits of the %s axis, %g .. %g deg (config): nothing was moved", m->deg,
            m->axis, axis->limits_deg[0], axis->limits_deg[1]);
    return 0;
}

static int move(struct campaign *c, const struct desk_manual *m, json_t **out, struct err *e) {
    struct stage_target target = {0};
    struct stage_reading reading;
    int which;
    int result = check_angle(c, m, e);
    if (result == 0)
        result = open_axis(c, m->axis, &which, e);
    if (result == 0)
        result = ready_axis(c, which, e);
    if (result < 0)
        return result;
    target.used[which] = true;
    target.udeg[which] = udeg_from_deg(m->deg);
    struct axis *axis = c->instruments.stage.axis[which];
    if (axis_config(axis)->kind == AXIS_MANUAL) { /* the order is the person's word that it stands there */
        result = axis_begin_move(axis, target.udeg[which], e);
        if (result == 0)
            axis_confirm(axis, target.udeg[which]);
    } else {
        result = stage_move(&c->instruments.stage, &target, &c->cancel, &reading, e);
    }
    return result < 0 ? result : where(c, out, e);
}

/* ---- spectrum ---- */

static int find_exposure(struct campaign *c, struct frame *frame, int *exposure_us, struct err *e) {
    struct spectrometer *s = c->instruments.spectrometer;
    const struct spectrometer_model *model = c->instruments.model;
    double us = GUESS_US;
    for (int i = 0; i < TRIES; i++) {
        int result = spectrometer_set_exposure(s, (int)us, &c->cancel, e);
        if (result == 0)
            result = spectrometer_acquire(s, 1, clock_now_us(c->clock), frame, &c->cancel, e);
        if (result < 0)
            return result;
        double peak = fmax(reduce_peak(spectrometer_calibration(s), frame->counts), 1e-4);
        *exposure_us = (int)us;
        double next = frame->saturated_pixels ? us / 8 : us * TARGET / peak;
        next = fmin(fmax(next, fmax(model->min_exposure_us, US_PER_MS)),
                    fmin(model->max_exposure_us, 5 * US_PER_S));
        if (fabs(next / us - 1) < 0.25)
            return 0;
        us = (int)(next / 10) * 10; /* resolution of the integration time, spectrometer-ocean.md 3.1 */
    }
    return 0;
}

static json_t *spectrum_json(const struct campaign *c, const struct frame *frames, int n, int exposure_us) {
    const struct calibration *k = spectrometer_calibration(c->instruments.spectrometer);
    json_t *lambda = json_array(), *counts = json_array();
    int saturated = 0;
    for (int i = 0; i < n; i++)
        saturated = frames[i].saturated_pixels > saturated ? frames[i].saturated_pixels : saturated;
    for (int p = k->active_first; p <= k->active_last; p++) {
        double sum = 0;
        for (int i = 0; i < n; i++)
            sum += frames[i].counts[p];
        json_array_append_new(lambda, json_real(calibration_lambda_nm(k, p)));
        json_array_append_new(counts, json_real(sum / n));
    }
    return json_pack("{s:o, s:o, s:f, s:i, s:i, s:i, s:s, s:s, s:b}", "lambda_nm", lambda, "counts", counts,
                     "exposure_ms", exposure_us / (double)US_PER_MS, "average", n, "saturated_pixels",
                     saturated, "saturation", k->saturation, "model", k->model, "serial", k->serial, "lamp",
                     frames[0].lamp);
}

static int spectrum(struct campaign *c, const struct desk_manual *m, json_t **out, struct err *e) {
    int n = m->average > 0 ? m->average : 1;
    double least_ms = c->instruments.model->min_exposure_us / 1e3,
           most_ms = c->instruments.model->max_exposure_us / 1e3;
    if (m->exposure_ms != 0 && !(m->exposure_ms >= least_ms && m->exposure_ms <= most_ms))
        return err_set(e, ERR_USAGE, "an exposure of %g ms is outside what a %s can: %g .. %g ms",
                       m->exposure_ms, c->instruments.model->title, least_ms, most_ms);
    int exposure_us = (int)(m->exposure_ms * US_PER_MS);
    if (n > SPECTRUM_SCANS_MAX)
        return err_set(e, ERR_USAGE, "an average of %d scans is too long: at most %d", n, SPECTRUM_SCANS_MAX);
    struct frame *frames = calloc(n, sizeof *frames);
    if (!frames)
        return err_set(e, ERR_NOMEM, "no memory for %d scans", n);
    int result = campaign_ready_spectrometer(c, e);
    struct spectrometer *s = c->instruments.spectrometer;
    if (result == 0 && c->setup.config->shutter == SHUTTER_LAMP_LINE) {
        c->lamp = -1; /* whatever was thought of it: the order is sent */
        result = campaign_set_lamp(c, m->lamp, e);
    }
    if (result == 0 && m->lamp && c->lamp_since_us == INT64_MIN)
        c->lamp_since_us = clock_now_us(c->clock);
    if (result == 0 && exposure_us == 0)
        result = find_exposure(c, frames, &exposure_us, e);
    if (result == 0)
        result = spectrometer_set_exposure(s, exposure_us, &c->cancel, e);
    if (result == 0)
        result = spectrometer_acquire(s, n, clock_now_us(c->clock), frames, &c->cancel, e);
    if (result == 0)
        *out = spectrum_json(c, frames, n, exposure_us);
    free(frames);
    return result;
}

/* ---- devices ---- */

static const char *model_title(const struct usb_device_info *info) {
    int n;
    const struct spectrometer_model *model = spectrometer_models(&n);
    for (int i = 0; i < n; i++)
        if (model[i].vid == info->vid && model[i].pid == info->pid)
            return model[i].title;
    return "unknown to goniod";
}

static json_t *usb_json(void) {
    struct usb_found found[32];
    struct err e = {0};
    json_t *all = json_array();
    int n = usb_link_list(found, 32, &e);
    if (n < 0)
        json_array_append_new(all, json_pack("{s:s}", "error", e.text));
    for (int i = 0; i < n; i++) {
        const struct usb_device_info *info = &found[i].info;
        json_array_append_new(all,
                              json_pack("{s:i, s:i, s:s, s:s, s:s, s:b, s:b}", "vid", info->vid, "pid",
                                        info->pid, "model", model_title(info), "serial", info->serial, "path",
                                        info->path, "can_open", found[i].can_open, "busy", found[i].busy));
    }
    return all;
}

static bool never(void *arg) {
    (void)arg;
    return false;
}

/* A unit that is mute takes its bus down for a moment; its neighbours are not to be blamed for it. */
static int open_patiently(struct campaign *c, const bool uses[STAGE_AXES], struct err *e) {
    int result;
    for (int i = 0; (result = instruments_open_stage(&c->instruments, uses, e)) < 0 && i < BUS_TRIES; i++) {
        if (result != -ERR_LINK && result != -ERR_BUSY)
            break;
        if (bench_wait(c->bench, clock_now_us(c->clock) + BUS_PAUSE_US, never, c, &c->cancel) < 0)
            return err_set(e, ERR_CANCELLED, "stopped");
        err_clear(e);
    }
    return result;
}

/* One sentence: where it stands, or what keeps it from answering. Negative: cancelled. */
static int axis_answer(struct campaign *c, int which, char *text, size_t size) {
    bool uses[STAGE_AXES] = {false};
    struct axis_status s;
    struct err e = {0};
    uses[which] = true;
    int result = open_patiently(c, uses, &e);
    if (result == 0)
        result = await_answer(c, which, &e);
    if (result < 0) {
        snprintf(text, size, "%s", e.text);
        return result == -ERR_CANCELLED ? result : 0;
    }
    axis_status(c->instruments.stage.axis[which], &s);
    if (s.alarm)
        snprintf(text, size, "answers, with alarm %02Xh: %s", (unsigned)s.alarm, s.alarm_text);
    else
        snprintf(text, size, "answers: %.3f deg%s", deg_from_udeg(s.position_udeg),
                 s.valid ? "" : ", position not valid");
    return 0;
}

static int axes_answers(struct campaign *c, json_t *all) {
    for (int a = 0; a < STAGE_AXES; a++) {
        const struct config_axis *axis = instruments_axis(c->setup.config, a);
        char text[ANSWER_TEXT];
        if (axis->kind != CONFIG_AXIS_MOTOR)
            continue;
        int result = axis_answer(c, a, text, sizeof text);
        if (result < 0)
            return result;
        json_array_append_new(all, json_pack("{s:s, s:s, s:i, s:s}", "axis", stage_axis_name(a), "link",
                                             axis->link, "unit", axis->unit, "answer", text));
    }
    return 0;
}

static json_t *spectrometer_answer(struct campaign *c) {
    struct err e = {0};
    int result = campaign_ready_spectrometer(c, &e);
    char text[ANSWER_TEXT];
    if (result == 0)
        snprintf(text, sizeof text, "answers: serial number %s",
                 spectrometer_calibration(c->instruments.spectrometer)->serial);
    else
        snprintf(text, sizeof text, "%s", e.text);
    return json_pack("{s:s, s:s, s:s}", "link", c->setup.config->spectrometer.link, "model",
                     c->instruments.model->name, "answer", text);
}

static int devices(struct campaign *c, json_t **out, struct err *e) {
    json_t *axes = json_array();
    int result = axes_answers(c, axes);
    if (result < 0) {
        json_decref(axes);
        return err_set(e, ERR_CANCELLED, "stopped");
    }
    json_t *spectrometer = spectrometer_answer(c);
    *out = json_pack("{s:o, s:o, s:o}", "usb", usb_json(), "axes", axes, "spectrometer", spectrometer);
    return 0;
}

/* ---- commissioning ---- */

/* What a person and the drive have agreed on is recorded for this unit and this text of its profile. */
static int record_commissioned(struct campaign *c, int which, struct err *e) {
    const struct commission *k = &c->commission;
    if (k->position_confirmed)
        axis_declare_valid(c->instruments.stage.axis[which]);
    return instruments_record_drive(&c->instruments, which, k->position_confirmed, true, e);
}

static int commission(struct campaign *c, const struct desk_manual *m, json_t **out, struct err *e) {
    struct commission *k = &c->commission;
    int which;
    int result = open_axis(c, m->axis, &which, e);
    if (result == 0)
        result = await_answer(c, which, e);
    if (result == 0 && axis_config(c->instruments.stage.axis[which])->kind != AXIS_MOTOR)
        result = err_set(e, ERR_USAGE, "the %s axis has no motor: there is nothing to commission", m->axis);
    if (result < 0)
        return result;
    if (!*m->answer || which != c->commission_axis)
        commission_begin(k, c->instruments.stage.axis[which], c->bench);
    c->commission_axis = which;
    result = commission_answer(k, m->answer, &c->cancel, e);
    if (result == 0 && k->over && k->passed)
        result = record_commissioned(c, which, e);
    if (result < 0)
        return result;
    *out = json_pack("{s:s, s:b, s:b}", "text", k->text, "done", k->over, "passed", k->passed);
    if (!k->over)
        json_object_set_new(*out, "question", json_string(k->question));
    else
        c->commission_axis = -1;
    return 0;
}

/* ---- one order ---- */

static int execute(struct campaign *c, const struct desk_manual *m, json_t **out, struct err *e) {
    switch (m->kind) {
    case MANUAL_DEVICES:
        return devices(c, out, e);
    case MANUAL_WHERE:
        return where(c, out, e);
    case MANUAL_HOME:
        return home(c, m, out, e);
    case MANUAL_MOVE:
        return move(c, m, out, e);
    case MANUAL_SPECTRUM:
        return spectrum(c, m, out, e);
    case MANUAL_COMMISSION:
        return commission(c, m, out, e);
    default:
        return err_set(e, ERR_USAGE, "this order is not known");
    }
}

void campaign_manual(struct campaign *c) {
    struct err e = {0};
    json_t *out = NULL;
    int result = execute(c, &c->manual.manual, &out, &e);
    char *text = out ? json_dumps(out, JSON_COMPACT) : NULL;
    json_decref(out);
    if (result < 0 && !e.code)
        err_set(&e, -result, "stopped");
    desk_finish(c->setup.desk, c->manual.ticket, result, e.text, text);
    c->manual_pending = false;
    atomic_store(&c->cancel.raised, false);
    campaign_publish(c);
}
