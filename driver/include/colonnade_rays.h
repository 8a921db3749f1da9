/* SPDX-License-Identifier: Apache-2.0 */
/* Rays of an application: docs/rays.md. A device, scenes of triangle meshes, and the hits of batches of rays.
 *
 * Unlike the driver below it, this library allocates, and computes in double. Positions and distances are in the
 * application's unit; t counts lengths of a ray's direction, which may have any. A call that fails changes nothing;
 * `colonnade_rays_error` says what to do. Calls may come from any thread, but while a call changes or commits a scene
 * no other one of that scene runs. Queries of a scene run at the same time on the model, one after the other on a
 * device; the model traces thousands of rays in several threads. */
#ifndef COLONNADE_RAYS_H
#define COLONNADE_RAYS_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum colonnade_rays_status {
    COLONNADE_RAYS_OK,
    COLONNADE_RAYS_BAD_DESIGN, /* the design has a line that is none, or lacks one */
    COLONNADE_RAYS_BAD_MESH, /* a vertex is not finite, an index has no vertex, a wrong count, no face has an area, too
                                many vanish */
    COLONNADE_RAYS_NO_MESH,  /* the scene has no mesh of this number */
    COLONNADE_RAYS_DOES_NOT_FIT,  /* more records, triangles or stack entries than the design has */
    COLONNADE_RAYS_NOT_COMMITTED, /* a scene changed after its last commit */
    COLONNADE_RAYS_BAD_BATCH,     /* misaligned, empty, over 2^24 rays, or of an unknown mode */
    COLONNADE_RAYS_DEVICE,        /* a stack overflowed, or a record was illegal: the hits are not valid */
    COLONNADE_RAYS_NO_MEMORY
};

/* A batch of rays in memory, 64 bytes. Addresses are multiples of 64, for the model in this process. */
struct colonnade_rays_batch {
    uint64_t rays, hits;     /* rays in, or a sensor; hits out */
    uint32_t count, mode;    /* 1 to 2^24 rays; the bits below */
    float origin[3];         /* of the forms `fan` and `sensor` */
    float tnear, tfar;       /* tnear of the form `fan`; both of the form `sensor` */
    uint32_t tag;            /* written to `done` when all hits are in memory; bit 31: refused, or failed */
    uint64_t done, reserved; /* 4 bytes at `done`; 0 */
};

/* Bits of a batch's mode. A ray hits the faces whose mask has a bit in common with its own, the top byte. */
enum {
    COLONNADE_RAYS_HITS = 0,              /* a hit each: colonnade_rays_record */
    COLONNADE_RAYS_RANGES = 1,            /* t and id: the first 8 bytes of a hit */
    COLONNADE_RAYS_OCCLUDED = 2,          /* a bit each, 64 rays a word; the first hit ends a ray */
    COLONNADE_RAYS_RESPONSE = 3,          /* bits of the above */
    COLONNADE_RAYS_FAN = 1 << 4,          /* rays have 16 bytes: direction and tfar */
    COLONNADE_RAYS_SENSOR = 1 << 5,       /* no rays: `rays` has a colonnade_rays_sensor */
    COLONNADE_RAYS_CULL_FRONT = 1 << 8,   /* no hit where the corners turn counter-clockwise */
    COLONNADE_RAYS_CULL_BACK = 1 << 9,    /* no hit where they turn clockwise */
    COLONNADE_RAYS_OPAQUE_ONLY = 1 << 10, /* no hit of a face that is not opaque */
    COLONNADE_RAYS_LOCAL = 1 << 11,       /* origins are relative to the scene's corner: colonnade_rays_grid */
    COLONNADE_RAYS_MASK_SHIFT = 24
};

/* A ray in memory, 32 bytes: hits are those at tnear <= t <= tfar of origin + t * direction. */
struct colonnade_rays_record {
    float origin[3], tnear, direction[3], tfar;
};

/* What makes the rays of a batch of the form `sensor`, 64 bytes. Ray i is in column i % width of row i / width. Its
 * direction is the float32 nearest to corner + column * right + row * down, modulo 2^32, times 2^-30. */
struct colonnade_rays_sensor {
    uint32_t corner[3], right[3], down[3];
    uint32_t width, reserved[6]; /* columns: a multiple of 64, at most 2^24; 0 */
};

