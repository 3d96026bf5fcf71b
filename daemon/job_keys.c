#include "daemon/job_keys.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/job.h"
#include "proto/yaml_table.h"

#define AT(field) struct job, field
#define SAMPLE_AT(field) struct job_sample, field
#define RANGE_AT(field) struct range, field
#define GRAZING_DEG 89.0 /* a spot at 89 deg is already 57 times its width */

static const char *const modes[] = {"fixed", "per_incidence", "every_geometry", "start_end", NULL};
static const char *const models[] = {"lambert",     "oren-nayar", "eq1", "composite", "heavy-tail",
                                     "transmitted", "two-lobe",   "all", NULL};

const char *job_mode_name(enum job_reference_mode mode) {
    return modes[mode];
}

struct range {
    double from, to, step;
};

const struct yaml_key job_range_keys[] = {
    YAML_NUMBER("from", RANGE_AT(from), -GRAZING_DEG, GRAZING_DEG, .required = true, .unit = "deg",
                .doc = "first angle"),
    YAML_NUMBER("to", RANGE_AT(to), -GRAZING_DEG, GRAZING_DEG, .required = true, .unit = "deg",
                .doc = "last angle, reached where it is a whole number of steps"),
    YAML_NUMBER("step", RANGE_AT(step), 0.01, 180, .required = true, .unit = "deg",
                .doc = "from one angle to the next"),
    {0}};

struct angles { /* where a list of angles goes */
    double *deg;
    int *n;
    int capacity;
    double low, high;
};

