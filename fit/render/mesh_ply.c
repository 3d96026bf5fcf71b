#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "fit/render/mesh.h"
#include "proto/number.h"

#define ELEMENTS_MAX 16
#define PROPERTIES_MAX 64
#define WORD_MAX 64

enum format { ASCII, LITTLE, BIG, FORMATS };
static const char *const format_names[FORMATS] = {"ascii", "binary_little_endian", "binary_big_endian"};

enum type { INT8, UINT8, INT16, UINT16, INT32, UINT32, FLOAT32, FLOAT64, TYPES };
static const struct {
    const char *name, *other;
    int size;
} types[TYPES] = {{"char", "int8", 1},     {"uchar", "uint8", 1},   {"short", "int16", 2},
                  {"ushort", "uint16", 2}, {"int", "int32", 4},     {"uint", "uint32", 4},
                  {"float", "float32", 4}, {"double", "float64", 8}};

enum role {
    VERTEX_X,
    VERTEX_Y,
    VERTEX_Z,
    VERTEX_NX,
    VERTEX_NY,
    VERTEX_NZ,
    VERTEX_ROLES,
    FACE_CORNERS,
    NO_ROLE
};
static const char *const vertex_roles[VERTEX_ROLES] = {"x", "y", "z", "nx", "ny", "nz"};

struct property {
    char name[WORD_MAX];
    bool is_list;
    enum type count, type;
    enum role role;
};

struct element {
    char name[WORD_MAX];
    int64_t count;
    int n_properties;
    struct property property[PROPERTIES_MAX];
};

struct ply { /* one file on the way through; the first mistake ends it */
    const char *file, *at, *end;
    int line;
    enum format format;
    struct mesh *mesh;
    struct err_list *errors;
    int n_elements;
    struct element element[ELEMENTS_MAX];
    const struct element *present; /* whose rows are read */
    int64_t row;
    bool has_normals;
};

struct row { /* what a row gives, by the roles of its properties */
    double vertex[VERTEX_ROLES];
    int n;
    struct mesh_corner corner[MESH_CORNERS_MAX];
};

