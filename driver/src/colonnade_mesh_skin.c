/* SPDX-License-Identifier: Apache-2.0 */
/* Vertices of a pose: docs/driver.md. */
#include "colonnade_integers.h"
#include "colonnade_mesh_parts.h"

enum { OCTAHEDRAL_ONE = (1 << (OCTAHEDRAL_BITS - 1)) - 1 };

uint32_t colonnade_mesh_pose_words(const struct colonnade_mesh *mesh) { return MATRIX_WORDS * mesh->bones + mesh->targets; }

void colonnade_mesh_pose(const struct colonnade_mesh *mesh, uint32_t time, int32_t *pose) {
    const size_t words = colonnade_mesh_pose_words(mesh), stride = 4 * (1 + words);
    const uint8_t *before = mesh->key_words;
    uint32_t low = 0, high = mesh->keys;
    if (time > mesh->duration) time %= mesh->duration != 0 ? mesh->duration : 1;
    while (high - low > 1) { /* the last key up to the time */
        const uint32_t middle = low + (high - low) / 2;
        if (colonnade_word(mesh->key_words + stride * middle, 0) <= time) low = middle;
        else high = middle;
    }
    before += stride * low;
    const uint8_t *after = high < mesh->keys ? before + stride : before;
    const uint32_t start = colonnade_word(before, 0), span = colonnade_word(after, 0) - start;
    const int64_t part = span == 0 ? 0 : (int64_t)(((uint64_t)(time - start) << 16) / span);
    for (size_t i = 0; i < words; ++i) {
        const int64_t from = colonnade_signed_word(before, 1 + i), to = colonnade_signed_word(after, 1 + i);
        pose[i] = (int32_t)(from + colonnade_nearest((to - from) * part, 16));
    }
}

/* A vertex where it is bound: position and normal. */
struct bound {
    int64_t position[3], normal[3];
};

/* Adds the changes of a vertex, the first of which is `next`; answers the one behind them. */
static size_t morph(const struct colonnade_mesh *mesh, const int32_t *weights, size_t vertex, size_t next,
                    struct bound *bound) {
    int64_t position[3] = {0, 0, 0}, normal[3] = {0, 0, 0};
    for (; next < mesh->changes; ++next) {
        const uint8_t *at = mesh->change_words + 4 * CHANGE_WORDS * next, *halves = at + 4 * 4;
        if (colonnade_word(at, 0) != vertex) break;
        const int64_t weight = weights[colonnade_half(halves, 3)];
        for (size_t axis = 0; axis < 3; ++axis) {
            position[axis] += colonnade_nearest(weight * colonnade_signed_word(at, 1 + axis), TARGET_WEIGHT_BITS);
            normal[axis] += colonnade_nearest(weight * colonnade_signed_half(halves, axis), TARGET_WEIGHT_BITS);
        }
    }
    for (int axis = 0; axis < 3; ++axis) {
        bound->position[axis] += position[axis];
        bound->normal[axis] += normal[axis];
    }
    return next;
}

/* The matrix of a vertex, from those of its bones. */
static void blend(const int32_t *pose, const uint8_t *halves, int64_t matrix[MATRIX_WORDS]) {
    int64_t weights[4] = {1 << WEIGHT_BITS, 0, 0, 0};
    for (size_t k = 1; k < 4; ++k) {
        weights[k] = colonnade_half(halves, 6 + k);
        weights[0] -= weights[k];
    }
    const int32_t *first = pose + MATRIX_WORDS * colonnade_half(halves, 3);
    if (weights[0] == 1 << WEIGHT_BITS) {
        for (int i = 0; i < MATRIX_WORDS; ++i) matrix[i] = first[i];
        return;
    }
    for (int i = 0; i < MATRIX_WORDS; ++i) matrix[i] = weights[0] * first[i];
    for (size_t k = 1; k < 4; ++k) {
        const int32_t *bone = pose + MATRIX_WORDS * colonnade_half(halves, 3 + k);
        for (int i = 0; weights[k] != 0 && i < MATRIX_WORDS; ++i) matrix[i] += weights[k] * bone[i];
    }
    for (int i = 0; i < MATRIX_WORDS; ++i) matrix[i] = colonnade_nearest(matrix[i], WEIGHT_BITS);
}

