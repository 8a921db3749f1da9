/// The tree over a quantised mesh. Its leaves are pairs of triangles, or triangles.
#pragma once

#include <optional>

#include "quantise.hpp"
#include "wide_bvh.hpp"

namespace colonnade::packer {

/// What the configuration says of records.
struct RecordFormat {
    std::map<std::string, Layout> layouts;
    int recordBits = 0, vertexBits = 0, boxBits = 0, stackDepth = 0, normalFraction = 0;
    int children = nodeChildren;  ///< most children of a node, 2 to nodeChildren
    bool bvh = true;

    std::size_t recordBytes() const { return static_cast<std::size_t>(recordBits / 8); }

    /// Faces of a record of attributes.
    int facesPerRecord() const {
        int count = 0;
        while (layouts.at("attributes").count("faces[" + std::to_string(count) + "].material")) ++count;
        return count;
    }
};

/// The attributes of the mesh's faces.
struct FaceAttributes {
    const std::array<mesh::Vector, 3>* cornerNormals;    ///< unit length, or 0
    const std::uint8_t* materials;                       ///< entries of the material table
    const std::uint8_t* isClear;                         ///< faces that let light through
    const std::array<mesh::Row<std::int64_t>, 3>* colours;  ///< red, green, blue at the corners; null: a design without
};

/// Recognises pairs: two triangles that share an edge in opposite directions, with equal materials, and equal normals and colours
/// at its ends.
class Pairing {
public:
    Pairing(const QuantisedMesh& quantised, const FaceAttributes& attributes, const RecordFormat& format)
        : quantised_(quantised), attributes_(attributes), normalOne_((1 << format.normalFraction) - 1) {}

    /// The corners of two faces at which each begins their common edge; none if they are no pair.
    std::optional<std::array<int, 2>> edge(std::uint32_t one, std::uint32_t other) const {
        if (attributes_.materials[meshFace(one)] != attributes_.materials[meshFace(other)]) return {};
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j)
                if (isSame(one, i, other, (j + 1) % 3) && isSame(one, (i + 1) % 3, other, j)) return std::array{i, j};
        return {};
    }

    /// A corner's normal as in its record.
    mesh::Row<std::int64_t> normal(std::size_t face, int corner) const { return rounded(attributes_.cornerNormals[meshFace(face)][corner]); }

    mesh::Row<std::int64_t> rounded(const mesh::Vector& normal) const {
        mesh::Row<std::int64_t> values;
        for (int axis = 0; axis < 3; ++axis) values[axis] = static_cast<std::int64_t>(std::rint(normal[axis] * normalOne_));
        return values;
    }

private:
    std::int64_t meshFace(std::size_t face) const { return quantised_.meshFaces[face]; }

    bool isSame(std::uint32_t one, int i, std::uint32_t other, int j) const {
        return quantised_.corner(one, i) == quantised_.corner(other, j) && normal(one, i) == normal(other, j) &&
               (!attributes_.colours || attributes_.colours[meshFace(one)][i] == attributes_.colours[meshFace(other)][j]);
    }

    const QuantisedMesh& quantised_;
    const FaceAttributes attributes_;
    const double normalOne_;
};

/// The tree over quantised triangles.
inline bvh::Bvh buildTree(const QuantisedMesh& quantised, const FaceAttributes& attributes, const RecordFormat& format) {
    std::vector<bvh::Box> boxes(quantised.faces.size());
    for (std::size_t i = 0; i < boxes.size(); ++i)
        for (int corner = 0; corner < 3; ++corner) {
            const Units at = quantised.corner(i, corner);
            boxes[i].add({at, at});
        }
    const Pairing pairing(quantised, attributes, format);
    const auto isPair = [&](std::uint32_t one, std::uint32_t other) { return pairing.edge(one, other).has_value(); };
    return bvh::build(boxes, isPair, static_cast<unsigned>(format.children), static_cast<unsigned>(format.boxBits), static_cast<unsigned>(format.stackDepth));
}

} // namespace colonnade::packer
