#include "fit/aperture.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "proto/units.h"

#define AXIS_MAX 5
#define NODES_MAX (AXIS_MAX * AXIS_MAX)
#define BATCH 256 /* geometries evaluated at once; their gradients fit into the first cache */

/* Abramowitz and Stegun, table 25.4: the non-negative abscissae of each rule, and their weights. */
static const struct rule {
    int n;
    double x[AXIS_MAX], w[AXIS_MAX];
} rules[] = {
    {1, {0}, {2}},
    {3,
     {-0.7745966692414834, 0, 0.7745966692414834},
     {0.5555555555555556, 0.8888888888888889, 0.5555555555555556}},
    {4,
     {-0.8611363115940526, -0.3399810435848563, 0.3399810435848563, 0.8611363115940526},
     {0.3478548451374538, 0.6521451548625461, 0.6521451548625461, 0.3478548451374538}},
    {5,
     {-0.9061798459386640, -0.5384693101056831, 0, 0.5384693101056831, 0.9061798459386640},
     {0.2369268850561891, 0.4786286704993665, 0.5688888888888889, 0.4786286704993665, 0.2369268850561891}},
};

static const struct rule *rule_of(double width_deg) {
    return &rules[width_deg == 0 ? 0 : width_deg <= 1 ? 1 : width_deg <= 2 ? 2 : 3];
}

struct axis { /* the directions of one width that reach the surface */
    const struct rule *rule;
    double at_deg[AXIS_MAX];
};

static void spread(struct axis *axis, double centre_deg, double width_deg) {
    double low_deg = fmax(centre_deg - width_deg / 2, -90), high_deg = fmin(centre_deg + width_deg / 2, 90);
    axis->rule = rule_of(width_deg);
    for (int k = 0; k < axis->rule->n; k++) {
        axis->at_deg[k] = width_deg == 0
                              ? centre_deg
                              : (low_deg + high_deg) / 2 + (high_deg - low_deg) / 2 * axis->rule->x[k];
    }
}

/* A direction past the normal lies on the other side of it. */
static int turned(struct reflectance_geometry *g, double theta_i_deg, double theta_r_deg, double dphi_deg,
                  struct err *e) {
    const bool over = (theta_i_deg < 0) != (theta_r_deg < 0);
    return reflectance_geometry_general(g, fabs(theta_i_deg), fabs(theta_r_deg),
                                        over ? fabs(dphi_deg) - 180 : dphi_deg, e);
}

/* dphi_deg NAN: in plane, by the signs of the angles. */
static int geometry_at(struct reflectance_geometry *g, double i_deg, double v_deg, double dphi_deg,
                       struct err *e) {
    const double side = i_deg < 0 ? -1 : 1;
    return isnan(dphi_deg) ? reflectance_geometry(g, side * i_deg, side * v_deg, e)
                           : turned(g, i_deg, v_deg, dphi_deg, e);
}

/* Fills nodes of one geometry and their weights, which sum up to 1. */
static int place(const struct aperture_form *form, double theta_i_deg, double theta_v_deg, double dphi_deg,
                 struct reflectance_geometry *geometry, double *weight, struct err *e) {
    struct axis i, v;
    int at = 0, status = geometry_at(geometry, theta_i_deg, theta_v_deg, dphi_deg, e);
    double sum = 0;
    spread(&i, theta_i_deg, form->source_width_deg);
    spread(&v, theta_v_deg, form->sensor_width_deg);
    for (int a = 0; a < i.rule->n && !status; a++) {
        for (int b = 0; b < v.rule->n && !status; b++, at++) {
            status = geometry_at(&geometry[at], i.at_deg[a], v.at_deg[b], dphi_deg, e);
            weight[at] = i.rule->w[a] * v.rule->w[b] *
                         cos(rad_from_deg(form->beam_in_view ? v.at_deg[b] : i.at_deg[a]));
            sum += weight[at];
        }
    }
    for (int k = 0; k < at; k++) {
        weight[k] /= sum;
    }
    return status;
}

static int nodes_of(const struct aperture_form *form) {
    return rule_of(form->source_width_deg)->n * rule_of(form->sensor_width_deg)->n;
}

static int check_width(double width_deg, struct err *e) {
    if (!(width_deg >= 0 && width_deg <= APERTURE_WIDTH_MAX_DEG)) {
        return err_set(e, ERR_RANGE, "an angular width of %g deg is not possible; give 0 to %g deg",
                       width_deg, APERTURE_WIDTH_MAX_DEG);
    }
    return 0;
}