/* Scales a vector to magnitudes of at most `bits` bits, if they have more. */
static void limit(int64_t *vector, int count, int bits) {
    uint64_t all = 0;
    for (int i = 0; i < count; ++i) all |= colonnade_magnitude(vector[i]);
    const int down = colonnade_bit_length(all) - bits;
    for (int i = 0; down > 0 && i < count; ++i) vector[i] = colonnade_floor(vector[i], down);
}

/* The octahedral code of a direction of any length. */
static void encode(int64_t vector[3], int16_t code[2]) {
    limit(vector, 3, 20);
    uint32_t size[3], sum = 0;
    for (int axis = 0; axis < 3; ++axis) sum += size[axis] = (uint32_t)colonnade_magnitude(vector[axis]);
    code[0] = code[1] = 0;
    if (sum == 0) return;
    for (int i = 0; i < 2; ++i) size[i] = (2 * OCTAHEDRAL_ONE * size[i] + sum) / (2 * sum);
    if (vector[2] < 0) {
        const uint32_t u = size[0];
        size[0] = OCTAHEDRAL_ONE - size[1];
        size[1] = OCTAHEDRAL_ONE - u;
    }
    for (int i = 0; i < 2; ++i) code[i] = (int16_t)(vector[i] < 0 ? -(int32_t)size[i] : (int32_t)size[i]);
}

/* Turns a normal as a matrix turns surfaces: by its cofactors. */
static void turn(const int64_t matrix[MATRIX_WORDS], int64_t normal[3], int16_t code[2]) {
    int64_t linear[9], turned[3];
    for (int i = 0; i < 9; ++i) linear[i] = matrix[i / 3 * 4 + i % 3];
    limit(linear, 9, 15);
    limit(normal, 3, 15);
    for (int i = 0; i < 3; ++i) {
        const int64_t *b = linear + 3 * ((i + 1) % 3), *c = linear + 3 * ((i + 2) % 3);
        turned[i] = 0;
        for (int k = 0; k < 3; ++k) {
            const int l = (k + 1) % 3, m = (k + 2) % 3;
            turned[i] += (b[l] * c[m] - b[m] * c[l]) * normal[k];
        }
    }
    encode(turned, code);
}

enum colonnade_error colonnade_mesh_skin(const struct colonnade_mesh *mesh, const int32_t *pose,
                                         struct colonnade_vertex *vertices) {
    const int32_t *weights = pose + MATRIX_WORDS * mesh->bones;
    size_t change = 0;
    for (size_t i = 0; i < mesh->vertices; ++i) {
        const uint8_t *at = mesh->vertex_words + 4 * VERTEX_WORDS * i, *halves = at + 4 * 3;
        struct bound bound;
        int64_t matrix[MATRIX_WORDS];
        for (size_t axis = 0; axis < 3; ++axis) {
            bound.position[axis] = colonnade_signed_word(at, axis);
            bound.normal[axis] = colonnade_signed_half(halves, axis);
        }
        change = morph(mesh, weights, i, change, &bound);
        blend(pose, halves, matrix);
        if (colonnade_largest(bound.position) >> (BOUND_BITS + 1) != 0) return COLONNADE_OUTSIDE;
        for (int axis = 0; axis < 3; ++axis) {
            const int64_t *row = matrix + 4 * axis;
            int64_t sum = 0;
            for (int k = 0; k < 3; ++k) sum += row[k] * bound.position[k];
            const int64_t place = colonnade_nearest(colonnade_nearest(sum, mesh->linear_shift) + row[3], mesh->shift);
            if (place < 0 || place >> mesh->vertex_bits != 0) return COLONNADE_OUTSIDE;
            vertices[i].position[axis] = (int32_t)place;
        }
        turn(matrix, bound.normal, vertices[i].normal);
    }
    return COLONNADE_OK;
}
