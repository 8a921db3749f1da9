// Instances: objects of a scene in their own axes (docs/numbers.md, section 10).
#pragma once
#include "traversal.hpp"

namespace colonnade {

/// An object of the scene. `matrix` · 2^−shift leads from world to object, `origin` is the world position of the
/// object's (0, 0, 0), grid steps. `normal` leads back, for normals; 14 fraction bits.
struct Instance {
    std::array<Vector, 3> matrix, normal;
    int shift;
    Vector origin;
    std::size_t root;
    int materialBase;
    Bounds box; ///< in the world, cells of 2^−7 of its edge, inclusive
};

/// A ray in the axes of an object. `length` is its direction's dominant component; a step along it is 2^−`scale` ·
/// length world steps' worth of the ray.
struct ObjectRay {
    RayRequest request;
    Normalised length;
    int scale;
};

namespace instances {

constexpr int matrixBits = 25, normalFraction = 14, cellBits = 7, slopeBits = 6;

/// The box of every object: its whole cube.
inline Bounds cube(const Numbers& n) {
    const std::int64_t last = (std::int64_t(1) << n.vertexBits) - 1;
    return {{0, 0, 0}, {last, last, last}};
}

/// Whether a prepared ray of the world may enter an instance's box before `tMax`, grid steps. In its own frame, in
/// cells: sides are crossed between the entry to the box and the exit along z', by a slope of 6 bits. Distances are
/// rounded outwards.
inline bool mayEnter(const Ray& world, std::int64_t tMax, const Bounds& box, const Numbers& n) {
    const int drop = n.vertexBits + n.gridFraction - cellBits;
    const auto planes = [&](int a, bool negative) {
        const std::int64_t origin = world.origin[a] >> drop;
        return crossSlab<std::int64_t>(box.low[world.objectAxis(a)], box.high[world.objectAxis(a)], origin, negative,
                                       1);
    };
    const std::int64_t limit = (tMax >> drop) + 1;
    const Crossing<std::int64_t> along = planes(2, world.negative[2]);
    if (along.tNear > limit || along.tFar < 0) return false;
    const std::int64_t entry = std::max<std::int64_t>(along.tNear, 0), exit = std::min(along.tFar, limit);
    for (int a = 0; a < 2; ++a) {
        const bool negative = world.shear[a] < 0;
        const std::int64_t steep = world.shear[a] >> (n.shearFraction - slopeBits), slope = negative ? ~steep : steep;
        const Crossing<std::int64_t> side = planes(a, negative);
        if (((entry * slope) >> slopeBits) > side.tFar || ((exit * (slope + 1)) >> slopeBits) + 1 < side.tNear)
            return false;
    }
    return true;
}

inline Wide product(const Vector& row, const WideVector& v) {
    return Wide(row[0]) * v[0] + Wide(row[1]) * v[1] + Wide(row[2]) * v[2];
}

/// x / 2^bits rounded to nearest, ties upwards.
inline Wide nearest(Wide x, int bits) { return (floorShift<Wide>(x, bits - 1) + 1) >> 1; }

/// Bits of the numbers that are divided for distances.
inline int mantissaBits(const Numbers& n) { return std::min(n.mantissaBits, n.distanceDigits + 1); }

/// Bits of a transformed direction that its register drops.
inline int directionDrop(const Numbers& n) { return std::max(0, matrixBits + n.gridBits - n.directionBits); }

/// A bound of distances along an object's ray: no hit before `tMax` in the world is beyond it.
inline Wide limitOf(std::int64_t tMax, const ObjectRay& ray, const Numbers& n) {
    const Wide widened = Wide(tMax) + 8 + (tMax >> std::max(0, n.distanceDigits - 4));
    const Wide limit =
        floorShift<Wide>(widened * (Wide(ray.length.mantissa) + 1), mantissaBits(n) - ray.length.exponent + ray.scale) +
        2;
    return std::min(limit, n.unlimited());
}

/// A prepared ray of the world in the axes of an object, from the same origin. Hits before `tMax` count, grid steps of
/// the world.
inline ObjectRay toObject(const Ray& world, std::int64_t tMax, const Instance& instance, const Numbers& n) {
    const std::int64_t one = std::int64_t(1) << n.shearFraction;
    WideVector fromOrigin, along;
    for (int a = 0; a < 3; ++a) {
        const int axis = world.objectAxis(a);
        fromOrigin[axis] = Wide(world.origin[a]) - instance.origin[axis];
        along[axis] = a < 2 ? world.shear[a] : world.negative[2] ? -one : one;
    }
    const int drop = directionDrop(n);
    ObjectRay ray{};
    for (int a = 0; a < 3; ++a) {
        ray.request.origin[a] = wrapped(nearest(product(instance.matrix[a], fromOrigin), instance.shift), n.sceneBits);
        ray.request.direction[a] = floorShift<Wide>(product(instance.matrix[a], along), drop);
    }
    ray.length = normalise(magnitude(ray.request.direction[dominantAxis(ray.request.direction)]), mantissaBits(n));
    ray.scale = n.shearFraction + instance.shift - drop;
    ray.request.tMax = limitOf(tMax, ray, n);
    return ray;
}

/// The distance of a hit along the ray of the world, from that along the object's.
inline std::int64_t toWorld(Wide distance, const ObjectRay& ray, const Numbers& n) {
    const Normalised dividend = normalise(static_cast<UnsignedWide>(distance), mantissaBits(n));
    const Wide quotient = divide(dividend.mantissa, ray.length.mantissa, n.distanceDigits);
    const int shift = n.distanceDigits - (dividend.exponent - ray.length.exponent) - ray.scale;
    if (quotient != 0 && bitLength(static_cast<UnsignedWide>(quotient)) - shift >= n.gridBits) return n.maxT();
    return static_cast<std::int64_t>(floorShift<Wide>(quotient, shift));
}

/// A normal in the world.
inline Vector toWorld(const Vector& normal, const Instance& instance, const Numbers& n) {
    const Wide longest = (Wide(1) << n.normalFraction) - 1;
    const WideVector wide = {normal[0], normal[1], normal[2]};
    Vector rotated;
    for (int a = 0; a < 3; ++a)
        rotated[a] = static_cast<std::int64_t>(
            clamp(nearestEven<Wide>(product(instance.normal[a], wide), normalFraction), -longest, longest));
    return rotated;
}

/// A face in the world.
inline Face toWorld(Face face, const Instance& instance, const Numbers& n) {
    for (Vector& normal : face.normals) normal = toWorld(normal, instance, n);
    face.geometricNormal = toWorld(face.geometricNormal, instance, n);
    face.material = (face.material + instance.materialBase) & 0xff;
    return face;
}

} // namespace instances
} // namespace colonnade