int aperture_init(struct aperture *a, const struct aperture_form *form, size_t n, const double *theta_i_deg,
                  const double *theta_v_deg, struct err *e) {
    *a = (struct aperture){.form = *form, .n = n};
    int status = check_width(form->source_width_deg, e);
    if (status || (status = check_width(form->sensor_width_deg, e))) {
        return status;
    }
    a->nodes = nodes_of(form);
    size_t cells = (n + 1) * (size_t)a->nodes; /* never of size 0 */
    a->geometry = calloc(cells, sizeof *a->geometry);
    a->weight = a->nodes > 1 ? calloc(cells, sizeof *a->weight) : NULL;
    a->memory = calloc(reflectance_batch_size(cells), sizeof *a->memory);
    if (!a->geometry || !a->memory || (a->nodes > 1 && !a->weight)) {
        aperture_free(a);
        return err_set(e, ERR_NOMEM, "no memory for the geometry of %zu points", n);
    }
    for (size_t i = 0; i < n && !status; i++) {
        size_t at = i * (size_t)a->nodes;
        status = a->weight
                     ? place(form, theta_i_deg[i], theta_v_deg[i], NAN, &a->geometry[at], &a->weight[at], e)
                     : reflectance_geometry(&a->geometry[at], theta_i_deg[i], theta_v_deg[i], e);
    }
    if (status) {
        aperture_free(a);
    } else {
        aperture_refill(a);
    }
    return status;
}

void aperture_refill(struct aperture *a) {
    reflectance_batch_fill(&a->batch, a->n * (size_t)a->nodes, a->geometry, a->memory);
}

void aperture_free(struct aperture *a) {
    free(a->geometry);
    free(a->memory);
    free(a->weight);
    *a = (struct aperture){0};
}

static int weigh_all(struct aperture *a, struct err *e) {
    a->weight = malloc((a->n + 1) * (size_t)a->nodes * sizeof *a->weight);
    for (size_t i = 0; a->weight && i < a->n * (size_t)a->nodes; i++) {
        a->weight[i] = 1;
    }
    return a->weight ? 0 : err_set(e, ERR_NOMEM, "no memory for the geometry of %zu points", a->n);
}

int aperture_move(struct aperture *a, size_t point, double theta_i_deg, double theta_v_deg, double factor,
                  struct err *e) {
    double weight[NODES_MAX];
    size_t at = point * (size_t)a->nodes;
    if (fabs(theta_i_deg) >= 90 || fabs(theta_v_deg) >= 90) {
        return 0;
    }
    int status = place(&a->form, theta_i_deg, theta_v_deg, NAN, &a->geometry[at], weight, e);
    if (!status && !a->weight && factor != 1) {
        status = weigh_all(a, e);
    }
    for (int m = 0; m < a->nodes && a->weight && !status; m++) {
        a->weight[at + (size_t)m] = factor * weight[m];
    }
    return status;
}

int aperture_direct(struct aperture *a, size_t point, double theta_i_deg, double theta_r_deg, double dphi_deg,
                    struct err *e) {
    const size_t at = point * (size_t)a->nodes;
    double weight[NODES_MAX];
    int status = place(&a->form, theta_i_deg, theta_r_deg, dphi_deg, &a->geometry[at], weight, e);
    for (int m = 0; m < a->nodes && a->weight && !status; m++) {
        a->weight[at + (size_t)m] = weight[m];
    }
    return status;
}

/* Columns of some nodes into the columns of their points, from point at on. */
static void average_columns(const double *weight, size_t nodes, size_t n, const double *node, double *point) {
    for (size_t i = 0; i < n; i++) {
        double sum = 0;
        for (size_t m = i * nodes; m < (i + 1) * nodes; m++) {
            sum += weight[m] * node[m];
        }
        point[i] = sum;
    }
}

static int columns_of_nodes(const struct aperture *a, size_t first, size_t n, enum reflectance_model model,
                            const double *value, const struct reflectance_optics *optics, double *beta,
                            double *slope, size_t stride, struct err *e) {
    enum { ROOM = BATCH + REFLECTANCE_BATCH_LANES };
    double node_beta[ROOM], node_slope[ROOM * MATERIAL_PARAMETERS];
    const size_t nodes = (size_t)a->nodes, at_once = BATCH / nodes;
    for (size_t done = 0; done < n; done += at_once) {
        const size_t count = n - done < at_once ? n - done : at_once, at = (first + done) * nodes;
        int status = reflectance_batch_eval(&a->batch, at, count * nodes, model, value, optics, node_beta,
                                            node_slope, ROOM, e);
        if (status) {
            return status;
        }
        average_columns(a->weight + at, nodes, count, node_beta, beta + done);
        for (int j = 0; j < reflectance_parameters(model); j++) {
            average_columns(a->weight + at, nodes, count, node_slope + (size_t)j * ROOM,
                            slope + (size_t)j * stride + done);
        }
    }
    return 0;
}

