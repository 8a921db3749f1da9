/* SPDX-License-Identifier: Apache-2.0 */
/* Objects that move by a clip file of instances: docs/driver.md.
 *
 * Integers only: no allocation, no floating point, no library. The same file gives the same words on every processor. */
#ifndef COLONNADE_MOTION_H
#define COLONNADE_MOTION_H

#include "colonnade_instances.h"
#include "colonnade_mesh.h"
#include "colonnade_view.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Writes of a frame, at most: instances, bounds and `shading.offset`. */
enum { COLONNADE_MOTION_WRITES = COLONNADE_INSTANCES * COLONNADE_INSTANCE_WORDS + 6 + 2 };

/* Objects and where they are over time. Only the functions below read and write it. It points into the file. */
struct colonnade_motion {
    struct colonnade_world world;
    uint32_t instances_address, bounds_address, offset_address;
    uint32_t instance_words, offset_words; /* of `instances[i]`; of `shading.offset`, 0: the view file has it */
    uint32_t objects, keys, clips;
    uint32_t duration; /* 2^-16 s */
    int32_t shift;     /* fraction bits of translations */
    const uint8_t *object_words, *key_words, *clip_words;
};

/* Reads a clip file of instances, which `colonnade pack --clip-file` writes for a scene of several objects. */
enum colonnade_error colonnade_motion_open(struct colonnade_motion *motion, const struct colonnade_design *design,
                                           const void *data, size_t bytes);

/* Clip `index`, below motion->clips, of a mesh that bends, and the address of its root in the scene. It plays once, from the
 * start of the motion, and stays at its end. */
enum colonnade_error colonnade_motion_mesh(const struct colonnade_motion *motion, const struct colonnade_design *design,
                                           uint32_t index, struct colonnade_mesh *mesh, uint32_t *root);

/* The transforms of all objects at a time, 2^-16 s; the motion repeats. */
void colonnade_motion_transforms(const struct colonnade_motion *motion, uint32_t time, struct colonnade_transform *transforms);

/* Moves an object by a program's own pose: turns it about `pivot`, then shifts it, in the axes and the metres of the view's
 * world, 2^-30 and 2^-32 m. */
enum colonnade_error colonnade_motion_move(const struct colonnade_view *view, const struct colonnade_pose *move,
                                           const int64_t pivot[3], struct colonnade_transform *transform);

/* The registers of all objects: `transforms`, also those of the program's own, give `instances`. */
enum colonnade_error colonnade_motion_find(const struct colonnade_motion *motion, const struct colonnade_transform *transforms,
                                           struct colonnade_instance *instances);

/* The pairs of words of instances, of their bounds and offset, but for those that `before` has, too: instances that the device
 * has, NULL if it has none. Answers their number. `writes` has space for COLONNADE_MOTION_WRITES pairs. Set them by
 * colonnade_set_frame after those of a view, whose bounds colonnade_view_set_bounds gives. */
uint32_t colonnade_motion_writes(const struct colonnade_motion *motion, const struct colonnade_instance *instances,
                                 const struct colonnade_instance *before, uint8_t *writes);

#ifdef __cplusplus
}
#endif

#endif
