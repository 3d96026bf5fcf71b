#include "fit/commands.h"

#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/aperture.h"
#include "proto/csv.h"
#include "proto/file.h"

#define FILE_MAX (256u << 20)

static const char help[] =
    "usage: goniofit eval --params P.json --points G.csv [--as-seen]\n"
    "Prints the model at each point as CSV with 17 digits: the point, the radiance factor and its parts, and "
    "the\n"
    "derivatives with respect to each parameter.\n"
    "  --params P.json  {\"S\",\"sigma\",\"gamma\",\"beta_prime\",\"n\"[,\"tail\" | ,\"n_d\" |\n"
    "                   ,\"gamma_2\",\"beta_prime_2\"][,\"kappa\",\"q\"]}, or the output of goniofit fit "
    "--json;\n"
    "                   which parameters there are tells the model\n"
    "  --points G.csv   columns theta_i_deg,theta_v_deg; others are passed over\n"
    "  --as-seen        not the surface itself (P = 0), but as the points of the fit were seen: through the "
    "angular\n"
    "                   widths of source and sensor, with their polarisation, at readbacks whose zeros are "
    "off as\n"
    "                   the fit found (unmirrored, the area seen as it was); P.json is then the output of\n"
    "                   goniofit fit --json\n"
    "exit status: 0 done, 2 bad usage or bad input\n";

struct options {
    const char *params, *points;
    bool as_seen;
};

static int read_options(int argc, char **argv, struct options *o, struct err *e) {
    static const struct option known[] = {{"params", required_argument, NULL, 'p'},
                                          {"points", required_argument, NULL, 'g'},
                                          {"as-seen", no_argument, NULL, 's'},
                                          {"help", no_argument, NULL, 'h'},
                                          {NULL, 0, NULL, 0}};
    optind = 1;
    for (int c; (c = getopt_long(argc, argv, "", known, NULL)) != -1;) {
        if (c == 'h') {
            fputs(help, stdout);
            return 1;
        }
        if (c == '?') {
            return err_set(e, ERR_USAGE, "see goniofit eval --help");
        }
        if (c == 's') {
            o->as_seen = true;
        } else {
            *(c == 'p' ? &o->params : &o->points) = optarg;
        }
    }
    if (!o->params || !o->points || optind < argc) {
        return err_set(e, ERR_USAGE, "give --params P.json and --points G.csv; see goniofit eval --help");
    }
    return 0;
}

static bool has_name(const char *model, const char *name) {
    for (int p = 0; p < MATERIAL_PARAMETERS; p++) {
        const char *own = material_parameter_name(model, p);
        if (own && strcmp(own, name) == 0) {
            return true;
        }
    }
    return false;
}

/* Of all names of parameters there are, those present are the model's, and none of its is absent. */
static bool is_model_of(const char *model, const json_t *parameters) {
    for (int m = 0; m < REFLECTANCE_MODELS; m++) {
        for (int p = 0; p < MATERIAL_PARAMETERS; p++) {
            const char *any = material_parameter_name(reflectance_name((enum reflectance_model)m), p);
            if (any && has_name(model, any) != (json_object_get(parameters, any) != NULL)) {
                return false;
            }
        }
    }
    return true;
}

static const char *model_of(const json_t *parameters) {
    for (int m = 0; m < REFLECTANCE_MODELS; m++) {
        const char *model = reflectance_name((enum reflectance_model)m);
        if (is_model_of(model, parameters)) {
            return model;
        }
    }
    return "composite"; /* its reader then says what is missing */
}

/* The parameters, and where an estimate is wanted all of it. */
static int take_params(const json_t *json, bool whole, struct estimate *estimate, struct err *e) {
    const json_t *inner = json_object_get(json, "parameters"), *parameters = inner ? inner : json;
    if (whole && !inner) {
        return err_set(
            e, ERR_INPUT,
            "--as-seen needs the output of goniofit fit --json, which says how the points were seen; "
            "these are parameters alone");
    }
    if (whole) {
        return estimate_from_json(json, estimate, e);
    }
    *estimate = (struct estimate){.kappa = 1, .q = 1};
    snprintf(estimate->model, sizeof estimate->model, "%s", model_of(parameters));
    return estimate_parameters_from_json(parameters, estimate, e);
}

static int read_params(const char *path, bool whole, struct estimate *estimate, struct err *e) {
    char *text = NULL;
    size_t size;
    json_error_t where;
    int status = file_read(path, FILE_MAX, &text, &size, e);
    if (status) {
        return status;
    }
    json_t *json = json_loadb(text, size, 0, &where);
    free(text);
    if (!json) {
        return err_at(e, ERR_INPUT, path, where.line, where.column, "not JSON: %s", where.text);
    }
    struct err inside = {0};
    status = take_params(json, whole, estimate, &inside);
    json_decref(json);
    return status ? err_at(e, ERR_INPUT, path, 0, 0, "%s", inside.text) : 0;
}

