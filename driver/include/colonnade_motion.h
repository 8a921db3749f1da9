/* SPDX-License-Identifier: Apache-2.0 */
/* Objects that move by a clip file of instances: docs/driver.md.
 *
 * Integers only: no allocation, no floating point, no library. The same file gives the same words on every processor.
 */
#ifndef COLONNADE_MOTION_H
#define COLONNADE_MOTION_H

#include "colonnade_instances.h"
#include "colonnade_mesh.h"
#include "colonnade_view.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Writes of a frame, at most: instances, bounds, `shading.offset`, and two of meshes that bend. */
enum { COLONNADE_MOTION_WRITES = COLONNADE_INSTANCES * COLONNADE_INSTANCE_WORDS + 6 + 2 + 2 };

/* Objects and where they are over time. Only the functions below write it. It points into the file. */
struct colonnade_motion {
    struct colonnade_world world;
    uint32_t instances_address, bounds_address, offset_address;
    uint32_t invalidate_address, count_address; /* 0: no scene lies in DRAM */
    uint32_t instance_words, offset_words;      /* of `instances[i]`; of `shading.offset`, 0: the view file has it */
    uint32_t objects, keys, clips;
    uint32_t duration; /* 2^-16 s */
    int32_t shift;     /* fraction bits of translations */
    const uint8_t *object_words, *key_words;
    uint32_t vertices, depth, pose_words; /* of the largest mesh that bends */
    uint32_t copy_bytes;                  /* of a second copy of all records of meshes that bend */
    struct colonnade_mesh meshes[COLONNADE_INSTANCES];
    uint32_t roots[COLONNADE_INSTANCES][2]; /* of each mesh: in the scene, in the second copy */
    uint32_t records;                       /* of the scene with second copies; 0: there are none */
};

/* The caller's memory for meshes that bend. */
struct colonnade_motion_memory {
    uint32_t *scene;                   /* the records in DRAM, and behind them motion->copy_bytes bytes */
    struct colonnade_vertex *vertices; /* motion->vertices */
    struct colonnade_mesh_node *path;  /* motion->depth */
    int32_t *pose;                     /* motion->pose_words */
};

/* Reads a clip file of instances, which `colonnade pack --clip-file` writes for a scene of several objects. */
enum colonnade_error colonnade_motion_open(struct colonnade_motion *motion, const struct colonnade_design *design,
                                           const void *data, size_t bytes);

/* Makes the second copies of meshes that bend, behind the scene: `bytes` bytes, which `colonnade pack --dram-image`
 * writes. */
enum colonnade_error colonnade_motion_copy(struct colonnade_motion *motion,
                                           const struct colonnade_motion_memory *memory, uint32_t bytes);

/* The transforms of all objects at a time, 2^-16 s; the motion repeats. */
void colonnade_motion_transforms(const struct colonnade_motion *motion, uint32_t time,
                                 struct colonnade_transform *transforms);

/* Moves an object by a program's own pose: turns it about `pivot`, then shifts it, in the axes and the metres of the
 * view's world, 2^-30 and 2^-32 m. */
enum colonnade_error colonnade_motion_move(const struct colonnade_view *view, const struct colonnade_pose *move,
                                           const int64_t pivot[3], struct colonnade_transform *transform);

/* The registers of all objects: `transforms`, also of the program's own, give `instances`. */
enum colonnade_error colonnade_motion_find(const struct colonnade_motion *motion,
                                           const struct colonnade_transform *transforms,
                                           struct colonnade_instance *instances);

/* Has instances read the copy of each mesh that bends that `last` does not: the instances of the last frame that was
 * started, NULL: none. Its root is roots[i] for motion->meshes[i]. With COLONNADE_BUSY a frame is queued, so that both
 * copies are read. For programs that refit by the unit. */
enum colonnade_error colonnade_motion_swap(const struct colonnade_motion *motion, const struct colonnade *device,
                                           const struct colonnade_instance *last, struct colonnade_instance *instances,
                                           uint32_t roots[COLONNADE_INSTANCES]);

/* Bends meshes as they are at a time, 2^-16 s, in the copies of colonnade_motion_swap. Each plays once, from the start
 * of the motion, and stays at its end. No frame may show instances of a call that fails. */
enum colonnade_error colonnade_motion_bend(const struct colonnade_motion *motion, const struct colonnade *device,
                                           const struct colonnade_motion_memory *memory, uint32_t time,
                                           const struct colonnade_instance *last, struct colonnade_instance *instances);

/* The pairs of words of instances, of their bounds and offset, unless `before` has them: instances that the device
 * has, NULL if it has none. Where a mesh that bends has another root, they invalidate the caches. Answers their number.
 * `writes` has space for COLONNADE_MOTION_WRITES pairs. Set them by colonnade_set_frame after a view's, whose bounds
 * colonnade_view_set_bounds gives. */
uint32_t colonnade_motion_writes(const struct colonnade_motion *motion, const struct colonnade_instance *instances,
                                 const struct colonnade_instance *before, uint8_t *writes);

#ifdef __cplusplus
}
#endif

#endif
