/*
 * shape.h — the things a scene shows: where a ray meets them, with which normal and which paint.
 *
 * One struct for every kind, written by the scene's tables of keys; each kind keeps its own part and its own file
 * shape_KIND.c, and shape_hit, shape_prepare and shape_free ask the kind. Normals have length 1 and point outward
 * (flat shapes: towards their +z); what is seen from behind is black.
 *
 * Units      millimetres and degrees.
 * Errors     shape_prepare: -ERR_IO, -ERR_INPUT a file that cannot be used; -ERR_NOMEM.
 * Promises   shape_hit: no allocation, any thread; a ray inside a closed cylinder or a sphere does not meet it; a mesh is met from
 *            behind, too.
 * Checked    tests/unit/test_render.c: sphere and cylinder against their cosines; test_relief.c: rectangle, mask, board;
 *            test_fold.c, test_mesh_shape.c
 */
#ifndef FIT_RENDER_SHAPE_H
#define FIT_RENDER_SHAPE_H

#include <stdbool.h>

#include "fit/render/frame.h"
#include "fit/render/relief.h"
#include "proto/err.h"

#define SHAPE_MATERIALS 64

enum shape_kind {
    SHAPE_CYLINDER,
    SHAPE_SPHERE,
    SHAPE_RECTANGLE,
    SHAPE_BOARD,
    SHAPE_FOLD,
    SHAPE_MESH,
    SHAPE_KINDS
};

struct shape_cylinder {
    double radius_mm, length_mm;
    bool open; /* no discs at its ends */
};

struct shape_sphere {
    double radius_mm;
};

struct shape_rectangle { /* a painting: its materials by a mask, its relief by a height map */
    double width_mm, height_mm;
    char mask_file[256], relief_file[256], mask_sha256[65], relief_sha256[65]; /* empty: not read */
    unsigned mask_colour[SHAPE_MATERIALS];                                     /* 0xrrggbb of material i */
    double relief_mm;                                                          /* height of the code 65535 */
    int mask_width, mask_height;
    uint8_t *mask; /* index into the shape's materials, by rows from the top; NULL: all of one material */
    struct relief relief;
};

struct shape_board { /* patches by rows from the top left; what is between them is not there */
    int columns;
    double patch_mm, gap_mm;
};

struct shape_fold { /* two rectangles that meet in the y axis and open towards +z; materials: left, right */
    double width_mm, length_mm, angle_deg; /* width: of each, from the edge; length: of the edge */
    double sine, cosine;                   /* of half the angle */
};

struct shape_mesh { /* triangles of a file */
    char file[256], sha256[65];
    double scale; /* mm in a unit of the file */
    struct shape_mesh_parts *parts;
};

struct shape {
    enum shape_kind kind;
    bool given[SHAPE_KINDS]; /* as written in the scene: one of them must be */
    char material[SHAPE_MATERIALS][64];
    int n_materials, paint_of[SHAPE_MATERIALS]; /* index into the scene's paints of each material */
    double at_mm[3], turn_deg[3];
    int n_at, n_turn;
    struct frame frame;
    struct shape_cylinder cylinder;
    struct shape_sphere sphere;
    struct shape_rectangle rectangle;
    struct shape_board board;
    struct shape_fold fold;
    struct shape_mesh mesh;
};

struct hit {
    double t_mm; /* along the ray */
    struct vec3 position, normal;
    int paint, shape;
    uint32_t part; /* of a mesh: the triangle */
};

const char *shape_name(enum shape_kind kind);
/* Reads what the shape names; folder: where a relative path begins. Mistakes inside a mesh go to errors with their
 * place. */
int shape_prepare(struct shape *s, const char *folder, struct err_list *errors, struct err *e);
void shape_free(struct shape *s);
/* Nearer than hit->t_mm: fills *hit (all but shape) and returns true. */
bool shape_hit(const struct shape *s, const struct ray *ray, struct hit *hit);
/* Whether it stands in the way between near_mm and far_mm. */
bool shape_blocks(const struct shape *s, const struct ray *ray, double far_mm);
/* No point of it is lit or seen through another of its points: it casts no shadow on itself. */
bool shape_is_convex(const struct shape *s);
/* Whether its own relief stands between a hit on it and the light in direction l, or its facet is turned away. */
bool shape_shadows_itself(const struct shape *s, const struct hit *hit, struct vec3 l);
/* How near it comes to a place, or a little less. */
double shape_distance_mm(const struct shape *s, struct vec3 place);
/* The sphere around frame.at that holds all of it. */
double shape_reach_mm(const struct shape *s);

bool shape_cylinder_hit(const struct shape *s, const struct ray *ray, struct hit *hit);
bool shape_sphere_hit(const struct shape *s, const struct ray *ray, struct hit *hit);
bool shape_rectangle_hit(const struct shape *s, const struct ray *ray, struct hit *hit);
bool shape_rectangle_shadow(const struct shape *s, const struct hit *hit, struct vec3 l);
int shape_rectangle_prepare(struct shape *s, const char *folder, struct err_list *errors, struct err *e);
void shape_rectangle_free(struct shape *s);
bool shape_board_hit(const struct shape *s, const struct ray *ray, struct hit *hit);
int shape_fold_prepare(struct shape *s, const char *folder, struct err_list *errors, struct err *e);
bool shape_fold_hit(const struct shape *s, const struct ray *ray, struct hit *hit);
bool shape_mesh_hit(const struct shape *s, const struct ray *ray, struct hit *hit);
bool shape_mesh_blocks(const struct shape *s, const struct ray *ray, double far_mm);
bool shape_mesh_shadow(const struct shape *s, const struct hit *hit, struct vec3 l);
double shape_mesh_reach(const struct shape *s);
int shape_mesh_prepare(struct shape *s, const char *folder, struct err_list *errors, struct err *e);
void shape_mesh_free(struct shape *s);
const struct mesh *shape_mesh(const struct shape *s); /* NULL where the shape is none */

#endif
