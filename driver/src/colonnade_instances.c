/* SPDX-License-Identifier: Apache-2.0 */
/* Registers of instances: docs/numbers.md, section 10. Lengths have 20 fraction bits, vertex units of the world. */
#include "colonnade_instances.h"

#include "colonnade_integers.h"

enum {
    LENGTH_BITS = 20,     /* fraction of lengths */
    LINEAR_BITS = 30,     /* of a linear part, without the sign */
    COFACTOR_BITS = 62,   /* of its cofactors, without the sign */
    MATRIX_BITS = 24,     /* of `matrix`, without the sign */
    NORMAL_BITS = 14,     /* fraction of `normal` */
    CELL_BITS = 7,        /* of `box` */
    RATIO_BITS = 20,      /* fraction of the ratio of stretches */
    OBJECT_STEPS = 6,     /* roundings of a ray's origin and direction from world to object, steps of the object */
    WORLD_STEPS = 8,      /* and of the way back, steps of the world */
    MOST_EXPONENT = -14,  /* of a linear part: what is stretched more is flat, or leaves the world */
    LEAST_EXPONENT = -128 /* what is stretched less is too small */
};

/* A linear part and what follows from it. */
struct linear {
    int32_t rows[3][3]; /* 2^exponent */
    int32_t exponent;
    int64_t cofactors[3][3];    /* as long as fits */
    int64_t determinant;        /* of rows, by these cofactors, 2^32 */
    uint64_t most;              /* the largest stretch, of rows */
    uint64_t most_of_cofactors; /* theirs, 2^32: by these the product of the two largest stretches */
};

/* high * 2^32 + low: a sum of products of 64 and 32 bits. */
struct wide {
    int64_t high, low;
};

static void add_product(struct wide *sum, int64_t a, int32_t b) {
    sum->high += (int64_t)(int32_t)(a >> 32) * b;
    sum->low += (int64_t)(uint32_t)a * b;
}

/* The square root, rounded up. */
static uint64_t root(uint64_t square) {
    uint32_t result = 0;
    for (uint32_t bit = (uint32_t)1 << 31; bit != 0; bit >>= 1)
        if ((uint64_t)(result | bit) * (result | bit) <= square) result |= bit;
    return result + (uint64_t)((uint64_t)result * result < square);
}

/* The largest stretch of a matrix of 30 bits, or hardly more: the root of the largest eigenvalue of its square.
 * With a third of the trace taken off, this is the largest z with z^3 - p * z = q. */
static uint64_t stretch(int32_t m[3][3]) {
    enum { REST_BITS = 28, LAST_BIT = 1 << 8, ROUNDINGS = 3 };
    int64_t square[3][3];
    uint64_t trace = 0, all = 0;
    int32_t z = 0;
    for (int i = 0; i < 3; ++i)
        for (int j = i; j < 3; ++j)
            square[i][j] = (int64_t)m[0][i] * m[0][j] + (int64_t)m[1][i] * m[1][j] + (int64_t)m[2][i] * m[2][j];
    for (int i = 0; i < 3; ++i) trace += (uint64_t)square[i][i];
    const uint64_t third = trace / 3 + 1;
    for (int i = 0; i < 3; ++i) {
        square[i][i] -= (int64_t)third;
        for (int j = i; j < 3; ++j) all |= colonnade_magnitude(square[i][j]);
    }
    const int down = colonnade_bit_length(all) > REST_BITS ? colonnade_bit_length(all) - REST_BITS : 0;
    const int32_t a = (int32_t)(square[0][0] >> down), b = (int32_t)(square[1][1] >> down), c = -a - b;
    const int32_t d = (int32_t)(square[0][1] >> down), e = (int32_t)(square[0][2] >> down);
    const int32_t f = (int32_t)(square[1][2] >> down);
    const int64_t p = (int64_t)a * a - (int64_t)b * c + (int64_t)d * d + (int64_t)e * e + (int64_t)f * f;
    struct wide q = {0, 0};
    add_product(&q, (int64_t)b * c - (int64_t)f * f, a);
    add_product(&q, (int64_t)e * f - (int64_t)c * d, d);
    add_product(&q, (int64_t)d * f - (int64_t)b * e, e);
    for (int32_t bit = 1 << (REST_BITS + 1); bit >= LAST_BIT; bit >>= 1) {
        const int32_t next = z + bit;
        const int64_t power = (int64_t)next * next;
        struct wide rest = {-q.high - (q.low >> 32), -(int64_t)(uint32_t)q.low};
        add_product(&rest, power - p, next);
        if (3 * power < p || rest.high + (rest.low >> 32) < 0) z = next;
    }
    return root(third + ((uint64_t)(z + LAST_BIT + ROUNDINGS) << down));
}

