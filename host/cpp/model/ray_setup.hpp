// RayGenerator and RaySetup: docs/numbers.md, sections 1 and 2.
#pragma once
#include <algorithm>
#include <utility>

#include "formats.hpp"

namespace colonnade {

using WideVector = std::array<Wide, 3>;

/// A ray as it is asked for. Origin: scene position, grid steps; direction: any scale; limit: largest t, along the dominant axis, grid steps.
struct RayRequest {
    WideVector origin, direction;
    Wide limit;
    std::uint64_t limitId;
};

/// A ray ready for traversal, in its permuted frame (x', y', then the dominant axis z'); numbers.md 2 names the fields.
struct Ray {
    bool enters;
    int axis;
    std::array<bool, 3> negative;
    Vector origin;
    Vector boxOrigin;
    std::array<std::int64_t, 2> shear, reciprocal;
    std::array<int, 2> exponent;
    std::int64_t entry;
    std::int64_t limit;
    std::uint64_t limitId;

    /// Component `axis` of the object's frame that is component `permuted` of the ray's.
    int objectAxis(int permuted) const { return (axis + 1 + permuted) % 3; }
};

/// A slab's two crossings by a ray, in units.
struct Crossing {
    Wide near, far;
};

/// Crossings of the planes low..high on one axis; `pad` widens the slab on both sides. Dominant axis: no reciprocal.
inline Crossing crossDominant(Wide low, Wide high, Wide origin, bool negative, Wide pad) {
    return negative ? Crossing{origin - high - pad, origin - low + pad} : Crossing{low - origin - pad, high - origin + pad};
}

inline Crossing crossSheared(Wide low, Wide high, Wide origin, bool negative, Wide pad, std::int64_t reciprocal, int drop) {
    const Crossing distance = crossDominant(low, high, origin, negative, pad);
    return {floorShift<Wide>(distance.near * reciprocal, drop), floorShift<Wide>(distance.far * reciprocal, drop) + 1};
}

/// The root's tight box, units.
struct Bounds {
    Vector low, high;
};

inline std::int64_t boxOrigin(Wide origin, const Numbers& n) { return static_cast<std::int64_t>(nearestEven(origin, n.gridFraction)); }

/// Dominant axis: largest magnitude, ties to the lowest axis.
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

    // Where the ray enters the object's box
    const Wide pad = n.boxPad(), maximum = (Wide(1) << n.entryBits) - 1;
    const auto saturate = [&](Wide distance) { return clamp<Wide>(distance, -maximum, maximum); };
    const auto slack = [&](Wide distance) { return distance > 0 ? distance >> n.entrySlackShift : Wide(0); };
    const auto low = [&](int a) { return Wide(bounds.low[ray.objectAxis(a)]); };
    const auto high = [&](int a) { return Wide(bounds.high[ray.objectAxis(a)]); };
    const Crossing along = crossDominant(low(2), high(2), boxOrigin(origin[2], n), ray.negative[2], pad);
    Wide near = std::max<Wide>(0, along.near), far = along.far;
    const Wide sidePad = pad + (near >> n.vertexBits);
    for (int a = 0; a < 2; ++a) {
        const Crossing side = crossSheared(low(a), high(a), boxOrigin(origin[a], n), ray.negative[a], sidePad, ray.reciprocal[a],
                                           n.reciprocalFraction - ray.exponent[a]);
        const Wide sideNear = saturate(side.near), sideFar = saturate(side.far);
        near = std::max(near, sideNear - slack(sideNear));
        far = std::min(far, saturate(sideFar + slack(sideFar)));
    }
    ray.enters = near <= far;
    if (!ray.enters) return ray;
    if (n.gridFraction < 0) near = (near >> -n.gridFraction) << -n.gridFraction;
    ray.entry = static_cast<std::int64_t>(near);

    // Advance the origin to there
    const Wide entrySteps = floorShift<Wide>(near, -n.gridFraction);
    const auto inReach = [&](Wide position) {
        const Wide half = floorShift<Wide>(Wide(1) << (n.vertexBits - 1), -n.gridFraction);
        return static_cast<std::int64_t>(clamp<Wide>(position, -half, 3 * half));
    };
    for (int a = 0; a < 2; ++a) ray.origin[a] = inReach(origin[a] + nearestEven<Wide>(Wide(ray.shear[a]) * near, n.vertexBits + 1));
    ray.origin[2] = inReach(ray.negative[2] ? origin[2] - entrySteps : origin[2] + entrySteps);
    for (int a = 0; a < 3; ++a) ray.boxOrigin[a] = boxOrigin(ray.origin[a], n);
    ray.limit = static_cast<std::int64_t>(clamp<Wide>(request.limit - entrySteps, 0, n.farthest()));
    return ray;
}

} // namespace colonnade
