/// Writes leaf records: the smallest format that holds a pair, and the codes of corner normals.
#pragma once

#include <optional>

#include "mesh/topology.hpp"
#include "model/leaf.hpp"

namespace colonnade::packer {

/// The code nearest to a direction of any length but 0.
inline Octahedral octahedralOf(const mesh::Vector& normal) {
    const double sum = std::abs(normal[0]) + std::abs(normal[1]) + std::abs(normal[2]);
    const auto scaled = [&](int axis) {
        return static_cast<std::int64_t>(std::rint(octahedralOne * normal[axis] / sum));
    };
    const std::int64_t u = scaled(0), v = scaled(1);
    if (normal[2] >= 0) return {u, v};
    const std::int64_t across = octahedralOne - std::abs(v), up = octahedralOne - std::abs(u);
    return {u < 0 ? -across : across, v < 0 ? -up : up};
}

/// The code of a triangle's geometric normal. The triangle has an area.
inline Octahedral flatCode(const Leaf& leaf, int triangle, int normalFraction) {
    const Vector normal = geometricNormal(leaf.verticesOf(triangle), normalFraction);
    return octahedralOf(
        {static_cast<double>(normal[0]), static_cast<double>(normal[1]), static_cast<double>(normal[2])});
}

/// The format of a pair: flat where all normals are its triangles', else near or far; none if its vertices are too far
/// apart. A pair that bends is near, so that it may become twice as long before it loses its normals.
inline std::optional<LeafFormat> formatOf(const LeafFields& fields, const Leaf& pair, int normalFraction,
                                          bool bends = false) {
    bool isFlat = !bends;
    for (int triangle = 0; isFlat && triangle < 2; ++triangle)
        for (const int corner : Leaf::cornersOf(triangle))
            isFlat = isFlat && pair.normals[corner] == flatCode(pair, triangle, normalFraction);
    if (isFlat) return LeafFormat::flatPair;
    std::int64_t reach = 0; // the most bits of a delta, without its sign
    for (int i = 1; i < 4; ++i)
        for (int a = 0; a < 3; ++a) {
            const std::int64_t delta = pair.vertices[i][a] - pair.vertices[0][a];
            reach = std::max<std::int64_t>(reach, bitLength(static_cast<UnsignedWide>(delta < 0 ? ~delta : delta)));
        }
    if (reach < fields.deltaBits()) return LeafFormat::nearPair;
    if (reach == fields.deltaBits() && !bends) return LeafFormat::farPair;
    return std::nullopt;
}

/// Writes a leaf in its format into a record of zeros. A far pair's codes lose their lowest bits.
inline void writeLeaf(const LeafFields& fields, const Leaf& leaf, std::uint8_t* record) {
    fields.format.write(record, static_cast<std::int64_t>(leaf.format));
    fields.isClear.write(record, leaf.isClear);
    fields.material.write(record, leaf.material);
    const bool isFar = leaf.format == LeafFormat::farPair, isRelative = leaf.isRelative();
    for (int i = 0; i < leaf.corners(); ++i) {
        for (int a = 0; a < 3; ++a) {
            const std::int64_t delta = leaf.vertices[i][a] - leaf.vertices[0][a];
            if (i == 0 || !isRelative) fields.vertices[i][a].write(record, leaf.vertices[i][a]);
            else fields.deltas[i - 1][a].write(record, delta);
            if (i > 0 && isFar) fields.signs[i - 1][a].write(record, delta < 0);
        }
        if (leaf.format == LeafFormat::flatPair) continue;
        const std::array<std::int64_t, 2> code{leaf.normals[i].u, leaf.normals[i].v};
        for (int c = 0; c < 2; ++c) {
            if (!isRelative) fields.normals[i][c].write(record, code[c]);
            else fields.highNormals[i][c].write(record, code[c] >> 1);
            if (leaf.format == LeafFormat::nearPair) fields.lowNormals[i][c].write(record, code[c] & 1);
        }
    }
}

} // namespace colonnade::packer
