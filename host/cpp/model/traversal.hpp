// BoxUnit and TriangleUnit (docs/numbers.md, sections 3 and 4).
#pragma once
#include <cstring>
#include <limits>
#include <utility>
#ifdef __SSE4_1__
#include <smmintrin.h>
#endif

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

    /// A miss, limited to t < `tMax`.
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

// Vectors of 32 bytes are no arguments between files. g++ warns of them at the end of a file.
#ifndef __clang__
#pragma GCC diagnostic ignored "-Wpsabi"
#endif

/// Whether 32 bits hold the numbers of box tests: not with wide vertices and narrow divisions.
inline bool hasNarrowBoxes(const Numbers& n) { return n.nodeBits < 30; }

/// Box tests of a ray (docs/numbers.md, section 3). `Integer` holds their numbers.
template <class Integer> class BoxTests {
public:
    /// A value of each child of a node.
    using Lanes __attribute__((vector_size(sizeof(Integer) * nodeChildren))) = Integer;

    BoxTests(const Ray& ray, const Numbers& n)
        : n_(n), maxPlane_((std::int64_t(1) << n.boxBits) - 1), maxBase_((std::int64_t(1) << (n.nodeBits - 1)) - 1),
          maxNear_((std::int64_t(1) << (n.nearBits - 1)) - 1) {
        // A plane from the other side has all of its bits changed
        for (int a = 0; a < 3; ++a) {
            const int axis = ray.objectAxis(a);
            const auto flip = ray.negative[a] ? static_cast<std::uint32_t>(maxPlane_) * 0x01010101u : 0u;
            axes_[a] = {axis, ray.negative[a], ray.boxOrigin[a], ray.negative[a] ? maxPlane_ : 0, flip};
        }
        for (int a = 0; a < 2; ++a) {
            const int drop = n.reciprocalFraction - ray.exponent[a];
            sides_[a] = {ray.reciprocal[a], ray.negative[a] ? -ray.reciprocal[a] : ray.reciprocal[a], drop,
                         ray.exponent[a] - n.stepFraction};
        }
    }

    /// Tests a node's children; writes the hit ones in order of tNear and returns their number. `limit`: the tMaxUnits
    /// of the ray.
    int test(const Node& node, std::int64_t limit, std::array<Entered, nodeChildren>& entered) const {
        // The distance along z' at which the ray reaches the node's first z plane, vertex units, and the exponent of
        // the node there
        const Axis& along = axes_[2];
        const int exponent = node.exponent[along.axis], toNear = n_.nearFraction - exponent;
        const std::int64_t cornerZ = node.origin[along.axis] - along.origin + (along.first << exponent),
                           z = along.negative ? -cornerZ : cornerZ;
        // The planes along z', the ray's origin and its tMax, in the children's t
        const Lanes pad = all(std::int64_t(1) << std::max(0, n_.boxPadLog + toNear));
        Lanes tNear = greatest(all(scaled(-z, toNear)), first(node, along) * (1 << n_.nearFraction) - pad);
        Lanes tFar = least(all(scaled(limit - z, toNear)), last(node, along) * (1 << n_.nearFraction) + pad);
        for (int a = 0; a < 2; ++a) {
            const Axis& axis = axes_[a];
            const Side& side = sides_[a];
            const int axisExponent = node.exponent[axis.axis], finest = axisExponent + side.finest;
            // At least `finest`, so no shift is negative, and those to the children's t are short
            const int lowest = std::max(finest, exponent - n_.stepReach);
            // A floored and, plus 1, a raised plane's step; the first planes' near and far t; the left shift of a sum
            // of these to the children's t
            const std::int64_t step =
                side.reciprocal >> std::min(63, n_.reciprocalFraction - n_.stepFraction + lowest - finest);
            const std::int64_t exact =
                (node.origin[axis.axis] - axis.origin) * side.signedReciprocal - (z << side.drop);
            const std::int64_t base = clamp(exact >> std::min(63, lowest + side.drop), -maxBase_ - 1, maxBase_);
            const std::int64_t sidePad = (((step + 1) << n_.boxPadLog) >> axisExponent) + 1;
            const int scale = lowest + toNear;
            const std::int64_t roundUp = (std::int64_t(1) << std::max(0, -scale)) - 1;
            const std::int64_t near = base - sidePad - axis.first * (step + 1),
                               far = base + sidePad + 1 + roundUp - axis.first * step;
            const Lanes steps = all(step);
            tNear = greatest(tNear, scaled(all(near) + first(node, axis) * steps, scale));
            tFar = least(tFar, scaled(all(far) + last(node, axis) * (steps + 1), scale));
        }
        // Sorted by (tNear, slot) in a network of four, the missed ones last
        const Lanes slots{0, 1, 2, 3};
        const Lanes isHit = (tNear <= tFar) & (slots < all(node.children()));
        const Lanes keys = isHit ? tNear * nodeChildren + slots : all(std::numeric_limits<Integer>::max());
        const int count = static_cast<int>(-(isHit[0] + isHit[1] + isHit[2] + isHit[3]));
        Integer sorted[nodeChildren] = {keys[0], keys[1], keys[2], keys[3]};
        const auto order = [&sorted](int one, int other) {
            const Integer low = std::min(sorted[one], sorted[other]);
            sorted[other] = std::max(sorted[one], sorted[other]);
            sorted[one] = low;
        };
        order(0, 1), order(2, 3), order(0, 2), order(1, 3), order(1, 2);
        // A child's t in vertex units, rounded down
        for (int i = 0; i < count; ++i)
            entered[i] = {static_cast<int>(sorted[i] & (nodeChildren - 1)),
                          std::max<std::int64_t>(0, z + floorShift(std::int64_t{sorted[i] >> 2}, toNear))};
        return count;
    }

private:
    /// An axis x', y' or z' of the ray: the object's axis, the ray's origin and the node's first plane there, and what
    /// turns planes round.
    struct Axis {
        int axis;
        bool negative;
        std::int64_t origin, first;
        std::uint32_t flip;
    };

    /// Axis x' or y': the reciprocal, with its sign, the right shift of its products to vertex units, and the exponent
    /// of the finest steps in a node of exponent 0.
    struct Side {
        std::int64_t reciprocal, signedReciprocal;
        int drop, finest;
    };

    static Lanes least(Lanes one, Lanes other) { return one < other ? one : other; }
    static Lanes greatest(Lanes one, Lanes other) { return one > other ? one : other; }
    static Lanes all(std::int64_t value) {
        const auto each = static_cast<Integer>(value);
        return Lanes{each, each, each, each};
    }

    static Lanes lanesOf(const std::array<std::uint8_t, nodeChildren>& planes, std::uint32_t flip) {
        std::uint32_t bytes;
        std::memcpy(&bytes, planes.data(), sizeof bytes);
        bytes ^= flip;
#ifdef __SSE4_1__
        if constexpr (sizeof(Integer) == 4)
            return reinterpret_cast<Lanes>(_mm_cvtepu8_epi32(_mm_cvtsi32_si128(static_cast<int>(bytes))));
#endif
        using Bytes = std::uint8_t __attribute__((vector_size(nodeChildren)));
        Bytes each;
        std::memcpy(&each, &bytes, sizeof each);
        return __builtin_convertvector(each, Lanes);
    }

    /// The first and the last plane of each child that the ray crosses along an axis, from the node's first one.
    static Lanes first(const Node& node, const Axis& along) {
        return lanesOf((along.negative ? node.high : node.low)[along.axis], along.flip);
    }
    static Lanes last(const Node& node, const Axis& along) {
        return lanesOf((along.negative ? node.low : node.high)[along.axis], along.flip);
    }

    /// t · 2^scale, rounded down and saturated to `nearBits` bits.
    std::int64_t scaled(std::int64_t t, int scale) const {
        if (scale <= 0) return clamp(t >> std::min(-scale, 63), -maxNear_ - 1, maxNear_);
        // All but 0 saturate by `nearBits` places
        return clamp(clamp(t, -maxNear_ - 1, maxNear_) * (std::int64_t(1) << std::min(scale, n_.nearBits)),
                     -maxNear_ - 1, maxNear_);
    }

    Lanes scaled(Lanes t, int scale) const {
        const Lanes high = all(maxNear_), low = ~high;
        if (scale <= 0) t = t >> -scale;
        else {
            const int shift = std::min(scale, n_.nearBits);
            t = least(greatest(t, all((~maxNear_ >> shift) - 1)), all((maxNear_ >> shift) + 1)) * (1 << shift);
        }
        return least(greatest(t, low), high);
    }

    const Numbers& n_;
    std::int64_t maxPlane_, maxBase_, maxNear_;
    std::array<Axis, 3> axes_;
    std::array<Side, 2> sides_;
};

