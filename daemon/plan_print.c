#include <math.h>
#include <string.h>
#include <time.h>

#include "daemon/plan.h"
#include "proto/units.h"

static const char *duration(int64_t us, char buffer[32]) {
    int64_t minutes = (us + US_PER_MIN / 2) / US_PER_MIN;
    if (minutes < 1)
        snprintf(buffer, 32, "%lld s", (long long)((us + US_PER_S / 2) / US_PER_S));
    else if (minutes < 60)
        snprintf(buffer, 32, "%lld min", (long long)minutes);
    else
        snprintf(buffer, 32, "%lld h %02lld min", (long long)(minutes / 60), (long long)(minutes % 60));
    return buffer;
}

static const char *wall_clock(int64_t utc_s, char buffer[32]) {
    time_t seconds = (time_t)utc_s;
    struct tm utc;
    gmtime_r(&seconds, &utc);
    strftime(buffer, 32, "%Y-%m-%d %H:%M UTC", &utc);
    return buffer;
}

static const char *size(double bytes, char buffer[32]) {
    static const char *const units[] = {"kB", "MB", "GB", "TB"};
    int unit = 0;
    for (bytes /= 1000; bytes >= 1000 && unit < 3; unit++)
        bytes /= 1000;
    snprintf(buffer, 32, "%.3g %s", bytes, units[unit]);
    return buffer;
}

static void print_time(const struct plan *plan, FILE *out) {
    char middle[32], low[32], high[32], end[32];
    fprintf(out, "Time: about %s (%s to %s).", duration(plan->estimate_us, middle),
            duration(plan->estimate_low_us, low), duration(plan->estimate_high_us, high));
    if (plan->start_utc_s > 0)
        fprintf(out, " Started now it ends about %s.",
                wall_clock(plan->start_utc_s + plan->estimate_us / US_PER_S, end));
    fputc('\n', out);
}

static void print_space(const struct plan *plan, FILE *out) {
    char needed[32], there[32];
    fprintf(out, "Disk: about %s", size(plan->bytes, needed));
    if (plan->free_bytes > 0)
        fprintf(out, " of %s free%s", size(plan->free_bytes, there),
                plan->bytes > 0.9 * plan->free_bytes ? ". THAT MAY NOT BE ENOUGH" : "");
    fputs(".\n", out);
}

static void print_summary(const struct plan *plan, const struct job *job, FILE *out) {
    fprintf(out, "Job %s: %d geometries, %d readings of %d sample%s, %d scans in all.\n", job->name,
            plan->n_geometries, plan->n_points, job->n_samples, job->n_samples == 1 ? "" : "s",
            plan->n_exposures);
    fprintf(out, "Reference: mode %s, certificate %s%s%s, %d bracket%s of at most %g min.\n",
            job_mode_name(job->reference.mode), job->reference.certificate_file,
            job->certificate.serial[0] ? ", diffuser " : "", job->certificate.serial, plan->n_brackets,
            plan->n_brackets == 1 ? "" : "s", job->reference.bracket_min);
    print_time(plan, out);
    print_space(plan, out);
    if (plan->n_holds > 0)
        fprintf(out, "A person is needed %d time%s; a minute is counted for each.\n", plan->n_holds,
                plan->n_holds == 1 ? "" : "s");
}

static void print_overlap(const struct plan *plan, FILE *out) {
    for (int i = 0; i < plan->n_steps; i++)
        if (plan->step[i].kind == STEP_OVERLAP)
            fprintf(out, "Linearity: the diffuser at %g:%g, read at two exposure times.\n",
                    deg_from_udeg(plan->step[i].theta_i_udeg), deg_from_udeg(plan->step[i].theta_v_udeg));
}

static void print_holds(const struct plan *plan, FILE *out) {
    int64_t at_us = 0;
    char when[32];
    for (int i = 0; i < plan->n_steps; at_us += plan->step[i].estimate_us, i++)
        if (plan->step[i].kind == STEP_HOLD)
            fprintf(out, "  step %d, after %s: %s\n", i + 1, duration(at_us, when), plan->step[i].text);
}

static void print_refusals(const struct plan *plan, const struct job *job, FILE *out) {
    if (plan->n_refusals == 0)
        return;
    fprintf(out, "Refused, %d:\n", plan->n_refusals);
    for (int i = 0; i < plan->n_refusals; i++) {
        const struct refusal *refusal = &plan->refusal[i];
        fprintf(out, "  %g:%g%s%s: %s\n", refusal->theta_i_deg, refusal->theta_v_deg,
                refusal->sample < 0 ? "" : " on ",
                refusal->sample < 0 ? "" : job->sample[refusal->sample].name, refusal->why);
    }
}

/* One line a bracket: its control geometry, how many readings lie in it, and how long it is. */
static void print_brackets(const struct plan *plan, FILE *out) {
    int64_t open_us = 0, at_us = 0;
    int samples = 0, references = 0;
    char length[32];
    fprintf(out, "Brackets:\n");
    for (int i = 0; i < plan->n_steps; i++) {
        const struct step *step = &plan->step[i];
        at_us += step->estimate_us;
        samples += step->kind == STEP_SAMPLE;
        references += step->kind == STEP_REFERENCE && !step->control;
        if (!step->control)
            continue;
        if (step->bracket != step->opens)
            fprintf(out, "  %d: control %g:%g, %d sample and %d reference readings, %s\n", step->bracket,
                    deg_from_udeg(step->theta_i_udeg), deg_from_udeg(step->theta_v_udeg), samples, references,
                    duration(at_us - open_us, length));
        open_us = at_us;
        samples = references = 0;
    }
}

void plan_print(const struct plan *plan, const struct job *job, FILE *out) {
    print_summary(plan, job, out);
    print_overlap(plan, out);
    if (plan->n_mounted > 0)
        fprintf(out, "Mount before the start:\n");
    for (int i = 0; i < plan->n_mounted; i++)
        fprintf(out, "  %s\n", plan->mounted[i]);
    print_holds(plan, out);
    print_brackets(plan, out);
    print_refusals(plan, job, out);
    if (plan->n_left_out > 0)
        fprintf(out, "Left out:\n");
    for (int i = 0; i < plan->n_left_out; i++)
        fprintf(out, "  %s\n", plan->left_out[i]);
}