/* Shifts a matrix, to numbers of so many bits. Answers by how much, to the left. */
static int shift_to(int64_t m[3][3], int bits) {
    uint64_t all = 0;
    for (int i = 0; i < 9; ++i) all |= colonnade_magnitude(m[i / 3][i % 3]);
    const int up = bits - colonnade_bit_length(all);
    for (int i = 0; i < 9; ++i) m[i / 3][i % 3] = colonnade_nearest(m[i / 3][i % 3], -up);
    return up;
}

/* Whether a linear part has no axis of a stretch below 1e-4 of the largest. */
static bool find_linear(const struct colonnade_transform *transform, struct linear *linear) {
    int64_t m[3][3];
    int32_t high[3][3];
    for (int i = 0; i < 9; ++i) m[i / 3][i % 3] = transform->linear[i / 3][i % 3];
    const int32_t exponent = transform->exponent, limit = 1 << 16;
    linear->exponent = (exponent < -limit ? -limit : exponent > limit ? limit : exponent) - shift_to(m, LINEAR_BITS);
    for (int i = 0; i < 9; ++i) {
        const int a = (i / 3 + 1) % 3, b = (i / 3 + 2) % 3, c = (i % 3 + 1) % 3, d = (i % 3 + 2) % 3;
        linear->rows[i / 3][i % 3] = (int32_t)m[i / 3][i % 3];
        linear->cofactors[i / 3][i % 3] = m[a][c] * m[b][d] - m[a][d] * m[b][c];
    }
    shift_to(linear->cofactors, COFACTOR_BITS);
    for (int i = 0; i < 9; ++i) high[i / 3][i % 3] = (int32_t)(linear->cofactors[i / 3][i % 3] >> 32);
    linear->determinant = 0;
    for (int i = 0; i < 3; ++i)
        linear->determinant += colonnade_product(m[i][0] * ((int64_t)1 << 32), linear->cofactors[i][0]);
    linear->most = stretch(linear->rows);
    linear->most_of_cofactors = stretch(high) + 3;     /* by the floors */
    const uint64_t share = (uint64_t)1844674407370956; /* 1e-4, 2^-64 */
    return colonnade_magnitude(linear->determinant) >
           colonnade_multiply_high(linear->most * linear->most_of_cofactors, share);
}

/* value / 2^bits, rounded up; bits may be negative, if the result has 63 bits. */
static int64_t round_up(int64_t value, int bits) {
    return bits > 0 ? -colonnade_floor(-value, bits) : colonnade_shift_left(value, -bits);
}

/* Whether a ray from the reach of the world's cube starts in the object's scene: 1.5 * sqrt(3) * the cube's edge, by
 * the least stretch, is below 2^(scene_bits - 1) steps. */
static bool is_large(const struct colonnade_world *world, const struct linear *linear) {
    const int down = world->vertex_bits + world->grid_fraction + 1 - world->scene_bits - linear->exponent - 14;
    const uint64_t size = colonnade_magnitude(linear->determinant),
                   reach = linear->most_of_cofactors * 42567; /* 2^-14 */
    return down > 0 ? size >> (down < 63 ? down : 63) > reach : size > reach >> (down > -63 ? -down : 63);
}

