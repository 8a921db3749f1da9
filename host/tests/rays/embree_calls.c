/* A program for Embree 4: each case prints what its calls answer. Usage: embree_calls CASE [NAME...] */
#include <dlfcn.h>
#include <math.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/types.h>

typedef void *Handle;
struct Ray {
    float origin[3], tnear, direction[3], time, tfar;
    unsigned mask, id, flags;
};
struct RayHit {
    _Alignas(16) struct Ray ray;
    float normal[3], u, v;
    unsigned primitive, geometry, instance, instance_primitive;
};
struct FilterArguments {
    int *valid;
    void *user, *context;
    struct Ray *ray;
    float *hit;
    unsigned count;
};
typedef void (*Filter)(const struct FilterArguments *);
struct QueryArguments {
    unsigned flags, features;
    void *context;
    Filter filter;
    void *callback;
};

Handle rtcNewDevice(const char *), rtcNewScene(Handle), rtcNewGeometry(Handle, int), rtcNewBuffer(Handle, size_t),
    rtcNewSharedBuffer(Handle, void *, size_t);
Handle rtcGetSceneDevice(Handle), rtcGetSceneTraversable(Handle), rtcGetGeometryThreadSafe(Handle, unsigned),
    rtcGetGeometry(Handle, unsigned);
int rtcGetDeviceError(Handle);
ssize_t rtcGetDeviceProperty(Handle, int);
unsigned rtcAttachGeometry(Handle, Handle);
const char *rtcGetDeviceLastErrorMessage(Handle), *rtcGetErrorString(int);
void *rtcSetNewGeometryBuffer(Handle, int, unsigned, int, size_t, size_t), *rtcGetBufferData(Handle),
    *rtcGetGeometryBufferData(Handle, int, unsigned);
void rtcReleaseDevice(Handle), rtcReleaseScene(Handle), rtcReleaseGeometry(Handle), rtcReleaseBuffer(Handle),
    rtcRetainDevice(Handle);
void rtcCommitGeometry(Handle), rtcCommitScene(Handle), rtcJoinCommitScene(Handle),
    rtcAttachGeometryByID(Handle, Handle, unsigned), rtcDetachGeometry(Handle, unsigned);
void rtcSetSharedGeometryBuffer(Handle, int, unsigned, int, const void *, size_t, size_t, size_t);
void rtcSetGeometryBuffer(Handle, int, unsigned, int, Handle, size_t, size_t, size_t);
void rtcSetGeometryMask(Handle, unsigned), rtcSetGeometryVertexAttributeCount(Handle, unsigned),
    rtcSetGeometryTimeStepCount(Handle, unsigned);
void rtcSetGeometryIntersectFilterFunction(Handle, Filter), rtcSetGeometryOccludedFilterFunction(Handle, Filter),
    rtcSetGeometryUserData(Handle, void *);
void rtcSetGeometryEnableFilterFunctionFromArguments(Handle, bool), rtcSetSceneFlags(Handle, int),
    rtcSetGeometryBuildQuality(Handle, int);
void rtcSetSceneProgressMonitorFunction(Handle, bool (*)(void *, double), void *),
    rtcSetDeviceErrorFunction(Handle, void (*)(void *, int, const char *), void *);
void rtcGetSceneBounds(Handle, float *), rtcDisableGeometry(Handle), rtcEnableGeometry(Handle),
    rtcSetGeometryTransform(Handle, unsigned, int, const void *);
void rtcUpdateGeometryBuffer(Handle, int, unsigned), rtcSetDeviceProperty(Handle, int, ssize_t);
void rtcIntersect1(Handle, struct RayHit *, void *), rtcOccluded1(Handle, struct Ray *, void *),
    rtcTraversableIntersect1(Handle, struct RayHit *, void *);
void rtcTraversableOccluded1(Handle, struct Ray *, void *);

enum { indices, vertices, attributes };
enum { uint3 = 0x5003, float3 = 0x9003 };
static Handle device, scene;
static int calls;

