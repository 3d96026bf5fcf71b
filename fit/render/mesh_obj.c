#include <stdio.h>
#include <string.h>

#include "fit/render/mesh.h"
#include "proto/number.h"

#define WORD_MAX 64

struct obj { /* one file on the way through */
    const char *file;
    struct mesh *mesh;
    struct err_list *errors;
    const char *at, *begin, *end; /* in the present line */
    int line, material, status;
    size_t n_errors; /* of this file */
};

struct word {
    char text[WORD_MAX];
    int column;
};

#define COMPLAIN(o, column, ...)                                                                             \
    ((o)->n_errors++, (o)->status = mesh_complain((o)->errors, (o)->file, (o)->line, column, __VA_ARGS__))

static bool is_blank(const struct obj *o, const char *p) {
    return *p == ' ' || *p == '\t' || *p == '\r' || *p == '\n' ||
           (*p == '\\' && p + 1 < o->end && (p[1] == '\n' || p[1] == '\r'));
}

/* False at the end of the line. A word too long is cut, and says so by its last character. */
static bool next_word(struct obj *o, struct word *word) {
    size_t n = 0;
    while (o->at < o->end && is_blank(o, o->at)) {
        o->at++;
    }
    word->column = (int)(o->at - o->begin) + 1;
    while (o->at < o->end && !is_blank(o, o->at)) {
        if (n + 1 < sizeof word->text) {
            word->text[n++] = *o->at;
        } else {
            word->text[n - 1] = '~'; /* too long: no number and no name */
        }
        o->at++;
    }
    word->text[n] = '\0';
    return n > 0;
}

static bool read_vector(struct obj *o, struct vec3 *v) {
    double *const part[3] = {&v->x, &v->y, &v->z};
    struct word word;
    for (int i = 0; i < 3; i++) {
        if (!next_word(o, &word) || !number_read_double(word.text, part[i])) {
            COMPLAIN(o, word.column, "'%s' stands where a number is expected: x, y, z after v or vn",
                     word.text);
            return false;
        }
    }
    return true;
}

static void too_many(struct obj *o, int status) {
    if (status == -ERR_NOMEM) {
        COMPLAIN(o, 0, "no memory for a mesh of this size");
    } else if (status) {
        COMPLAIN(o, 0, "more than %u of a kind; make the mesh coarser", MESH_COUNT_MAX);
    }
}

static void read_vertex(struct obj *o) {
    struct vec3 v;
    if (read_vector(o, &v)) {
        too_many(o, mesh_add_vertex(o->mesh, v));
    }
}

static void read_normal(struct obj *o) {
    struct vec3 v;
    if (read_vector(o, &v)) {
        too_many(o, mesh_add_normal(o->mesh, v));
    }
}

/* 1, 2, ... from the first, -1, -2, ... from the last one so far. */
static bool resolve(struct obj *o, int column, const char *what, const char *text, size_t n,
                    uint32_t *index) {
    int64_t value;
    if (!number_read_int(text, &value) || value == 0 || value > (int64_t)n || -value > (int64_t)n) {
        COMPLAIN(o, column, "%s '%s' is none of the %zu above this line", what, text, n);
        return false;
    }
    *index = (uint32_t)(value > 0 ? value - 1 : (int64_t)n + value);
    return true;
}

/* v, v/vt, v//vn or v/vt/vn */
static bool read_corner(struct obj *o, struct word *word, struct mesh_corner *corner) {
    char *slash = strchr(word->text, '/'), *second = slash ? strchr(slash + 1, '/') : NULL;
    if (slash) {
        *slash = '\0';
    }
    corner->normal = MESH_NO_NORMAL;
    return resolve(o, word->column, "vertex", word->text, o->mesh->n_vertices, &corner->vertex) &&
           (!second || resolve(o, word->column, "normal", second + 1, o->mesh->n_normals, &corner->normal));
}

