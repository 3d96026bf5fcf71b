/* First light by hand: a spectrum, and the commissioning of an axis. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/verb_live.h"
#include "proto/number.h"
#include "proto/output.h"

#define SPECTRUM_MS (15 * 60 * 1000)

static void print_spectrum(const json_t *result, FILE *out) {
    json_t *lambda = json_object_get(result, "lambda_nm"), *counts = json_object_get(result, "counts");
    fprintf(out, "# exposure_ms: %g\n# average: %lld\n# saturated_pixels: %lld\nlambda_nm,counts\n",
            json_number_value(json_object_get(result, "exposure_ms")),
            (long long)json_integer_value(json_object_get(result, "average")),
            (long long)json_integer_value(json_object_get(result, "saturated_pixels")));
    for (size_t i = 0; i < json_array_size(lambda); i++)
        fprintf(out, "%.3f,%.3f\n", json_number_value(json_array_get(lambda, i)),
                json_number_value(json_array_get(counts, i)));
}

static int save_spectrum(const json_t *result, const char *path, struct err *e) {
    FILE *out = output_open(path, e);
    if (!out)
        return -e->code;
    print_spectrum(result, out);
    return output_close(out, path, 0, e);
}

/* Adds the number an option gives; 0 or the exit status. */
static int add_number(json_t *params, const char *key, const char *text) {
    double value;
    if (!text)
        return 0;
    if (!number_read_double(text, &value) || !(value > 0)) {
        fprintf(stderr, "gonioctl: spectrum: '%s' is not a number above 0 for %s\n", text, key);
        return 2;
    }
    json_object_set_new(params, key, json_real(value));
    return 0;
}

static void warn_saturated(const json_t *result) {
    json_int_t n = json_integer_value(json_object_get(result, "saturated_pixels"));
    if (n)
        fprintf(stderr, "gonioctl: spectrum: SATURATED in %lld pixels; use a shorter --exposure\n",
                (long long)n);
}

int verb_spectrum(int argc, char **argv) {
    static const struct verb_option OPTIONS[] = {{"--average", 'n', "N", "scans to average (default 1)"},
                                                 {"--exposure", 0, "MS", "integration time (default: found)"},
                                                 {"--output", 'o', "FILE.csv", "a file instead of stdout"},
                                                 {"--dark", 0, NULL, "with the lamp line off"},
                                                 {0}};
    struct verb_args args;
    struct err e = {0};
    json_t *result = NULL;
    int done = verb_parse(argc, argv, OPTIONS, 0, 0, &args);
    if (done >= 0)
        return done;
    json_t *params = json_object();
    if (args.option[3])
        json_object_set_new(params, "lamp", json_false());
    if (add_number(params, "average", args.option[0]) || add_number(params, "exposure_ms", args.option[1])) {
        json_decref(params);
        return 2;
    }
    /* The file first: a spectrum that took minutes is not lost to a name that was wrong. */
    int rc = args.option[2] ? output_check(args.option[2], &e) : 0;
    if (rc == 0)
        rc = live_call(&args, "spectrum", json_incref(params), SPECTRUM_MS, &result, NULL, &e);
    if (rc == 0 && args.option[2])
        rc = save_spectrum(result, args.option[2], &e);
    if (rc == 0 && args.json)
        live_print_json(result);
    else if (rc == 0 && !args.option[2])
        print_spectrum(result, stdout);
    warn_saturated(result);
    json_decref(params);
    json_decref(result);
    return rc < 0 ? verb_fail(&e, NULL) : 0;
}

/* Each answer of goniod is {"text": ..., "question": ...} until it is {"text": ..., "done": true}. */
int verb_commission(int argc, char **argv) {
    struct verb_args args;
    char answer[64] = "";
    int done = verb_parse(argc, argv, NULL, 1, 1, &args);
    if (done >= 0)
        return done;
    for (;;) {
        struct err e = {0};
        json_t *result = NULL;
        json_t *params = json_pack("{s:s, s:s}", "axis", args.operand[0], "answer", answer);
        if (live_call(&args, "commission", params, SPECTRUM_MS, &result, NULL, &e) != 0)
            return verb_fail(&e, NULL);
        const char *text = json_string_value(json_object_get(result, "text"));
        const char *question = json_string_value(json_object_get(result, "question"));
        printf("%s%s", text ?: "", text ? "\n" : "");
        bool over = json_is_true(json_object_get(result, "done")) || !question;
        bool passed = json_is_true(json_object_get(result, "passed"));
        if (!over)
            printf("%s ", question);
        fflush(stdout);
        json_decref(result);
        if (over)
            return passed ? 0 : 1;
        if (!fgets(answer, sizeof answer, stdin)) {
            fprintf(stderr, "\ngonioctl: commission: stopped without a result; nothing was recorded\n");
            return 1;
        }
        answer[strcspn(answer, "\n")] = '\0';
    }
}
