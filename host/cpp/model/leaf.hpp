// A leaf record: a pair of triangles that share an edge, or one triangle.
#pragma once
#include "normals.hpp"

namespace colonnade {

enum class LeafFormat : std::uint8_t { nearPair = 0, triangle = 1, flatPair = 2, farPair = 3 };

/// Triangles are (0, 1, 2) and, of a pair, (1, 0, 3). A flat pair has no normals: geometric ones stand for them.
struct Leaf {
    LeafFormat format;
    bool isClear;
    int material;
    std::array<Vector, 4> vertices;
    std::array<Octahedral, 4> normals;

    bool isPair() const { return format != LeafFormat::triangle; }
    /// Whether its vertices are relative to the first one.
    bool isRelative() const { return format == LeafFormat::nearPair || format == LeafFormat::farPair; }
    int triangles() const { return isPair() ? 2 : 1; }
    int corners() const { return isPair() ? 4 : 3; }

    /// The vertex that is each corner of a triangle.
    static constexpr std::array<int, 3> cornersOf(int triangle) {
        return triangle == 0 ? std::array<int, 3>{0, 1, 2} : std::array<int, 3>{1, 0, 3};
    }

    std::array<Vector, 3> verticesOf(int triangle) const {
        const std::array<int, 3> corners = cornersOf(triangle);
        return {vertices[corners[0]], vertices[corners[1]], vertices[corners[2]]};
    }
};

/// What rays test of a leaf.
struct LeafTriangles {
    std::array<std::array<std::int32_t, 3>, 4> vertices;
    std::uint8_t material;
    bool isClear;
    std::uint8_t count;

    explicit LeafTriangles(const Leaf& leaf)
        : vertices{}, material(static_cast<std::uint8_t>(leaf.material)), isClear(leaf.isClear),
          count(static_cast<std::uint8_t>(leaf.triangles())) {
        for (int i = 0; i < leaf.corners(); ++i)
            for (int a = 0; a < 3; ++a) vertices[i][a] = static_cast<std::int32_t>(leaf.vertices[i][a]);
    }

    std::array<Vector, 3> verticesOf(int triangle) const {
        std::array<Vector, 3> result;
        for (int i = 0; i < 3; ++i) {
            const std::array<std::int32_t, 3>& vertex = vertices[Leaf::cornersOf(triangle)[i]];
            result[i] = {vertex[0], vertex[1], vertex[2]};
        }
        return result;
    }
};

/// The fields of leaf records, by the layouts of their formats.
class LeafFields {
public:
    using VectorFields = std::array<Field, 3>;
    using CodeFields = std::array<Field, 2>;

    explicit LeafFields(const std::map<std::string, Layout>& layouts) {
        const Layout &nearPair = layouts.at("nearPair"), &farPair = layouts.at("farPair"),
                     &flat = layouts.at("flatPair"), &triangle = layouts.at("triangle");
        format = nearPair.at("format");
        isClear = nearPair.at("isClear");
        material = nearPair.at("material");
        for (int i = 0; i < 4; ++i) vertices[i] = vectorOf(flat, "body.vertices", i);
        for (int i = 0; i < 3; ++i) {
            deltas[i] = vectorOf(nearPair, "body.deltas", i);
            signs[i] = vectorOf(farPair, "body.signs", i);
            normals[i] = codeOf(triangle, "body.normals", i);
        }
        for (int i = 0; i < 4; ++i) {
            highNormals[i] = codeOf(nearPair, "body.normals", i);
            lowNormals[i] = codeOf(nearPair, "body.lowBits", i);
        }
        const auto companion = layouts.find("colours");
        for (int i = 0; companion != layouts.end() && i < 4; ++i)
            colours.push_back(vectorOf(companion->second, "colours", i, "rgb"));
    }

