/* SPDX-License-Identifier: Apache-2.0 */
/* Vertices of a pose: docs/driver.md. */
#include "colonnade_integers.h"
#include "colonnade_mesh_parts.h"

enum { OCTAHEDRAL_ONE = (1 << (OCTAHEDRAL_BITS - 1)) - 1 };

uint32_t colonnade_mesh_pose_words(const struct colonnade_mesh *mesh) {
    return MATRIX_WORDS * mesh->bones + mesh->targets;
}

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
    const struct colonnade_keys keys = {mesh->key_words, mesh->keys, colonnade_mesh_pose_words(mesh), 0,
                                        mesh->duration};
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

/* a * b / 2^32, towards minus infinity. */
static int32_t high(uint32_t a, int32_t b) { return (int32_t)((int64_t)a * b >> 32); }

/* What a number adds to the bits of a largest magnitude. */
static uint32_t size_of(int32_t value) { return (uint32_t)(value ^ value >> 31); }

/* Scales a vector to magnitudes of at most 2^bits, if they are larger. */
static void limit(int32_t vector[3], int bits) {
    const int down = colonnade_bit_length((size_of(vector[0]) | size_of(vector[1]) | size_of(vector[2])) >> bits);
    for (int axis = 0; axis < 3; ++axis) vector[axis] >>= down;
}

/* Adds the changes of a vertex, the first of which is `*next`, and moves on behind them. Answers whether it stays in
 * bounds. */