static void add(Handle to, Handle geometry) {
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(to, geometry);
    rtcReleaseGeometry(geometry);
}

/* A square of two triangles around the z axis, not committed. */
static Handle square(float z, float half) {
    const float corners[12] = {-half, -half, z, half, -half, z, half, half, z, -half, half, z};
    const unsigned faces[6] = {0, 1, 2, 0, 2, 3};
    Handle geometry = rtcNewGeometry(device, 0);
    memcpy(rtcSetNewGeometryBuffer(geometry, vertices, 0, float3, 12, 4), corners, sizeof corners);
    memcpy(rtcSetNewGeometryBuffer(geometry, indices, 0, uint3, 12, 2), faces, sizeof faces);
    return geometry;
}

static struct RayHit down(unsigned mask) {
    struct RayHit query = {.ray = {.origin = {.3f, .2f, 5}, .direction = {0, 0, -1}, .tfar = INFINITY, .mask = mask}};
    query.primitive = query.geometry = query.instance = ~0u;
    return query;
}

/* Prints the closest hit, occlusion and error of a ray that meets the first triangle of a square. */
static void shoot(unsigned mask) {
    struct RayHit query = down(mask);
    struct Ray ray = query.ray;
    rtcIntersect1(scene, &query, NULL);
    rtcOccluded1(scene, &ray, NULL);
    printf("%d %d t %g occluded %d error %d\n", (int)query.geometry, (int)query.primitive, query.ray.tfar, ray.tfar < 0,
           rtcGetDeviceError(device));
}

static void error(const char *what) { printf("%s: error %d\n", what, rtcGetDeviceError(device)); }

static void refuse(const struct FilterArguments *call) {
    ++calls;
    call->valid[0] = 0;
}
static void accept(const struct FilterArguments *call) {
    calls += call->ray->id;
    printf("filter: user %d t %g geometry %d\n", call->user ? *(int *)call->user : 0, call->ray->tfar,
           (int)((unsigned *)call->hit)[6]);
}