static int by_value(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void sort_unique(const struct angles *list) {
    qsort(list->deg, (size_t)*list->n, sizeof *list->deg, by_value);
    int kept = 0;
    for (int i = 0; i < *list->n; i++)
        if (kept == 0 || list->deg[i] != list->deg[kept - 1])
            list->deg[kept++] = list->deg[i];
    *list->n = kept;
}

static void add_angle(struct yaml_reader *r, const struct yaml_node *node, const struct angles *list,
                      double deg) {
    if (!(deg >= list->low && deg <= list->high))
        yaml_error(r, node, "%g deg is outside %g .. %g deg", deg, list->low, list->high);
    else
        list->deg[(*list->n)++] = deg;
}

static void read_range(struct yaml_reader *r, const struct yaml_node *node, const struct angles *list) {
    struct range range = {0};
    if (yaml_read_map(r, node, job_range_keys, &range) < 0)
        return;
    if (range.to < range.from) {
        yaml_error(r, node, "from %g to %g deg runs backwards: `from` is the smaller angle", range.from,
                   range.to);
        return;
    }
    double steps = floor((range.to - range.from) / range.step + 1e-9);
    if (steps + 1 > list->capacity) {
        yaml_error(r, node, "%.0f angles are too many: at most %d in one list", steps + 1, list->capacity);
        return;
    }
    for (int k = 0; k <= (int)steps; k++)
        add_angle(r, node, list, range.from + k * range.step);
}

static void read_list(struct yaml_reader *r, const struct yaml_node *node, const struct angles *list) {
    if (yaml_count(node) > (size_t)list->capacity) {
        yaml_error(r, node, "%zu angles are too many: at most %d in one list", yaml_count(node),
                   list->capacity);
        return;
    }
    for (size_t i = 0; i < yaml_count(node); i++) {
        double deg;
        if (yaml_read_double(r, yaml_item(node, i), &deg) == 0)
            add_angle(r, yaml_item(node, i), list, deg);
    }
}

static void read_angles(struct yaml_reader *r, const struct yaml_node *node, const struct angles *list) {
    *list->n = 0;
    if (yaml_is_map(node))
        read_range(r, node, list);
    else if (yaml_is_list(node) && yaml_count(node) > 0)
        read_list(r, node, list);
    else
        yaml_error(r, node, "expected angles in degrees, [10, 20, 30] or {from: 10, to: 60, step: 10}");
    sort_unique(list);
}

static int read_theta_i(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    struct job_geometry *g = &((struct job *)object)->geometry;
    read_angles(r, node, &(struct angles){g->theta_i_deg, &g->n_theta_i, JOB_ANGLES, 0, GRAZING_DEG});
    return 0;
}

static int read_theta_v(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    struct job_geometry *g = &((struct job *)object)->geometry;
    read_angles(r, node,
                &(struct angles){g->theta_v_deg, &g->n_theta_v, JOB_VIEWS, -GRAZING_DEG, GRAZING_DEG});
    return 0;
}

static int read_pairs(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    struct job_geometry *g = &((struct job *)object)->geometry;
    g->n_pairs = 0;
    if (!yaml_is_list(node) || yaml_count(node) == 0 || yaml_count(node) > JOB_PAIRS) {
        yaml_error(r, node, "expected 1 to %d pairs [theta_i, theta_v], as [[40, 38.5], [40, 40]]",
                   JOB_PAIRS);
        return 0;
    }
    for (size_t i = 0; i < yaml_count(node); i++) {
        const struct yaml_node *pair = yaml_item(node, i);
        double *deg = g->pair_deg[g->n_pairs];
        if (!yaml_is_list(pair) || yaml_count(pair) != 2)
            yaml_error(r, pair, "expected a pair [theta_i, theta_v] in degrees");
        else if (yaml_read_double(r, yaml_item(pair, 0), &deg[0]) < 0 ||
                 yaml_read_double(r, yaml_item(pair, 1), &deg[1]) < 0)
            continue;
        else if (!(deg[0] >= 0 && deg[0] <= GRAZING_DEG && fabs(deg[1]) <= GRAZING_DEG))
            yaml_error(r, pair, "theta_i lies in 0 .. %g deg and theta_v in -%g .. %g deg", GRAZING_DEG,
                       GRAZING_DEG, GRAZING_DEG);
        else
            g->n_pairs++;
    }
    return 0;
}

static int read_size(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    struct job_sample *sample = object;
    if (!yaml_is_list(node) || yaml_count(node) != 2) {
        yaml_error(r, node, "expected [in the plane of incidence, across it] in mm, as [60, 40]");
        return 0;
    }
    for (size_t i = 0; i < 2; i++)
        if (yaml_read_double(r, yaml_item(node, i), &sample->size_mm[i]) == 0 &&
            !(sample->size_mm[i] > 0 && sample->size_mm[i] <= 2000))
            yaml_error(r, yaml_item(node, i), "the size of a sample lies within 0 .. 2000 mm");
    return 0;
}

static int read_notes(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    struct job_sample *sample = object;
    if (!yaml_is_map(node))
        yaml_error(r, node, "expected a mapping of notes, as {applicator: 100 um}");
    else
        sample->notes = yaml_node_json(node);
    return 0;
}

static int read_mean(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    struct job *job = object;
    if (!yaml_is_list(node) || yaml_count(node) != 2) {
        yaml_error(r, node, "expected [low, high] in nm, as [400, 700]");
        return 0;
    }
    for (size_t i = 0; i < 2; i++) {
        int64_t nm;
        const int last_nm = BAND_FIRST_NM + BAND_STEP_NM * (BANDS - 1);
        if (yaml_read_int(r, yaml_item(node, i), BAND_FIRST_NM, last_nm, &nm) < 0)
            continue;
        job->mean_nm[i] = (int)nm;
        if (nm % BAND_STEP_NM != 0)
            yaml_error(r, yaml_item(node, i), "%d nm is no band: bands lie every %d nm", (int)nm,
                       BAND_STEP_NM);
    }
    return 0;
}

static const struct yaml_key job_sample_keys[] = {
    YAML_TEXT("name", SAMPLE_AT(name), .required = true,
              .doc = "short name, part of the session's name: letters, digits, - and _"),
    YAML_TEXT("holder", SAMPLE_AT(holder), .default_text = "sample",
              .doc = "position of the holder that brings it into the beam"),
    YAML_TEXT("paint", SAMPLE_AT(paint), .doc = "name of the paint"),
    YAML_TEXT("support", SAMPLE_AT(support), .doc = "what it is painted on"),
    YAML_OWN("size_mm", read_size, .required = true, .unit = "mm",
             .doc = "[in the plane of incidence, across it]; the inner of the two spots must lie on it"),
    YAML_NUMBER("water_percent", SAMPLE_AT(water_percent), 0, 1000, YAML_SETS(SAMPLE_AT(has_water)),
                .unit = "%", .doc = "added water / paint, by weight"),
    YAML_OWN("notes", read_notes, .doc = "anything else, any keys; kept in the session"),
    {0}};

static const struct yaml_key geometry_keys[] = {
    YAML_OWN("theta_i_deg", read_theta_i, .unit = "deg",
             .doc = "incidence angles, 0 or more: a list, or {from, to, step}"),
    YAML_OWN("theta_v_deg", read_theta_v, .unit = "deg",
             .doc = "viewing angles, above 0 on the mirror side: a list, or {from, to, step}"),
    YAML_NUMBER("mirror_step_deg", AT(geometry.mirror_step_deg), 0, 45, .unit = "deg",
                .doc = "further views this far apart around the mirror direction theta_v = theta_i"),
    YAML_NUMBER("mirror_half_width_deg", AT(geometry.mirror_half_width_deg), 0, 90, .unit = "deg",
                .doc = "how far around it, as far as theta_v_deg reaches"),
    YAML_FLAG("reciprocity", AT(geometry.reciprocity), .default_text = "false",
              .doc = "where only the source axis moves: measure a geometry that cannot be reached with light "
                     "path reversed"),
    YAML_OWN("pairs", read_pairs, .unit = "deg", .doc = "[[theta_i, theta_v], ...] instead of the grid"),
    {0}};

static const struct yaml_key exposure_keys[] = {
    YAML_NUMBER("target", AT(exposure.target), 0.05, 0.95, .default_text = "0.8",
                .doc = "peak signal aimed at, as a fraction of saturation"),
    YAML_NUMBER("min_ms", AT(exposure.min_ms), 0.01, 65535, .default_text = "4", .unit = "ms",
                .doc = "shortest integration time"),
    YAML_NUMBER("max_ms", AT(exposure.max_ms), 0.01, 65535, .default_text = "5000", .unit = "ms",
                .doc = "longest integration time"),
    YAML_INTEGER("average", AT(exposure.average), 1, 1000, .default_text = "4",
                 .doc = "scans of one reading; all are kept"),
    YAML_NUMBER("dark_every_min", AT(exposure.dark_every_min), 0.1, 1440, .default_text = "10", .unit = "min",
                .doc = "age at which a dark is measured again"),
    {0}};

static const struct yaml_key reference_geometry_keys[] = {
    YAML_NUMBER("theta_i_deg", AT(reference.theta_i_deg), 0, GRAZING_DEG, .default_text = "45", .unit = "deg",
                .doc = "not used in per_incidence"),
    YAML_NUMBER("theta_v_deg", AT(reference.theta_v_deg), -GRAZING_DEG, GRAZING_DEG, .default_text = "0",
                .unit = "deg", .doc = "also the view of per_incidence"),
    {0}};

static const struct yaml_key reference_keys[] = {
    YAML_WORD("mode", AT(reference.mode), modes, .default_text = "fixed",
              .doc = "fixed: at `geometry`; per_incidence: at each theta_i with its theta_v_deg; "
                     "every_geometry: at each geometry, with control readings at `geometry`; start_end: at "
                     "`geometry`, before and after all"),
    YAML_PART("geometry", reference_geometry_keys, .default_text = "{}", .doc = "where the diffuser is read"),
    YAML_TEXT("holder", AT(reference.holder), .default_text = "reference",
              .doc = "position of the holder that brings the diffuser into the beam"),
    YAML_TEXT("certificate", AT(reference.certificate_file), .required = true,
              .doc = "CSV of the diffuser's radiance factor, path relative to the job file"),
    YAML_NUMBER("size_mm", AT(reference.size_mm), 0.1, 2000, .unit = "mm",
                .doc = "diameter of the diffuser; left out, its footprint is not checked"),
    YAML_NUMBER("bracket_min", AT(reference.bracket_min), 0.1, 1440, .default_text = "15", .unit = "min",
                .doc = "longest time between two readings of the diffuser"),
    YAML_NUMBER("angular_u_rel", AT(reference.angular_u_rel), 0, 0.5,
                .doc = "relative uncertainty of the diffuser's angular dependence; only where its "
                       "certificate is of another geometry"),
    YAML_FLAG("accept_expired", AT(reference.accept_expired), .default_text = "false",
              .doc = "measure although the certificate's valid_until has passed; the session says so"),
    {0}};

static const struct yaml_key fit_keys[] = {
    YAML_TEXT("model", AT(fit_model), .default_text = "composite",
              .doc =
                  "lambert, oren-nayar, eq1, composite, heavy-tail, transmitted or two-lobe; all: composite "
                  "while measuring, at the end all of them, ranked"),
    YAML_WORD("loss", AT(fit_loss), material_losses, .default_text = "ml",
              .doc =
                  "what is minimised: ml (residuals over their u), ols (the paper's Eq. 6), log, cuberoot or "
                  "cosine"),
    {0}};

const struct yaml_key job_keys[] = {
    YAML_TEXT("name", AT(name), .required = true,
              .doc = "short name, part of the sessions' names: letters, digits, - and _"),
    YAML_TEXT("series", AT(series), .doc = "groups sessions for comparison; default: the name"),
    YAML_PARTS("samples", AT(sample), AT(n_samples), job_sample_keys, .minimum = 1, .required = true,
               .doc =
                   "what to measure; each gets a session of its own, all share the readings of the diffuser"),
    YAML_PART("geometry", geometry_keys, .required = true,
              .doc = "the angles: a grid of theta_i_deg x theta_v_deg, or pairs"),
    YAML_OWN("mean_nm", read_mean, .default_text = "[400, 700]", .unit = "nm",
             .doc = "[low, high] of the visible mean"),
    YAML_PART("exposure", exposure_keys, .default_text = "{}", .doc = "integration times"),
    YAML_PART("reference", reference_keys, .required = true,
              .doc = "the reference diffuser and how often it is read"),
    YAML_PART("fit", fit_keys, .default_text = "{}", .doc = "the reflection model"),
    {0}};

const char *const *job_fit_models(void) {
    return models;
}