static int column_of(const struct csv *csv, const char *name, struct err_list *errors) {
    for (size_t i = 0; i < csv->n_columns; i++) {
        if (strcmp(csv->name[i].text, name) == 0) {
            return (int)i;
        }
    }
    csv_error(csv, &csv->name[0], errors, "column '%s' is missing", name);
    return -1;
}

static void print_head(enum reflectance_model model) {
    printf("theta_i_deg,theta_v_deg,beta,diffuse,interreflection,specular");
    for (int j = 0; j < reflectance_parameters(model); j++) {
        printf(",d_%s", material_parameter_name(reflectance_name(model), reflectance_parameter(model, j)));
    }
    putchar('\n');
}

/* m says through which widths, with which P and zeros; all 0 is the surface itself. */
static int print_point(enum reflectance_model model, const struct estimate *m, const double *angle,
                       struct err *e) {
    struct aperture a;
    struct reflectance_parts parts;
    double beta, gradient[MATERIAL_PARAMETERS];
    double i_deg = angle[0] + m->zero_source_deg - m->zero_sample_deg;
    double v_deg = angle[1] + m->zero_sample_deg;
    if (i_deg < 0) { /* beyond the normal: the same seen from the other side */
        i_deg = -i_deg;
        v_deg = -v_deg;
    }
    const struct aperture_form form = {m->source_width_deg, m->sensor_width_deg, m->beam_in_view};
    const struct reflectance_optics optics = {m->kappa, m->q, m->polarisation};
    int status = aperture_init(&a, &form, 1, &i_deg, &v_deg, e);
    if (status) {
        return status;
    }
    status = aperture_eval(&a, 0, 1, model, m->value, &optics, &beta, gradient, e);
    status = status ? status : aperture_parts(&a, 0, model, m->value, &optics, &parts, e);
    aperture_free(&a);
    if (status) {
        return status;
    }
    printf("%.17g,%.17g,%.17g,%.17g,%.17g,%.17g", angle[0], angle[1], beta, parts.diffuse,
           parts.interreflection, parts.specular);
    for (int j = 0; j < reflectance_parameters(model); j++) {
        printf(",%.17g", gradient[j]);
    }
    putchar('\n');
    return 0;
}

struct grid {
    struct csv csv;
    double (*angle)[2];
};

/* All points are checked before the first is printed. */
static int read_grid(const char *path, struct grid *grid, struct err_list *errors) {
    struct err e = {0};
    char *text = NULL;
    size_t size;
    if (file_read(path, FILE_MAX, &text, &size, &e)) {
        err_list_add(errors, &e);
        return -e.code;
    }
    int status = csv_parse(path, text, size, &grid->csv, errors);
    free(text);
    if (status) {
        return status;
    }
    const struct csv *csv = &grid->csv;
    int column[2] = {column_of(csv, "theta_i_deg", errors), column_of(csv, "theta_v_deg", errors)};
    grid->angle = calloc(csv->n_rows + 1, sizeof *grid->angle);
    for (size_t row = 0; row < csv->n_rows && column[0] >= 0 && column[1] >= 0 && grid->angle; row++) {
        for (int c = 0; c < 2; c++) {
            const struct csv_cell *cell = &csv->cell[row * csv->n_columns + (size_t)column[c]];
            double value = NAN;
            csv_number(csv, cell, c ? "theta_v_deg" : "theta_i_deg", c ? -90 : 0, 90, &value, errors);
            if (fabs(value) == 90) {
                csv_error(csv, cell, errors, "an angle must be below 90 deg");
            }
            grid->angle[row][c] = value;
        }
    }
    return errors->n || !grid->angle ? -ERR_INPUT : 0;
}

int command_eval(int argc, char **argv) {
    struct options o = {0};
    struct err e = {0};
    struct err_list errors = {0};
    struct estimate m;
    enum reflectance_model model;
    struct grid grid = {0};
    int status = read_options(argc, argv, &o, &e);
    if (status > 0) {
        return 0;
    }
    if (status || (status = read_params(o.params, o.as_seen, &m, &e)) ||
        (status = reflectance_find(m.model, &model, &e))) {
        command_complain("eval", &e);
        return 2;
    }
    status = read_grid(o.points, &grid, &errors);
    for (size_t i = 0; i < grid.csv.n_rows && !status; i++) {
        if (i == 0) {
            print_head(model);
        }
        status = print_point(model, &m, grid.angle[i], &e);
    }
    csv_free(&grid.csv);
    free(grid.angle);
    if (e.code) {
        err_list_add(&errors, &e);
    }
    return status ? command_complain_all(&errors) : 0;
}