static void attach_by_id(void) {
    Handle geometry = square(0, 1);
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(scene, geometry, 5);
    rtcAttachGeometryByID(scene, geometry, 5);
    error("again");
    rtcAttachGeometryByID(scene, geometry, ~0u);
    error("without a number");
    printf("next %u\n", rtcAttachGeometry(scene, geometry));
    rtcDetachGeometry(scene, 0);
    rtcCommitScene(scene);
    shoot(~0u);
}
static void masks(void) {
    static const unsigned of_meshes[] = {1, ~0u, 0x100, 0x80000000},
                          of_rays[] = {1, 2, 0x100, 0xff00, 0x80000000, ~0u, 0};
    for (int i = -1; i < 4; ++i) {
        Handle geometry = square(0, 1);
        if (i >= 0) rtcSetGeometryMask(geometry, of_meshes[i]);
        scene = rtcNewScene(device);
        add(scene, geometry);
        rtcCommitScene(scene);
        for (int k = 0; k < 7; ++k) {
            struct RayHit query = down(of_rays[k]);
            struct Ray ray = query.ray;
            rtcIntersect1(scene, &query, NULL);
            rtcOccluded1(scene, &ray, NULL);
            printf("%d%d ", query.geometry == 0, ray.tfar < 0);
        }
        puts("");
    }
}
/* 40 meshes with a bit each, some shared, behind each other. */
static void many_masks(void) {
    for (int i = 0; i < 40; ++i) {
        Handle geometry = square(-i, 1);
        rtcSetGeometryMask(geometry, 1u << i % 32 | (i > 32) << 3);
        add(scene, geometry);
    }
    rtcCommitScene(scene);
    for (int bit = 31; bit >= 0; bit -= 3) shoot(1u << bit | 1u << (bit + 30) % 32);
}
static void no_error(void) {
    printf("'%s' %d\n", rtcGetDeviceLastErrorMessage(device), rtcGetDeviceError(device));
    for (int i = -1; i < 8; ++i) puts(rtcGetErrorString(i));
}
static void vertex_attributes(void) {
    static float data[64];
    Handle geometry = square(0, 1);
    rtcSetSharedGeometryBuffer(geometry, attributes, 0, float3, data, 0, 12, 4);
    error("no slot");
    rtcSetGeometryVertexAttributeCount(geometry, 2);
    rtcSetSharedGeometryBuffer(geometry, attributes, 1, float3, data, 0, 12, 4);
    printf("%d ", rtcGetGeometryBufferData(geometry, attributes, 1) == data);
    error("slot");
    add(scene, geometry);
    rtcCommitScene(scene);
    shoot(~0u);
}
static void bounds(void) {
    float box[8] = {0};
    rtcGetSceneBounds(scene, box);
    error("before the first commit");
    add(scene, square(2, 1));
    rtcCommitScene(scene);
    rtcGetSceneBounds(scene, box);
    printf("%g %g %g %g %g %g %g %g\n", box[0], box[1], box[2], box[3], box[4], box[5], box[6], box[7]);
    rtcDetachGeometry(scene, 0);
    rtcGetSceneBounds(scene, box);
    error("after a change");
    rtcCommitScene(scene);
    rtcGetSceneBounds(scene, box);
    printf("%g %g\n", box[0], box[4]);
}
static void huge_buffers(void) {
    Handle geometry = square(0, 1);
    printf("%d ", rtcSetNewGeometryBuffer(geometry, vertices, 0, float3, 12, (size_t)1 << 40) == NULL);
    error("count");
    add(scene, geometry);
    rtcCommitScene(scene);
    shoot(~0u);
}
static void small_buffers(void) {
    Handle geometry = square(0, 1);
    printf("%d ", rtcSetNewGeometryBuffer(geometry, vertices, 0, float3, (size_t)1 << 62, 4) == NULL);
    error("stride");
    rtcSetGeometryBuffer(geometry, vertices, 0, float3, rtcNewBuffer(device, 64), 0, 12, 6);
    error("too small");
    add(scene, geometry);
    rtcCommitScene(scene);
    shoot(~0u);
}
/* An index, or a vertex, that is none takes only its triangle out. */
static void bad_index(void) {
    Handle geometry = square(0, 1);
    unsigned *const faces = rtcGetGeometryBufferData(geometry, indices, 0);
    faces[5] = 77;
    add(scene, geometry);
    rtcCommitScene(scene);
    error("commit");
    shoot(~0u);
    faces[5] = 3;
    faces[2] = ~0u;
    add(scene, square(-1, 1));
    rtcCommitGeometry(rtcGetGeometry(scene, 0));
    rtcCommitScene(scene);
    shoot(~0u);
}
static void bad_vertices(void) {
    static const float bad[] = {NAN, INFINITY, -INFINITY, 1e30f, 2e18f};
    for (int i = 0; i < 5; ++i) {
        Handle geometry = square(0, 1);
        ((float *)rtcGetGeometryBufferData(geometry, vertices, 0))[9 + i % 3] = bad[i];
        scene = rtcNewScene(device);
        add(scene, geometry);
        rtcCommitScene(scene);
        shoot(~0u);
    }
}
static void no_triangle(void) {
    Handle geometry = square(0, 1), point = square(0, 0), empty = rtcNewGeometry(device, 0);
    for (int i = 0; i < 6; ++i) ((unsigned *)rtcGetGeometryBufferData(geometry, indices, 0))[i] = 9;
    add(scene, geometry);
    add(scene, point);
    add(scene, empty);
    rtcCommitScene(scene);
    shoot(~0u);
}
/* A filter refuses the upper one of two squares, `gap` apart. */
static void filter_below(float gap) {
    Handle upper = square(0, 1);
    rtcSetGeometryIntersectFilterFunction(upper, refuse);
    rtcSetGeometryOccludedFilterFunction(upper, refuse);
    add(scene, upper);
    add(scene, square(-gap, 2));
    rtcCommitScene(scene);
    shoot(~0u);
}
static void filter_coplanar(void) { filter_below(0); }
static void filter_near(void) { filter_below(1e-5f); }
static void filter_apart(void) {
    filter_below(1e-3f);
    printf("calls %d\n", calls);
}
/* A filter sees the ray of the caller, which may be a part of something larger. */
static void filter_ray(void) {
    struct {
        struct RayHit query;
        int own;
    } larger = {down(~0u), 0};
    int user = 17;
    Handle geometry = square(0, 1);
    rtcSetGeometryIntersectFilterFunction(geometry, accept);
    rtcSetGeometryOccludedFilterFunction(geometry, accept);
    rtcSetGeometryUserData(geometry, &user);
    add(scene, geometry);
    rtcCommitScene(scene);
    larger.query.ray.id = 3;
    rtcIntersect1(scene, &larger.query, NULL);
    printf("calls %d geometry %d t %g normal %g %g %g\n", calls, (int)larger.query.geometry, larger.query.ray.tfar,
           larger.query.normal[0] + 0, larger.query.normal[1] + 0, larger.query.normal[2]);
    struct Ray ray = down(~0u).ray;
    rtcOccluded1(scene, &ray, NULL);
    printf("%g\n", ray.tfar);
}
static struct Ray *expected;
static void compare_ray(const struct FilterArguments *call) { calls += call->ray == expected; }
static void filter_address(void) {
    Handle geometry = square(0, 1);
    struct RayHit query = down(~0u);
    struct Ray ray = query.ray;
    rtcSetGeometryIntersectFilterFunction(geometry, compare_ray);
    rtcSetGeometryOccludedFilterFunction(geometry, compare_ray);
    add(scene, geometry);
    rtcCommitScene(scene);
    expected = &query.ray;
    rtcIntersect1(scene, &query, NULL);
    expected = &ray;
    rtcOccluded1(scene, &ray, NULL);
    printf("%d\n", calls);
}
/* Filters of a call need a flag of the scene or of a geometry, and of the call or of the geometry. */
static void filter_of_call(void) {
    for (int i = 0; i < 8; ++i) {
        struct QueryArguments arguments = {i & 1 ? 1 << 1 : 0, ~0u, NULL, refuse, NULL};
        struct RayHit query = down(~0u);
        Handle geometry = square(0, 1);
        scene = rtcNewScene(device);
        rtcSetSceneFlags(scene, i & 2 ? 1 << 3 : 0);
        rtcSetGeometryEnableFilterFunctionFromArguments(geometry, i & 4);
        add(scene, geometry);
        rtcCommitScene(scene);
        rtcIntersect1(scene, &query, &arguments);
        printf("%d ", (int)query.geometry);
    }
    puts("");
}
static void null_handles(void) {
    rtcReleaseScene(NULL);
    error("of the device");
    printf("of the thread: %d %s\n", rtcGetDeviceError(NULL), rtcGetDeviceLastErrorMessage(NULL));
    const unsigned id = rtcAttachGeometry(scene, NULL);
    printf("%u ", id);
    error("attached");
}
/* The first error stays until it is asked for. */
static void first_error(void) {
    rtcDetachGeometry(scene, 9);
    rtcDetachGeometry(scene, ~0u);
    error("first");
    error("then");
}
static void *other_thread(void *unused) {
    rtcDetachGeometry(scene, 9);
    error("thread");
    return unused;
}
static void errors_of_threads(void) {
    pthread_t thread;
    rtcDetachGeometry(scene, ~0u);
    pthread_create(&thread, NULL, other_thread, NULL);
    pthread_join(thread, NULL);
    error("main");
}
static void report(void *user, int code, const char *text) {
    (void)text;
    printf("reported %d %d\n", *(int *)user, code);
}
static void error_function(void) {
    int user = 4;
    rtcSetDeviceErrorFunction(device, report, &user);
    rtcDetachGeometry(scene, 9);
    error("kept");
}
/* Four threads build, commit and trace scenes of their own. */
static void *build(void *of) {
    const float z = 1 + *(int *)of;
    for (int round = 0; round < 100; ++round) {
        Handle own = rtcNewScene(device), geometry = rtcNewGeometry(device, 0);
        float *const at = rtcSetNewGeometryBuffer(geometry, vertices, 0, float3, 12, 441);
        unsigned *const faces = rtcSetNewGeometryBuffer(geometry, indices, 0, uint3, 12, 800);
        for (int i = 0; i < 441; ++i) {
            at[3 * i] = -1 + .1f * (i / 21);
            at[3 * i + 1] = -1 + .1f * (i % 21);
            at[3 * i + 2] = z;
        }
        for (int i = 0; i < 400; ++i) {
            const unsigned corner = i / 20 * 21 + i % 20,
                           face[6] = {corner, corner + 21, corner + 22, corner, corner + 22, corner + 1};
            memcpy(faces + 6 * i, face, sizeof face);
        }
        if (*(int *)of == 3) {
            add(own, rtcNewGeometry(device, 0));
            rtcDetachGeometry(own, 7);
        }
        add(own, geometry);
        rtcCommitScene(own);
        for (int i = 0; i < 20; ++i) {
            struct RayHit query = down(~0u);
            query.ray.origin[2] = 50;
            rtcIntersect1(own, &query, NULL);
            if (query.geometry == ~0u || fabsf(query.ray.tfar - (50 - z)) > .01f) __sync_fetch_and_add(&calls, 1);
        }
        rtcReleaseScene(own);
        rtcGetDeviceError(device);
    }
    return NULL;
}
static void *trace(void *unused) {
    for (int i = 0; i < 2000; ++i) {
        struct RayHit query = down(~0u);
        rtcIntersect1(scene, &query, NULL);
        if (query.geometry != 0) __sync_fetch_and_add(&calls, 1);
    }
    return unused;
}
static void *join(void *unused) {
    rtcJoinCommitScene(scene);
    return unused;
}
static void in_threads(void *(*of[4])(void *)) {
    static int numbers[4] = {0, 1, 2, 3};
    pthread_t threads[4];
    for (int i = 0; i < 4; ++i) pthread_create(&threads[i], NULL, of[i], &numbers[i]);
    for (int i = 0; i < 4; ++i) pthread_join(threads[i], NULL);
    printf("wrong %d ", calls);
    error("main");
}
static void threads_build(void) { in_threads((void *(*[4])(void *)){build, build, build, build}); }
static void threads_trace(void) {
    add(scene, square(0, 1));
    rtcCommitScene(scene);
    in_threads((void *(*[4])(void *)){trace, trace, trace, build});
}
static void threads_filter(void) {
    Handle upper = square(1, 1);
    rtcSetGeometryIntersectFilterFunction(upper, compare_ray);
    add(scene, square(0, 1));
    add(scene, upper);
    rtcCommitScene(scene);
    rtcDetachGeometry(scene, 1);
    rtcCommitScene(scene);
    in_threads((void *(*[4])(void *)){trace, trace, trace, trace});
}
static void threads_join(void) {
    for (int round = 0; round < 50; ++round) {
        scene = rtcNewScene(device);
        add(scene, square(0, 1));
        pthread_t threads[4];
        for (int i = 0; i < 4; ++i) pthread_create(&threads[i], NULL, join, NULL);
        for (int i = 0; i < 4; ++i) pthread_join(threads[i], NULL);
        struct RayHit query = down(~0u);
        rtcIntersect1(scene, &query, NULL);
        calls += query.geometry == 0;
        rtcReleaseScene(scene);
    }
    printf("%d ", calls);
    error("main");
}
static void traversable(void) {
    add(scene, square(0, 1));
    rtcCommitScene(scene);
    struct RayHit query = down(~0u);
    struct Ray ray = query.ray;
    Handle through = rtcGetSceneTraversable(scene);
    rtcTraversableIntersect1(through, &query, NULL);
    rtcTraversableOccluded1(through, &ray, NULL);
    printf("%d %g\n", (int)query.geometry, ray.tfar);
}
static void buffers(void) {
    const float z[3] = {3, 3, 3};
    Handle geometry = square(0, 1), own = rtcNewBuffer(device, 64);
    memcpy(rtcGetBufferData(own), rtcGetGeometryBufferData(geometry, vertices, 0), 48);
    for (int i = 0; i < 4; ++i) memcpy((char *)rtcGetBufferData(own) + 12 * i + 8, z, 4);
    rtcSetGeometryBuffer(geometry, vertices, 0, float3, own, 65, 12, 0);
    error("behind it");
    rtcSetGeometryBuffer(geometry, vertices, 0, float3, own, 2, 12, 4);
    error("misaligned");
    rtcSetGeometryBuffer(geometry, vertices, 0, float3, own, 0, 12, 4);
    error("set");
    rtcReleaseBuffer(own);
    add(scene, geometry);
    rtcCommitScene(scene);
    shoot(~0u);
    static unsigned faces[4] = {9, 0, 1, 2};
    Handle shared = rtcNewSharedBuffer(device, faces, sizeof faces);
    printf("%d\n", rtcGetBufferData(shared) == faces);
    rtcSetGeometryBuffer(geometry, indices, 0, uint3, shared, 4, 12, 1);
    rtcCommitGeometry(geometry);
    rtcCommitScene(scene);
    shoot(~0u);
}
static void wrong_buffers(void) {
    static float data[64];
    Handle geometry = square(0, 1);
    rtcSetSharedGeometryBuffer(geometry, vertices, 1, float3, data, 0, 12, 4);
    error("slot");
    rtcSetSharedGeometryBuffer(geometry, indices, 0, uint3 + 1, data, 0, 16, 4);
    error("format");
    rtcSetSharedGeometryBuffer(geometry, vertices, 0, float3, data, 2, 12, 4);
    error("offset");
    rtcSetSharedGeometryBuffer(geometry, vertices, 0, float3, data, 0, 10, 4);
    error("stride");
    rtcSetSharedGeometryBuffer(geometry, 7, 0, float3, data, 0, 12, 4);
    error("type");
    rtcSetGeometryBuildQuality(geometry, 9);
    error("quality");
    rtcSetDeviceProperty(device, 5, 1);
    error("property");
}
static void handles(void) {
    Handle geometry = square(0, 1);
    add(scene, geometry);
    rtcCommitScene(scene);
    printf("%d %d %d\n", rtcGetGeometryThreadSafe(scene, 0) == geometry, rtcGetGeometry(scene, 0) == geometry,
           rtcGetSceneDevice(scene) == device);
    rtcReleaseDevice(device);
    rtcReleaseDevice(device);
    shoot(~0u);
}
static bool stop(void *count, double part) {
    (void)part;
    return ++*(int *)count == 0;
}
static void progress(void) {
    int count = 0;
    rtcSetSceneProgressMonitorFunction(scene, stop, &count);
    add(scene, square(0, 1));
    rtcCommitScene(scene);
    printf("%d ", count > 0);
    error("stopped");
    rtcSetSceneProgressMonitorFunction(scene, NULL, NULL);
    rtcCommitScene(scene);
    shoot(~0u);
}
static void lengths(void) {
    static const float of[] = {1e-30f, 1e-20f, 1e20f, 1e30f};
    add(scene, square(0, 1));
    rtcCommitScene(scene);
    for (int i = 0; i < 4; ++i) {
        struct RayHit query = down(~0u);
        query.ray.direction[2] = -of[i];
        rtcIntersect1(scene, &query, NULL);
        printf("%d %.5g\n", (int)query.geometry, query.ray.tfar);
    }
}
static void detached(void) {
    Handle geometry = square(0, 1);
    rtcSetGeometryIntersectFilterFunction(geometry, compare_ray);
    add(scene, geometry);
    rtcCommitScene(scene);
    rtcDetachGeometry(scene, 0);
    shoot(~0u);
    rtcCommitScene(scene);
    shoot(~0u);
}
static void null_data(void) {
    Handle geometry = square(0, 1);
    rtcSetSharedGeometryBuffer(geometry, vertices, 0, float3, NULL, 0, 12, 4);
    error("set");
    add(scene, geometry);
    rtcCommitScene(scene);
    error("commit");
}
static void refused(void) {
    printf("quads %d ", rtcNewGeometry(device, 1) == NULL);
    error("made");
    Handle geometry = square(0, 1);
    rtcSetGeometryTimeStepCount(geometry, 2);
    error("motion");
    rtcSetGeometryTransform(geometry, 0, 0x9244, NULL);
    error("transform");
}
/* Commits without which a change has no effect, or the scene none. */
static void commits(void) {
    Handle geometry = square(0, 1), other = square(1, 2);
    shoot(~0u);
    add(scene, geometry);
    rtcCommitScene(scene);
    rtcCommitGeometry(other);
    rtcAttachGeometry(scene, other);
    shoot(~0u);
    rtcCommitScene(scene);
    shoot(~0u);
    rtcDisableGeometry(other);
    rtcCommitScene(scene);
    shoot(~0u);
    rtcEnableGeometry(other);
    rtcSetGeometryMask(other, 2);
    rtcCommitScene(scene);
    error("geometry not committed");
    shoot(1);
    rtcCommitGeometry(other);
    rtcCommitScene(scene);
    shoot(1);
    ((float *)rtcGetGeometryBufferData(geometry, vertices, 0))[2] = -1;
    rtcUpdateGeometryBuffer(geometry, vertices, 0);
    rtcCommitGeometry(geometry);
    rtcCommitScene(scene);
    shoot(1);
}
static void outlier(void) {
    add(scene, square(0, 1));
    add(scene, square(-1e7f, 1));
    rtcCommitScene(scene);
    error("commit");
    shoot(~0u);
}
static void properties(void) {
    static const int of[] = {0, 1, 2, 3, 62, 63, 64, 65, 66, 68, 96, 129, 130, 140, 141, 5};
    for (int i = 0; i < 16; ++i) printf("%d ", (int)rtcGetDeviceProperty(device, of[i]));
    error("last");
}
/* Calls each name with nulls for all arguments. */
static void nulls(char **names) {
    for (; *names; ++names) {
        void *const call = dlsym(RTLD_DEFAULT, *names);
        if (!call) printf("%s is not there\n", *names);
        else ((void *(*)(void *, void *, void *, void *, void *, void *, void *, void *))call)(0, 0, 0, 0, 0, 0, 0, 0);
    }
    puts("done");
}

