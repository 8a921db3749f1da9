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
    /// The triangle lets light through.
    bool isClear = false;
    /// That was hit, in a scene of instances.
    int instance = 0;

    /// That of a ray that has hit nothing yet: only hits with t < `tMax` count.
    static Hit none(std::int64_t tMax) { return {false, tMax, 0, {}, false}; }

    /// Whether a triangle that the ray hits at `t` is the closest one so far.
    bool isReplacedBy(Wide t, std::uint64_t id) const { return t < this->t || (t == this->t && id < this->id); }
};

/// tMax in vertex units, rounded up and padded: the largest `tNear` of a box that may contain a closer hit.
inline std::int64_t tMaxUnits(std::int64_t tMax, const Numbers& n) {
    const std::int64_t units = floorShift(tMax, n.gridFraction) + 1 + n.boxPad();
    return std::min(units, (std::int64_t(1) << (n.boxDistanceBits - 1)) - 1);
}

/// A child box that the ray hits.
struct Entered {
    int slot;
    std::int64_t tNear;
};

/// A node as a ray sees it: everything that the box tests of its children share (docs/numbers.md, section 3).
struct RelativeNode {
    /// The distance along z' at which the ray reaches the node's first z plane, vertex units, and the exponent of the node there.
    std::int64_t z;
    int exponent;
    /// By axis x', y': a floored and a raised plane's step, the first planes' near and far t, and the left shift of a sum of these to the children's t.
    std::array<std::int64_t, 2> step, near, far;
    std::array<int, 2> scale;
    /// The pad along z', the ray's origin and its tMax, in the children's t.
    std::int64_t pad, origin, tMax;

    RelativeNode(const Ray& ray, const Node& node, std::int64_t tMaxInUnits, const Numbers& n) {
        const std::int64_t maxPlane = (std::int64_t(1) << n.boxBits) - 1, maxBase = (std::int64_t(1) << (n.nodeBits - 1)) - 1;
        std::array<std::int64_t, 3> corner, span;
        for (int a = 0; a < 3; ++a) {
            const int axis = ray.objectAxis(a);
            corner[a] = node.origin[axis] - ray.boxOrigin[a];
            span[a] = maxPlane << node.exponent[axis];
        }
        exponent = node.exponent[ray.objectAxis(2)];
        z = ray.negative[2] ? -(corner[2] + span[2]) : corner[2];
        for (int a = 0; a < 2; ++a) {
            const int axisExponent = node.exponent[ray.objectAxis(a)], drop = n.reciprocalFraction - ray.exponent[a];
            const int finest = axisExponent + ray.exponent[a] - n.stepFraction, lowest = std::max(finest, exponent - n.stepReach);
            step[a] = ray.reciprocal[a] >> (n.reciprocalFraction - n.stepFraction + lowest - finest);
            const std::int64_t product = corner[a] * ray.reciprocal[a];
            const std::int64_t exact = (ray.negative[a] ? -product : product) - shiftLeft(z, drop);
            const std::int64_t base = clamp(floorShift(exact, lowest + drop), -maxBase - 1, maxBase);
            const std::int64_t pad = (((step[a] + 1) << n.boxPadLog) >> axisExponent) + 1;
            scale[a] = lowest - (exponent - n.nearFraction);
            const std::int64_t roundUp = scale[a] < 0 ? (std::int64_t(1) << -scale[a]) - 1 : 0;
            near[a] = base - pad - (ray.negative[a] ? maxPlane * (step[a] + 1) : 0);
            far[a] = base + pad + 1 + roundUp - (ray.negative[a] ? maxPlane * step[a] : 0);
        }
        pad = std::int64_t(1) << std::max(0, n.boxPadLog + n.nearFraction - exponent);
        const std::int64_t maxNear = (std::int64_t(1) << (n.nearBits - 1)) - 1;
        origin = scaled(-z, n.nearFraction - exponent, maxNear);
        tMax = scaled(tMaxInUnits - z, n.nearFraction - exponent, maxNear);
    }

