#include "fit/render/tint.h"

#include <string.h>

#define PART 256 /* pixels whose missing planes are read from one block of zeros */

static const double nothing[PART];

static void add_part(const struct colour_matrix *m, size_t n, const double *a, const double *b,
                     const double *c, double *const out[3]) {
    for (size_t i = 0; i < n; i++) {
        for (int k = 0; k < 3; k++) {
            out[k][i] += m->m[k][0] * a[i] + m->m[k][1] * b[i] + m->m[k][2] * c[i];
        }
    }
}

#if defined(__x86_64__)
typedef double four __attribute__((vector_size(32)));

__attribute__((target("avx2"))) static void add_part_wide(const struct colour_matrix *m, size_t n,
                                                          const double *a, const double *b, const double *c,
                                                          double *const out[3]) {
    size_t wide = n - n % 4;
    for (size_t i = 0; i < wide; i += 4) {
        four va, vb, vc, sum;
        memcpy(&va, a + i, sizeof va);
        memcpy(&vb, b + i, sizeof vb);
        memcpy(&vc, c + i, sizeof vc);
        for (int k = 0; k < 3; k++) {
            memcpy(&sum, out[k] + i, sizeof sum);
            sum += m->m[k][0] * va + m->m[k][1] * vb + m->m[k][2] * vc;
            memcpy(out[k] + i, &sum, sizeof sum);
        }
    }
    add_part(m, n - wide, a + wide, b + wide, c + wide,
             (double *const[]){out[0] + wide, out[1] + wide, out[2] + wide});
}
#endif

typedef void part_kernel(const struct colour_matrix *m, size_t n, const double *a, const double *b,
                         const double *c, double *const out[3]);

static void add_all(part_kernel *kernel, const struct colour_matrix *m, size_t n, const double *a,
                    const double *b, const double *c, double *const out[3]) {
    for (size_t i = 0; i < n; i += PART) {
        size_t part = n - i < PART ? n - i : PART;
        kernel(m, part, a + i, b ? b + i : nothing, c ? c + i : nothing,
               (double *const[]){out[0] + i, out[1] + i, out[2] + i});
    }
}

void tint_add_plain(const struct colour_matrix *m, size_t n, const double *a, const double *b,
                    const double *c, double *const out[3]) {
    add_all(add_part, m, n, a, b, c, out);
}

void tint_add(const struct colour_matrix *m, size_t n, const double *a, const double *b, const double *c,
              double *const out[3]) {
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2")) {
        add_all(add_part_wide, m, n, a, b, c, out);
        return;
    }
#endif
    tint_add_plain(m, n, a, b, c, out);
}
