/* SPDX-License-Identifier: Apache-2.0 */
/* Parts of colonnade_mesh: fields of records, and words of a clip file. */
#ifndef COLONNADE_MESH_PARTS_H
#define COLONNADE_MESH_PARTS_H

#include "colonnade_mesh.h"
#include "colonnade_words.h"

enum {
    RECORD_WORDS = 8,
    RECORD_BITS = 32 * RECORD_WORDS,
    OCTAHEDRAL_BITS = 11,
    COUNT_BITS = 3,
    VERTEX_WORDS = 8,
    LEAF_WORDS = 4,
    CHANGE_WORDS = 6,
    MATRIX_WORDS = 12,
    WEIGHT_BITS = 15,        /* of bones; the weights of a vertex have the sum 2^15 */
    TARGET_WEIGHT_BITS = 16, /* fraction of the weights of morph targets */
    BOUND_BITS = 25,         /* of a bound position and of what a morph target adds, without the sign */
    TARGET_BITS = 24,        /* of the weight of a morph target, without the sign */
    MATRIX_BITS = 30         /* of an element of a bone's matrix, without the sign */
};

/* The order of fields in a clip file. */
enum field {
    FIELD_PLANES = 0, /* by child: low x, y, z, high x, y, z */
    FIELD_CORNER = FIELD_PLANES + 6 * COLONNADE_MESH_CHILDREN,
    FIELD_FIRST = FIELD_CORNER + 3,
    FIELD_LEAVES,
    FIELD_NODES,
    FIELD_VERTICES,                         /* absolute ones, by vertex */
    FIELD_DELTAS = FIELD_VERTICES + 12,     /* of vertices 1 to 3 from vertex 0 */
    FIELD_SIGNS = FIELD_DELTAS + 9,         /* of the deltas of a far pair */
    FIELD_NORMALS = FIELD_SIGNS + 9,        /* of a triangle: u, v by corner */
    FIELD_HIGH_NORMALS = FIELD_NORMALS + 6, /* of a pair: all bits but the lowest */
    FIELD_LOW_NORMALS = FIELD_HIGH_NORMALS + 8,
    FIELD_FORMAT = FIELD_LOW_NORMALS + 8,
    FIELD_MATERIAL,
    FIELD_IS_CLEAR
};

_Static_assert(FIELD_IS_CLEAR + 1 == COLONNADE_MESH_FIELDS, "each field has its place");

/* Poses over time: of each key its time, 2^-16 s, and numbers, matrices first. */
struct colonnade_keys {
    const uint8_t *words;
    uint32_t count, numbers, of_matrices, duration;
};

/* Whether times ascend from 0 on to the duration, and numbers are small enough for what is computed. */
bool colonnade_are_keys(const struct colonnade_keys *keys);
/* A time within a duration that repeats. */
static inline uint32_t colonnade_repeated(uint32_t time, uint32_t duration) {
    return time <= duration ? time : time % (duration != 0 ? duration : 1);
}
/* The numbers at a time, 2^-16 s; keys repeat. */
void colonnade_find_pose(const struct colonnade_keys *keys, uint32_t time, int32_t *pose);

/* A walk over the tree of a copy. Children of a node are beside each other, nodes first; subtrees follow depth first. */
struct colonnade_mesh_walk {
    const struct colonnade_mesh *mesh;
    const uint32_t *copy;
    struct colonnade_mesh_node *path;
    uint32_t root, next, leaf, open; /* the next record and leaf to be met; nodes on the path. At first `next` is `root` */
};

/* The next node, after all nodes below it; NULL at the end, or where the tree is not the clip's. */
struct colonnade_mesh_node *colonnade_mesh_next(struct colonnade_mesh_walk *walk);
/* Whether the walk has met the clip's tree. */
enum colonnade_error colonnade_mesh_end(const struct colonnade_mesh_walk *walk);

static inline int32_t colonnade_signed_word(const uint8_t *bytes, size_t index) {
    return (int32_t)colonnade_word(bytes, index);
}

/* Half `index` of a word: 0 the lower one. */
static inline uint32_t colonnade_half(const uint8_t *bytes, size_t index) {
    return (uint32_t)bytes[2 * index] | (uint32_t)bytes[2 * index + 1] << 8;
}

static inline int32_t colonnade_signed_half(const uint8_t *bytes, size_t index) {
    return (int16_t)colonnade_half(bytes, index);
}

/* A field of a record. */
static inline uint32_t colonnade_field(const uint32_t *record, uint32_t low, int32_t width) {
    const uint32_t *word = &record[low / 32], at = low % 32;
    const uint32_t more = at + (uint32_t)width > 32 ? word[1] << (32 - at) : 0;
    return (word[0] >> at | more) & (((uint32_t)1 << width) - 1);
}

/* A record that is put together. */
struct colonnade_record {
    uint32_t words[RECORD_WORDS];
};

static inline void colonnade_put(struct colonnade_record *record, uint32_t low, int32_t width, uint32_t value) {
    uint32_t *word = &record->words[low / 32];
    const uint32_t bits = value & (((uint32_t)1 << width) - 1), at = low % 32;
    word[0] |= bits << at;
    if (at + (uint32_t)width > 32) word[1] |= bits >> (32 - at);
}

static inline void colonnade_store(uint32_t *to, const struct colonnade_record *record) {
    for (int i = 0; i < RECORD_WORDS; ++i) to[i] = record->words[i];
}

/* Half of a box's area. */
static inline uint64_t colonnade_half_area(const int32_t low[3], const int32_t high[3]) {
    const uint64_t x = (uint64_t)(high[0] - low[0]), y = (uint64_t)(high[1] - low[1]), z = (uint64_t)(high[2] - low[2]);
    return x * y + y * z + z * x;
}

#endif