static void read_face(struct obj *o) {
    struct mesh_corner corner[MESH_CORNERS_MAX];
    struct word word;
    int n = 0, normals = 0;
    while (next_word(o, &word)) {
        if (n == MESH_CORNERS_MAX) {
            COMPLAIN(o, word.column, "a face of more than %d corners", MESH_CORNERS_MAX);
            return;
        }
        if (!read_corner(o, &word, &corner[n])) {
            return;
        }
        normals += corner[n++].normal != MESH_NO_NORMAL;
    }
    if (n < 3) {
        COMPLAIN(o, 1, "a face of %d corners; it needs three", n);
    } else if (normals != 0 && normals != n) {
        COMPLAIN(o, 1, "%d of the %d corners of this face have a normal; all or none must", normals, n);
    } else {
        too_many(o, mesh_add_polygon(o->mesh, n, corner, o->material));
    }
}

static void read_material(struct obj *o) {
    struct mesh *mesh = o->mesh;
    struct word word;
    if (!next_word(o, &word)) {
        COMPLAIN(o, word.column, "usemtl needs the name of a material");
        return;
    }
    for (o->material = 0; o->material < mesh->n_materials; o->material++) {
        if (strcmp(mesh->material[o->material].name, word.text) == 0) {
            return;
        }
    }
    if (mesh->n_materials == MESH_MATERIALS) {
        o->material = -1;
        COMPLAIN(o, word.column, "more than %d materials in one mesh", MESH_MATERIALS);
        return;
    }
    snprintf(mesh->material[o->material].name, sizeof mesh->material[0].name, "%s", word.text);
    mesh->material[mesh->n_materials++].line = o->line;
}

static void pass_over(struct obj *o) {
    (void)o;
}

static const struct {
    const char *name;
    void (*read)(struct obj *o);
} keywords[] = {
    {"v", read_vertex},      {"vn", read_normal},     {"f", read_face},          {"usemtl", read_material},
    {"vt", pass_over},       {"g", pass_over},        {"o", pass_over},          {"s", pass_over},
    {"mg", pass_over},       {"l", pass_over},        {"p", pass_over},          {"mtllib", pass_over},
    {"usemap", pass_over},   {"maplib", pass_over},   {"lod", pass_over},        {"bevel", pass_over},
    {"c_interp", pass_over}, {"d_interp", pass_over}, {"shadow_obj", pass_over}, {"trace_obj", pass_over},
};

static void read_line(struct obj *o) {
    struct word word;
    if (!next_word(o, &word) || word.text[0] == '#') {
        return;
    }
    for (size_t i = 0; i < sizeof keywords / sizeof *keywords; i++) {
        if (strcmp(keywords[i].name, word.text) == 0) {
            keywords[i].read(o);
            return;
        }
    }
    COMPLAIN(o, word.column, "'%s' is not read; v, vn, f and usemtl are: save the surface as polygons",
             word.text);
}

/* A backslash at its end carries a line on; not that of a comment. */
static const char *line_end(const char *begin, const char *end, int *lines) {
    const char *p = begin;
    for (*lines = 1; (p = memchr(p, '\n', (size_t)(end - p))); ++*lines, p++) {
        const char *last = p - (p > begin && p[-1] == '\r');
        if (*begin == '#' || last == begin || last[-1] != '\\') {
            return p;
        }
    }
    return end;
}

int mesh_read_obj(const char *file, const char *text, size_t size, struct mesh *mesh,
                  struct err_list *errors) {
    struct obj o = {.file = file, .mesh = mesh, .errors = errors, .material = -1, .line = 1};
    const char *end = text + size;
    struct err e = {0};
    *mesh = (struct mesh){0};
    for (const char *p = text; p < end && o.n_errors < ERR_LIST_OF_FILE;) {
        int lines;
        o.at = o.begin = p;
        o.end = line_end(p, end, &lines);
        read_line(&o);
        p = o.end + 1;
        o.line += lines;
    }
    if (!o.status && mesh_finish(mesh, &e)) {
        o.status = mesh_complain(errors, file, 0, 0, "%s", e.text);
    }
    if (o.status) {
        mesh_free(mesh);
    }
    return o.status;
}
