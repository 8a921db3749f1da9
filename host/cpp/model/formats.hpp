// The manifest's number formats and record layouts. No width or offset is repeated here.
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "arithmetic.hpp"

namespace colonnade {

using Vector = std::array<std::int64_t, 3>;

/// Children of a node, and triangles of a leaf, at most.
constexpr int nodeChildren = 4, leafTriangles = 2;

inline std::int64_t lookUp(const std::map<std::string, std::int64_t>& values, const std::string& key) {
    const auto found = values.find(key);
    if (found == values.end()) throw std::invalid_argument("the manifest names no value '" + key + "'");
    return found->second;
}

/// The manifest's `numbers` (docs/numbers.md), and the configuration values that traversal depends on.
struct Numbers {
    int vertexBits, boxBits, gridBits, gridFraction, sceneBits, directionBits, mantissaBits, shearFraction, shearDigits,
        reciprocalFraction, reciprocalDigits, entrySlackShift, entryBits, weightBits, distanceDigits, barycentricBits,
        shadeBits, radicandBits, cosineFraction, boxDistanceBits, boxPadLog, stepFraction, stepReach, nodeBits,
        nearFraction, nearBits, normalFraction, colourBits, lightBits, lightFraction, etaFraction, rootBits,
        maxExponent;
    int stackDepth;
    bool bvh;

    explicit Numbers(const std::map<std::string, std::int64_t>& values) {
        const auto take = [&](const char* key) { return static_cast<int>(lookUp(values, key)); };
        vertexBits = take("vertexBits");
        boxBits = take("boxBits");
        gridBits = take("gridBits");
        gridFraction = take("gridFraction");
        sceneBits = take("sceneBits");
        directionBits = take("directionBits");
        mantissaBits = take("mantissaBits");
        shearFraction = take("shearFraction");
        shearDigits = take("shearDigits");
        reciprocalFraction = take("reciprocalFraction");
        reciprocalDigits = take("reciprocalDigits");
        entrySlackShift = take("entrySlackShift");
        entryBits = take("entryBits");
        weightBits = take("weightBits");
        distanceDigits = take("distanceDigits");
        barycentricBits = take("barycentricBits");
        shadeBits = take("shadeBits");
        radicandBits = take("radicandBits");
        cosineFraction = take("cosineFraction");
        boxDistanceBits = take("boxDistanceBits");
        boxPadLog = take("boxPadLog");
        stepFraction = take("stepFraction");
        stepReach = take("stepReach");
        nodeBits = take("nodeBits");
        nearFraction = take("nearFraction");
        nearBits = take("nearBits");
        normalFraction = take("normalFraction");
        colourBits = take("colourBits");
        lightBits = take("lightBits");
        lightFraction = take("lightFraction");
        etaFraction = take("etaFraction");
        rootBits = take("rootBits");
        maxExponent = take("maxExponent");
        stackDepth = take("stackDepth");
        bvh = take("bvh") != 0;
    }

    /// Padding of a box, vertex units.
    std::int64_t boxPad() const { return std::int64_t(1) << boxPadLog; }
    /// The largest t of a ray after set-up.
    std::int64_t maxT() const { return static_cast<std::int64_t>(largest(gridBits)); }
    /// The tMax of a ray without a limit: above `maxT` even after any tEntry is subtracted.
    Wide unlimited() const { return (Wide(1) << (sceneBits + 1)) - 1; }
};

/// The position of a field in its record.
struct Field {
    int offset, width;
    bool isSigned;

    std::int64_t read(const std::uint8_t* record) const {
        std::uint64_t bits = 0;
        for (int bit = 0; bit < width;) {
            const int position = offset + bit, shift = position % 8, count = std::min(8 - shift, width - bit);
            bits |= static_cast<std::uint64_t>((record[position / 8] >> shift) & ((1u << count) - 1)) << bit;
            bit += count;
        }
        if (isSigned && width < 64 && (bits >> (width - 1))) bits |= ~std::uint64_t(0) << width;
        return static_cast<std::int64_t>(bits);
    }

    /// Whether the field can hold a value.
    bool holds(std::int64_t value) const {
        if (width >= 64) return isSigned || value >= 0;
        const std::int64_t low = isSigned ? -(std::int64_t(1) << (width - 1)) : 0;
        return value >= low && value < low + (std::int64_t(1) << width);
    }

