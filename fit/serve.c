#include "fit/serve.h"

#include <errno.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fit/joint_fit.h"
#include "fit/models.h"
#include "fit/request.h"

#define PREFIX 4

static json_t *slopes_to_json(const struct request *r, const double *slope) {
    json_t *list = json_array();
    for (size_t i = 0; i < r->n_points; i++) {
        json_array_append_new(list, r->index[i] < 0 ? json_null() : json_real(slope[r->index[i]]));
    }
    return list;
}

static int add_slopes(json_t *reply, struct request *r, const struct estimate *estimate, struct err *e) {
    const struct fitset *d = &r->data;
    double *slope = calloc(2 * d->n + 1, sizeof *slope);
    if (!slope) {
        return err_set(e, ERR_NOMEM, "no memory for the slopes of %zu points", d->n);
    }
    int status = estimate_axis_slopes(estimate, d->n, d->theta_i_deg, d->theta_v_deg, d->mirrored, slope,
                                      slope + d->n, e);
    if (!status) {
        json_object_set_new(reply, "axis_slopes",
                            json_pack("{s:o,s:o}", "source", slopes_to_json(r, slope), "sample",
                                      slopes_to_json(r, slope + d->n)));
    }
    free(slope);
    return status;
}

static int add_joint(json_t *reply, struct request *r, const struct estimate *estimate, struct err *e) {
    struct joint joint;
    const struct estimate_input *input;
    int status = fitset_input(&r->data, &input, e);
    if (!status && !(status = joint_fit(input, estimate, false, &joint, e))) {
        json_object_set_new(reply, "joint", joint_to_json(&joint));
        joint_free(&joint);
    }
    return status;
}

/* The recommended one becomes the estimate; the others go beside it. */
static int fit_all(struct request *r, struct estimate *estimate, json_t *reply, struct err *e) {
    size_t n = 0;
    struct model_fit *fit = calloc(REFLECTANCE_MODELS, sizeof *fit);
    json_t *list = json_array();
    int status = fit ? models_fit(&r->data, NULL, fit, &n, e)
                     : err_set(e, ERR_NOMEM, "no memory to compare %d models", REFLECTANCE_MODELS);
    for (size_t i = 0; i < n && !status; i++) {
        json_array_append_new(list,
                              json_pack("{s:b, s:s, s:o}", "recommended", fit[i].choice.recommended, "why",
                                        fit[i].choice.text, "estimate", estimate_to_json(&fit[i].estimate)));
    }
    if (!status) {
        enum reflectance_model best = REFLECTANCE_COMPOSITE;
        *estimate = fit[0].estimate;
        reflectance_find(estimate->model, &best, NULL);
        r->data.input.model = reflectance_name(best);
        r->data.input.trace = NULL;
        json_object_set(reply, "models", list);
    }
    json_decref(list);
    free(fit);
    return status;
}

static int fit_request(struct request *r, struct estimate *estimate, json_t *reply, struct err *e) {
    return r->final && r->data.all_models ? fit_all(r, estimate, reply, e)
                                          : fitset_fit(&r->data, estimate, e);
}

static int estimate_request(const json_t *json, json_t *reply, struct err *e) {
    struct request r = {0};
    struct estimate estimate;
    fitset_init(&r.data);
    int status = request_read(json, &r, e);
    if (!status && !(status = fit_request(&r, &estimate, reply, e))) {
        json_object_set_new(reply, "estimate", estimate_to_json(&estimate));
        if (r.final && estimate.converged) {
            status = add_slopes(reply, &r, &estimate, e);
        }
        if (!status && r.final && estimate.converged && r.data.has_bands) {
            status = add_joint(reply, &r, &estimate, e);
        }
    }
    request_free(&r);
    return status;
}