static bool morph(const struct colonnade_mesh *mesh, const int32_t *weights, uint32_t vertex, uint32_t *next,
                  struct bound *bound) {
    int64_t sums[6] = {0};
    bool is_good = true;
    for (; *next < mesh->changes; ++*next) {
        uint32_t space[CHANGE_WORDS];
        const uint8_t *words = mesh->change_words + 4 * CHANGE_WORDS * (size_t)*next;
        const uint8_t *at = colonnade_aligned(words, CHANGE_WORDS, space), *halves = at + 4 * 4;
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
    limit(bound->normal, NORMAL_BITS);
    return is_good;
}

/* What places and turns vertices that have the same bones and weights. */
struct blend {
    uint32_t bone, others[3];     /* the first bone; words of the other ones and their weights */
    int32_t matrix[MATRIX_WORDS]; /* half of it */
    int32_t cofactors[9];         /* of its linear part, scaled */
};

/* Half the matrix of a vertex, from its bones'. */
static void mix(const int32_t *pose, const uint8_t *halves, int32_t matrix[MATRIX_WORDS]) {
    const uint32_t others = colonnade_half(halves, 7) + colonnade_half(halves, 8) + colonnade_half(halves, 9);
    const uint32_t first = (((uint32_t)1 << WEIGHT_BITS) - others) << (32 - 1 - WEIGHT_BITS);
    const int32_t *bone = pose + MATRIX_WORDS * colonnade_half(halves, 3);
    for (int i = 0; i < MATRIX_WORDS; ++i) matrix[i] = high(first, bone[i]);
    if (others == 0) return;
    for (size_t k = 1; k < 4; ++k) {
        const uint32_t weight = colonnade_half(halves, 6 + k) << (32 - 1 - WEIGHT_BITS);
        if (weight == 0) continue;
        bone = pose + MATRIX_WORDS * colonnade_half(halves, 3 + k);
        for (int i = 0; i < MATRIX_WORDS; ++i) matrix[i] += high(weight, bone[i]);
    }
}

/* A minor of a matrix: its elements a, b, c, d are below 2^14. */
static int32_t minor(int32_t a, int32_t b, int32_t c, int32_t d) { return (a * b - c * d) >> 15; }

/* What places and turns a vertex, unless the last one had the same bones and weights. */
static void find_blend(const int32_t *pose, const uint8_t *halves, struct blend *blend) {
    const uint32_t bone = colonnade_half(halves, 3);
    uint32_t difference = bone ^ blend->bone;
    for (size_t i = 0; i < 3; ++i) difference |= colonnade_word(halves, 2 + i) ^ blend->others[i];
    if (difference == 0) return;
    blend->bone = bone;
    for (size_t i = 0; i < 3; ++i) blend->others[i] = colonnade_word(halves, 2 + i);
    mix(pose, halves, blend->matrix);
    const int32_t *from = blend->matrix;
    uint32_t all = 0;
    for (int i = 0; i < MATRIX_WORDS; i += 4) all |= size_of(from[i]) | size_of(from[i + 1]) | size_of(from[i + 2]);
    const int down = colonnade_bit_length(all >> 14);
    const int32_t a = from[0] >> down, b = from[1] >> down, c = from[2] >> down;
    const int32_t d = from[4] >> down, e = from[5] >> down, f = from[6] >> down;
    const int32_t g = from[8] >> down, h = from[9] >> down, i = from[10] >> down;
    const int32_t cofactors[9] = {
        minor(e, i, f, h), minor(f, g, d, i), minor(d, h, e, g), minor(h, c, i, b), minor(i, a, g, c),
        minor(g, b, h, a), minor(b, f, c, e), minor(c, d, a, f), minor(a, e, b, d),
    };
    for (int k = 0; k < 9; ++k) blend->cofactors[k] = cofactors[k];
}

/* The octahedral code of a direction of any length. */
static void encode(int32_t vector[3], int16_t code[2]) {
    limit(vector, 20);
    uint32_t size[3], sum = 0;
    for (int axis = 0; axis < 3; ++axis)
        sum += size[axis] = (uint32_t)(vector[axis] < 0 ? -vector[axis] : vector[axis]);
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

/* Turns a normal of magnitudes up to 2^15 as a matrix turns surfaces: by its cofactors, which are up to 2^14. */
static void turn(const int32_t cofactors[9], const int32_t normal[3], int16_t code[2]) {
    int32_t turned[3];
    for (int row = 0; row < 3; ++row) {
        const int32_t *c = cofactors + 3 * row;
        turned[row] = c[0] * normal[0] + c[1] * normal[1] + c[2] * normal[2];
    }
    encode(turned, code);
}

/* Places a vertex, each coordinate by a row of half a matrix, to nearest. Answers whether it is on the grid. */
static bool place(const struct colonnade_mesh *mesh, const int32_t matrix[MATRIX_WORDS], const int32_t at[3],
                  int32_t position[3]) {
    /* From 1 to 19. The half that rounds is a whole number behind the first shift */
    const int down = mesh->shift - 1;
    const int linear_shift = mesh->linear_shift, bits = mesh->vertex_bits;
    uint32_t outside = 0;
    for (int axis = 0; axis < 3; ++axis) {
        const int32_t *row = matrix + 4 * axis;
        const int64_t sum = (int64_t)row[0] * at[0] + (int64_t)row[1] * at[1] + (int64_t)row[2] * at[2];
        const int64_t moved = (sum >> linear_shift) + (row[3] + (1 << (down - 1)));
        const int32_t top = (int32_t)(moved >> 32);
        const uint32_t coordinate = (uint32_t)moved >> down | (uint32_t)top << (32 - down);
        outside |= (uint32_t)(top >> down) | coordinate >> bits;
        position[axis] = (int32_t)coordinate;
    }
    return outside == 0;
}

/* The vertex of a change; behind the last one none. */
static uint32_t changed(const struct colonnade_mesh *mesh, uint32_t change) {
    return change == mesh->changes ? UINT32_MAX : colonnade_word(mesh->change_words, CHANGE_WORDS * (size_t)change);
}

enum colonnade_error colonnade_mesh_skin(const struct colonnade_mesh *mesh, const int32_t *pose,
                                         struct colonnade_vertex *vertices) {
    const int32_t *weights = pose + MATRIX_WORDS * mesh->bones;
    struct blend blend = {.bone = UINT32_MAX}; /* of no vertex */
    uint32_t change = 0, next = changed(mesh, 0);
    for (uint32_t i = 0; i < mesh->vertices; ++i) {
        uint32_t space[VERTEX_WORDS];
        const uint8_t *words = mesh->vertex_words + 4 * VERTEX_WORDS * (size_t)i;
        const uint8_t *at = colonnade_aligned(words, VERTEX_WORDS, space), *halves = at + 4 * 3;
        struct bound bound;
        for (size_t axis = 0; axis < 3; ++axis) {
            bound.position[axis] = colonnade_signed_word(at, axis);
            bound.normal[axis] = colonnade_signed_half(halves, axis);
        }
        if (i == next) {
            if (!morph(mesh, weights, i, &change, &bound)) return COLONNADE_OUTSIDE;
            next = changed(mesh, change);
        }
        find_blend(pose, halves, &blend);
        if (!place(mesh, blend.matrix, bound.position, vertices[i].position)) return COLONNADE_OUTSIDE;
        turn(blend.cofactors, bound.normal, vertices[i].normal);
    }
    return COLONNADE_OK;
}
