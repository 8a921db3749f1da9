// RayGenerator and RaySetup (docs/numbers.md, sections 1 and 2).
#pragma once
#include <algorithm>
#include <utility>

#include "formats.hpp"

namespace colonnade {

using WideVector = std::array<Wide, 3>;

/// A requested ray. The origin is a scene position in grid steps, the direction has any scale, tMin and tMax are along
/// the dominant axis in grid steps.
struct RayRequest {
    WideVector origin, direction;
    Wide tMax, tMin = 0;
};

/// A prepared ray in its permuted frame (x', y', then the dominant axis z'). docs/numbers.md, section 2, defines the
/// fields.
struct Ray {
    bool enters;
    int axis;
    std::array<bool, 3> negative;
    Vector origin;
    Vector boxOrigin;
    std::array<std::int64_t, 2> shear, reciprocal;
    std::array<int, 2> exponent;
    std::int64_t tEntry;
    std::int64_t tMax, tMin;

    /// The object's axis that component `permuted` of the ray's frame is on.
    int objectAxis(int permuted) const {
        const int next = axis + 1 + permuted;
        return next < 3 ? next : next - 3;
    }
};

/// A ray's entry to and exit from a slab along one axis, vertex units.
template <class Integer> struct Crossing {
    Integer tNear, tFar;
};

/// Intersects the slab low..high on one axis; `pad` widens it on both sides.
template <class Integer>
Crossing<Integer> crossSlab(Integer low, Integer high, Integer origin, bool negative, Integer pad) {
    return negative ? Crossing<Integer>{origin - high - pad, origin - low + pad}
                    : Crossing<Integer>{low - origin - pad, high - origin + pad};
}

/// The object's bounding box, vertex units.
struct Bounds {
    Vector low, high;
};

template <class Integer> std::int64_t boxOrigin(Integer origin, const Numbers& n) {
    return static_cast<std::int64_t>(nearestEven(origin, n.gridFraction));
}

/// The axis of largest magnitude; ties go to the lowest axis.
inline int dominantAxis(const WideVector& direction) {
    int axis = 0;
    for (int other = 1; other < 3; ++other)
        if (magnitude(direction[other]) > magnitude(direction[axis])) axis = other;
    return axis;
}

/// Intersects a ray of known direction with the object's box and advances it to its entry. `Integer` holds the products
/// of positions.
template <class Integer> void enterBox(Ray& ray, const RayRequest& request, const Bounds& bounds, const Numbers& n) {
    std::array<Integer, 3> origin;
    for (int a = 0; a < 3; ++a) origin[a] = static_cast<Integer>(request.origin[ray.objectAxis(a)]);
    const Integer pad = n.boxPad(), maximum = (Integer(1) << n.entryBits) - 1;
    const auto saturate = [&](Integer distance) { return clamp<Integer>(distance, -maximum, maximum); };
    const auto slack = [&](Integer distance) { return distance > 0 ? distance >> n.entrySlackShift : Integer(0); };
    const auto cross = [&](int a, Integer width) {
        const int axis = ray.objectAxis(a);
        return crossSlab<Integer>(bounds.low[axis], bounds.high[axis], boxOrigin(origin[a], n), ray.negative[a], width);
    };
    const Crossing<Integer> along = cross(2, pad);
    Integer tNear = std::max<Integer>(0, along.tNear), tFar = along.tFar;
    const Integer sidePad = pad + (tNear >> n.vertexBits);
    for (int a = 0; a < 2; ++a) {
        const Crossing<Integer> side = cross(a, sidePad);
        const int drop = n.reciprocalFraction - ray.exponent[a];
        const Integer sideTNear = saturate(floorShift<Integer>(side.tNear * ray.reciprocal[a], drop)),
                      sideTFar = saturate(floorShift<Integer>(side.tFar * ray.reciprocal[a], drop) + 1);
        tNear = std::max(tNear, sideTNear - slack(sideTNear));
        tFar = std::min(tFar, saturate(sideTFar + slack(sideTFar)));
    }
    tNear = std::max(tNear, saturate(floorShift(static_cast<Integer>(request.tMin), n.gridFraction)));
    ray.enters = tNear <= tFar;
    if (!ray.enters) return;
    if (n.gridFraction < 0) tNear = (tNear >> -n.gridFraction) << -n.gridFraction;
    ray.tEntry = static_cast<std::int64_t>(tNear);

    // Advance the origin to the entry point
    const Integer entrySteps = floorShift<Integer>(tNear, -n.gridFraction);
    const auto inReach = [&](Integer position) {
        const Integer half = floorShift<Integer>(Integer(1) << (n.vertexBits - 1), -n.gridFraction);
        return static_cast<std::int64_t>(clamp<Integer>(position, -half, 3 * half));
    };
    for (int a = 0; a < 2; ++a)
        ray.origin[a] = inReach(origin[a] + nearestEven<Integer>(ray.shear[a] * tNear, n.vertexBits + 1));
    ray.origin[2] = inReach(ray.negative[2] ? origin[2] - entrySteps : origin[2] + entrySteps);
    for (int a = 0; a < 3; ++a) ray.boxOrigin[a] = boxOrigin(ray.origin[a], n);
    ray.tMax = static_cast<std::int64_t>(clamp<Integer>(static_cast<Integer>(request.tMax) - entrySteps, 0, n.maxT()));
    ray.tMin = static_cast<std::int64_t>(clamp<Integer>(static_cast<Integer>(request.tMin) - entrySteps, 0, n.maxT()));
}

/// Whether 64 bits hold the numbers of `enterBox`: not in wide formats, or from far away.
inline bool isNarrow(const RayRequest& request, const Numbers& n) {
    UnsignedWide all = 0;
    for (const Wide position : request.origin) all |= magnitude(position);
    const int bits = bitLength(all), unitBits = std::max(bits - n.gridFraction, n.vertexBits) + 3;
    return std::max({bits, bitLength(magnitude(request.tMax)), bitLength(magnitude(request.tMin)),
                     unitBits + n.reciprocalFraction, n.shearFraction + n.entryBits, n.gridFraction + n.entryBits,
                     n.gridBits}) < 60;
}

/// Writes the fields of a ray that the request sets; one that does not enter has others as they were.
inline void prepareRay(const RayRequest& request, const Bounds& bounds, const Numbers& n, Ray& ray) {
    ray.axis = dominantAxis(request.direction);
    ray.enters = false;
    if (request.direction[ray.axis] == 0) return;

    // Shear factors and reciprocals
    const Normalised dominant = normalise(magnitude(request.direction[ray.axis]), n.mantissaBits);
    for (int a = 0; a < 3; ++a) ray.negative[a] = request.direction[ray.objectAxis(a)] < 0;
    for (int a = 0; a < 2; ++a) {
        const Wide component = request.direction[ray.objectAxis(a)];
        const Normalised minor = normalise(magnitude(component), n.mantissaBits);
        const int exponent = dominant.exponent - minor.exponent;
        ray.shear[a] = 0;
        if (component != 0) {
            const std::uint64_t quotient = divide(minor.mantissa, dominant.mantissa, n.shearDigits);
            const auto shear = static_cast<std::int64_t>(
                floorShift<Wide>(Wide(quotient) << (n.shearFraction - n.shearDigits), exponent));
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
    if (isNarrow(request, n)) enterBox<std::int64_t>(ray, request, bounds, n);
    else enterBox<Wide>(ray, request, bounds, n);
}

inline Ray prepareRay(const RayRequest& request, const Bounds& bounds, const Numbers& n) {
    Ray ray{};
    prepareRay(request, bounds, n, ray);
    return ray;
}

} // namespace colonnade
