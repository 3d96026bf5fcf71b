#include "tests/support/plan_bench.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

char *plan_bench_certificate(void) {
    char *text;
    size_t size;
    FILE *out = open_memstream(&text, &size);
    fputs("# geometry: in-plane table\n# k: 2\n# serial: T-1\n# valid_until: 2030-01-01\n"
          "lambda_nm,beta,u,theta_i_deg,theta_v_deg\n",
          out);
    for (int i = 0; i <= 80; i += 20)
        for (int v = -85; v <= 85; v += 17)
            for (int nm = 380; nm <= 780; nm += 200)
                fprintf(out, "%d,%.4f,0.01,%d,%d\n", nm, 0.98 + 1e-5 * v * i, i, v);
    fclose(out);
    return text;
}

void plan_bench_show(const struct err_list *errors) {
    char text[900];
    for (size_t i = 0; i < errors->n; i++)
        fprintf(stderr, "%s\n", err_format(&errors->item[i], text, sizeof text));
}

bool plan_bench_says(const struct err_list *errors, const char *part) {
    for (size_t i = 0; i < errors->n; i++)
        if (strstr(errors->item[i].text, part))
            return true;
    return false;
}

void plan_bench_open(struct plan_bench *b, const char *config_text) {
    memset(b, 0, sizeof *b);
    const char *text = config_text ? config_text : config_builtin_text();
    if (config_read_text("goniod.yaml", text, strlen(text), &b->config, &b->errors) < 0)
        plan_bench_show(&b->errors);
    assert_int_equal(b->errors.n, 0);
    assert_int_equal(profile_load("om-az", &b->profile, &b->errors), 0);
    const struct config_axis *axes[STAGE_AXES] = {&b->config.source, &b->config.sample, &b->config.holder};
    for (int i = 0; i < STAGE_AXES; i++)
        b->devices.profile[i] = axes[i]->kind == CONFIG_AXIS_MOTOR ? &b->profile : NULL;
    b->devices.spectrometer = spectrometer_model_find(b->config.spectrometer.model);
}

void plan_bench_job(struct plan_bench *b, const char *samples, const char *geometry, const char *reference) {
    char *text, *certificate = plan_bench_certificate();
    if (asprintf(&text, "name: test\nsamples:\n%sgeometry: %s\nreference: %s\n",
                 samples ? samples : PLAN_BENCH_SAMPLE, geometry, reference) < 0)
        abort();
    struct job_file file = {"ptfe.csv", certificate, strlen(certificate)};
    job_free(&b->job);
    if (job_read_text("job.yaml", text, strlen(text), &file, 1, &b->job, &b->errors) < 0)
        plan_bench_show(&b->errors);
    assert_int_equal(b->errors.n, 0);
    free(text);
    free(certificate);
}

int plan_bench_make(struct plan_bench *b) {
    plan_free(&b->plan);
    err_list_free(&b->errors);
    return plan_make(&b->job, &b->config, &b->devices, &b->plan, &b->errors);
}

void plan_bench_close(struct plan_bench *b) {
    plan_free(&b->plan);
    job_free(&b->job);
    err_list_free(&b->errors);
}
