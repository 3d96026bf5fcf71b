#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fit/serve.h"
#include "proto/joint.h"
#include "tests/support/goniometry.h"

static struct goniometry m;

static json_t *list_of(const double *x, size_t n) {
    json_t *list = json_array();
    for (size_t i = 0; i < n; i++) {
        json_array_append_new(list, isnan(x[i]) ? json_null() : json_real(x[i]));
    }
    return list;
}

static json_t *request_of(int id) {
    json_t *points = json_array();
    for (size_t i = 0; i < m.input.n; i++) {
        json_t *point = json_pack("{s:f,s:f,s:f,s:f}", "theta_i_deg", m.theta_i_deg[i], "theta_v_deg",
                                  m.theta_v_deg[i], "beta", m.beta[i], "u_ind", m.u[i]);
        if (m.input.band_beta) {
            json_object_set_new(point, "bands", list_of(m.band_beta + i * BANDS, BANDS));
            json_object_set_new(point, "bands_u", list_of(m.band_u + i * BANDS, BANDS));
        }
        json_array_append_new(points, point);
    }
    return json_pack("{s:i,s:o}", "id", id, "points", points);
}

static void put_frame(FILE *f, const char *text, size_t size) {
    unsigned char prefix[4] = {size & 255, size >> 8 & 255, size >> 16 & 255, size >> 24 & 255};
    assert_int_equal(fwrite(prefix, 1, 4, f), 4);
    assert_int_equal(fwrite(text, 1, size, f), size);
}

static void put_json(FILE *f, json_t *json) {
    char *text = json_dumps(json, JSON_COMPACT);
    put_frame(f, text, strlen(text));
    free(text);
    json_decref(json);
}

static json_t *take_frame(FILE *f) {
    unsigned char prefix[4];
    if (fread(prefix, 1, 4, f) != 4) {
        return NULL;
    }
    size_t size = prefix[0] | (size_t)prefix[1] << 8 | (size_t)prefix[2] << 16 | (size_t)prefix[3] << 24;
    char *text = malloc(size + 1);
    assert_int_equal(fread(text, 1, size, f), size);
    json_t *json = json_loadb(text, size, 0, NULL);
    assert_non_null(json);
    free(text);
    return json;
}

/* Serves what was written to in; out then stands at its first answer. */
static int serve(FILE *in, FILE *out, struct err *e) {
    fflush(in);
    assert_int_equal(lseek(fileno(in), 0, SEEK_SET), 0);
    int status = serve_run(fileno(in), fileno(out), e);
    rewind(out);
    return status;
}

static json_t *ask(json_t *request) {
    char *text = json_dumps(request, JSON_COMPACT), *reply = serve_answer(text, strlen(text));
    json_t *json = json_loads(reply, 0, NULL);
    free(text);
    free(reply);
    json_decref(request);
    assert_non_null(json);
    return json;
}

static double parameter_of(const json_t *reply, const char *name) {
    const json_t *estimate = json_object_get(reply, "estimate");
    if (!estimate) {
        fail_msg("%s", json_string_value(json_object_get(reply, "error")));
    }
    return json_number_value(json_object_get(json_object_get(estimate, "parameters"), name));
}

static double std_of(const json_t *reply, const char *part, const char *name) {
    return json_number_value(
        json_object_get(json_object_get(json_object_get(reply, "estimate"), part), name));
}

static void questions_are_answered_in_turn(void **state) {
    (void)state;
    FILE *in = tmpfile(), *out = tmpfile();
    struct err e = {0};
    goniometry_make(&m, goniometry_set[2], 60, 5);
    put_json(in, request_of(7));
    put_frame(in, "{not json", 9);
    put_frame(in, "", 0);
    put_frame(in, "[1,2]", 5);
    put_json(in, json_pack("{s:s,s:[{s:f}]}", "id", "x", "points", "beta", 0.5));
    put_json(in, json_pack("{s:i,s:[]}", "id", 8, "points"));
    put_json(in, request_of(9));
    assert_int_equal(serve(in, out, &e), 0);
    json_t *first = take_frame(out);
    assert_int_equal(json_integer_value(json_object_get(first, "id")), 7);
    assert_float_equal(parameter_of(first, "n"), 1.7, 1e-7);
    json_decref(first);
    for (int i = 0; i < 4; i++) { /* each mistake has its sentence, and the next question is still taken */
        json_t *refused = take_frame(out);
        const char *sentence = json_string_value(json_object_get(refused, "error"));
        assert_non_null(sentence);
        assert_true(strlen(sentence) > 20);
        assert_null(json_object_get(refused, "estimate"));
        json_decref(refused);
    }
    json_t *few = take_frame(out);
    assert_int_equal(json_integer_value(json_object_get(few, "id")), 8);
    assert_non_null(json_string_value(json_object_get(json_object_get(few, "estimate"), "refusal")));
    json_decref(few);
    json_t *last = take_frame(out);
    assert_int_equal(json_integer_value(json_object_get(last, "id")), 9);
    json_decref(last);
    assert_null(take_frame(out));
    fclose(in);
    fclose(out);
}