/// As `BoxTests::test`, of a ray with a tMax.
inline int testBoxes(const Ray& ray, const Node& node, std::int64_t tMax, const Numbers& n,
                     std::array<Entered, nodeChildren>& entered) {
    const std::int64_t limit = tMaxUnits(tMax, n);
    return hasNarrowBoxes(n) ? BoxTests<std::int32_t>(ray, n).test(node, limit, entered)
                             : BoxTests<std::int64_t>(ray, n).test(node, limit, entered);
}

/// The watertight test of Woop, Benthin and Wald (2013). With vertices p relative to the origin in the ray's own axes:
///     x' = x - Sx·z, y' = y - Sy·z     shear; the ray is the z axis
///     U = x1·y2 - y1·x2, V = x2·y0 - y2·x0, W = x0·y1 - y0·x1     twice the area beside each edge, exact
///     t = z0 + (V·(z1 - z0) + W·(z2 - z0)) / (U + V + W)
/// U, V and W of one sign, or 0: the ray's line crosses the triangle.
///
/// Tests a triangle; true if it is the closest hit so far, and then updates `best`, which begins as `Hit::none`.
/// `crossesTriangle`, if any, becomes true if the ray's line crosses it.
template <class Product> bool testTriangle(const Ray& ray, const std::array<Vector, 3>& vertices, std::uint64_t id,
                                           const Numbers& n, Hit& best, bool* crossesTriangle) {
    // Translate to the ray's origin, permute and shear
    std::array<std::int64_t, 3> x, y, z;
    for (int i = 0; i < 3; ++i) {
        Vector p;
        for (int a = 0; a < 3; ++a) {
            const std::int64_t vertex = vertices[i][ray.objectAxis(a)];
            p[a] =
                (n.gridFraction >= 0 ? vertex << n.gridFraction : nearestEven(vertex, -n.gridFraction)) - ray.origin[a];
        }
        z[i] = ray.negative[2] ? -p[2] : p[2];
        x[i] = static_cast<std::int64_t>(p[0] - nearestEven<Product>(Product(ray.shear[0]) * z[i], n.shearFraction));
        y[i] = static_cast<std::int64_t>(p[1] - nearestEven<Product>(Product(ray.shear[1]) * z[i], n.shearFraction));
    }

    // Edge functions: exact, so that triangles with a common edge leave no gap
    const std::array<Product, 3> edges = {Product(x[1]) * y[2] - Product(y[1]) * x[2],
                                          Product(x[2]) * y[0] - Product(y[2]) * x[0],
                                          Product(x[0]) * y[1] - Product(y[0]) * x[1]};
    const bool anyNegative = edges[0] < 0 || edges[1] < 0 || edges[2] < 0,
               anyPositive = edges[0] > 0 || edges[1] > 0 || edges[2] > 0;
    if (anyNegative == anyPositive) return false;
    if (crossesTriangle) *crossesTriangle = true;

    // Barycentric weights: the areas, with one exponent
    std::array<UnsignedOf<Product>, 3> areas;
    for (int i = 0; i < 3; ++i) areas[i] = magnitude(edges[i]);
    const int drop = bitLength(areas[0] + areas[1] + areas[2]) - n.weightBits;
    std::array<std::int64_t, 3> weights;
    for (int i = 0; i < 3; ++i)
        weights[i] = static_cast<std::int64_t>(drop >= 0 ? areas[i] >> drop : areas[i] << -drop);
    // Distance: a quotient of normalised numbers, rounded towards z of the first vertex
    const Wide sum = Wide(weights[0]) + weights[1] + weights[2];
    const Wide numerator = Wide(weights[1]) * (Wide(z[1]) - z[0]) + Wide(weights[2]) * (Wide(z[2]) - z[0]);

    const Normalised dividend = normalise(magnitude(numerator), n.mantissaBits),
                     divisor = normalise(sum, n.mantissaBits);
    const Wide quotient = floorShift<Wide>(divide(dividend.mantissa, divisor.mantissa, n.distanceDigits),
                                           n.distanceDigits - (dividend.exponent - divisor.exponent));
    const Wide t = numerator < 0 ? z[0] - quotient : z[0] + quotient;
    if (t < ray.tMin || !best.isReplacedBy(t, id)) return false;

    best.found = true;
    best.t = static_cast<std::int64_t>(t);
    best.id = id;
    for (int i = 0; i < 3; ++i) best.weights[i] = weights[i] >> (n.weightBits - n.barycentricBits);
    best.backSide = anyPositive != ray.negative[2];
    return true;
}

inline bool testTriangle(const Ray& ray, const std::array<Vector, 3>& vertices, std::uint64_t id, const Numbers& n,
                         Hit& best, bool* crossesTriangle = nullptr) {
    return n.gridBits <= 32 ? testTriangle<std::int64_t>(ray, vertices, id, n, best, crossesTriangle)
                            : testTriangle<Wide>(ray, vertices, id, n, best, crossesTriangle);
}

} // namespace colonnade
