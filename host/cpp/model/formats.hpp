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
    int vertexBits, boxBits, gridBits, gridFraction, sceneBits, mantissaBits, shearFraction, shearDigits, reciprocalFraction, reciprocalDigits, entrySlackShift,
        entryBits, weightBits, distanceDigits, barycentricBits, shadeBits, radicandBits, cosineFraction, boxDistanceBits, boxPadLog, stepFraction, stepReach, nodeBits,
        nearFraction, nearBits, normalFraction, colourBits, lightBits, lightFraction, etaFraction, rootBits, maxExponent;
    int stackDepth;
    bool bvh;

    explicit Numbers(const std::map<std::string, std::int64_t>& values) {
        const auto take = [&](const char* key) { return static_cast<int>(lookUp(values, key)); };
        vertexBits = take("vertexBits");
        boxBits = take("boxBits");
        gridBits = take("gridBits");
        gridFraction = take("gridFraction");
        sceneBits = take("sceneBits");
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
            record[position / 8] |= static_cast<std::uint8_t>(((static_cast<std::uint64_t>(value) >> bit) & ((1u << count) - 1)) << shift);
            bit += count;
        }
    }
};

using Layout = std::map<std::string, Field>;

enum class Child : std::uint8_t { empty = 0, node = 1, leaf = 2, illegal = 3 };

/// A node record. Illegal records (docs/errors.md) count as empty.
struct Node {
    bool isLegal;
    Vector origin;
    std::array<int, 3> exponent;
    std::array<Child, nodeChildren> kinds;
    std::array<std::array<std::int32_t, 3>, nodeChildren> low, high;
    std::uint32_t firstChild, firstTriangles;
};

struct Triangles {
    bool isLegal;
    int count;
    std::array<bool, leafTriangles> isTransmissive;
    std::array<std::array<Vector, 3>, leafTriangles> vertices;
};

struct Face {
    std::array<Vector, 3> normals;
    Vector geometricNormal;
    /// By corner, linear; zeros in a record without them.
    std::array<Vector, 3> colours;
    int material;
};

/// Decodes records by the manifest's layouts. The fields are resolved once, for speed.
class RecordDecoder {
public:
    RecordDecoder(const std::map<std::string, Layout>& layouts, const Numbers& numbers) : maxExponent_(numbers.maxExponent) {
        const Layout& node = layouts.at("node");
        origin_ = vectorOf(node, "origin");
        exponent_ = vectorOf(node, "exponent");
        firstChild_ = node.at("firstChild");
        firstTriangles_ = node.at("firstTriangles");
        for (int child = 0; child < nodeChildren; ++child) {
            const std::string index = "[" + std::to_string(child) + "]";
            kinds_.push_back(node.at("kinds" + index));
            low_.push_back(vectorOf(node, "low" + index));
            high_.push_back(vectorOf(node, "high" + index));
        }
        const Layout& triangles = layouts.at("triangles");
        count_ = triangles.at("count");
        for (int vertex = 0; vertex < 3 * leafTriangles; ++vertex) vertices_.push_back(vectorOf(triangles, "vertices[" + std::to_string(vertex) + "]"));
        for (int triangle = 0; triangle < leafTriangles; ++triangle) isTransmissive_.push_back(triangles.at("isClear[" + std::to_string(triangle) + "]"));
        const Layout& attributes = layouts.at("attributes");
        for (int face = 0; attributes.count("faces[" + std::to_string(face) + "].material"); ++face) {
            const std::string prefix = "faces[" + std::to_string(face) + "].";
            FaceFields fields;
            for (int corner = 0; corner < 3; ++corner) fields.normals[corner] = vectorOf(attributes, prefix + "normals[" + std::to_string(corner) + "]");
            fields.geometricNormal = vectorOf(attributes, prefix + "geometricNormal");
            fields.hasColours = attributes.count(prefix + "colours[0].r") != 0;
            for (int corner = 0; corner < 3 && fields.hasColours; ++corner)
                fields.colours[corner] = vectorOf(attributes, prefix + "colours[" + std::to_string(corner) + "]", "rgb");
            fields.material = attributes.at(prefix + "material");
            faces_.push_back(fields);
        }
    }