static void a_torn_frame_is_an_error_a_huge_one_is_read_over(void **state) {
    (void)state;
    FILE *in = tmpfile(), *out = tmpfile();
    struct err e = {0};
    put_json(in, json_pack("{s:i,s:[]}", "id", 1, "points"));
    assert_int_equal(fwrite("\x10\x00\x00\x00{}", 1, 6, in), 6);
    assert_int_equal(serve(in, out, &e), -ERR_IO);
    json_t *reply = take_frame(out);
    assert_non_null(reply);
    json_decref(reply);
    fclose(in);
    fclose(out);
    in = tmpfile();
    out = tmpfile();
    err_clear(&e);
    assert_int_equal(fwrite("\x01\x00\x00\x10", 1, 4, in), 4); /* 256 MiB and one byte */
    fflush(in);
    assert_int_equal(ftruncate(fileno(in), 4 + (256L << 20) + 1), 0); /* sparse */
    fseek(in, 0, SEEK_END);
    put_json(in, json_pack("{s:i,s:[]}", "id", 2, "points"));
    assert_int_equal(serve(in, out, &e), 0);
    reply = take_frame(out);
    assert_non_null(strstr(json_string_value(json_object_get(reply, "error")), "too large"));
    json_decref(reply);
    reply = take_frame(out);
    assert_int_equal(json_integer_value(json_object_get(reply, "id")), 2);
    json_decref(reply);
    fclose(in);
    fclose(out);
}

static void parts_of_the_covariance_come_from_their_causes(void **state) {
    (void)state;
    goniometry_make(&m, goniometry_set[1], 60, 5);
    goniometry_colour(&m, 0.04, 0.45);
    json_t *plain = ask(request_of(1)), *scaled = request_of(2);
    double scale[GONIOMETRY_MAX], tau[GONIOMETRY_MAX];
    json_t *indices = json_array();
    for (size_t i = 0; i < m.input.n; i++) {
        scale[i] = 0.01 * m.beta[i];
        tau[i] = 1e6 * (double)i;
        json_array_append_new(indices, json_integer((json_int_t)i));
    }
    json_object_set_new(scaled, "common",
                        json_pack("[{s:s,s:o}]", "name", "certificate", "mean", list_of(scale, m.input.n)));
    json_object_set_new(scaled, "final", json_true());
    json_object_set_new(scaled, "u_zero_sample_deg", json_real(0.01));
    json_object_set_new(scaled, "hold_offset", json_true()); /* free, it would weigh the points anew */
    scaled = ask(scaled);
    /* 1 % of everything is 1 % of S, less what interreflection takes; nothing statistical changes */
    assert_float_equal(std_of(scaled, "std_statistical", "S"), std_of(plain, "std_statistical", "S"), 1e-12);
    assert_float_equal(std_of(scaled, "std_common", "S") / parameter_of(plain, "S"), 0.01, 0.001);
    assert_true(std_of(plain, "std_common", "S") == 0);
    const json_t *slopes = json_object_get(json_object_get(scaled, "axis_slopes"), "sample");
    assert_int_equal(json_array_size(slopes), m.input.n);
    struct joint joint; /* only the final answer has it */
    assert_null(json_object_get(plain, "joint"));
    assert_int_equal(joint_from_json(json_object_get(scaled, "joint"), &joint, NULL), 0);
    assert_true(joint.converged && joint.n_bands == BANDS && joint.n == 4 + BANDS);
    assert_float_equal(joint.s_lambda[30], m.s_lambda[30], 1e-7);
    assert_float_equal(joint.value[MATERIAL_SIGMA], m.value[MATERIAL_SIGMA], 1e-7);
    const int s30 = joint_row(&joint, MATERIAL_S, 30);
    assert_float_equal(sqrt(joint.common[s30 * (joint.n + 1)]) / joint.s_lambda[30], 0.01, 0.001);
    joint_free(&joint);
    json_t *drifting = request_of(3);
    json_object_set_new(drifting, "drift",
                        json_pack("[{s:o,s:o,s:f,s:f}]", "bracket_points", indices, "tau_us",
                                  list_of(tau, m.input.n), "T_us", 2e8, "rate", 1e-7));
    drifting = ask(drifting);
    assert_true(std_of(drifting, "std_statistical", "S") > 1.5 * std_of(plain, "std_statistical", "S"));
    json_decref(plain);
    json_decref(scaled);
    json_decref(drifting);
}

