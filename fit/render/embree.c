#include "fit/render/embree.h"

#include <dlfcn.h>
#include <embree3/rtcore.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LIBRARY "libembree3.so.3"
#define PACKAGE "libembree3-3"

/* The functions that are used, each with the type that the header gives it. */
#define CALLS(CALL)                                                                                          \
    CALL(rtcNewDevice)                                                                                       \
    CALL(rtcGetDeviceError)                                                                                  \
    CALL(rtcNewScene)                                                                                        \
    CALL(rtcSetSceneFlags)                                                                                   \
    CALL(rtcCommitScene)                                                                                     \
    CALL(rtcReleaseScene)                                                                                    \
    CALL(rtcNewGeometry)                                                                                     \
    CALL(rtcSetNewGeometryBuffer)                                                                            \
    CALL(rtcSetGeometryIntersectFilterFunction)                                                              \
    CALL(rtcSetGeometryOccludedFilterFunction)                                                               \
    CALL(rtcCommitGeometry)                                                                                  \
    CALL(rtcAttachGeometry)                                                                                  \
    CALL(rtcReleaseGeometry)                                                                                 \
    CALL(rtcIntersect1)                                                                                      \
    CALL(rtcOccluded1)

static struct {
#define CALL(name) __typeof__(&name) name;
    CALLS(CALL)
#undef CALL
    RTCDevice device;
    char trouble[256];
} library;

struct embree {
    RTCScene scene;
};

static bool symbol(void *handle, const char *name, void *function) {
    void *found = dlsym(handle, name);
    memcpy(function, &found, sizeof found);
    return found != NULL;
}

/* One thread builds: with several, which of two triangles at the same place is found would be up to them. */
static void load(void) {
    void *handle = dlopen(LIBRARY, RTLD_NOW | RTLD_LOCAL);
    bool complete = handle != NULL;
#define CALL(name) complete = complete && symbol(handle, #name, &library.name);
    CALLS(CALL)
#undef CALL
    if (!complete) {
        const char *why = dlerror();
        snprintf(library.trouble, sizeof library.trouble, "%s", why ? why : LIBRARY);
    } else if (!(library.device = library.rtcNewDevice("threads=1"))) {
        snprintf(library.trouble, sizeof library.trouble, "it does not run on this processor (error %d)",
                 (int)library.rtcGetDeviceError(NULL));
    }
}

int embree_load(struct err *e) {
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    pthread_once(&once, load);
    return library.device ? 0
                          : err_set(e, ERR_STATE,
                                    "meshes need Embree 3, which cannot be loaded (%s); install the Debian "
                                    "package " PACKAGE,
                                    library.trouble);
}

struct context { /* Embree hands the first member back */
    struct RTCIntersectContext context;
    const struct embree_ray *ray;
};

/* One ray at a time: then RTCHitN is one RTCHit. */
static void filter(const struct RTCFilterFunctionNArguments *arguments) {
    const struct embree_ray *ray = ((const struct context *)(const void *)arguments->context)->ray;
    if (!ray->accept(ray->arg, ((const struct RTCHit *)(const void *)arguments->hit)->primID)) {
        arguments->valid[0] = 0;
    }
}

static int fill(struct embree *mesh, RTCGeometry geometry, size_t n_vertices,
                void (*vertex)(void *arg, size_t i, float v[3]), size_t n_triangles,
                void (*triangle)(void *arg, size_t i, uint32_t corner[3]), void *arg) {
    float(*place)[3] = library.rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                       sizeof *place, n_vertices);
    uint32_t(*corner)[3] = library.rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0,
                                                           RTC_FORMAT_UINT3, sizeof *corner, n_triangles);
    if (!place || !corner) {
        return -ERR_NOMEM;
    }
    for (size_t i = 0; i < n_vertices; i++) {
        vertex(arg, i, place[i]);
    }
    for (size_t i = 0; i < n_triangles; i++) {
        triangle(arg, i, corner[i]);
    }
    library.rtcSetGeometryIntersectFilterFunction(geometry, filter);
    library.rtcSetGeometryOccludedFilterFunction(geometry, filter);
    library.rtcCommitGeometry(geometry);
    library.rtcAttachGeometry(mesh->scene, geometry);
    library.rtcSetSceneFlags(mesh->scene, RTC_SCENE_FLAG_ROBUST); /* no ray slips through a shared edge */
    library.rtcCommitScene(mesh->scene);
    return library.rtcGetDeviceError(library.device) == RTC_ERROR_NONE ? 0 : -ERR_NOMEM;
}

int embree_make(struct embree **mesh, size_t n_vertices, void (*vertex)(void *arg, size_t i, float v[3]),
                size_t n_triangles, void (*triangle)(void *arg, size_t i, uint32_t corner[3]), void *arg,
                struct err *e) {
    int status = embree_load(e);
    if (status) {
        return status;
    }
    *mesh = calloc(1, sizeof **mesh);
    if (!*mesh) {
        return err_set(e, ERR_NOMEM, "no memory for a mesh");
    }
    (*mesh)->scene = library.rtcNewScene(library.device);
    RTCGeometry geometry = library.rtcNewGeometry(library.device, RTC_GEOMETRY_TYPE_TRIANGLE);
    status = fill(*mesh, geometry, n_vertices, vertex, n_triangles, triangle, arg);
    library.rtcReleaseGeometry(geometry);
    if (status) {
        embree_free(*mesh);
        *mesh = NULL;
        err_set(e, ERR_NOMEM, "no memory for the tree over %zu triangles", n_triangles);
    }
    return status;
}

void embree_free(struct embree *mesh) {
    if (mesh) {
        library.rtcReleaseScene(mesh->scene);
        free(mesh);
    }
}

static struct context context_of(const struct embree_ray *ray) {
    struct context context = {.ray = ray};
    rtcInitIntersectContext(&context.context);
    return context;
}

static struct RTCRay ray_of(const struct embree_ray *ray) {
    return (struct RTCRay){.org_x = ray->origin[0],
                           .org_y = ray->origin[1],
                           .org_z = ray->origin[2],
                           .dir_x = ray->direction[0],
                           .dir_y = ray->direction[1],
                           .dir_z = ray->direction[2],
                           .tfar = ray->length,
                           .mask = ~0u};
}

void embree_nearest(const struct embree *mesh, const struct embree_ray *ray) {
    struct context context = context_of(ray);
    struct RTCRayHit hit = {.ray = ray_of(ray), .hit = {.geomID = RTC_INVALID_GEOMETRY_ID}};
    library.rtcIntersect1(mesh->scene, &context.context, &hit);
}

bool embree_blocked(const struct embree *mesh, const struct embree_ray *ray) {
    struct context context = context_of(ray);
    struct RTCRay probe = ray_of(ray);
    library.rtcOccluded1(mesh->scene, &context.context, &probe);
    return probe.tfar < 0; /* -INFINITY where something was hit */
}

const char *embree_version(void) {
    return RTC_VERSION_STRING;
}
