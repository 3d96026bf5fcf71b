#include "fit/stability.h"

#include <errno.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "fit/solve.h"

#define LIMIT_REACH 3 /* how many of its own lengths a one-sided limit may fall short of the truth */

/* What comes out of the child. */
struct answer {
    struct estimate estimate;
    size_t n;
    int status;
    struct err e;
    double apart_u;
};

/* Far outside of what a surface can be, so that nothing but the data holds the fit. */
static const double wide_bounds[MATERIAL_PARAMETERS][2] = {
    [MATERIAL_S] = {1e-8, 100},         [MATERIAL_SIGMA] = {1e-6, 3},  [MATERIAL_GAMMA] = {1e-5, 3},
    [MATERIAL_BETA_PRIME] = {NAN, NAN}, [MATERIAL_N] = {1 + 1e-9, 50}, [MATERIAL_EXTRA_1] = {NAN, NAN},
    [MATERIAL_EXTRA_2] = {NAN, NAN},
};

static const char *const words[] = {[STABILITY_GOOD] = "good",
                                    [STABILITY_REFUSED] = "refused",
                                    [STABILITY_LIES] = "LIES",
                                    [STABILITY_HANGS] = "HANGS",
                                    [STABILITY_CRASHES] = "CRASHES"};

const char *stability_word(enum stability_verdict verdict) {
    return words[verdict];
}

/* Where both solvers end from the same start beside the estimate, with the weights of the estimate: the largest
 * difference of a claimed coordinate in its u. */
static int compare_solvers(struct problem *p, const struct estimate *m, double *apart_u, struct err *e) {
    struct solve_result tiny, bounded;
    double start[COORDINATES_MAX], chain[COORDINATES_MAX * COORDINATES_MAX];
    int status = problem_evaluate(p, m->value, e);
    if (status || (status = problem_reweigh(p, m->value, e))) {
        return status;
    }
    coordinates_from_value(p->model, m->value, start);
    coordinates_chain(p->model, m->value, chain);
    for (int j = 0; j < p->k; j++) {
        start[j] = fmin(fmax(start[j] + 0.05, p->low[j]), p->high[j]);
    }
    if ((status = solve_by(SOLVE_TINY, p, start, NULL, &tiny, NULL, e)) ||
        (status = solve_by(SOLVE_QR, p, start, NULL, &bounded, NULL, e))) {
        return status;
    }
    for (int j = 0; j < p->k && tiny.converged && bounded.converged; j++) {
        int parameter = (int)reflectance_parameter(p->model, j);
        double u = sqrt(m->statistical[parameter][parameter] + m->common[parameter][parameter]);
        if (!m->at_bound[parameter] && !m->not_identifiable[parameter]) {
            *apart_u = fmax(*apart_u, fabs(tiny.x[j] - bounded.x[j]) * chain[j * p->k + j] / u);
        }
    }
    return 0;
}

static int find_apart(const struct estimate_input *input, const struct estimate *m, double *apart_u,
                      struct err *e) {
    struct problem p;
    int status = problem_init(&p, input, e);
    if (status) {
        return status;
    }
    status = compare_solvers(&p, m, apart_u, e);
    problem_free(&p);
    return status;
}

static void estimate_points(const struct stability_case *c, uint64_t seed, struct answer *a) {
    struct stability_points p;
    a->apart_u = NAN;
    if ((a->status = stability_points_make(c, seed, &p, &a->e))) {
        return;
    }
    const struct estimate_input input = {.n = p.n,
                                         .theta_i_deg = p.theta_i_deg,
                                         .theta_v_deg = p.theta_v_deg,
                                         .beta = p.beta,
                                         .u_ind = p.u,
                                         .kappa = 1,
                                         .mean_low_nm = 400,
                                         .mean_high_nm = 700,
                                         .model = "composite",
                                         .bound = c->wide ? wide_bounds : NULL};
    a->n = p.n;
    a->status = estimate_fit(&input, &a->estimate, &a->e);
    if (!a->status && a->estimate.converged) {
        a->status = find_apart(&input, &a->estimate, &a->apart_u, &a->e);
    }
    stability_points_free(&p);
}

static bool write_all(int fd, const void *data, size_t size) {
    for (size_t done = 0; done < size;) {
        ssize_t n = write(fd, (const char *)data + done, size - done);
        if (n <= 0) {
            return false;
        }
        done += (size_t)n;
    }
    return true;
}

static bool read_all(int fd, void *data, size_t size) {
    for (size_t done = 0; done < size;) {
        ssize_t n = read(fd, (char *)data + done, size - done);
        if (n < 0 && errno == EINTR) {
            continue;
        }
        if (n <= 0) {
            return false;
        }
        done += (size_t)n;
    }
    return true;
}

/* The child: its alarm ends it where the estimation does not. */
static void answer_in_child(const struct stability_case *c, uint64_t seed, unsigned limit_s, int fd) {
    static struct answer a;
    signal(SIGALRM, SIG_DFL);
    alarm(limit_s);
    estimate_points(c, seed, &a);
    _exit(write_all(fd, &a, sizeof a) ? 0 : 1);
}