/* A hit in memory, 16 bytes. u, v are the weights of the second and third corner of the triangle as the device has it.
 * A miss has t = tfar, u = v = 0. `id`: bits 0 to 29 the device's number of the triangle, or one of the values below.
 */
struct colonnade_rays_response {
    float t;
    uint32_t id;
    float u, v;
};
#define COLONNADE_RAYS_BACK_SIDE 0x80000000u
#define COLONNADE_RAYS_NON_OPAQUE 0x40000000u
#define COLONNADE_RAYS_MISS 0xFFFFFFFFu
#define COLONNADE_RAYS_OUT_OF_RANGE 0xFFFFFFFEu /* the origin is 16 edges of the box or more away */

/* A ray and a hit of this library. */
struct colonnade_rays_ray {
    double origin[3], tnear, direction[3], tfar;
};
struct colonnade_rays_hit {
    double t, u, v; /* of the face as the application has it: u, v are the weights of its second and third corner */
    uint32_t mesh, face; /* UINT32_MAX: a miss, with t = tfar */
    uint32_t flags;      /* COLONNADE_RAYS_BACK_SIDE, COLONNADE_RAYS_NON_OPAQUE */
    uint32_t ray;        /* index of the ray */
};

/* Sums since the device was opened. */
struct colonnade_rays_sums {
    uint64_t rays, rays_refused; /* without a number, without direction, or with an empty interval: they miss */
    uint64_t rays_in_box, node_reads, box_tests, triangle_tests, deepest_stack;
};

/* What a backend loads: the records of the column memory with the root first, and the placement of rays. */
struct colonnade_rays_image {
    const uint8_t *records;
    size_t record_count, record_bytes;
    int32_t bounds_low[3], bounds_high[3]; /* vertex units */
    uint32_t scale_mantissa;               /* vertex units in the application's unit: mantissa * 2^(exponent - 24) */
    int32_t scale_exponent;
    int64_t base[3]; /* position (0, 0, 0) in steps of 2^(-gridFraction - exponent - 3) */
};

/* What traces batches: the model, or a device. Functions return a colonnade_rays_status. */
struct colonnade_rays_backend {
    void *context;
    int (*load)(void *context, const struct colonnade_rays_image *image); /* keeps `records` until the next one */
    int (*submit)(void *context, const struct colonnade_rays_batch *batch);
    int (*wait)(void *context); /* until all batches are done */
    void (*counters)(void *context, struct colonnade_rays_sums *counters);
    void (*close)(void *context);
};

struct colonnade_rays_device;
struct colonnade_rays_scene;

/* Opens a device of a design: lines "number NAME VALUE" and "layout RECORD FIELD OFFSET WIDTH SIGNED" of its manifest.
 * `design` NULL: `edge`, and for a scene of which it drops more than one face in a hundred `edge` with vertices of 24
 * bits. `backend` NULL: the model. The device is NULL if there is no memory, and otherwise has the error. */
int colonnade_rays_open(const char *design, const struct colonnade_rays_backend *backend,
                        struct colonnade_rays_device **device);
/* Opens the device that the environment names (simulated.cpp). COLONNADE_RAYS_DESIGN is a file with the design, or not
 * set. COLONNADE_RAYS_DEVICE is one with a simulated device: lines "program PATH" and "argument WORD", then "register
 * NAME ADDRESS BITS SIGNED ACCESS"; without it the model answers. A failure prints a line on stderr, and `*device` is
 * NULL. */
int colonnade_rays_open_environment(struct colonnade_rays_device **device);
/* Closes a device, after its scenes. */
void colonnade_rays_close(struct colonnade_rays_device *device);
/* Text of the calling thread's last call, if it failed, until its next call. NULL: of a call without a device. */
const char *colonnade_rays_error(const struct colonnade_rays_device *device);
/* A number of the design, such as "vertexBits"; -1 without it. */
int64_t colonnade_rays_design(const struct colonnade_rays_device *device, const char *name);
/* What the rays have read and tested since the device was opened. */
void colonnade_rays_counters(const struct colonnade_rays_device *device, struct colonnade_rays_sums *counters);

