// Normals of a leaf: corner normals by octahedral codes, and the geometric normal of a triangle by its vertices.
#pragma once
#include <cstdlib>

#include "formats.hpp"

namespace colonnade {

/// A direction as a point of the unfolded octahedron: signed numbers of `octahedralBits` bits.
struct Octahedral {
    std::int64_t u, v;

    bool operator==(const Octahedral& other) const { return u == other.u && v == other.v; }
};

constexpr int octahedralBits = 11;
constexpr std::int64_t octahedralOne = (std::int64_t(1) << (octahedralBits - 1)) - 1;

/// A vector of whole numbers, zero or at least 2^9 long, scaled to the length of a stored normal by a table of 128
/// reciprocals of lengths: at most 2^normalFraction − 1 long and less than 1 % shorter, before each component is
/// rounded to nearest.
inline Vector unitLength(const Vector& v, int normalFraction) {
    const auto squared = static_cast<std::uint64_t>(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    const Normalised length = normalise(squared, 7);
    const std::uint64_t one = (std::uint64_t(1) << normalFraction) - 1;
    // A quarter of one / length, for the upper end of the lengths with this mantissa, in a power of 4
    const std::uint64_t factor = squareRoot((one * one << (length.exponent % 2 ? 4 : 3)) / (length.mantissa + 1));
    Vector result;
    for (int a = 0; a < 3; ++a)
        result[a] = nearestEven(v[a] * static_cast<std::int64_t>(factor), (length.exponent + 1) / 2 - 2);
    return result;
}

/// The direction of a code, with the length of a stored normal. The lowest number counts as the one above it.
inline Vector directionOf(const Octahedral& code, int normalFraction) {
    const std::int64_t u = std::min<std::int64_t>(octahedralOne, std::abs(code.u)),
                       v = std::min<std::int64_t>(octahedralOne, std::abs(code.v));
    const std::int64_t z = octahedralOne - u - v, x = z < 0 ? octahedralOne - v : u, y = z < 0 ? octahedralOne - u : v;
    return unitLength({code.u < 0 ? -x : x, code.v < 0 ? -y : y, z}, normalFraction);
}

/// The normal of a triangle by its winding, with the length of a stored normal: the exact cross product of two edges,
/// floored to 13 bits. Zero for a triangle without area.
inline Vector geometricNormal(const std::array<Vector, 3>& vertices, int normalFraction) {
    Vector cross, scaled;
    std::uint64_t lengths = 0;
    for (int a = 0; a < 3; ++a) {
        const int b = (a + 1) % 3, c = (a + 2) % 3;
        cross[a] = (vertices[1][b] - vertices[0][b]) * (vertices[2][c] - vertices[0][c]) -
                   (vertices[1][c] - vertices[0][c]) * (vertices[2][b] - vertices[0][b]);
        lengths |= static_cast<std::uint64_t>(cross[a] < 0 ? ~cross[a] : cross[a]);
    }
    for (int a = 0; a < 3; ++a) scaled[a] = floorShift(cross[a], bitLength(lengths) - 12);
    return unitLength(scaled, normalFraction);
}

} // namespace colonnade
