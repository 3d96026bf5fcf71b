#include "fit/render/spread_paint.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/dice.h"

#define PIVOT_LEAST 1e-13             /* of a unit diagonal: what is below is rounding of the sums in C */
#define SEED_STEP 0x9e3779b97f4a7c15u /* splitmix64's own step: streams far apart */

static int largest_pivot(int n, const double *left, const bool *used) {
    int best = -1;
    for (int i = 0; i < n; i++) {
        if (!used[i] && (best < 0 || left[i] > left[best])) {
            best = i;
        }
    }
    return best;
}

/* Cholesky with pivots of the correlations, so that units have no say in what is rounding. */
int spread_factor(int n, const double *c, double *l) {
    double u[JOINT_ROWS], left[JOINT_ROWS];
    bool used[JOINT_ROWS] = {false};
    int rank = 0;
    for (int i = 0; i < n; i++) {
        u[i] = sqrt(fmax(c[i * n + i], 0));
        left[i] = u[i] > 0 ? 1 : 0;
    }
    memset(l, 0, (size_t)n * (size_t)n * sizeof *l);
    for (; rank < n; rank++) {
        int p = largest_pivot(n, left, used);
        if (!(left[p] > PIVOT_LEAST)) {
            break;
        }
        double root = sqrt(left[p]);
        used[p] = true;
        for (int i = 0; i < n; i++) {
            double sum = u[i] > 0 ? c[i * n + p] / (u[i] * u[p]) : 0;
            for (int k = 0; k < rank; k++) {
                sum -= l[i * n + k] * l[p * n + k];
            }
            l[i * n + rank] = i == p ? root : used[i] ? 0 : sum / root;
            left[i] -= l[i * n + rank] * l[i * n + rank];
        }
    }
    for (int i = 0; i < n * n; i++) {
        l[i] *= u[i / n];
    }
    return rank;
}

struct band {   /* the rows that a band's value rests on, and their parts: its own, or those it is held by */
    int row[2]; /* -1: none */
    double part[2];
};

static void find_bands(const struct joint *joint, int parameter, struct band band[BANDS]) {
    int row[BANDS];
    for (int k = 0; k < BANDS; k++) {
        row[k] = joint_row(joint, parameter, k);
    }
    for (int k = 0; k < BANDS; k++) {
        int low = k, high = k;
        while (low >= 0 && row[low] < 0) {
            low--;
        }
        while (high < BANDS && row[high] < 0) {
            high++;
        }
        low = low < 0 ? high : low;
        high = high == BANDS ? low : high;
        bool any = low >= 0 && low < BANDS;
        double part = any && high > low ? (k - low) / (double)(high - low) : 0;
        band[k] = (struct band){{any ? row[low] : -1, any ? row[high] : -1}, {1 - part, part}};
    }
}

struct making { /* of one paint */
    const struct scene *scene;
    const struct paint *paint;
    const struct joint *joint;
    struct spread_paint *out;
    double *l; /* [n * n] */
    struct band s[BANDS], beta_prime[BANDS];
    double power[PLANES_SETS][BANDS]; /* scaled: sum of power times ybar is 1 */
    const double (*cmf)[3];
};

static double *basis_at(const struct spread_paint *p, int set, int kind, int axis) {
    return p->basis + (size_t)((set * SPREAD_KINDS + kind) * 3 + axis) * (size_t)p->rank;
}

static void add_row(double *to, const struct making *m, int row, double factor) {
    for (int r = 0; r < m->out->rank && row >= 0; r++) {
        to[r] += factor * m->l[row * m->joint->n + r];
    }
}

static void fill_basis(const struct making *m) {
    for (int i = 0; i < m->out->sets * BANDS * 3; i++) {
        int set = i / (BANDS * 3), k = i / 3 % BANDS, axis = i % 3;
        double weight = m->power[set][k] * m->cmf[k][axis];
        for (int side = 0; side < 2; side++) {
            double one = weight * m->s[k].part[side], lobe = weight * m->beta_prime[k].part[side];
            add_row(basis_at(m->out, set, 0, axis), m, m->s[k].row[side], one);
            add_row(basis_at(m->out, set, 1, axis), m, m->s[k].row[side], one * 2 * m->paint->s[k]);
            add_row(basis_at(m->out, set, 2, axis), m, m->beta_prime[k].row[side], lobe);
        }
    }
}

static void fill_shared(const struct making *m) {
    for (int i = 0; i < m->joint->n; i++) {
        const struct joint_row *row = &m->joint->row[i];
        m->out->moves[row->parameter] = m->out->moves[row->parameter] || row->parameter != MATERIAL_S;
        if (row->band < 0) {
            add_row(m->out->shared + (size_t)row->parameter * (size_t)m->out->rank, m, i, 1);
        }
    }
}

static void fill_bands(const struct making *m) {
    for (int i = 0; i < SPREAD_BAND_KINDS * BANDS * 2; i++) {
        int kind = i / (2 * BANDS), k = i / 2 % BANDS, side = i % 2;
        const struct band *band = kind == 0 ? &m->s[k] : &m->beta_prime[k];
        add_row(m->out->band + (size_t)(kind * BANDS + k) * (size_t)m->out->rank, m, band->row[side],
                band->part[side]);
    }
    m->out->beta_prime_by_band = m->beta_prime[0].row[0] >= 0;
}