/* The corners of the box of a placed object. */
static void find_box(const struct linear *linear, const struct colonnade_object *object, const int64_t position[3],
                     int64_t low[3], int64_t high[3]) {
    for (int a = 0; a < 3; ++a) {
        int64_t least = 0, most = 0;
        for (int b = 0; b < 3; ++b) {
            const int64_t factor = linear->rows[a][b];
            least += factor * (factor > 0 ? object->low[b] : object->high[b]);
            most += factor * (factor > 0 ? object->high[b] : object->low[b]);
        }
        low[a] = position[a] - round_up(-least, -linear->exponent - LENGTH_BITS);
        high[a] = position[a] + round_up(most, -linear->exponent - LENGTH_BITS);
    }
}

/* `matrix`, the inverse of the linear part, and `shift`, its fraction bits. */
static uint32_t *put_matrix(uint32_t *to, const struct linear *linear, uint64_t reciprocal, int up, int *shift) {
    int64_t matrix[3][3];
    uint64_t most = 0;
    for (int i = 0; i < 9; ++i) {
        const int64_t cofactor = linear->cofactors[i % 3][i / 3];
        const uint64_t size = colonnade_multiply_high(colonnade_magnitude(cofactor) << 1, reciprocal);
        matrix[i / 3][i % 3] = colonnade_signed(size, (cofactor < 0) != (linear->determinant < 0));
        if (size > most) most = size;
    }
    int down = colonnade_bit_length(most) - MATRIX_BITS;
    if (colonnade_nearest((int64_t)most, down) >> MATRIX_BITS != 0) ++down;
    for (int i = 0; i < 9; ++i) *to++ = colonnade_bits(colonnade_nearest(matrix[i / 3][i % 3], down), MATRIX_BITS + 1);
    *shift = 95 + linear->exponent - up - down;
    *to++ = (uint32_t)*shift;
    return to;
}

/* `normal`: the cofactors, so that the longest that they make of a unit vector is one. */
static uint32_t *put_normal(uint32_t *to, const struct linear *linear) {
    const int up = 64 - colonnade_bit_length(linear->most_of_cofactors);
    const uint64_t reciprocal = colonnade_reciprocal(linear->most_of_cofactors << up);
    for (int i = 0; i < 9; ++i) {
        const int64_t cofactor = linear->cofactors[i / 3][i % 3];
        const int64_t size = (int64_t)colonnade_multiply_high(colonnade_magnitude(cofactor) << 1, reciprocal);
        const int64_t normal = colonnade_nearest(size, 95 - up - NORMAL_BITS);
        *to++ = colonnade_bits((cofactor < 0) != (linear->determinant < 0) ? -normal : normal, NORMAL_BITS + 2);
    }
    return to;
}

/* The least distance from the surface, by the stretches (docs/numbers.md), at most the edge of the cube. */
static int64_t find_offset(const struct colonnade_world *world, const struct linear *linear, uint64_t own,
                           uint64_t reciprocal, int up) {
    const int64_t cube = (int64_t)1 << (world->vertex_bits + LENGTH_BITS);
    const int steps = world->grid_fraction - LENGTH_BITS;
    if (own >> (world->vertex_bits + world->grid_fraction) != 0) return cube;
    const uint64_t at_rest = (uint64_t)round_up((int64_t)own + OBJECT_STEPS, steps);
    const int64_t stretched = (int64_t)colonnade_multiply_high(at_rest << 18, linear->most << 32);
    uint64_t offset = (uint64_t)(colonnade_floor(stretched, -linear->exponent - 14) + 2 + round_up(WORLD_STEPS, steps));
    if (offset > (uint64_t)cube) offset = (uint64_t)cube;
    const uint64_t ratio =
        (colonnade_multiply_high(linear->most * linear->most_of_cofactors, reciprocal) >> (62 - RATIO_BITS - up)) + 2;
    const int64_t least = (int64_t)colonnade_multiply_high(offset << 19, ratio << (45 - RATIO_BITS)) + 1;
    return least < cube ? least : cube;
}

uint32_t colonnade_instance_words(const struct colonnade_world *world) {
    return world->vertex_bits + world->grid_fraction + 3 > 32 ? COLONNADE_INSTANCE_WORDS : COLONNADE_INSTANCE_WORDS - 3;
}

uint32_t colonnade_instance_root(const struct colonnade_world *world) {
    return colonnade_instance_words(world) - (2 + 2 * 3); /* behind it: materialBase, box */
}

