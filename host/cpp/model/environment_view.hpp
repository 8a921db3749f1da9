// A room as the march sees it: its registers, rays in its maps, and the points that they meet. docs/background.md.
#pragma once
#include "shading.hpp"

namespace colonnade {

/// The frame registers of a room, decoded. A position P in grid steps has the projection p = matrix · P + (offset << offsetShift), in steps of
/// 2^-exponent: it is seen at the map's pixel 1024 · (p0, p1) / p2, and its inverse depth is w = 1 / p2.
struct EnvironmentView {
    std::array<Vector, 3> matrix, rotation;
    Vector offset;
    /// Counts as sceneBits above that.
    int offsetShift;
    int exponent;
    /// Count as all that there are above that.
    int boundingPlanes;
    std::array<std::int64_t, 2> step;
    /// Pixels that show the room itself: x0, y0, x1, y1, the latter exclusive.
    std::array<std::int64_t, 4> window;

    bool shows(std::int64_t x, std::int64_t y) const { return x >= window[0] && x < window[2] && y >= window[1] && y < window[3]; }
};

/// What a point of the room is made of; the normal in object space, 11 fraction bits.
struct EnvironmentTexel {
    Colour albedo;
    Vector normal;
    /// A word was read beyond a heap.
    bool isIllegal;
};

/// Where a ray meets the room: it has the albedo and the normal of pixel (x, y), or of a shell's entry. The way there is travel · 2^travelExponent
/// times the ray's direction. `isHidden`: on the extension of a surface that something else hides.
struct EnvironmentPoint {
    enum class Kind { nothing, map, boundingPlane } kind;
    int x, y, entry;
    bool isHidden;
    std::int64_t travel;
    int travelExponent;
    int steps;
    /// A word was read beyond the heap of the planes, on the way or at its end.
    bool isIllegal;
};

/// A ray as the map sees it: straight in (u, v, w), shadeBits fraction bits each, u and v in units of 1024 pixels. `from` and `towards` are the
/// projections of its origin and direction, each shifted down by its shift; without `isInFront` the origin is behind the camera.
struct MapRay {
    bool isInFront;
    Vector position, direction;
    Vector from, dir;
    int fromShift, dirShift, directionShift;
};

/// Scales a vector so that its components take `bits` bits and a sign; returns by how many bits it was shifted down.
inline int blockScale(const WideVector& v, int bits, Vector& scaled) {
    int length = 0;
    for (const Wide component : v) length = std::max(length, bitLength(UnsignedWide(component < 0 ? ~component : component)));
    for (int a = 0; a < 3; ++a) scaled[a] = static_cast<std::int64_t>(floorShift(v[a], length - bits));
    return length - bits;
}

} // namespace colonnade
