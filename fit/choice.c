#include "fit/choice.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static enum reflectance_model model_of(const struct estimate *m) {
    enum reflectance_model model = REFLECTANCE_MODELS;
    reflectance_find(m->model, &model, NULL);
    return model;
}

/* A parameter is the same in two models where it has the same name. */
static bool has_named(const char *model, const char *name) {
    for (int p = 0; p < MATERIAL_PARAMETERS; p++) {
        const char *other = material_parameter_name(model, p);
        if (other && strcmp(other, name) == 0) {
            return true;
        }
    }
    return false;
}

static bool is_nested(const struct estimate *small, const struct estimate *large) {
    for (int p = 0; p < MATERIAL_PARAMETERS; p++) {
        const char *name = material_parameter_name(small->model, p);
        if (name && !has_named(large->model, name)) {
            return false;
        }
    }
    return small->n_parameters < large->n_parameters;
}

/* What a point adds to the BIC, whatever they are worth: chi2 / n, or its logarithm. */
static double misfit_of(const struct choice *c) {
    const struct estimate *m = c->estimate;
    return (m->bic - m->n_parameters * log(m->n_effective)) / m->n_effective;
}

static const struct choice *describes_best(const struct choice *choice, size_t n) {
    const struct choice *best = NULL;
    for (size_t i = 0; i < n; i++) {
        if (choice[i].estimate->converged && (!best || misfit_of(&choice[i]) < misfit_of(best))) {
            best = &choice[i];
        }
    }
    return best;
}

static void fill_bic(struct choice *choice, size_t n) {
    const struct choice *best = describes_best(choice, n);
    double worth = best ? best->estimate->n_effective : 1, scatter = 1;
    if (best && best->u_stated) {
        double degrees = fmax(best->estimate->n_points - best->estimate->n_parameters, 1);
        scatter = fmax(1, misfit_of(best) * best->estimate->n_points / degrees);
    }
    for (size_t i = 0; i < n; i++) {
        const struct estimate *m = choice[i].estimate;
        choice[i].bic =
            m->converged ? worth * misfit_of(&choice[i]) / scatter + m->n_parameters * log(worth) : INFINITY;
    }
}

static bool is_needed(const struct choice *c, const struct choice *choice, size_t n) {
    if (!c->estimate->converged ||
        (!(c->estimate->loio > 0) && model_of(c->estimate) > REFLECTANCE_COMPOSITE)) {
        return false;
    }
    for (size_t i = 0; i < n; i++) {
        const struct choice *other = &choice[i];
        if (!other->estimate->converged || !is_nested(other->estimate, c->estimate)) {
            continue;
        }
        bool foretells = c->estimate->loio < other->estimate->loio || !(other->estimate->loio > 0);
        if (!(c->bic < other->bic) || !foretells) {
            return false;
        }
    }
    return true;
}

static struct choice *recommend(struct choice *choice, size_t n) {
    struct choice *best = NULL;
    for (size_t i = 0; i < n; i++) {
        choice[i].recommended = false;
        if (is_needed(&choice[i], choice, n) && (!best || choice[i].bic < best->bic)) {
            best = &choice[i];
        }
    }
    if (best) {
        best->recommended = true;
    }
    return best;
}

static void append(char *text, size_t size, const char *format, ...) __attribute__((format(printf, 3, 4)));
static void append(char *text, size_t size, const char *format, ...) {
    size_t used = strlen(text);
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text + used, size - used, format, arguments);
    va_end(arguments);
}

/* Names of a that b has not. */
static void append_names(char *text, size_t size, const struct estimate *a, const struct estimate *b) {
    const char *comma = "";
    for (int p = 0; p < MATERIAL_PARAMETERS; p++) {
        const char *name = material_parameter_name(a->model, p);
        if (name && !has_named(b->model, name)) {
            append(text, size, "%s%s", comma, name);
            comma = ", ";
        }
    }
}

/* The parameter both have that moves by the most of its u. */
static void append_move(char *text, size_t size, const struct estimate *to, const struct estimate *from) {
    double most = 0;
    int at = -1;
    for (int p = 0; p <= MATERIAL_N; p++) {
        double u = sqrt(from->statistical[p][p] + from->common[p][p]);
        bool both = material_parameter_name(to->model, p) && material_parameter_name(from->model, p);
        double move = both && u > 0 ? (to->value[p] - from->value[p]) / u : 0;
        if (fabs(move) > fabs(most)) {
            most = move;
            at = p;
        }
    }
    if (at >= 0) {
        append(text, size, ", %s %.4g -> %.4g (%+.1f u)", material_parameter_name(from->model, at),
               from->value[at], to->value[at], most);
    }
}

static void append_figures(char *text, size_t size, const struct choice *to, const struct choice *from) {
    append(text, size, "BIC %+.1f", to->bic - from->bic);
    if (to->estimate->loio > 0 && from->estimate->loio > 0) {
        append(text, size, ", an incidence left out %.3g -> %.3g", from->estimate->loio, to->estimate->loio);
    }
    append(text, size, ", median error %.2g -> %.2g %%", 100 * from->estimate->median_relative_error,
           100 * to->estimate->median_relative_error);
}

/* Beside the recommended model: what this one has more or less, and what that does. */
static void describe(struct choice *c, const struct choice *best) {
    const struct estimate *m = c->estimate;
    c->text[0] = 0;
    if (!m->converged) {
        append(c->text, sizeof c->text, "no estimate");
    } else if (!best) {
        append(c->text, sizeof c->text, "no model is needed");
    } else if (c == best) {
        append(c->text, sizeof c->text, "recommended: ");
        append_names(c->text, sizeof c->text, m, &(struct estimate){0});
        append(c->text, sizeof c->text, " are kept");
    } else {
        bool richer = is_nested(best->estimate, m), simpler = is_nested(m, best->estimate);
        append(c->text, sizeof c->text, simpler ? "too simple, without " : "left out: ");
        append_names(c->text, sizeof c->text, simpler ? best->estimate : m, simpler ? m : best->estimate);
        append(c->text, sizeof c->text, richer ? " is not needed: " : ": ");
        append_figures(c->text, sizeof c->text, c, best);
        append_move(c->text, sizeof c->text, m, best->estimate);
    }
}

/* Ties keep the order of the models. */
static int best_first(const void *a, const void *b) {
    const struct choice *x = a, *y = b;
    if (x->recommended != y->recommended) {
        return x->recommended ? -1 : 1;
    }
    if (x->bic != y->bic) {
        return x->bic < y->bic ? -1 : 1;
    }
    return model_of(x->estimate) < model_of(y->estimate) ? -1 : model_of(x->estimate) > model_of(y->estimate);
}

void choice_rank(struct choice *choice, size_t n) {
    fill_bic(choice, n);
    struct choice *best = recommend(choice, n);
    for (size_t i = 0; i < n; i++) {
        describe(&choice[i], best);
    }
    qsort(choice, n, sizeof *choice, best_first);
}