static int complain(struct ply *p, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* Text has lines; of a binary row its number is told. */
static int complain(struct ply *p, const char *format, ...) {
    char text[400];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    if (p->present && p->format != ASCII) {
        return mesh_complain(p->errors, p->file, 0, 0, "%s %lld, counted from 0: %s", p->present->name,
                             (long long)p->row, text);
    }
    return mesh_complain(p->errors, p->file, p->line, 0, "%s", text);
}

static bool is_blank(char c) {
    return c == ' ' || c == '\t' || c == '\r' || c == '\n';
}

/* The next word before `end`, cut to what fits; false: there is none. */
static bool next_word(struct ply *p, const char *end, char word[WORD_MAX]) {
    size_t n = 0;
    for (; p->at < end && is_blank(*p->at); p->at++) {
        p->line += *p->at == '\n';
    }
    for (; p->at < end && !is_blank(*p->at); p->at++) {
        if (n + 1 < WORD_MAX) {
            word[n++] = *p->at;
        } else {
            word[n - 1] = '~'; /* too long: no number and no keyword */
        }
    }
    word[n] = '\0';
    return n > 0;
}

static int find(const char *word, const char *const *names, int n) {
    for (int i = 0; i < n; i++) {
        if (strcmp(word, names[i]) == 0) {
            return i;
        }
    }
    return n;
}

static int find_type(struct ply *p, const char *word, enum type *type) {
    for (*type = 0; *type < TYPES; ++*type) {
        if (strcmp(word, types[*type].name) == 0 || strcmp(word, types[*type].other) == 0) {
            return 0;
        }
    }
    return complain(p, "'%s' is no type of a PLY file; char to double and int8 to float64 are", word);
}

/* --- the header, line by line ----------------------------------------------------------------------- */

#define HEADER_WORDS 5

static int header_format(struct ply *p, int n, char word[][WORD_MAX]) {
    p->format = n > 1 ? (enum format)find(word[1], format_names, FORMATS) : FORMATS;
    return p->format < FORMATS && n == 3 && strcmp(word[2], "1.0") == 0
               ? 0
               : complain(p, "expected `format ascii 1.0`, or binary_little_endian or binary_big_endian");
}

static int header_element(struct ply *p, int n, char word[][WORD_MAX]) {
    struct element *x = &p->element[p->n_elements];
    if (p->n_elements == ELEMENTS_MAX) {
        return complain(p, "more than %d elements", ELEMENTS_MAX);
    }
    *x = (struct element){0};
    if (n != 3 || !number_read_int(word[2], &x->count) || x->count < 0 || x->count > MESH_COUNT_MAX) {
        return complain(p, "expected `element NAME COUNT`, at most %u of them", MESH_COUNT_MAX);
    }
    memcpy(x->name, word[1], WORD_MAX);
    p->n_elements++;
    return 0;
}

static enum role role_of(const struct element *x, const struct property *q) {
    if (strcmp(x->name, "vertex") == 0 && !q->is_list) {
        int role = find(q->name, vertex_roles, VERTEX_ROLES);
        return role < VERTEX_ROLES ? (enum role)role : NO_ROLE;
    }
    bool corners = strcmp(q->name, "vertex_indices") == 0 || strcmp(q->name, "vertex_index") == 0;
    return strcmp(x->name, "face") == 0 && q->is_list && corners ? FACE_CORNERS : NO_ROLE;
}

static int header_property(struct ply *p, int n, char word[][WORD_MAX]) {
    struct element *x = p->n_elements ? &p->element[p->n_elements - 1] : NULL;
    struct property q = {.is_list = n > 1 && strcmp(word[1], "list") == 0};
    if (!x || n != (q.is_list ? 5 : 3)) {
        return complain(p,
                        "expected `property TYPE NAME` or `property list TYPE TYPE NAME` after an element");
    }
    if (x->n_properties == PROPERTIES_MAX) {
        return complain(p, "more than %d properties of one element", PROPERTIES_MAX);
    }
    int status = q.is_list ? find_type(p, word[2], &q.count) : 0;
    status = status ? status : find_type(p, word[n - 2], &q.type);
    if (!status && q.is_list && q.count >= FLOAT32) {
        status = complain(p, "a list is counted in whole numbers, not %s", word[2]);
    }
    memcpy(q.name, word[n - 1], WORD_MAX);
    q.role = role_of(x, &q);
    if (!status && q.role == FACE_CORNERS && q.type >= FLOAT32) {
        status = complain(p, "corners of faces are whole numbers, not %s", word[3]);
    }
    x->property[x->n_properties++] = q;
    return status;
}

static const struct element *element_of(const struct ply *p, const char *name) {
    for (int i = 0; i < p->n_elements; i++) {
        if (strcmp(p->element[i].name, name) == 0) {
            return &p->element[i];
        }
    }
    return NULL;
}

static int count_role(const struct element *x, enum role role) {
    int n = 0;
    for (int i = 0; x && i < x->n_properties; i++) {
        n += x->property[i].role == role;
    }
    return n;
}

static int check_header(struct ply *p) {
    const struct element *vertex = element_of(p, "vertex"), *face = element_of(p, "face");
    if (p->format == FORMATS) {
        return complain(p, "the header has no line `format ...`");
    }
    for (int i = 0; i < p->n_elements; i++) {
        if (element_of(p, p->element[i].name) != &p->element[i]) {
            return complain(p, "there are two elements %s", p->element[i].name);
        }
        if (p->element[i].n_properties == 0) {
            return complain(p, "the element %s has no property", p->element[i].name);
        }
    }
    for (int i = VERTEX_X; i <= VERTEX_Z; i++) {
        if (count_role(vertex, (enum role)i) != 1) {
            return complain(p, "a mesh needs an element vertex with x, y and z, once each");
        }
    }
    if (count_role(face, FACE_CORNERS) != 1 || face < vertex) {
        return complain(p, "a mesh needs an element face with a list vertex_indices, after its vertices");
    }
    p->has_normals = count_role(vertex, VERTEX_NX) == 1 && count_role(vertex, VERTEX_NY) == 1 &&
                     count_role(vertex, VERTEX_NZ) == 1;
    return 0;
}

/* 1: that was end_header. */
static int header_line(struct ply *p) {
    static const char *const keywords[] = {"format",     "element", "property",
                                           "end_header", "comment", "obj_info"};
    char word[HEADER_WORDS][WORD_MAX], more[WORD_MAX];
    const char *newline = memchr(p->at, '\n', (size_t)(p->end - p->at));
    int n = 0, status;
    if (!newline) {
        return complain(p, "the header has no end_header");
    }
    while (n < HEADER_WORDS && next_word(p, newline, word[n])) {
        n++;
    }
    int keyword = n ? find(word[0], keywords, 6) : 6;
    if (keyword < 4 && next_word(p, newline, more)) {
        return complain(p, "'%s' is too much in this line", more);
    }
    switch (keyword) {
    case 0:
        status = header_format(p, n, word);
        break;
    case 1:
        status = header_element(p, n, word);
        break;
    case 2:
        status = header_property(p, n, word);
        break;
    case 3:
        status = check_header(p);
        status = status ? status : 1;
        break;
    case 4:
    case 5:
        status = 0;
        break;
    default:
        status = complain(p, "expected format, element, property, comment or end_header, not '%s'",
                          n ? word[0] : "");
    }
    p->at = newline + 1;
    p->line++;
    return status;
}

static int read_header(struct ply *p) {
    char word[WORD_MAX];
    int status = 0;
    p->format = FORMATS;
    if (!next_word(p, p->end, word) || strcmp(word, "ply") != 0) {
        return complain(p, "this is no PLY file: it does not begin with `ply`");
    }
    const char *newline = memchr(p->at, '\n', (size_t)(p->end - p->at));
    p->at = newline ? newline + 1 : p->end;
    p->line++;
    while (status == 0) {
        status = header_line(p);
    }
    return status < 0 ? status : 0;
}

/* --- the rows --------------------------------------------------------------------------------------- */

static int read_text(struct ply *p, enum type type, double *value) {
    char word[WORD_MAX];
    if (!next_word(p, p->end, word)) {
        return complain(p, "the file ends in %s %lld of %lld", p->present->name, (long long)p->row + 1,
                        (long long)p->present->count);
    }
    if (!number_read_double(word, value) || (type < FLOAT32 && *value != floor(*value))) {
        return complain(p, "'%s' stands where a%s number is expected", word, type < FLOAT32 ? " whole" : "");
    }
    return 0;
}

static int read_binary(struct ply *p, enum type type, double *value) {
    int size = types[type].size;
    uint64_t bits = 0;
    if (p->end - p->at < size) {
        return complain(p, "the file ends here; there should be %lld", (long long)p->present->count);
    }
    for (int i = 0; i < size; i++) {
        bits |= (uint64_t)(uint8_t)p->at[p->format == LITTLE ? i : size - 1 - i] << 8 * i;
    }
    p->at += size;
    union {
        uint32_t bits;
        float value;
    } single = {(uint32_t)bits};
    union {
        uint64_t bits;
        double value;
    } twice = {bits};
    const double values[TYPES] = {(int8_t)bits,  (uint8_t)bits,  (int16_t)bits, (uint16_t)bits,
                                  (int32_t)bits, (uint32_t)bits, single.value,  twice.value};
    *value = values[type];
    return 0;
}

static int read_value(struct ply *p, enum type type, double *value) {
    return p->format == ASCII ? read_text(p, type, value) : read_binary(p, type, value);
}

static int take_corner(struct ply *p, double value, struct row *row) {
    if (row->n == MESH_CORNERS_MAX) {
        return complain(p, "a face of more than %d corners", MESH_CORNERS_MAX);
    }
    if (!(value >= 0 && value < (double)p->mesh->n_vertices)) {
        return complain(p, "vertex %.0f is none of 0 .. %lld", value, (long long)p->mesh->n_vertices - 1);
    }
    uint32_t index = (uint32_t)value;
    row->corner[row->n++] = (struct mesh_corner){index, p->has_normals ? index : MESH_NO_NORMAL};
    return 0;
}

static int read_property(struct ply *p, const struct property *q, struct row *row) {
    double count = 1, value;
    int status = q->is_list ? read_value(p, q->count, &count) : 0;
    if (!status && count < 0) {
        return complain(p, "a list of %.0f values", count);
    }
    for (double i = 0; i < count && !status; i++) {
        status = read_value(p, q->type, &value);
        if (!status && q->role < VERTEX_ROLES) {
            row->vertex[q->role] = value;
            status = isfinite(value) ? 0 : complain(p, "its %s is no finite number", q->name);
        } else if (!status && q->role == FACE_CORNERS) {
            status = take_corner(p, value, row);
        }
    }
    return status;
}

static int keep_row(struct ply *p, const struct row *row) {
    const double *v = row->vertex;
    int status = 0;
    if (strcmp(p->present->name, "vertex") == 0) {
        status = mesh_add_vertex(p->mesh, (struct vec3){v[VERTEX_X], v[VERTEX_Y], v[VERTEX_Z]});
        if (!status && p->has_normals) {
            status = mesh_add_normal(p->mesh, (struct vec3){v[VERTEX_NX], v[VERTEX_NY], v[VERTEX_NZ]});
        }
    } else if (strcmp(p->present->name, "face") == 0) {
        if (row->n < 3) {
            return complain(p, "a face of %d corners; it needs three", row->n);
        }
        status = mesh_add_polygon(p->mesh, row->n, row->corner, -1);
    }
    return status == -ERR_NOMEM ? complain(p, "no memory for a mesh of this size")
           : status             ? complain(p, "more than %u triangles; make the mesh coarser", MESH_COUNT_MAX)
                                : 0;
}

static int read_rows(struct ply *p, const struct element *x) {
    int status = 0;
    p->present = x;
    for (p->row = 0; p->row < x->count && !status; p->row++) {
        struct row row;
        row.n = 0;
        for (int i = 0; i < x->n_properties && !status; i++) {
            status = read_property(p, &x->property[i], &row);
        }
        status = status ? status : keep_row(p, &row);
    }
    p->present = NULL;
    return status;
}

int mesh_read_ply(const char *file, const char *bytes, size_t size, struct mesh *mesh,
                  struct err_list *errors) {
    struct ply p = {
        .file = file, .at = bytes, .end = bytes + size, .line = 1, .mesh = mesh, .errors = errors};
    struct err e = {0};
    *mesh = (struct mesh){0};
    int status = read_header(&p);
    for (int i = 0; i < p.n_elements && !status; i++) {
        status = read_rows(&p, &p.element[i]);
    }
    if (!status && mesh_finish(mesh, &e)) {
        status = mesh_complain(errors, file, 0, 0, "%s", e.text);
    }
    if (status) {
        mesh_free(mesh);
    }
    return status;
}