static void take_end(int end, unsigned limit_s, struct stability_result *r) {
    if (WIFSIGNALED(end) && WTERMSIG(end) == SIGALRM) {
        r->verdict = STABILITY_HANGS;
        snprintf(r->why, sizeof r->why, "no answer within %u s", limit_s);
        return;
    }
    r->verdict = STABILITY_CRASHES;
    if (WIFSIGNALED(end)) {
        snprintf(r->why, sizeof r->why, "ended by signal %d", WTERMSIG(end));
    } else {
        snprintf(r->why, sizeof r->why, "ended with status %d and no answer", WEXITSTATUS(end));
    }
}

/* ln where the fit is logarithmic; n by n - 1. */
static double on_scale(int parameter, double value) {
    return log(fmax(parameter == MATERIAL_N ? value - 1 : value, 1e-300));
}

static void judge_claim(const struct stability_case *c, int parameter, struct stability_result *r) {
    const struct estimate *m = &r->estimate;
    double u = sqrt(m->statistical[parameter][parameter] + m->common[parameter][parameter]);
    double error_u = fabs(m->value[parameter] - c->truth[parameter]) / u;
    if (!(error_u <= r->worst_u)) {
        r->worst_u = error_u;
        r->worst = parameter;
    }
    if (!(error_u <= STABILITY_LIE_U)) {
        r->verdict = STABILITY_LIES;
        snprintf(r->why, sizeof r->why, "%s is said to be %.6g with u %.2g; it is %.6g",
                 material_parameter_name(m->model, parameter), m->value[parameter], u, c->truth[parameter]);
    }
}

static void judge_limit(const struct stability_case *c, int parameter, struct stability_result *r) {
    const struct estimate *m = &r->estimate;
    double bound = on_scale(parameter, m->value[parameter]),
           limit = on_scale(parameter, m->limit_95[parameter]);
    double truth = on_scale(parameter, c->truth[parameter]);
    double reach = (truth - bound) / (limit - bound); /* 1: at the limit; below 0: beyond the bound */
    if (!(reach <= LIMIT_REACH)) {
        r->verdict = STABILITY_LIES;
        snprintf(r->why, sizeof r->why, "%s is said to be between %.4g and %.4g; it is %.4g",
                 material_parameter_name(m->model, parameter), m->value[parameter], m->limit_95[parameter],
                 c->truth[parameter]);
    }
}

/* The parameter whose truth the usual bounds leave out, -1 where none is: no fit can find it, but it has to be said to
 * be at its bound, and what goes with it then holds for that bound only. */
static int find_excluded(const struct stability_case *c) {
    double low[COORDINATES_MAX], high[COORDINATES_MAX], bound[MATERIAL_PARAMETERS];
    coordinates_bounds(REFLECTANCE_COMPOSITE, low, high);
    for (int end = 0; end < 2 && !c->wide && !c->replaced; end++) {
        coordinates_to_value(REFLECTANCE_COMPOSITE, end ? high : low, bound);
        for (int p = MATERIAL_S; p <= MATERIAL_N; p++) {
            if (p != MATERIAL_BETA_PRIME && (end ? c->truth[p] > bound[p] : c->truth[p] < bound[p])) {
                return p;
            }
        }
    }
    return -1;
}

void stability_judge(const struct stability_case *c, struct stability_result *r) {
    const struct estimate *m = &r->estimate;
    r->verdict = STABILITY_GOOD;
    r->worst_u = NAN;
    r->worst = -1;
    for (int p = MATERIAL_S; p <= MATERIAL_N; p++) {
        if (m->not_identifiable[p]) {
            continue;
        }
        if (m->at_bound[p]) {
            judge_limit(c, p, r);
        } else {
            judge_claim(c, p, r);
        }
    }
    int excluded = find_excluded(c);
    if (excluded >= 0 && (m->at_bound[excluded] || m->not_identifiable[excluded])) {
        r->verdict = STABILITY_GOOD;
        snprintf(r->why, sizeof r->why, "%s is outside the bounds: said to be at one, or unknown",
                 material_parameter_name(m->model, excluded));
    }
}

static void take_answer(const struct stability_case *c, const struct answer *a, struct stability_result *r) {
    r->estimate = a->estimate;
    r->n = a->n;
    r->apart_u = a->apart_u;
    if (a->status || !a->estimate.converged) {
        r->verdict = STABILITY_REFUSED;
        snprintf(r->why, sizeof r->why, "%.255s", a->status ? a->e.text : a->estimate.refusal);
        return;
    }
    stability_judge(c, r);
}

int stability_run(const struct stability_case *c, uint64_t seed, unsigned limit_s, struct stability_result *r,
                  struct err *e) {
    int ends[2], end = 0;
    *r = (struct stability_result){.worst_u = NAN, .worst = -1, .apart_u = NAN};
    if (pipe(ends) != 0) {
        return err_errno(e, ERR_IO, errno, "no pipe for a case of the stability table");
    }
    fflush(NULL);
    pid_t child = fork();
    if (child == 0) {
        close(ends[0]);
        answer_in_child(c, seed, limit_s, ends[1]);
    }
    int saved_errno = errno;
    close(ends[1]);
    struct answer *a = malloc(sizeof *a);
    bool answered = child > 0 && a && read_all(ends[0], a, sizeof *a);
    close(ends[0]);
    if (child < 0 || waitpid(child, &end, 0) < 0) {
        free(a);
        return err_errno(e, ERR_IO, saved_errno, "no process for a case of the stability table");
    }
    if (answered) {
        take_answer(c, a, r);
    } else {
        take_end(end, limit_s, r);
    }
    free(a);
    return 0;
}
