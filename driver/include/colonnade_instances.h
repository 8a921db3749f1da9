/* SPDX-License-Identifier: Apache-2.0 */
/* Registers of objects with transforms of their own: docs/driver.md.
 *
 * Integers only: no allocation, no floating point, no library. The same transforms give the same words on every
 * processor. */
#ifndef COLONNADE_INSTANCES_H
#define COLONNADE_INSTANCES_H

#include "colonnade.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    COLONNADE_INSTANCES = 16, /* of a design, at most */
    /* Words of `instances[i]`, at most: matrix, shift, origin of up to 64 bits, normal, root, materialBase, box */
    COLONNADE_INSTANCE_WORDS = 9 + 1 + 2 * 3 + 9 + 2 + 2 * 3
};

/* Number formats of the design: the world and each object are cubes of 2^vertex_bits units. */
struct colonnade_world {
    int32_t vertex_bits, grid_fraction, scene_bits;
};

/* World = linear * 2^exponent * object + position, in vertex units of each. It may mirror, scale and shear. */
struct colonnade_transform {
    int32_t linear[3][3]; /* [row][column]; as large as fits, since it is computed with 30 bits */
    int32_t exponent;
    int64_t position[3]; /* 2^-20 vertex units of the world */
};

/* A mesh. */
struct colonnade_object {
    int32_t low[3], high[3]; /* its bounds, its vertex units, inclusive */
    uint64_t offset;         /* `shading.offset` of the mesh alone, its grid steps */
    uint32_t root, material_base;
};

/* An object at its place. */
struct colonnade_instance {
    uint32_t words[COLONNADE_INSTANCE_WORDS]; /* of `instances[i]`, in the order of the register map */
    int32_t low[3], high[3];                  /* its bounds, vertex units of the world, inclusive */
    uint64_t offset;                          /* from its surfaces, grid steps of the world */
};

/* The words of `instances[i]`. */
uint32_t colonnade_instance_words(const struct colonnade_world *world);
/* The place of the root among them. */
uint32_t colonnade_instance_root(const struct colonnade_world *world);

/* Places an object. Errors: a transform that scales an axis to nothing, or makes the object too small for the world,
 * or lets it leave the world's cube. */
enum colonnade_error colonnade_find_instance(const struct colonnade_world *world, const struct colonnade_object *object,
                                             const struct colonnade_transform *transform,
                                             struct colonnade_instance *instance);

/* What all instances share: `bounds`, vertex units, and `shading.offset`, grid steps. */
struct colonnade_shared {
    int32_t low[3], high[3];
    uint64_t offset;
};

/* Of at least one instance. */
struct colonnade_shared colonnade_find_shared(const struct colonnade_instance *instances, uint32_t count);

#ifdef __cplusplus
}
#endif

#endif