    /// t · 2^scale, rounded down and saturated to −high − 1 … high.
    static std::int64_t scaled(std::int64_t t, int scale, std::int64_t high) {
        const std::int64_t low = -high - 1;
        if (scale <= 0) return clamp(t >> std::min(-scale, 63), low, high);
        const int shift = std::min(scale, 62);
        if (t > high >> shift) return high;
        if (t < low >> shift) return low;
        return std::max(t * (std::int64_t(1) << shift), low);
    }

    /// A child's t in vertex units, rounded down.
    std::int64_t units(std::int64_t t, const Numbers& n) const { return std::max<std::int64_t>(0, z + floorShift(t, n.nearFraction - exponent)); }
};

/// Tests a node's children; writes the hit ones in order of tNear and returns their number. `tests` counts the tested children.
inline int testBoxes(const Ray& ray, const Node& node, std::int64_t tMax, const Numbers& n, std::array<Entered, nodeChildren>& entered, std::uint64_t& tests) {
    const RelativeNode relative(ray, node, tMaxUnits(tMax, n), n);
    const std::int64_t maxPlane = (std::int64_t(1) << n.boxBits) - 1, high = (std::int64_t(1) << (n.nearBits - 1)) - 1;
    const std::array<int, 3> axes = {ray.objectAxis(0), ray.objectAxis(1), ray.objectAxis(2)};
    int count = 0;
    for (int slot = 0; slot < node.children(); ++slot) {
        ++tests;
        std::int64_t tNear = relative.origin, tFar = relative.tMax;
        for (int a = 0; a < 3; ++a) {
            const std::int64_t lower = node.low[slot][axes[a]], upper = node.high[slot][axes[a]];
            const std::int64_t first = ray.negative[a] ? maxPlane - upper : lower, last = ray.negative[a] ? maxPlane - lower : upper;
            if (a < 2) {
                const std::int64_t near = relative.near[a] + first * relative.step[a], far = relative.far[a] + last * (relative.step[a] + 1);
                tNear = std::max(tNear, RelativeNode::scaled(near, relative.scale[a], high));
                tFar = std::min(tFar, RelativeNode::scaled(far, relative.scale[a], high));
            } else {
                tNear = std::max(tNear, (first << n.nearFraction) - relative.pad);
                tFar = std::min(tFar, (last << n.nearFraction) + relative.pad);
            }
        }
        if (tNear > tFar) continue;
        int position = count++;
        for (; position > 0 && entered[position - 1].tNear > tNear; --position) entered[position] = entered[position - 1];
        entered[position] = {slot, tNear};
    }
    for (int i = 0; i < count; ++i) entered[i].tNear = relative.units(entered[i].tNear, n);
    return count;
}

/// Tests a triangle; true if it is the closest hit so far, and then updates `best`, which begins as `Hit::none`.
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

    std::array<UnsignedOf<Product>, 3> areas;
    for (int i = 0; i < 3; ++i) areas[i] = magnitude(edges[i]);
    const int drop = bitLength(areas[0] + areas[1] + areas[2]) - n.weightBits;
    std::array<std::int64_t, 3> weights;
    for (int i = 0; i < 3; ++i) weights[i] = static_cast<std::int64_t>(drop >= 0 ? areas[i] >> drop : areas[i] << -drop);
    const Wide sum = Wide(weights[0]) + weights[1] + weights[2];
    const Wide numerator = Wide(weights[1]) * (Wide(z[1]) - z[0]) + Wide(weights[2]) * (Wide(z[2]) - z[0]);

    const Normalised dividend = normalise(magnitude(numerator), n.mantissaBits), divisor = normalise(sum, n.mantissaBits);
    const Wide quotient = floorShift<Wide>(divide(dividend.mantissa, divisor.mantissa, n.distanceDigits), n.distanceDigits - (dividend.exponent - divisor.exponent));
    const Wide t = numerator < 0 ? z[0] - quotient : z[0] + quotient;
    if (t < ray.tMin || !best.isReplacedBy(t, id)) return false;

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
