/* SPDX-License-Identifier: Apache-2.0 */
/* Vertices of a pose: docs/driver.md. */
#include "colonnade_integers.h"
#include "colonnade_mesh_parts.h"

enum { OCTAHEDRAL_ONE = (1 << (OCTAHEDRAL_BITS - 1)) - 1 };

uint32_t colonnade_mesh_pose_words(const struct colonnade_mesh *mesh) { return MATRIX_WORDS * mesh->bones + mesh->targets; }

void colonnade_find_pose(const struct colonnade_keys *keys, uint32_t time, int32_t *pose) {
    const size_t stride = 4 * (1 + (size_t)keys->numbers);
    uint32_t low = 0, high = keys->count;
    time = colonnade_repeated(time, keys->duration);
    while (high - low > 1) { /* the last key up to the time */
        const uint32_t middle = low + (high - low) / 2;
        if (colonnade_word(keys->words + stride * middle, 0) <= time) low = middle;
        else high = middle;
    }
    const uint8_t *before = keys->words + stride * low, *after = high < keys->count ? before + stride : before;
    const uint32_t start = colonnade_word(before, 0), span = colonnade_word(after, 0) - start;
    const int64_t part = span == 0 ? 0 : (int64_t)(((uint64_t)(time - start) << 16) / span);
    for (size_t i = 0; i < keys->numbers; ++i) {
        const int64_t from = colonnade_signed_word(before, 1 + i), to = colonnade_signed_word(after, 1 + i);
        pose[i] = (int32_t)(from + colonnade_nearest((to - from) * part, 16));
    }
}

void colonnade_mesh_pose(const struct colonnade_mesh *mesh, uint32_t time, int32_t *pose) {
    const struct colonnade_keys keys = {mesh->key_words, mesh->keys, colonnade_mesh_pose_words(mesh), 0, mesh->duration};
    colonnade_find_pose(&keys, time, pose);
}

/* A vertex where it is bound: position and normal. */
struct bound {
    int32_t position[3], normal[3];
};

static bool add_within(int32_t *value, int64_t more, int bits) {
    const int64_t sum = *value + more;
    if (colonnade_magnitude(sum) >> bits != 0) return false;
    *value = (int32_t)sum;
    return true;
}

/* Adds the changes of a vertex, the first of which is `*next`, and moves on behind them. Answers whether it stays in bounds. */
static bool morph(const struct colonnade_mesh *mesh, const int32_t *weights, uint32_t vertex, uint32_t *next,
                  struct bound *bound) {
    int64_t sums[6] = {0};
    bool is_good = true;
    if (*next == mesh->changes || colonnade_word(mesh->change_words, CHANGE_WORDS * *next) != vertex) return true;
    for (; *next < mesh->changes; ++*next) {
        const uint8_t *at = mesh->change_words + 4 * CHANGE_WORDS * (size_t)*next, *halves = at + 4 * 4;
        if (colonnade_word(at, 0) != vertex) break;
        const int64_t weight = weights[colonnade_half(halves, 3)];
        for (size_t axis = 0; axis < 3; ++axis) {
            sums[axis] += colonnade_nearest(weight * colonnade_signed_word(at, 1 + axis), TARGET_WEIGHT_BITS);
            sums[3 + axis] += colonnade_nearest(weight * colonnade_signed_half(halves, axis), TARGET_WEIGHT_BITS);
        }
    }
    for (int axis = 0; axis < 3; ++axis) {
        is_good &= add_within(&bound->position[axis], sums[axis], BOUND_BITS + 1);
        is_good &= add_within(&bound->normal[axis], sums[3 + axis], 30);
    }
    return is_good;
}

/* a * b / 2^32, towards minus infinity. */
static int32_t high(uint32_t a, int32_t b) { return (int32_t)((int64_t)a * b >> 32); }

/* Half the matrix of a vertex, from those of its bones. */
static void blend(const int32_t *pose, const uint8_t *halves, int32_t matrix[MATRIX_WORDS]) {
    int32_t weights[4] = {1 << WEIGHT_BITS, 0, 0, 0};
    for (size_t k = 1; k < 4; ++k) {
        weights[k] = (int32_t)colonnade_half(halves, 6 + k);
        weights[0] -= weights[k];
    }
    const int32_t *bone = pose + MATRIX_WORDS * colonnade_half(halves, 3);
    if (weights[0] == 1 << WEIGHT_BITS) {
        for (int i = 0; i < MATRIX_WORDS; ++i) matrix[i] = bone[i] >> 1;
        return;
    }
    for (int i = 0; i < MATRIX_WORDS; ++i) matrix[i] = 0;
    for (size_t k = 0; k < 4; ++k) {
        const uint32_t weight = (uint32_t)weights[k] << (32 - 1 - WEIGHT_BITS);
        if (weight == 0) continue;
        bone = pose + MATRIX_WORDS * colonnade_half(halves, 3 + k);
        for (int i = 0; i < MATRIX_WORDS; ++i) matrix[i] += high(weight, bone[i]);
    }
}

