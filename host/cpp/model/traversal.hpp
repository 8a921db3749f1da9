// BoxUnit and TriangleUnit (docs/numbers.md, sections 3 and 4).
#pragma once
#include "ray_setup.hpp"

namespace colonnade {

/// The closest hit of a ray so far.
struct Hit {
    bool found;
    std::int64_t t;
    std::uint64_t id;
    std::array<std::int64_t, 3> weights;
    bool backSide;
};

/// tMax in vertex units, rounded up and padded: the largest `tNear` of a box that may contain a closer hit.
inline std::int64_t tMaxUnits(std::int64_t tMax, const Numbers& n) {
    const Wide units = floorShift<Wide>(tMax, n.gridFraction) + 1 + n.boxPad();
    return static_cast<std::int64_t>(std::min<Wide>(units, largest(n.boxDistanceBits)));
}

/// A child box that the ray hits.
struct Entered {
    int slot;
    std::int64_t tNear;
};

/// Tests a node's children; writes the hit ones in order of tNear and returns their number. `tests` counts the tested children.
inline int testBoxes(const Ray& ray, const Node& node, std::int64_t tMax, const Numbers& n, std::array<Entered, 4>& entered, std::uint64_t& tests) {
    const std::int64_t maximum = static_cast<std::int64_t>(largest(n.boxDistanceBits)), tMaxInUnits = tMaxUnits(tMax, n);
    int count = 0;
    for (int slot = 0; slot < n.arity; ++slot) {
        if (node.kinds[slot] != Child::node && node.kinds[slot] != Child::leaf) continue;
        ++tests;
        std::int64_t tNear = 0, tFar = maximum;
        for (int a = 0; a < 3; ++a) {
            const int axis = ray.objectAxis(a);
            const std::int64_t origin = node.origin[axis] - ray.boxOrigin[a];
            const std::int64_t low = origin + (std::int64_t(node.low[slot][axis]) << node.exponent[axis]);
            const std::int64_t high = origin + (std::int64_t(node.high[slot][axis]) << node.exponent[axis]);
            std::int64_t first = (ray.negative[a] ? -high : low) - n.boxPad(), last = (ray.negative[a] ? -low : high) + n.boxPad();
            if (a < 2) {
                const int drop = n.reciprocalFraction - ray.exponent[a];
                first = (first * ray.reciprocal[a]) >> drop;
                last = ((last * ray.reciprocal[a]) >> drop) + 1;
            }
            tNear = std::max(tNear, clamp(first, -maximum - 1, maximum));
            tFar = std::min(tFar, clamp(last, -maximum - 1, maximum));
        }
        if (tNear > tFar || tNear > tMaxInUnits) continue;
        int position = count++;
        for (; position > 0 && entered[position - 1].tNear > tNear; --position) entered[position] = entered[position - 1];
        entered[position] = {slot, tNear};
    }
    return count;
}

/// Tests a triangle; true if it is the closest hit so far, and then updates `best`, which initially holds the ray's limits.
template <class Product> bool testTriangle(const Ray& ray, const std::array<Vector, 3>& vertices, std::uint64_t id, const Numbers& n, Hit& best) {
    std::array<std::int64_t, 3> x, y, z;
    for (int i = 0; i < 3; ++i) {
        Vector p;
        for (int a = 0; a < 3; ++a) {
            const std::int64_t vertex = vertices[i][ray.objectAxis(a)];
            p[a] = (n.gridFraction >= 0 ? vertex << n.gridFraction : nearestEven(vertex, -n.gridFraction)) - ray.origin[a];
        }
        z[i] = ray.negative[2] ? -p[2] : p[2];
        x[i] = static_cast<std::int64_t>(p[0] - nearestEven<Product>(Product(ray.shear[0]) * z[i], n.shearFraction));
        y[i] = static_cast<std::int64_t>(p[1] - nearestEven<Product>(Product(ray.shear[1]) * z[i], n.shearFraction));
    }

    const std::array<Product, 3> edges = {Product(x[1]) * y[2] - Product(y[1]) * x[2], Product(x[2]) * y[0] - Product(y[2]) * x[0],
                                          Product(x[0]) * y[1] - Product(y[0]) * x[1]};
    const bool anyNegative = edges[0] < 0 || edges[1] < 0 || edges[2] < 0, anyPositive = edges[0] > 0 || edges[1] > 0 || edges[2] > 0;
    if (anyNegative == anyPositive) return false;

    std::array<UnsignedWide, 3> areas;
    for (int i = 0; i < 3; ++i) areas[i] = magnitude(edges[i]);
    const int drop = bitLength(areas[0] + areas[1] + areas[2]) - n.weightBits;
    std::array<std::int64_t, 3> weights;
    for (int i = 0; i < 3; ++i) weights[i] = static_cast<std::int64_t>(drop >= 0 ? areas[i] >> drop : areas[i] << -drop);
    const Wide sum = Wide(weights[0]) + weights[1] + weights[2];
    const Wide numerator = Wide(weights[1]) * (Wide(z[1]) - z[0]) + Wide(weights[2]) * (Wide(z[2]) - z[0]);

    const Normalised dividend = normalise(magnitude(numerator), n.mantissaBits), divisor = normalise(sum, n.mantissaBits);
    const Wide quotient = floorShift<Wide>(divide(dividend.mantissa, divisor.mantissa, n.distanceDigits),
                                           n.distanceDigits - (dividend.exponent - divisor.exponent));
    const Wide t = numerator < 0 ? z[0] - quotient : z[0] + quotient;
    if (t < 0 || t > best.t || (t == best.t && id >= best.id)) return false;

    best.found = true;
    best.t = static_cast<std::int64_t>(t);
    best.id = id;
    for (int i = 0; i < 3; ++i) best.weights[i] = weights[i] >> (n.weightBits - n.barycentricBits);
    best.backSide = anyPositive != ray.negative[2];
    return true;
}

inline bool testTriangle(const Ray& ray, const std::array<Vector, 3>& vertices, std::uint64_t id, const Numbers& n, Hit& best) {
    return n.gridBits <= 32 ? testTriangle<std::int64_t>(ray, vertices, id, n, best) : testTriangle<Wide>(ray, vertices, id, n, best);
}

} // namespace colonnade