static void points_without_a_mean_are_left_out(void **state) {
    (void)state;
    goniometry_make(&m, goniometry_set[2], 60, 5);
    json_t *request = request_of(1), *points = json_object_get(request, "points");
    json_object_set_new(json_array_get(points, 3), "beta", json_null());
    json_object_set_new(json_array_get(points, 4), "provisional", json_true());
    json_object_set_new(request, "final", json_true());
    /* a cause that names the point left out and its neighbour */
    json_object_set_new(
        request, "common",
        json_pack("[{s:s,s:[i,i],s:[f,f]}]", "name", "reference/1", "points", 3, 4, "mean", 0.1, 0.1));
    json_t *reply = ask(request);
    assert_float_equal(parameter_of(reply, "gamma"), 0.07, 1e-8);
    assert_int_equal(json_integer_value(json_object_get(json_object_get(reply, "estimate"), "n_points")),
                     197);
    assert_true(json_is_true(json_object_get(json_object_get(reply, "estimate"), "provisional")));
    const json_t *slopes = json_object_get(json_object_get(reply, "axis_slopes"), "source");
    assert_true(json_is_null(json_array_get(slopes, 3)) && json_is_real(json_array_get(slopes, 4)));
    json_decref(reply);
}

#define NINE_NULLS "null,null,null,null,null,null,null,null,null"
#define NULLS                                                                                                \
    "[" NINE_NULLS "," NINE_NULLS "," NINE_NULLS "," NINE_NULLS "," NINE_NULLS "," NINE_NULLS "," NINE_NULLS \
    "," NINE_NULLS "," NINE_NULLS "]"

/* Wrong members, one at a time: the sentence names the key. */
static void every_wrong_member_is_named(void **state) {
    (void)state;
    static const struct {
        const char *key, *json, *named;
    } wrong[] = {
        {"model", "\"phong\"", "phong"},
        {"model", "3", "model"},
        {"mean_nm", "[400]", "mean_nm"},
        {"kappa", "\"one\"", "kappa"},
        {"kappa", "-1", "kappa"},
        {"u_zero_source_deg", "null", "axis"},
        {"q_is_one", "1", "q_is_one"},
        {"filling", "1", "filling"},
        {"filling", "\"open\"", "view-in-beam"},
        {"reference", "\"often\"", "every_geometry"},
        {"points", "{}", "points"},
        {"points", "[3]", "points"},
        {"points", "[{\"theta_i_deg\":\"a\"}]", "theta_i_deg"},
        {"points", "[{\"theta_i_deg\":95,\"theta_v_deg\":0,\"beta\":1}]", "95 deg"},
        {"points", "[{\"beta\":1,\"bands\":[1,2]}]", "bands"},
        {"points", "[{\"theta_i_deg\":9,\"theta_v_deg\":0,\"beta\":1,\"u_ind\":-1}]", "point 1"},
        {"points", "[{\"beta\":1,\"bands\":" NULLS ",\"bands_cov_next\":[1]}]", "bands_cov_next"},
        {"common", "[{\"mean\":[1]}]", "common"},
        {"common", "[{\"name\":\"x\",\"mean\":[1]}]", "mean"},
        {"common", "[{\"name\":\"x\",\"points\":[999],\"mean\":[1]}]", "points"},
        {"common", "[{\"name\":\"x\",\"points\":[0],\"mean\":[null]}]", "common cause"},
        {"drift", "[{}]", "drift"},
        {"drift", "[{\"bracket_points\":[0]}]", "tau_us"},
        {"drift", "[{\"bracket_points\":[0],\"tau_us\":[1],\"rate\":-1}]", "bracket"},
    };
    goniometry_make(&m, goniometry_set[2], 30, 20);
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        json_t *request = request_of(1);
        json_object_set_new(request, wrong[i].key, json_loads(wrong[i].json, JSON_DECODE_ANY, NULL));
        json_t *reply = ask(request);
        const char *sentence = json_string_value(json_object_get(reply, "error"));
        if (!sentence || !strstr(sentence, wrong[i].named)) {
            fail_msg("%s = %s was answered with: %s", wrong[i].key, wrong[i].json,
                     sentence ? sentence : "an estimate");
        }
        json_decref(reply);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(questions_are_answered_in_turn),
        cmocka_unit_test(a_torn_frame_is_an_error_a_huge_one_is_read_over),
        cmocka_unit_test(parts_of_the_covariance_come_from_their_causes),
        cmocka_unit_test(points_without_a_mean_are_left_out),
        cmocka_unit_test(every_wrong_member_is_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
