// Exact integer arithmetic of the datapaths (docs/numbers.md, "Rounding").
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <type_traits>

namespace colonnade {

using Wide = __int128;
using UnsignedWide = unsigned __int128;

/// The unsigned integer of a signed one's size.
template <class Integer> using UnsignedOf =
    std::conditional_t<sizeof(Integer) == sizeof(Wide), UnsignedWide, std::uint64_t>;

/// Number of bits of x; 0 for 0.
inline int bitLength(UnsignedWide x) {
    const auto high = static_cast<std::uint64_t>(x >> 64), low = static_cast<std::uint64_t>(x);
    return high ? 128 - __builtin_clzll(high) : low ? 64 - __builtin_clzll(low) : 0;
}

template <class Integer> UnsignedOf<Integer> magnitude(Integer x) {
    return x < 0 ? -static_cast<UnsignedOf<Integer>>(x) : static_cast<UnsignedOf<Integer>>(x);
}

/// x · 2^bits, modulo the integer's range.
template <class Integer> Integer shiftLeft(Integer x, int bits) {
    return bits >= static_cast<int>(8 * sizeof(Integer))
               ? Integer(0)
               : static_cast<Integer>(static_cast<UnsignedOf<Integer>>(x) << bits);
}

/// The low `bits` bits of x as a signed number, as in a register of that width.
inline Wide wrapped(Wide x, int bits) { return shiftLeft<Wide>(x, 128 - bits) >> (128 - bits); }

/// x / 2^bits rounded towards minus infinity; a left shift for negative `bits`.
template <class Integer> Integer floorShift(Integer x, int bits) {
    if (bits <= 0) return shiftLeft(x, -bits);
    return bits >= static_cast<int>(8 * sizeof(Integer)) ? (x < 0 ? Integer(-1) : Integer(0)) : x >> bits;
}

/// floorShift(x, bits) for x within the bits of `all`, where the result fits 64 bits; faster if `all` fits 62.
inline std::int64_t shiftToFit(Wide x, int bits, UnsignedWide all) {
    return all >> 62 == 0 ? floorShift(static_cast<std::int64_t>(x), bits)
                          : static_cast<std::int64_t>(floorShift(x, bits));
}

/// x / 2^bits rounded to nearest, ties to even; a left shift for negative `bits`.
template <class Integer> Integer nearestEven(Integer x, int bits) {
    if (bits <= 0) return floorShift(x, bits);
    const Integer quotient = x >> bits, rest = x & ((Integer(1) << bits) - 1), half = Integer(1) << (bits - 1);
    return quotient + (rest + (quotient & 1) > half);
}

template <class Integer> Integer clamp(Integer x, Integer low, Integer high) {
    return x < low ? low : x > high ? high : x;
}

/// Largest value of a signed number of `bits` bits.
inline Wide largest(int bits) { return (Wide(1) << (bits - 1)) - 1; }

/// x = mantissa * 2^(exponent - bits) with the mantissa's top bit set, rounded down; both are 0 for x = 0.
struct Normalised {
    std::uint64_t mantissa;
    int exponent;
};

inline Normalised normalise(UnsignedWide x, int bits) {
    const int exponent = bitLength(x);
    const int drop = exponent - bits;
    if (exponent > 64) return {static_cast<std::uint64_t>(drop >= 0 ? x >> drop : x << -drop), exponent};
    const auto low = static_cast<std::uint64_t>(x);
    return {low == 0 ? 0 : drop >= 0 ? low >> drop : low << -drop, exponent};
}

/// floor(numerator * 2^digits / denominator) for mantissas of at most 32 bits; 0 for a zero denominator.
inline std::uint64_t divide(std::uint64_t numerator, std::uint64_t denominator, int digits) {
    if (denominator == 0) return 0;
    return (numerator << digits) / denominator;
}

/// floor(sqrt(radicand)): by floating point, corrected.
inline std::uint64_t squareRoot(std::uint64_t radicand) {
    auto root =
        std::min<std::uint64_t>(0xffffffff, static_cast<std::uint64_t>(std::sqrt(static_cast<double>(radicand))));
    while (root * root > radicand) --root;
    while (root < 0xffffffff && (root + 1) * (root + 1) <= radicand) ++root;
    return root;
}

} // namespace colonnade
