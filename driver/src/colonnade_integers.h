/* SPDX-License-Identifier: Apache-2.0 */
/* Arithmetic of colonnade_view, colonnade_mesh and colonnade_instances. */
#ifndef COLONNADE_INTEGERS_H
#define COLONNADE_INTEGERS_H

#include "colonnade_view.h"

_Static_assert(-3 >> 1 == -2, "right shifts of negative numbers go towards minus infinity");

static inline uint64_t colonnade_magnitude(int64_t value) { return value < 0 ? 0 - (uint64_t)value : (uint64_t)value; }

static inline int64_t colonnade_signed(uint64_t magnitude, bool is_negative) {
    return is_negative ? -(int64_t)magnitude : (int64_t)magnitude;
}

static inline int colonnade_bit_length(uint64_t value) {
    uint32_t half = (uint32_t)(value >> 32);
    int length = half != 0 ? 32 : 0;
    if (half == 0) half = (uint32_t)value;
    for (int step = 16; step > 0; step >>= 1)
        if (half >> step != 0) half >>= step, length += step;
    return length + (half != 0);
}

/* The bit length of the largest magnitude. */
static inline int colonnade_block_length(const int64_t vector[3]) {
    return colonnade_bit_length(colonnade_magnitude(vector[0]) | colonnade_magnitude(vector[1]) |
                                colonnade_magnitude(vector[2]));
}

static inline uint64_t colonnade_largest(const int64_t vector[3]) {
    uint64_t most = 0;
    for (int axis = 0; axis < 3; ++axis) {
        const uint64_t size = colonnade_magnitude(vector[axis]);
        if (size > most) most = size;
    }
    return most;
}

static inline int64_t colonnade_shift_left(int64_t value, int bits) { return (int64_t)((uint64_t)value << bits); }

/* value / 2^bits, towards minus infinity. */
static inline int64_t colonnade_floor(int64_t value, int bits) { return value >> (bits < 63 ? bits : 63); }

/* value / 2^bits to nearest; bits may be negative, if the result has 63 bits. |value| < 2^62. */
static inline int64_t colonnade_nearest(int64_t value, int bits) {
    if (bits <= 0) return colonnade_shift_left(value, -bits);
    return bits > 62 ? 0 : colonnade_floor(value + ((int64_t)1 << (bits - 1)), bits);
}

/* The upper 64 bits of a product of 128. */
static inline uint64_t colonnade_multiply_high(uint64_t a, uint64_t b) {
    const uint64_t a0 = (uint32_t)a, a1 = a >> 32, b0 = (uint32_t)b, b1 = b >> 32;
    const uint64_t low = a0 * b0, cross = a1 * b0 + (low >> 32), middle = a0 * b1 + (uint32_t)cross;
    return a1 * b1 + (cross >> 32) + (middle >> 32);
}

/* a * b / 2^64 to within 8: of the lower halves only what signed multiplications of 32 bits give. |a|, |b| <= 2^62. */
static inline int64_t colonnade_product(int64_t a, int64_t b) {
    const int32_t a1 = (int32_t)(a >> 32), b1 = (int32_t)(b >> 32);
    const int32_t a0 = (int32_t)((uint32_t)a >> 1), b0 = (int32_t)((uint32_t)b >> 1);
    const int32_t cross = (int32_t)((int64_t)a1 * b0 >> 32), other = (int32_t)((int64_t)b1 * a0 >> 32);
    return (int64_t)a1 * b1 + 2 * ((int64_t)cross + other);
}

/* 2^126 / value, at most 2^-60 of it less; the top bit of value is set. */
static inline uint64_t colonnade_reciprocal(uint64_t value) {
    const uint64_t first = ((uint64_t)1 << 63) / ((value >> 32) + 1), estimate = first << 31;
    const uint64_t error = ((uint64_t)1 << 62) - colonnade_multiply_high(value, estimate);
    return estimate + (first * error >> 31);
}

/* value * factor * 2^-scale to nearest; `limit`, with the sign of value, if it is larger. |value| < 2^63, limit < 2^62.
 */
static inline int64_t colonnade_scaled(int64_t value, const struct colonnade_factor *factor, int scale, int64_t limit) {
    if (value == 0) return 0;
    const uint64_t size = colonnade_magnitude(value);
    const int up = 64 - colonnade_bit_length(size);
    const uint64_t product = colonnade_multiply_high(size << up, factor->mantissa);
    const int down = scale + up - 64 - factor->exponent;
    uint64_t result = 0;
    if (down < 2) result = (uint64_t)limit;
    else if (down < 64) result = ((product >> (down - 1)) + 1) >> 1;
    if (result > (uint64_t)limit) result = (uint64_t)limit;
    return colonnade_signed(result, value < 0);
}

/* A fraction from -2^31 to 2^31 over a positive number of 31 bits, times 2^exponent: points of a picture are compared
 * without a division. */
struct colonnade_ratio {
    int32_t over, under;
};

static inline bool colonnade_is_less(struct colonnade_ratio a, struct colonnade_ratio b) {
    return (int64_t)a.over * b.under < (int64_t)b.over * a.under;
}

/* floor(ratio * 2^exponent), within +-2^30. */
static inline int32_t colonnade_whole(struct colonnade_ratio ratio, int exponent) {
    const uint64_t size = (colonnade_magnitude(ratio.over) << 32) / (uint32_t)ratio.under;
    const int down = 32 - exponent;
    const uint64_t limit = (uint64_t)1 << 30;
    uint64_t whole;
    if (down <= 0) return ratio.over < 0 ? -(int32_t)limit : size == 0 ? 0 : (int32_t)limit;
    if (down > 63) whole = 0;
    else whole = size >> down;
    if (whole >= limit) return ratio.over < 0 ? -(int32_t)limit : (int32_t)limit;
    return ratio.over < 0 ? -(int32_t)whole - 1 : (int32_t)whole;
}

/* A rectangle in a picture. */
struct colonnade_extent {
    struct colonnade_ratio low[2], high[2];
    bool is_empty;
};

/* Widens a rectangle to the point (point[0], point[1]) / point[2]. Answers whether the point lies before the eye, by
 * more than 2^-20 of its distance from it. |point| < 2^63. */
static inline bool colonnade_include(struct colonnade_extent *extent, const int64_t point[3]) {
    const int down = colonnade_block_length(point) - 31;
    struct colonnade_ratio ratio[2];
    const int64_t depth = down > 0 ? colonnade_floor(point[2], down) : colonnade_shift_left(point[2], -down);
    if (depth < 1 << 11) return false;
    for (int i = 0; i < 2; ++i) {
        const int64_t over = down > 0 ? colonnade_floor(point[i], down) : colonnade_shift_left(point[i], -down);
        ratio[i] = (struct colonnade_ratio){(int32_t)over, (int32_t)depth};
    }
    for (int i = 0; i < 2; ++i) {
        if (extent->is_empty || colonnade_is_less(ratio[i], extent->low[i])) extent->low[i] = ratio[i];
        if (extent->is_empty || colonnade_is_less(extent->high[i], ratio[i])) extent->high[i] = ratio[i];
    }
    extent->is_empty = false;
    return true;
}

/* A value of a register of `width` bits. */
static inline uint32_t colonnade_bits(int64_t value, int width) {
    return (uint32_t)value & (width < 32 ? ((uint32_t)1 << width) - 1 : UINT32_MAX);
}

static inline bool colonnade_is_within(int64_t value, int64_t low, int64_t high) {
    return low <= value && value <= high;
}

#endif