/* Scenes. Changes take effect at the next commit. */
int colonnade_rays_scene_new(struct colonnade_rays_device *device, struct colonnade_rays_scene **scene);
/* Frees a scene; NULL is none. */
void colonnade_rays_scene_free(struct colonnade_rays_scene *scene);
/* Adds a mesh, which is copied: `vertices` [vertex_count][3], `faces` [face_count][3]. `*mesh` is its number. */
int colonnade_rays_mesh_add(struct colonnade_rays_scene *scene, const double *vertices, size_t vertex_count,
                            const uint32_t *faces, size_t face_count, uint32_t *mesh);
/* Moves the vertices of a mesh: `vertex_count` is what it has. */
int colonnade_rays_mesh_update(struct colonnade_rays_scene *scene, uint32_t mesh, const double *vertices,
                               size_t vertex_count);
/* Removes a mesh; its number is not used again. */
int colonnade_rays_mesh_remove(struct colonnade_rays_scene *scene, uint32_t mesh);
/* Leaves a mesh out of the scene, or takes it in. */
int colonnade_rays_mesh_enable(struct colonnade_rays_scene *scene, uint32_t mesh, int is_enabled);
/* Rays with a bit in common with the mask, at first all ones, may hit the mesh. */
int colonnade_rays_mesh_mask(struct colonnade_rays_scene *scene, uint32_t mesh, uint32_t mask);
/* `is_opaque` [face_count], which is what the mesh has; NULL, 0: all are. */
int colonnade_rays_mesh_opacity(struct colonnade_rays_scene *scene, uint32_t mesh, const uint8_t *is_opaque,
                                size_t face_count);
/* Packs the scene and loads it. A scene without faces has no hits. One in which more than one face in a hundred
 * vanishes on the device's grid is refused. */
int colonnade_rays_commit(struct colonnade_rays_scene *scene);
/* Faces that vanish on the grid of the committed scene, so that no ray hits them; not those thinner than 2^-36 of the
 * box. */
int colonnade_rays_dropped(const struct colonnade_rays_scene *scene, size_t *faces);
/* The box of the committed scene. */
int colonnade_rays_bounds(const struct colonnade_rays_scene *scene, double low[3], double high[3]);
/* A vertex unit, and the corner that local origins count from. */
int colonnade_rays_grid(const struct colonnade_rays_scene *scene, double *unit, double corner[3]);

/* Rays. `mode` has the bits of CULL_FRONT, CULL_BACK, OPAQUE_ONLY; `mask` is for all rays of a call. */

/* The closest hit of each ray. With `colonnade_rays_refine` it is on the meshes as the application has them. */
int colonnade_rays_closest(struct colonnade_rays_scene *scene, const struct colonnade_rays_ray *rays, size_t count,
                           uint32_t mode, uint32_t mask, struct colonnade_rays_hit *hits);
/* 1 for each ray with a hit, else 0. */
int colonnade_rays_occluded(struct colonnade_rays_scene *scene, const struct colonnade_rays_ray *rays, size_t count,
                            uint32_t mode, uint32_t mask, uint8_t *is_occluded);
/* All hits of all rays, by ray and t, at most `most` a ray. `hits` has room for `capacity`; `*found` may be more. */
int colonnade_rays_all(struct colonnade_rays_scene *scene, const struct colonnade_rays_ray *rays, size_t count,
                       uint32_t mode, uint32_t mask, size_t most, struct colonnade_rays_hit *hits, size_t capacity,
                       size_t *found);
/* t, u, v of hits in double, from the meshes' own vertices, or a neighbour's where these say no: 1, as at first. */
void colonnade_rays_refine(struct colonnade_rays_scene *scene, int is_refined);
/* An order of the rays in which near ones follow each other: origins in Morton order, then the octant of the direction.
 */
int colonnade_rays_order(const struct colonnade_rays_scene *scene, const struct colonnade_rays_ray *rays, size_t count,
                         uint32_t *order);
/* Hands over a batch as it is. The mask of its mode is the device's: of the low 8 bits of the meshes' masks, if no
 * other bits tell meshes apart. */
int colonnade_rays_submit(struct colonnade_rays_scene *scene, const struct colonnade_rays_batch *batch);
/* Waits until all batches are done. */
int colonnade_rays_wait(struct colonnade_rays_scene *scene);
/* The mesh and the face of the id of a response. */
int colonnade_rays_face(const struct colonnade_rays_scene *scene, uint32_t id, uint32_t *mesh, uint32_t *face);

#ifdef __cplusplus
}
#endif

#endif
