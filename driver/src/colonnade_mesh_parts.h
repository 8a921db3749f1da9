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
    COUNT_BITS = 3,    /* of a node's numbers of nodes and leaves, above the address of the first child */
    LEAF_HEAD = 245,   /* lowest bit of a leaf's head: its material, whether it is clear, its format */
    KEPT_BITS = 8 + 1, /* of the head: all but the format */
    FORMAT_BITS = 2,
    VERTEX_WORDS = 8,
    LEAF_WORDS = 4,
    CHANGE_WORDS = 6,
    MATRIX_WORDS = 12,
    NORMAL_BITS = 15,        /* of a bound normal, without the sign */
    WEIGHT_BITS = 15,        /* of bones; the weights of a vertex have the sum 2^15 */
    TARGET_WEIGHT_BITS = 16, /* fraction of the weights of morph targets */
    BOUND_BITS = 25,         /* of a bound position and of what a morph target adds, without the sign */
    TARGET_BITS = 24,        /* of the weight of a morph target, without the sign */
    MATRIX_BITS = 30         /* of an element of a bone's matrix, without the sign */
};

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

/* A walk over the tree of a copy. Children of a node are beside each other, nodes first; subtrees follow depth first.
 */
struct colonnade_mesh_walk {
    const struct colonnade_mesh *mesh;
    const uint32_t *copy;
    struct colonnade_mesh_node *path;
    uint32_t root, next, leaf,
        open; /* the next record and leaf to be met; nodes on the path. At first `next` is `root` */
};

/* The next node, after all nodes below it; NULL at the end, or where the tree is not the clip's. */
struct colonnade_mesh_node *colonnade_mesh_next(struct colonnade_mesh_walk *walk);
/* Whether the walk has met the clip's tree. */
enum colonnade_error colonnade_mesh_end(const struct colonnade_mesh_walk *walk);

/* Words that may lie anywhere: themselves if they lie at a multiple of 4, where one instruction reads a word, else a
 * copy. */
static inline const uint8_t *colonnade_aligned(const uint8_t *words, size_t count, uint32_t *copy) {
#ifdef __GNUC__
    if (__builtin_expect((uintptr_t)words % 4 == 0, 1)) return __builtin_assume_aligned(words, 4);
#endif
    for (size_t i = 0; i < 4 * count; ++i) ((uint8_t *)copy)[i] = words[i];
    return (const uint8_t *)copy;
}

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

/* The lowest bit of a node's head, above the planes of its children and its corner. */
static inline uint32_t colonnade_node_head(const struct colonnade_mesh *mesh) {
    return (uint32_t)(6 * COLONNADE_MESH_CHILDREN * mesh->box_bits + 3 * (mesh->vertex_bits + 1));
}

/* Material of a leaf, and whether it is clear. */
static inline uint32_t colonnade_leaf_head(const uint32_t *record) {
    return record[LEAF_HEAD / 32] >> LEAF_HEAD % 32 & ((1 << KEPT_BITS) - 1);
}

/* The lowest bits of a number, less than 32. */
static inline uint32_t colonnade_low_bits(uint32_t value, uint32_t count) {
    return value & (((uint32_t)1 << count) - 1);
}

/* Writes a record from its lowest bit on, each word once. */
struct colonnade_writer {
    uint32_t *to, bits, count; /* the next word, and the bits for it that there are */
};

/* Appends a number of `width` bits, less than 32. */
static inline void colonnade_put(struct colonnade_writer *writer, uint32_t value, uint32_t width) {
    writer->bits |= value << writer->count;
    writer->count += width;
    if (writer->count < 32) return;
    *writer->to++ = writer->bits;
    writer->count -= 32;
    writer->bits = value >> (width - writer->count);
}

/* Appends zeros up to a bit of the record. */
static inline void colonnade_pad(struct colonnade_writer *writer, const uint32_t *record, uint32_t bit) {
    while (writer->to < record + bit / 32) {
        *writer->to++ = writer->bits;
        writer->bits = 0;
    }
    writer->count = bit % 32;
}

/* Appends a node's head, and zeros up to the end of the record. */
static inline void colonnade_put_node_head(const struct colonnade_mesh *mesh, struct colonnade_writer *writer,
                                           const uint32_t *record, uint32_t first, uint32_t leaves, uint32_t nodes) {
    const uint32_t counts = leaves | nodes << COUNT_BITS, bits = (uint32_t)mesh->address_bits;
    colonnade_put(writer, first | counts << bits, bits + 2 * COUNT_BITS);
    colonnade_pad(writer, record, RECORD_BITS);
}

/* Appends zeros up to a leaf's head, and its head. */
static inline void colonnade_put_leaf_head(struct colonnade_writer *writer, const uint32_t *record, uint32_t kept,
                                           uint32_t format) {
    colonnade_pad(writer, record, LEAF_HEAD);
    colonnade_put(writer, kept | format << KEPT_BITS, KEPT_BITS + FORMAT_BITS);
}

/* Half of a box's area. */
static inline uint64_t colonnade_half_area(const int32_t low[3], const int32_t high[3]) {
    const uint32_t x = (uint32_t)(high[0] - low[0]), y = (uint32_t)(high[1] - low[1]), z = (uint32_t)(high[2] - low[2]);
    return (uint64_t)x * (y + z) + (uint64_t)y * z;
}

#endif