/* Scales a vector to magnitudes of at most 2^bits, if they are larger. */
static void limit(int32_t *vector, int count, int bits) {
    uint32_t all = 0;
    for (int i = 0; i < count; ++i) all |= (uint32_t)(vector[i] < 0 ? ~vector[i] : vector[i]);
    const int down = colonnade_bit_length(all) - bits;
    for (int i = 0; down > 0 && i < count; ++i) vector[i] >>= down;
}

/* The octahedral code of a direction of any length. */
static void encode(int32_t vector[3], int16_t code[2]) {
    limit(vector, 3, 20);
    uint32_t size[3], sum = 0;
    for (int axis = 0; axis < 3; ++axis) sum += size[axis] = (uint32_t)(vector[axis] < 0 ? -vector[axis] : vector[axis]);
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

/* A minor of a matrix: its elements a, b, c, d are below 2^14. */
static int32_t minor(int32_t a, int32_t b, int32_t c, int32_t d) { return (a * b - c * d) >> 15; }

/* Turns a normal as a matrix turns surfaces: by its cofactors. */
static void turn(const int32_t *matrix, int32_t normal[3], int16_t code[2]) {
    int32_t m[9] = {matrix[0], matrix[1], matrix[2], matrix[4], matrix[5], matrix[6], matrix[8], matrix[9], matrix[10]};
    limit(m, 9, 14);
    limit(normal, 3, 15);
    const int32_t x = normal[0], y = normal[1], z = normal[2];
    int32_t turned[3] = {
        minor(m[4], m[8], m[5], m[7]) * x + minor(m[5], m[6], m[3], m[8]) * y + minor(m[3], m[7], m[4], m[6]) * z,
        minor(m[7], m[2], m[8], m[1]) * x + minor(m[8], m[0], m[6], m[2]) * y + minor(m[6], m[1], m[7], m[0]) * z,
        minor(m[1], m[5], m[2], m[4]) * x + minor(m[2], m[3], m[0], m[5]) * y + minor(m[0], m[4], m[1], m[3]) * z,
    };
    encode(turned, code);
}

/* A coordinate by a row of a matrix, to nearest. */
static int64_t place(const struct colonnade_mesh *mesh, const int32_t row[4], const int32_t at[3]) {
    const int bits = mesh->linear_shift + mesh->shift - 1;
    const int64_t sum = (int64_t)row[0] * at[0] + (int64_t)row[1] * at[1] + (int64_t)row[2] * at[2];
    return (((sum + row[3] * ((int64_t)1 << mesh->linear_shift)) >> (bits - 1)) + 1) >> 1;
}

enum colonnade_error colonnade_mesh_skin(const struct colonnade_mesh *mesh, const int32_t *pose,
                                         struct colonnade_vertex *vertices) {
    const int32_t *weights = pose + MATRIX_WORDS * mesh->bones;
    uint32_t change = 0;
    for (uint32_t i = 0; i < mesh->vertices; ++i) {
        const uint8_t *at = mesh->vertex_words + 4 * VERTEX_WORDS * (size_t)i, *halves = at + 4 * 3;
        struct bound bound;
        int32_t matrix[MATRIX_WORDS];
        for (size_t axis = 0; axis < 3; ++axis) {
            bound.position[axis] = colonnade_signed_word(at, axis);
            bound.normal[axis] = colonnade_signed_half(halves, axis);
        }
        if (!morph(mesh, weights, i, &change, &bound)) return COLONNADE_OUTSIDE;
        blend(pose, halves, matrix);
        for (int axis = 0; axis < 3; ++axis) {
            const int64_t coordinate = place(mesh, matrix + 4 * axis, bound.position);
            if (coordinate < 0 || coordinate >> mesh->vertex_bits != 0) return COLONNADE_OUTSIDE;
            vertices[i].position[axis] = (int32_t)coordinate;
        }
        turn(matrix, bound.normal, vertices[i].normal);
    }
    return COLONNADE_OK;
}