#define CASE(NAME) {#NAME, NAME}
static const struct {
    const char *name;
    void (*run)(void);
} cases[] = {
    CASE(attach_by_id),   CASE(bad_index),         CASE(bad_vertices),
    CASE(bounds),         CASE(buffers),           CASE(commits),
    CASE(detached),       CASE(error_function),    CASE(errors_of_threads),
    CASE(filter_address), CASE(filter_apart),      CASE(filter_coplanar),
    CASE(filter_near),    CASE(filter_of_call),    CASE(filter_ray),
    CASE(first_error),    CASE(handles),           CASE(huge_buffers),
    CASE(lengths),        CASE(many_masks),        CASE(masks),
    CASE(no_error),       CASE(no_triangle),       CASE(null_data),
    CASE(null_handles),   CASE(outlier),           CASE(progress),
    CASE(properties),     CASE(refused),           CASE(threads_build),
    CASE(threads_filter), CASE(threads_join),      CASE(threads_trace),
    CASE(traversable),    CASE(vertex_attributes), CASE(small_buffers),
    CASE(wrong_buffers),
};

int main(int count, char **words) {
    if (count > 1 && strcmp(words[1], "nulls") == 0) {
        nulls(words + 2);
        return 0;
    }
    device = rtcNewDevice(NULL);
    scene = rtcNewScene(device);
    for (size_t i = 0; count > 1 && i < sizeof cases / sizeof *cases; ++i) {
        if (strcmp(words[1], cases[i].name) != 0) continue;
        cases[i].run();
        return 0;
    }
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) puts(cases[i].name);
    return 2;
}
