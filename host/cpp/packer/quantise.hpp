/// Quantisation: a mesh with vertices rounded to vertex units (docs/numbers.md).
#pragma once

#include "mesh/topology.hpp"

namespace colonnade::packer {

using Units = mesh::Row<std::int32_t>;

struct QuantisedMesh {
    std::vector<Units> vertices;          ///< 0 to 2^vertexBits − 1; one for each vertex of the mesh
    std::vector<mesh::Face> faces;        ///< without degenerate faces
    std::vector<std::int64_t> meshFaces;  ///< their indices in the mesh's faces
    double scale = 0;                     ///< vertex units per mesh unit
    mesh::Vector offset{};                ///< mesh coordinates of vertex-unit position (0, 0, 0)

    Units corner(std::size_t face, int corner) const { return vertices[faces[face][corner]]; }
};

struct QuantiseOptions {
    int scaleBits = 53;       ///< of the scale's mantissa, which is rounded down
    bool keepsEqual = false;  ///< faces equal to an earlier one
};

/// Scales a mesh uniformly into the centre of the cube [0, 2^vertexBits − 1]³ and rounds to nearest. The low planes of
/// its box are integers, so that a flat side stays flat. Faces that become degenerate, or equal to an earlier one, are
/// dropped: all of them, if the mesh is too thin for its vertex units.
inline QuantisedMesh quantise(const mesh::Vector* vertices, std::size_t vertexCount, const mesh::Face* faces,
                              std::size_t faceCount, int vertexBits, const QuantiseOptions& options = {}) {
    const double maximum = static_cast<double>((std::int64_t{1} << vertexBits) - 1);
    mesh::Vector low = vertices[0], high = vertices[0];
    for (std::size_t i = 0; i < vertexCount; ++i)
        for (int axis = 0; axis < 3; ++axis) {
            low[axis] = std::min(low[axis], vertices[i][axis]);
            high[axis] = std::max(high[axis], vertices[i][axis]);
        }
    QuantisedMesh result;
    int exponent;
    const double mantissa =
        std::frexp(maximum / std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]}), &exponent);
    result.scale = std::ldexp(std::floor(std::ldexp(mantissa, options.scaleBits)), exponent - options.scaleBits);
    mesh::Vector start;
    for (int axis = 0; axis < 3; ++axis) {
        start[axis] = std::floor((maximum - std::rint((high[axis] - low[axis]) * result.scale)) / 2);
        result.offset[axis] = low[axis] - start[axis] / result.scale;
    }
    std::vector<mesh::Row<std::int64_t>> positions(vertexCount), corners(faceCount);
    result.vertices.resize(vertexCount);
    for (std::size_t i = 0; i < vertexCount; ++i)
        for (int axis = 0; axis < 3; ++axis) {
            const double unit = std::rint((vertices[i][axis] - low[axis]) * result.scale) + start[axis];
            positions[i][axis] = result.vertices[i][axis] = static_cast<std::int32_t>(std::clamp(unit, 0.0, maximum));
        }
    // Merge coincident vertices to compare faces
    const mesh::MergedRows<std::int64_t> merged = mesh::mergeRows(positions.data(), vertexCount);
    for (std::size_t i = 0; i < faceCount; ++i)
        for (int corner = 0; corner < 3; ++corner) corners[i][corner] = merged.index[faces[i][corner]];
    result.meshFaces = mesh::dropFaces(merged.rows, corners, options.keepsEqual);
    for (const std::int64_t face : result.meshFaces) result.faces.push_back(faces[face]);
    return result;
}

} // namespace colonnade::packer