static void fill_draws(const struct making *m, uint64_t seed) {
    struct dice dice = {seed};
    for (int d = 0; d < SPREAD_DRAWS; d++) {
        double *z = m->out->normal + (size_t)d * (size_t)m->out->rank;
        for (int r = 0; r < m->out->rank; r++) {
            z[r] = dice_normal(&dice);
        }
        for (int i = 0; i < m->out->n; i++) {
            double sum = 0;
            for (int r = 0; r < m->out->rank; r++) {
                sum += m->l[i * m->out->n + r] * z[r];
            }
            m->out->draw[d * m->out->n + i] = sum;
        }
    }
}

static double change_of(const struct making *m, int draw, const struct band *band) {
    double sum = 0;
    for (int side = 0; side < 2; side++) {
        sum += band->row[side] >= 0 ? band->part[side] * m->out->draw[draw * m->out->n + band->row[side]] : 0;
    }
    return sum;
}

static int fill_matrices(const struct making *m, struct err *e) {
    enum colour_observer observer = (enum colour_observer)m->scene->image.observer;
    int status = 0;
    for (int d = 0; d < SPREAD_DRAWS && !status; d++) {
        double s[BANDS], change[BANDS];
        for (int k = 0; k < BANDS; k++) {
            s[k] = fmax(m->paint->s[k] + change_of(m, d, &m->s[k]), 0);
            change[k] = change_of(m, d, &m->beta_prime[k]);
        }
        for (int j = 0; j < m->out->sets && !status; j++) {
            double radiance[BANDS];
            for (int k = 0; k < BANDS; k++) {
                radiance[k] = m->power[j][k] * change[k];
            }
            colour_sum(radiance, observer, m->out->per_band[d * m->out->sets + j]);
            status = colour_collapse(s, m->scene->spd[j].power, observer,
                                     &m->out->matrix[d * m->out->sets + j], e);
        }
    }
    return status;
}

static int fill_known(struct making *m, uint64_t seed, struct err *e) {
    int n = m->joint->n;
    struct spread_paint *p = m->out;
    double *c = malloc((size_t)n * (size_t)n * sizeof *c);
    m->l = malloc((size_t)n * (size_t)n * sizeof *m->l);
    if (!c || !m->l) {
        free(c);
        return err_set(e, ERR_NOMEM, "no memory for a covariance");
    }
    for (int i = 0; i < n * n; i++) {
        c[i] = m->joint->statistical[i] + m->joint->common[i];
    }
    p->n = n;
    p->rank = spread_factor(n, c, m->l);
    free(c);
    size_t rank = (size_t)p->rank, sets = (size_t)p->sets;
    p->draw = calloc(SPREAD_DRAWS * (size_t)n, sizeof *p->draw);
    p->normal = calloc(SPREAD_DRAWS * rank + 1, sizeof *p->normal);
    p->band = calloc(SPREAD_BAND_KINDS * BANDS * rank + 1, sizeof *p->band);
    p->shared = calloc(MATERIAL_PARAMETERS * rank + 1, sizeof *p->shared);
    p->basis = calloc(sets * SPREAD_KINDS * 3 * rank + 1, sizeof *p->basis);
    p->matrix = calloc(SPREAD_DRAWS * sets, sizeof *p->matrix);
    p->per_band = calloc(SPREAD_DRAWS * sets, sizeof *p->per_band);
    if (!p->draw || !p->normal || !p->band || !p->shared || !p->basis || !p->matrix || !p->per_band) {
        return err_set(e, ERR_NOMEM, "no memory for %d draws", SPREAD_DRAWS);
    }
    find_bands(m->joint, MATERIAL_S, m->s);
    find_bands(m->joint, MATERIAL_BETA_PRIME, m->beta_prime);
    fill_shared(m);
    fill_basis(m);
    fill_bands(m);
    fill_draws(m, seed);
    return fill_matrices(m, e);
}

int spread_paint_make(const struct scene *scene, int paint, const struct joint *joint, uint64_t seed,
                      struct spread_paint *p, struct err *e) {
    enum colour_observer observer = (enum colour_observer)scene->image.observer;
    struct making m = {
        .scene = scene, .paint = &scene->paint[paint], .joint = joint, .out = p, .cmf = colour_cmf(observer)};
    int status = 0;
    *p = (struct spread_paint){.sets = scene->n_spds};
    for (int j = 0; j < scene->n_spds && !status; j++) {
        colour_scale_power(scene->spd[j].power, observer, m.power[j]);
        status = colour_collapse(m.paint->s, scene->spd[j].power, observer, &p->best[j], e);
    }
    if (!status && joint && strcmp(joint->model, m.paint->estimate.model) != 0) {
        status = err_set(e, ERR_STATE, "material %s: its joint fit is of the model %s, its estimate of %s",
                         m.paint->name, joint->model, m.paint->estimate.model);
    }
    if (!status && joint && joint->n > 0) {
        status = fill_known(&m, seed + SEED_STEP * (uint64_t)paint, e);
        free(m.l);
    }
    if (status) {
        spread_paint_free(p);
    }
    return status;
}

void spread_paint_free(struct spread_paint *p) {
    free(p->draw);
    free(p->normal);
    free(p->band);
    free(p->shared);
    free(p->basis);
    free(p->matrix);
    free(p->per_band);
    *p = (struct spread_paint){0};
}

double spread_paint_change(const struct spread_paint *p, const struct joint *joint, int draw, int parameter) {
    int row = joint ? joint_row(joint, parameter, -1) : -1;
    return row >= 0 ? p->draw[draw * p->n + row] : 0;
}