    int facesPerRecord() const { return static_cast<int>(faces_.size()); }

    /// Bit mask of a record address.
    std::uint32_t addressMask() const { return static_cast<std::uint32_t>((std::uint64_t(1) << firstChild_.width) - 1); }

    /// Decodes the node at an address.
    Node node(const std::uint8_t* record, std::size_t at) const {
        Node result{};
        result.origin = read(origin_, record);
        const Vector exponent = read(exponent_, record);
        for (int axis = 0; axis < 3; ++axis) result.exponent[axis] = static_cast<int>(exponent[axis]);
        result.firstChild = static_cast<std::uint32_t>(firstChild_.read(record));
        result.firstTriangles = static_cast<std::uint32_t>(firstTriangles_.read(record));
        for (int child = 0; child < nodeChildren; ++child) {
            result.kinds[child] = static_cast<Child>(kinds_[child].read(record));
            const Vector low = read(low_[child], record), high = read(high_[child], record);
            for (int axis = 0; axis < 3; ++axis) {
                result.low[child][axis] = static_cast<std::int32_t>(low[axis]);
                result.high[child][axis] = static_cast<std::int32_t>(high[axis]);
            }
        }
        bool hasNodes = false, isKnown = true, isSmall = true;
        for (int child = 0; child < nodeChildren; ++child) {
            hasNodes = hasNodes || result.kinds[child] == Child::node;
            isKnown = isKnown && result.kinds[child] != Child::illegal;
        }
        for (int axis = 0; axis < 3; ++axis) isSmall = isSmall && result.exponent[axis] <= maxExponent_;
        const bool isBelow = result.firstChild > at && result.firstChild <= addressMask() - static_cast<std::uint32_t>(nodeChildren);
        result.isLegal = isKnown && isSmall && (isBelow || !hasNodes);
        return result;
    }

    Triangles triangles(const std::uint8_t* record) const {
        Triangles result{};
        result.count = static_cast<int>(count_.read(record));
        result.isLegal = result.count > 0 && result.count <= leafTriangles;
        for (int vertex = 0; vertex < 3 * leafTriangles; ++vertex) result.vertices[vertex / 3][vertex % 3] = read(vertices_[vertex], record);
        for (int triangle = 0; triangle < leafTriangles; ++triangle) result.isTransmissive[triangle] = isTransmissive_[triangle].read(record) != 0;
        return result;
    }

    Face face(const std::uint8_t* record, int slot) const {
        const FaceFields& fields = faces_[slot];
        Face result{};
        for (int corner = 0; corner < 3; ++corner) result.normals[corner] = read(fields.normals[corner], record);
        result.geometricNormal = read(fields.geometricNormal, record);
        for (int corner = 0; corner < 3 && fields.hasColours; ++corner) result.colours[corner] = read(fields.colours[corner], record);
        result.material = static_cast<int>(fields.material.read(record));
        return result;
    }

private:
    using VectorFields = std::array<Field, 3>;
    struct FaceFields {
        std::array<VectorFields, 3> normals;
        VectorFields geometricNormal;
        bool hasColours;
        std::array<VectorFields, 3> colours;
        Field material;
    };

    static VectorFields vectorOf(const Layout& layout, const std::string& name, const char* components = "xyz") {
        return {layout.at(name + "." + components[0]), layout.at(name + "." + components[1]), layout.at(name + "." + components[2])};
    }
    static Vector read(const VectorFields& fields, const std::uint8_t* record) { return {fields[0].read(record), fields[1].read(record), fields[2].read(record)}; }

    int maxExponent_;
    VectorFields origin_, exponent_;
    Field firstChild_, firstTriangles_, count_;
    std::vector<Field> kinds_, isTransmissive_;
    std::vector<VectorFields> low_, high_, vertices_;
    std::vector<FaceFields> faces_;
};

} // namespace colonnade