enum colonnade_error colonnade_find_instance(const struct colonnade_world *world, const struct colonnade_object *object,
                                             const struct colonnade_transform *transform,
                                             struct colonnade_instance *instance) {
    const int64_t cube = (int64_t)1 << (world->vertex_bits + LENGTH_BITS), unit = 1 << LENGTH_BITS;
    struct linear linear;
    struct colonnade_instance found;
    int64_t low[3], high[3];
    int shift;
    if (!find_linear(transform, &linear)) return COLONNADE_FLAT;
    if (linear.exponent < LEAST_EXPONENT || !is_large(world, &linear)) return COLONNADE_TOO_SMALL;
    for (int axis = 0; axis < 3; ++axis)
        if (!colonnade_is_within(transform->position[axis], unit - 4 * cube, 4 * cube - unit)) return COLONNADE_OUTSIDE;
    if (linear.exponent > MOST_EXPONENT) return COLONNADE_OUTSIDE;
    find_box(&linear, object, transform->position, low, high);
    for (int axis = 0; axis < 3; ++axis)
        if (low[axis] < 0 || high[axis] > cube - unit) return COLONNADE_OUTSIDE;

    const uint64_t size = colonnade_magnitude(linear.determinant);
    const int up = 64 - colonnade_bit_length(size);
    const uint64_t reciprocal = colonnade_reciprocal(size << up); /* 2^(126 - up) / size */
    uint32_t *to = put_matrix(found.words, &linear, reciprocal, up, &shift);
    if (!colonnade_is_within(shift, 1, 63)) return COLONNADE_TOO_SMALL;
    const int grid_bits = world->vertex_bits + world->grid_fraction + 3;
    for (int axis = 0; axis < 3; ++axis) {
        const int64_t origin = colonnade_nearest(transform->position[axis], LENGTH_BITS - world->grid_fraction);
        *to++ = colonnade_bits(origin, grid_bits);
        if (grid_bits > 32) *to++ = colonnade_bits(origin >> 32, grid_bits - 32);
    }
    to = put_normal(to, &linear);
    *to++ = object->root;
    *to++ = object->material_base;

    const int64_t least = find_offset(world, &linear, object->offset, reciprocal, up);
    const int64_t cells = (1 << CELL_BITS) - 1,
                  most_offset = (int64_t)1 << (world->vertex_bits + world->grid_fraction - 2);
    const int64_t offset = round_up(least, LENGTH_BITS - world->grid_fraction);
    found.offset = (uint64_t)(offset < most_offset ? offset : most_offset);
    for (int axis = 0; axis < 3; ++axis) {
        const int64_t first = (low[axis] - 2 * least) >> (world->vertex_bits + LENGTH_BITS - CELL_BITS);
        const int64_t last = (high[axis] + 2 * least) >> (world->vertex_bits + LENGTH_BITS - CELL_BITS);
        to[axis] = first > 0 ? (uint32_t)first : 0;
        to[3 + axis] = (uint32_t)(last < cells ? last : cells);
        found.low[axis] = (int32_t)(low[axis] >= unit ? (low[axis] >> LENGTH_BITS) - 1 : 0);
        const int64_t end = round_up(high[axis], LENGTH_BITS) + 1;
        found.high[axis] = (int32_t)(end < cube / unit ? end : cube / unit - 1);
    }
    *instance = found;
    return COLONNADE_OK;
}

struct colonnade_shared colonnade_find_shared(const struct colonnade_instance *instances, uint32_t count) {
    struct colonnade_shared shared = {{0}, {0}, 0};
    for (uint32_t i = 0; i < count; ++i) {
        const struct colonnade_instance *one = &instances[i];
        for (int axis = 0; axis < 3; ++axis) {
            if (i == 0 || one->low[axis] < shared.low[axis]) shared.low[axis] = one->low[axis];
            if (i == 0 || one->high[axis] > shared.high[axis]) shared.high[axis] = one->high[axis];
        }
        if (one->offset > shared.offset) shared.offset = one->offset;
    }
    return shared;
}
