// The environment's registers, rays projected to its maps, and points where rays hit it (docs/background.md).
#pragma once
#include "shading.hpp"

namespace colonnade {

/// The decoded frame registers of an environment. A position P in grid steps projects to p = matrix · P + (offset <<
/// offsetShift), in units of 2^-exponent. Its pixel in the map is 1024 · (p0, p1) / p2, and its inverse depth is w = 1
/// / p2.
struct EnvironmentView {
    std::array<Vector, 3> matrix, rotation;
    Vector offset;
    /// Values above sceneBits count as sceneBits.
    int offsetShift;
    int exponent;
    /// Values above the number of planes count as all planes.
    int boundingPlanes;
    std::array<std::int64_t, 2> step;
    /// Pixels that show the environment itself: x0, y0, x1, y1, the latter two exclusive.
    std::array<std::int64_t, 4> window;
    /// The environment may hide the object; by how much its point must then be nearer, grid steps along the ray's
    /// dominant axis.
    bool occlusion;
    std::int64_t occlusionTolerance;
    /// The frame's camera took the maps; otherwise its rays march.
    bool isMapCamera;

    bool shows(std::int64_t x, std::int64_t y) const {
        return x >= window[0] && x < window[2] && y >= window[1] && y < window[3];
    }
};

/// Albedo and normal of an environment point; the normal is in object space, 11 fraction bits.
struct EnvironmentTexel {
    Colour albedo;
    Vector normal;
    /// A word beyond a heap was read.
    bool isIllegal;
};

/// What of the environment a ray hits.
enum class HitKind { miss, map, boundingPlane };

/// What a march has done, for the cycle model: tiles of one plane, tiles of several planes with the planes that are
/// looked at there, tiles that are passed cell by cell, cells, planes that are none of the last four, squares passed
/// behind the visible surfaces, bounding planes with approached ones; and planes that a camera's origin is outside of.
struct MarchWork {
    std::uint16_t flatTiles, tiles, planes, cellTiles, cells, fetches, behind, boundingPlanes, approached, outside;
    bool isFromCamera;
    std::array<int, 4> last;
    int oldest;

    /// A plane is looked up.
    void lookUp(int id) {
        if (std::find(last.begin(), last.end(), id + 1) != last.end()) return;
        last[static_cast<std::size_t>(oldest++ & 3)] = id + 1;
        ++fetches;
    }
};

/// The point where a ray hits the environment, with the albedo and normal of pixel (x, y) or of a bounding plane's
/// entry. Its distance from the origin is travel · 2^travelExponent ray directions. `isHidden`: the point is on the
/// extension of an occluded surface.
struct EnvironmentPoint {
    HitKind kind;
    int x, y, entry;
    bool isHidden;
    std::int64_t travel;
    int travelExponent;
    int steps;
    MarchWork work;
    /// A word beyond the planes' heap was read on the way.
    bool isIllegal;
};

/// A ray in map space, where it is straight: (u, v, w) with shadeBits fraction bits, u and v in units of 1024 pixels.
/// `from` and `dir` are the projected origin and direction, shifted right by `fromShift` and `dirShift`. Without
/// `isInFront` the origin is behind the camera.
struct MapRay {
    bool isInFront;
    Vector position, direction;
    Vector from, dir;
    int fromShift, dirShift, directionShift;
};

/// Scales a vector so that its components fit `bits` bits and a sign, as if one of them had at least `length` bits;
/// returns the right shift.
inline int blockScale(const WideVector& v, int bits, Vector& scaled, int length = 0) {
    UnsignedWide all = 0;
    for (const Wide component : v) all |= UnsignedWide(component ^ (component >> 127));
    length = std::max(length, bitLength(all));
    for (int a = 0; a < 3; ++a) scaled[a] = shiftToFit(v[a], length - bits, all);
    return length - bits;
}

} // namespace colonnade