    /// Sets the bits of a field that is 0 in the record.
    void write(std::uint8_t* record, std::int64_t value) const {
        for (int bit = 0; bit < width;) {
            const int position = offset + bit, shift = position % 8, count = std::min(8 - shift, width - bit);
            record[position / 8] |=
                static_cast<std::uint8_t>(((static_cast<std::uint64_t>(value) >> bit) & ((1u << count) - 1)) << shift);
            bit += count;
        }
    }
};

using Layout = std::map<std::string, Field>;

/// A node record. Illegal records (docs/errors.md) count as empty.
struct Node {
    std::array<std::array<std::uint8_t, nodeChildren>, 3> low, high; ///< planes of the children, by axis
    std::array<std::int32_t, 3> origin;
    std::uint32_t first;
    std::array<std::uint8_t, 3> exponent;
    bool isLegal;
    std::uint8_t nodes, leaves; ///< children of each kind, in this order, at consecutive records from `first`

    int children() const { return nodes + leaves; }
};

struct Face {
    std::array<Vector, 3> normals;
    Vector geometricNormal;
    /// By corner, linear; zeros in a record without them.
    std::array<Vector, 3> colours;
    int material;
};

/// Decodes nodes by the manifest's layouts. The fields are resolved once, for speed.
class NodeDecoder {
public:
    NodeDecoder(const std::map<std::string, Layout>& layouts, const Numbers& numbers)
        : maxExponent_(numbers.maxExponent) {
        const Layout& node = layouts.at("node");
        corner_ = vectorOf(node, "corner");
        first_ = node.at("first");
        nodes_ = node.at("nodes");
        leaves_ = node.at("leaves");
        for (int child = 0; child < nodeChildren; ++child) {
            const std::string prefix = "children[" + std::to_string(child) + "].";
            low_.push_back(vectorOf(node, prefix + "low"));
            high_.push_back(vectorOf(node, prefix + "high"));
        }
    }

    /// Bit mask of a record address.
    std::uint32_t addressMask() const { return static_cast<std::uint32_t>((std::uint64_t(1) << first_.width) - 1); }

    /// Decodes the node at an address.
    Node node(const std::uint8_t* record, std::size_t at) const {
        Node result{};
        const Vector corner = read(corner_, record);
        bool isMarked = true;
        for (int axis = 0; axis < 3; ++axis) {
            // 2 · origin + 2^exponent: the lowest set bit is the exponent's
            result.exponent[axis] = static_cast<std::uint8_t>(
                corner[axis] == 0 ? 0 : bitLength(static_cast<UnsignedWide>(corner[axis] & -corner[axis])) - 1);
            result.origin[axis] = static_cast<std::int32_t>((corner[axis] & (corner[axis] - 1)) >> 1);
            isMarked = isMarked && corner[axis] != 0 && result.exponent[axis] <= maxExponent_;
        }
        result.first = static_cast<std::uint32_t>(first_.read(record));
        result.nodes = static_cast<std::uint8_t>(nodes_.read(record));
        result.leaves = static_cast<std::uint8_t>(leaves_.read(record));
        for (int child = 0; child < nodeChildren; ++child) {
            const Vector low = read(low_[child], record), high = read(high_[child], record);
            for (int axis = 0; axis < 3; ++axis) {
                result.low[axis][child] = static_cast<std::uint8_t>(low[axis]);
                result.high[axis][child] = static_cast<std::uint8_t>(high[axis]);
            }
        }
        const bool isBelow = result.first > at && result.first + static_cast<std::uint64_t>(result.children()) <=
                                                      addressMask() + std::uint64_t{1};
        result.isLegal = result.children() == 0 || (result.children() <= nodeChildren && isMarked && isBelow);
        return result;
    }

private:
    using VectorFields = std::array<Field, 3>;
    static VectorFields vectorOf(const Layout& layout, const std::string& name, const char* components = "xyz") {
        return {layout.at(name + "." + components[0]), layout.at(name + "." + components[1]),
                layout.at(name + "." + components[2])};
    }
    static Vector read(const VectorFields& fields, const std::uint8_t* record) {
        return {fields[0].read(record), fields[1].read(record), fields[2].read(record)};
    }

    int maxExponent_;
    VectorFields corner_;
    Field first_, nodes_, leaves_;
    std::vector<VectorFields> low_, high_;
};

} // namespace colonnade