char *serve_answer(const char *request, size_t size) {
    struct err e = {0};
    json_error_t where;
    json_t *json = json_loadb(request, size, 0, &where), *id = json_object_get(json, "id");
    json_t *reply = json_object();
    json_object_set(reply, "id", id ? id : json_null());
    if (!json) {
        err_set(&e, ERR_INPUT, "the request is not JSON: %s (line %d, column %d)", where.text, where.line,
                where.column);
    } else {
        estimate_request(json, reply, &e);
    }
    if (e.code) {
        json_object_clear(reply);
        json_object_set(reply, "id", id ? id : json_null());
        json_object_set_new(reply, "error", json_string(e.text));
    }
    char *text = json_dumps(reply, JSON_COMPACT);
    json_decref(reply);
    json_decref(json);
    return text;
}

/* *got < size: the end of the file came first. */
static int read_all(int fd, void *buffer, size_t size, size_t *got, struct err *e) {
    for (*got = 0; *got < size;) {
        ssize_t n = read(fd, (char *)buffer + *got, size - *got);
        int saved = errno;
        if (n == 0) {
            return 0;
        }
        if (n < 0 && saved != EINTR) {
            return err_errno(e, ERR_IO, saved, "cannot read the next request");
        }
        *got += n > 0 ? (size_t)n : 0;
    }
    return 0;
}

static int write_all(int fd, const void *buffer, size_t size, struct err *e) {
    for (size_t done = 0; done < size;) {
        ssize_t n = write(fd, (const char *)buffer + done, size - done);
        int saved = errno;
        if (n < 0 && saved != EINTR) {
            return err_errno(e, ERR_IO, saved, "cannot write the answer");
        }
        done += n > 0 ? (size_t)n : 0;
    }
    return 0;
}

static int write_frame(int fd, const char *text, struct err *e) {
    size_t size = strlen(text);
    unsigned char prefix[PREFIX] = {size & 255, size >> 8 & 255, size >> 16 & 255, size >> 24 & 255};
    int status = write_all(fd, prefix, PREFIX, e);
    return status ? status : write_all(fd, text, size, e);
}

static int cut_short(struct err *e) {
    return err_set(e, ERR_IO, "the input ended inside a frame");
}

static int read_over(int fd, size_t size, struct err *e) {
    char scrap[1 << 16];
    while (size > 0) {
        size_t want = size < sizeof scrap ? size : sizeof scrap, got;
        int status = read_all(fd, scrap, want, &got, e);
        if (status || got < want) {
            return status ? status : cut_short(e);
        }
        size -= got;
    }
    return 0;
}

static int refuse_frame(int in_fd, int out_fd, size_t size, const char *reply, struct err *e) {
    int status = read_over(in_fd, size, e);
    return status ? status : write_frame(out_fd, reply, e);
}

static int serve_frame(int in_fd, int out_fd, size_t size, struct err *e) {
    size_t got;
    char *request = size <= SERVE_FRAME_MAX ? malloc(size + 1) : NULL;
    if (!request) {
        return refuse_frame(
            in_fd, out_fd, size,
            "{\"id\":null,\"error\":\"the request is too large: send fewer points or common parts\"}", e);
    }
    int status = read_all(in_fd, request, size, &got, e);
    if (!status && got < size) {
        status = cut_short(e);
    }
    char *reply = status ? NULL : serve_answer(request, size);
    free(request);
    if (!status) {
        status = reply ? write_frame(out_fd, reply, e) : err_set(e, ERR_NOMEM, "no memory for an answer");
    }
    free(reply);
    return status;
}

int serve_run(int in_fd, int out_fd, struct err *e) {
    for (;;) {
        unsigned char p[PREFIX];
        size_t got;
        int status = read_all(in_fd, p, PREFIX, &got, e);
        if (status || got == 0) {
            return status;
        }
        if (got < PREFIX) {
            return cut_short(e);
        }
        size_t size = p[0] | (size_t)p[1] << 8 | (size_t)p[2] << 16 | (size_t)p[3] << 24;
        if ((status = serve_frame(in_fd, out_fd, size, e))) {
            return status;
        }
    }
}