    /// By vertex, from 0: absolute ones.
    std::array<VectorFields, 4> vertices;
    /// By vertex, from 1: of a pair, relative to vertex 0; and of a far pair, their signs, above their bits.
    std::array<VectorFields, 3> deltas, signs;
    /// Codes of a triangle; a pair's without their lowest bits, and these.
    std::array<CodeFields, 3> normals;
    std::array<CodeFields, 4> highNormals, lowNormals;
    Field format, isClear, material;
    /// By vertex, in the companion of a leaf; none in a design without corner colours.
    std::vector<VectorFields> colours;

    bool hasColours() const { return !colours.empty(); }
    int vertexBits() const { return vertices[0][0].width; }
    int deltaBits() const { return deltas[0][0].width; }
    /// 32-bit words of a leaf; its format is at the top.
    std::size_t words() const { return static_cast<std::size_t>(format.offset + format.width) / 32; }

private:
    static std::string indexed(const std::string& name, int i) { return name + "[" + std::to_string(i) + "]."; }
    static VectorFields vectorOf(const Layout& layout, const std::string& name, int i, const char* components = "xyz") {
        const std::string prefix = indexed(name, i);
        return {layout.at(prefix + components[0]), layout.at(prefix + components[1]),
                layout.at(prefix + components[2])};
    }
    static CodeFields codeOf(const Layout& layout, const std::string& name, int i) {
        const std::string prefix = indexed(name, i);
        return {layout.at(prefix + "u"), layout.at(prefix + "v")};
    }
};

/// Reads a leaf. Any bits are legal: a vertex wraps at its width.
inline Leaf readLeaf(const LeafFields& fields, const std::uint8_t* record) {
    Leaf leaf{};
    leaf.format = static_cast<LeafFormat>(fields.format.read(record));
    leaf.isClear = fields.isClear.read(record) != 0;
    leaf.material = static_cast<int>(fields.material.read(record));
    const bool isFar = leaf.format == LeafFormat::farPair, isRelative = leaf.isRelative();
    const auto lowBits = [](std::int64_t x, int bits) { return x & ((std::int64_t(1) << bits) - 1); };
    for (int i = 0; i < leaf.corners(); ++i)
        for (int a = 0; a < 3; ++a) {
            std::int64_t& to = leaf.vertices[i][a];
            to = fields.vertices[isRelative ? 0 : i][a].read(record);
            if (!isRelative || i == 0) continue;
            const Field& field = fields.deltas[i - 1][a];
            std::int64_t delta = field.read(record);
            if (isFar) delta = lowBits(delta, field.width) - (fields.signs[i - 1][a].read(record) << field.width);
            to = lowBits(to + delta, fields.vertexBits());
        }
    if (leaf.format == LeafFormat::flatPair) return leaf;
    for (int i = 0; i < leaf.corners(); ++i) {
        const auto component = [&](int c) {
            if (!isRelative) return fields.normals[i][c].read(record);
            return fields.highNormals[i][c].read(record) * 2 + (isFar ? 0 : fields.lowNormals[i][c].read(record));
        };
        leaf.normals[i] = {component(0), component(1)};
    }
    return leaf;
}

/// Reads the colours of a triangle's corners in the companion of its leaf.
inline void readColours(const LeafFields& fields, const std::uint8_t* record, int triangle, Face& face) {
    for (int i = 0; i < 3; ++i)
        for (int channel = 0; channel < 3; ++channel)
            face.colours[i][channel] = fields.colours[Leaf::cornersOf(triangle)[i]][channel].read(record);
}

/// The attributes of a leaf's triangle, without colours.
inline Face faceOf(const Leaf& leaf, int triangle, int normalFraction) {
    Face face{};
    face.material = leaf.material;
    face.geometricNormal = geometricNormal(leaf.verticesOf(triangle), normalFraction);
    for (int i = 0; i < 3; ++i)
        face.normals[i] = leaf.format == LeafFormat::flatPair
                              ? face.geometricNormal
                              : directionOf(leaf.normals[Leaf::cornersOf(triangle)[i]], normalFraction);
    return face;
}

} // namespace colonnade
