// RayGenerator and RaySetup (docs/numbers.md, sections 1 and 2).
#pragma once
#include <algorithm>
#include <utility>

#include "formats.hpp"

namespace colonnade {

using WideVector = std::array<Wide, 3>;

/// A requested ray. The origin is a scene position in grid steps, the direction has any scale, tMax is along the dominant axis in grid steps.
struct RayRequest {
    WideVector origin, direction;
    Wide tMax;
    std::uint64_t limitId;
};

/// A prepared ray in its permuted frame (x', y', then the dominant axis z'). docs/numbers.md, section 2, defines the fields.
struct Ray {
    bool enters;
    int axis;
    std::array<bool, 3> negative;
    Vector origin;
    Vector boxOrigin;
    std::array<std::int64_t, 2> shear, reciprocal;
    std::array<int, 2> exponent;
    std::int64_t tEntry;
    std::int64_t tMax;
    std::uint64_t limitId;

    /// The object's axis that component `permuted` of the ray's frame is on.
    int objectAxis(int permuted) const { return (axis + 1 + permuted) % 3; }
};

/// A ray's entry to and exit from a slab, vertex units.
struct Crossing {
    Wide tNear, tFar;
};

/// Intersects the slab low..high on one axis; `pad` widens it on both sides. The dominant axis needs no reciprocal.
inline Crossing crossDominant(Wide low, Wide high, Wide origin, bool negative, Wide pad) {
    return negative ? Crossing{origin - high - pad, origin - low + pad} : Crossing{low - origin - pad, high - origin + pad};
}

inline Crossing crossSheared(Wide low, Wide high, Wide origin, bool negative, Wide pad, std::int64_t reciprocal, int drop) {
    const Crossing distance = crossDominant(low, high, origin, negative, pad);
    return {floorShift<Wide>(distance.tNear * reciprocal, drop), floorShift<Wide>(distance.tFar * reciprocal, drop) + 1};
}

/// The object's bounding box, vertex units.
struct Bounds {
    Vector low, high;
};

inline std::int64_t boxOrigin(Wide origin, const Numbers& n) { return static_cast<std::int64_t>(nearestEven(origin, n.gridFraction)); }

/// The axis of largest magnitude; ties go to the lowest axis.
inline int dominantAxis(const WideVector& direction) {
    int axis = 0;
    for (int other = 1; other < 3; ++other)
        if (magnitude(direction[other]) > magnitude(direction[axis])) axis = other;
    return axis;
}

inline Ray prepareRay(const RayRequest& request, const Bounds& bounds, const Numbers& n) {
    Ray ray{};
    ray.limitId = request.limitId;
    ray.axis = dominantAxis(request.direction);
    if (request.direction[ray.axis] == 0) return ray;

    // Shear factors and reciprocals
    const Normalised dominant = normalise(magnitude(request.direction[ray.axis]), n.mantissaBits);
    WideVector origin;
    for (int a = 0; a < 3; ++a) {
        origin[a] = request.origin[ray.objectAxis(a)];
        ray.negative[a] = request.direction[ray.objectAxis(a)] < 0;
    }
    for (int a = 0; a < 2; ++a) {
        const Wide component = request.direction[ray.objectAxis(a)];
        const Normalised minor = normalise(magnitude(component), n.mantissaBits);
        const int exponent = dominant.exponent - minor.exponent;
        if (component != 0) {
            const std::uint64_t quotient = divide(minor.mantissa, dominant.mantissa, n.shearDigits);
            const auto shear = static_cast<std::int64_t>(floorShift<Wide>(Wide(quotient) << (n.shearFraction - n.shearDigits), exponent));
            ray.shear[a] = component < 0 ? -shear : shear;
        }
        if (component == 0 || exponent > n.reciprocalFraction) {
            ray.reciprocal[a] = std::int64_t(1) << n.reciprocalFraction;
            ray.exponent[a] = n.reciprocalFraction;
        } else {
            ray.reciprocal[a] = static_cast<std::int64_t>(divide(dominant.mantissa, minor.mantissa, n.reciprocalDigits)
                                                          << (n.reciprocalFraction - n.reciprocalDigits));
            ray.exponent[a] = exponent;
        }
    }

    // Intersect the object's box
    const Wide pad = n.boxPad(), maximum = (Wide(1) << n.entryBits) - 1;
    const auto saturate = [&](Wide distance) { return clamp<Wide>(distance, -maximum, maximum); };
    const auto slack = [&](Wide distance) { return distance > 0 ? distance >> n.entrySlackShift : Wide(0); };
    const auto low = [&](int a) { return Wide(bounds.low[ray.objectAxis(a)]); };
    const auto high = [&](int a) { return Wide(bounds.high[ray.objectAxis(a)]); };
    const Crossing along = crossDominant(low(2), high(2), boxOrigin(origin[2], n), ray.negative[2], pad);
    Wide tNear = std::max<Wide>(0, along.tNear), tFar = along.tFar;
    const Wide sidePad = pad + (tNear >> n.vertexBits);
    for (int a = 0; a < 2; ++a) {
        const Crossing side = crossSheared(low(a), high(a), boxOrigin(origin[a], n), ray.negative[a], sidePad, ray.reciprocal[a],
                                           n.reciprocalFraction - ray.exponent[a]);
        const Wide sideTNear = saturate(side.tNear), sideTFar = saturate(side.tFar);
        tNear = std::max(tNear, sideTNear - slack(sideTNear));
        tFar = std::min(tFar, saturate(sideTFar + slack(sideTFar)));
    }
    ray.enters = tNear <= tFar;
    if (!ray.enters) return ray;
    if (n.gridFraction < 0) tNear = (tNear >> -n.gridFraction) << -n.gridFraction;
    ray.tEntry = static_cast<std::int64_t>(tNear);

    // Advance the origin to the entry point
    const Wide entrySteps = floorShift<Wide>(tNear, -n.gridFraction);
    const auto inReach = [&](Wide position) {
        const Wide half = floorShift<Wide>(Wide(1) << (n.vertexBits - 1), -n.gridFraction);
        return static_cast<std::int64_t>(clamp<Wide>(position, -half, 3 * half));
    };
    for (int a = 0; a < 2; ++a) ray.origin[a] = inReach(origin[a] + nearestEven<Wide>(Wide(ray.shear[a]) * tNear, n.vertexBits + 1));
    ray.origin[2] = inReach(ray.negative[2] ? origin[2] - entrySteps : origin[2] + entrySteps);
    for (int a = 0; a < 3; ++a) ray.boxOrigin[a] = boxOrigin(ray.origin[a], n);
    ray.tMax = static_cast<std::int64_t>(clamp<Wide>(request.tMax - entrySteps, 0, n.maxT()));
    return ray;
}

} // namespace colonnade
