// BoxUnit and TriangleUnit (docs/numbers.md, sections 3 and 4).
#pragma once
#include <cstring>

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

/// A value of each child of a node. The widths of docs/numbers.md, section 3, fit 32 bits in all formats.
using Lanes = std::int32_t __attribute__((vector_size(4 * nodeChildren)));

/// Box tests of a ray (docs/numbers.md, section 3).
class BoxTests {
public:
    BoxTests(const Ray& ray, const Numbers& n)
        : n_(n), maxPlane_((std::int64_t(1) << n.boxBits) - 1), maxBase_((std::int64_t(1) << (n.nodeBits - 1)) - 1), maxNear_((std::int64_t(1) << (n.nearBits - 1)) - 1) {
        for (int a = 0; a < 3; ++a) {
            axis_[a] = ray.objectAxis(a);
            negative_[a] = ray.negative[a];
            origin_[a] = ray.boxOrigin[a];
        }
        for (int a = 0; a < 2; ++a) {
            reciprocal_[a] = ray.reciprocal[a];
            exponent_[a] = ray.exponent[a];
        }
    }

    /// Tests a node's children; writes the hit ones in order of tNear and returns their number. `tests` counts the tested children.
    int test(const Node& node, std::int64_t tMax, std::array<Entered, nodeChildren>& entered, std::uint64_t& tests) const {
        tests += static_cast<std::uint64_t>(node.children());
        // The distance along z' at which the ray reaches the node's first z plane, vertex units, and the exponent of the node there
        const int exponent = node.exponent[axis_[2]];
        const std::int64_t cornerZ = node.origin[axis_[2]] - origin_[2], z = negative_[2] ? -(cornerZ + (maxPlane_ << exponent)) : cornerZ;
        // The planes along z', the ray's origin and its tMax, in the children's t
        const int toNear = n_.nearFraction - exponent;
        const Lanes pad = all(std::int64_t(1) << std::max(0, n_.boxPadLog + toNear));
        const Planes along = planesOf(node, 2);
        Lanes tNear = greatest(all(scaled(-z, toNear)), along.first * (1 << n_.nearFraction) - pad);
        Lanes tFar = least(all(scaled(tMaxUnits(tMax, n_) - z, toNear)), along.last * (1 << n_.nearFraction) + pad);
        for (int a = 0; a < 2; ++a) {
            const Side side(*this, a, node.origin[axis_[a]] - origin_[a], node.exponent[axis_[a]], z, exponent);
            const Planes planes = planesOf(node, a);
            const Lanes step = all(side.step);
            tNear = greatest(tNear, scaled(all(side.near) + planes.first * step, side.scale));
            tFar = least(tFar, scaled(all(side.far) + planes.last * (step + 1), side.scale));
        }
        const Lanes misses = tNear > tFar;
        int count = 0;
        for (int slot = 0; slot < node.children(); ++slot) {
            if (misses[slot]) continue;
            const std::int64_t t = tNear[slot];
            int position = count++;
            for (; position > 0 && entered[position - 1].tNear > t; --position) entered[position] = entered[position - 1];
            entered[position] = {slot, t};
        }
        // A child's t in vertex units, rounded down
        for (int i = 0; i < count; ++i) entered[i].tNear = std::max<std::int64_t>(0, z + floorShift(entered[i].tNear, toNear));
        return count;
    }

private:
    /// The first and the last plane of each child that the ray crosses along an axis, from the node's first one.
    struct Planes {
        Lanes first, last;
    };

    /// What the children of a node share along axis x' or y': a floored and, plus 1, a raised plane's step, the first planes' near and far t,
    /// and the left shift of a sum of these to the children's t.
    struct Side {
        std::int64_t step, near, far;
        int scale;

        Side(const BoxTests& of, int a, std::int64_t corner, int axisExponent, std::int64_t z, int exponent) {
            const Numbers& n = of.n_;
            const int drop = n.reciprocalFraction - of.exponent_[a], finest = axisExponent + of.exponent_[a] - n.stepFraction;
            // Not below 0 and at least `finest`, so no shift is negative, and those to the children's t are short
            const int lowest = std::max(finest, exponent - n.stepReach);
            step = of.reciprocal_[a] >> std::min(63, n.reciprocalFraction - n.stepFraction + lowest - finest);
            const std::int64_t product = corner * of.reciprocal_[a], exact = (of.negative_[a] ? -product : product) - (z << drop);
            const std::int64_t base = clamp(exact >> std::min(63, lowest + drop), -of.maxBase_ - 1, of.maxBase_);
            const std::int64_t pad = (((step + 1) << n.boxPadLog) >> axisExponent) + 1;
            scale = lowest - (exponent - n.nearFraction);
            const std::int64_t roundUp = (std::int64_t(1) << std::max(0, -scale)) - 1;
            near = base - pad - (of.negative_[a] ? of.maxPlane_ * (step + 1) : 0);
            far = base + pad + 1 + roundUp - (of.negative_[a] ? of.maxPlane_ * step : 0);
        }
    };

    static Lanes least(Lanes one, Lanes other) { return one < other ? one : other; }
    static Lanes greatest(Lanes one, Lanes other) { return one > other ? one : other; }
    static Lanes all(std::int64_t value) {
        const auto each = static_cast<std::int32_t>(value);
        return Lanes{each, each, each, each};
    }

    static Lanes lanesOf(std::uint32_t bytes) {
        using Bytes = std::uint8_t __attribute__((vector_size(nodeChildren)));
        Bytes each;
        std::memcpy(&each, &bytes, sizeof each);
        return __builtin_convertvector(each, Lanes);
    }

    Planes planesOf(const Node& node, int a) const {
        std::uint32_t low, high;
        std::memcpy(&low, node.low[axis_[a]].data(), sizeof low);
        std::memcpy(&high, node.high[axis_[a]].data(), sizeof high);
        if (!negative_[a]) return {lanesOf(low), lanesOf(high)};
        // Counted from the other side: all bits of a plane change
        const std::uint32_t flip = static_cast<std::uint32_t>(maxPlane_) * 0x01010101u;
        return {lanesOf(high ^ flip), lanesOf(low ^ flip)};
    }

    /// t · 2^scale, rounded down and saturated to `nearBits` bits.
    std::int64_t scaled(std::int64_t t, int scale) const {
        if (scale <= 0) return clamp(t >> std::min(-scale, 63), -maxNear_ - 1, maxNear_);
        // All but 0 saturate by `nearBits` places
        const int shift = std::min(scale, n_.nearBits);
        return clamp(clamp(t, -maxNear_ - 1, maxNear_) * (std::int64_t(1) << shift), -maxNear_ - 1, maxNear_);
    }

    Lanes scaled(Lanes t, int scale) const {
        const Lanes high = all(maxNear_), low = ~high;
        if (scale <= 0) t = t >> -scale;
        else t = least(greatest(t, low), high) * (1 << std::min(scale, n_.nearBits));
        return least(greatest(t, low), high);
    }

    const Numbers& n_;
    std::int64_t maxPlane_, maxBase_, maxNear_;
    std::array<int, 3> axis_;
    std::array<bool, 3> negative_;
    std::array<std::int64_t, 3> origin_;
    std::array<std::int64_t, 2> reciprocal_;
    std::array<int, 2> exponent_;
};

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