int aperture_columns(const struct aperture *a, size_t first, size_t n, enum reflectance_model model,
                     const double *value, const struct reflectance_optics *optics, double *beta,
                     double *slope, size_t stride, struct err *e) {
    int status =
        a->weight ? columns_of_nodes(a, first, n, model, value, optics, beta, slope, stride, e)
                  : reflectance_batch_eval(&a->batch, first, n, model, value, optics, beta, slope, stride, e);
    for (size_t i = n; i < reflectance_batch_room(n); i++) {
        beta[i] = 0;
        for (int j = 0; j < reflectance_parameters(model); j++) {
            slope[(size_t)j * stride + i] = 0;
        }
    }
    return status;
}

int aperture_eval(const struct aperture *a, size_t first, size_t n, enum reflectance_model model,
                  const double *value, const struct reflectance_optics *optics, double *beta,
                  double *gradient, struct err *e) {
    double block_beta[BATCH], slope[BATCH * MATERIAL_PARAMETERS];
    const size_t k = (size_t)reflectance_parameters(model);
    for (size_t done = 0; done < n; done += BATCH) {
        const size_t count = n - done < BATCH ? n - done : BATCH;
        int status =
            aperture_columns(a, first + done, count, model, value, optics, block_beta, slope, BATCH, e);
        if (status) {
            return status;
        }
        memcpy(beta + done, block_beta, count * sizeof *beta);
        for (size_t i = 0; gradient && i < count; i++) {
            for (size_t j = 0; j < k; j++) {
                gradient[(done + i) * k + j] = slope[j * BATCH + i];
            }
        }
    }
    return 0;
}

int aperture_at(const struct aperture_form *form, double theta_i_deg, double theta_v_deg,
                enum reflectance_model model, const double *value, const struct reflectance_optics *optics,
                double *beta, double *gradient, struct err *e) {
    struct reflectance_geometry geometry[NODES_MAX];
    double weight[NODES_MAX], node_beta[NODES_MAX], node_gradient[NODES_MAX * MATERIAL_PARAMETERS];
    const int nodes = nodes_of(form), k = reflectance_parameters(model);
    int status = place(form, theta_i_deg, theta_v_deg, NAN, geometry, weight, e);
    if (status || (status = reflectance_eval(model, (size_t)nodes, geometry, value, optics, node_beta,
                                             gradient ? node_gradient : NULL, e))) {
        return status;
    }
    *beta = 0;
    for (int j = 0; gradient && j < k; j++) {
        gradient[j] = 0;
    }
    for (int m = 0; m < nodes; m++) {
        *beta += weight[m] * node_beta[m];
        for (int j = 0; gradient && j < k; j++) {
            gradient[j] += weight[m] * node_gradient[m * k + j];
        }
    }
    return 0;
}

int aperture_parts(const struct aperture *a, size_t point, enum reflectance_model model, const double *value,
                   const struct reflectance_optics *optics, struct reflectance_parts *parts, struct err *e) {
    size_t at = point * (size_t)a->nodes;
    if (!a->weight) {
        return reflectance_eval_parts(model, &a->geometry[at], value, optics, parts, e);
    }
    struct reflectance_parts sum = {0}, one;
    int status = 0;
    for (size_t m = at; m < at + (size_t)a->nodes && !status; m++) {
        status = reflectance_eval_parts(model, &a->geometry[m], value, optics, &one, e);
        sum.diffuse += a->weight[m] * one.diffuse;
        sum.interreflection += a->weight[m] * one.interreflection;
        sum.specular += a->weight[m] * one.specular;
    }
    *parts = sum;
    return status;
}

int aperture_polarisation_slope(const struct aperture *a, enum reflectance_model model, const double *value,
                                double *slope, struct err *e) {
    const size_t nodes = (size_t)a->nodes;
    double node[NODES_MAX];
    int status = 0;
    for (size_t i = 0; i < a->n && !status; i++) {
        status = reflectance_polarisation_slope(model, nodes, &a->geometry[i * nodes], value, node, e);
        slope[i] = 0;
        for (size_t m = 0; m < nodes && !status; m++) {
            slope[i] += (a->weight ? a->weight[i * nodes + m] : 1) * node[m];
        }
    }
    return status;
}
