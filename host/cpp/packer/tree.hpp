/// The tree over a quantised mesh. Its leaves are pairs of triangles, or triangles.
#pragma once

#include <optional>

#include "leaf.hpp"
#include "quantise.hpp"
#include "wide_bvh.hpp"

namespace colonnade::packer {

/// What the configuration says of records.
struct RecordFormat {
    std::map<std::string, Layout> layouts;
    int recordBits = 0, vertexBits = 0, boxBits = 0, stackDepth = 0, normalFraction = 0;
    int children = nodeChildren;  ///< most children of a node, 2 to nodeChildren
    bool bvh = true;
    bool bends = false;  ///< the mesh has a clip: vertices that are at one place may part

    std::size_t recordBytes() const { return static_cast<std::size_t>(recordBits / 8); }
};

/// The attributes of the mesh's faces.
struct FaceAttributes {
    const std::array<mesh::Vector, 3>* cornerNormals;    ///< unit length, or 0
    const std::uint8_t* materials;                       ///< entries of the material table
    const std::uint8_t* isClear;                         ///< faces that let light through
    const std::array<mesh::Row<std::int64_t>, 3>* colours;  ///< red, green, blue at the corners; null: none

    /// Records of a leaf: itself, and the companion with its colours.
    std::size_t leafRecords() const { return colours ? 2 : 1; }
};

/// Recognises pairs: two triangles that share an edge in opposite directions, with one material, whose codes of normals and colours
/// are equal at its ends, and whose vertices a leaf can hold.
class Pairing {
public:
    Pairing(const QuantisedMesh& quantised, const FaceAttributes& attributes, const RecordFormat& format)
        : quantised_(quantised), attributes_(attributes), fields_(format.layouts), normalFraction_(format.normalFraction), bends_(format.bends),
          codes_(quantised.faces.size()) {
        for (std::size_t face = 0; face < codes_.size(); ++face)
            for (int i = 0; i < 3; ++i) {
                const mesh::Vector& normal = attributes_.cornerNormals[meshFace(face)][i];
                codes_[face][i] = octahedralOf(normal == mesh::Vector{} ? areaOf(face) : normal);
            }
    }

    const LeafFields& fields() const { return fields_; }

    /// A face alone.
    Leaf triangle(std::uint32_t face) const {
        Leaf leaf{LeafFormat::triangle, attributes_.isClear[meshFace(face)] != 0, attributes_.materials[meshFace(face)], {}, {}};
        for (int i = 0; i < 3; ++i) take(leaf, i, face, i);
        return leaf;
    }

    /// Two faces; none if they are no pair. `begins` are the corners at which each begins their common edge.
    std::optional<Leaf> pair(std::uint32_t one, std::uint32_t other, std::array<int, 2>& begins) const {
        if (attributes_.materials[meshFace(one)] != attributes_.materials[meshFace(other)] || attributes_.isClear[meshFace(one)] != attributes_.isClear[meshFace(other)])
            return {};
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) {
                if (!isSame(one, i, other, (j + 1) % 3) || !isSame(one, (i + 1) % 3, other, j)) continue;
                Leaf leaf = triangle(one);
                for (int k = 0; k < 3; ++k) take(leaf, k, one, (i + k) % 3);
                take(leaf, 3, other, (j + 2) % 3);
                begins = {i, j};
                const std::optional<LeafFormat> format = formatOf(fields_, leaf, normalFraction_, bends_);
                if (!format) return {};
                leaf.format = *format;
                return leaf;
            }
        return {};
    }

private:
    std::int64_t meshFace(std::size_t face) const { return quantised_.meshFaces[face]; }

    /// The normal of a quantised triangle by its winding, as long as twice its area.
    mesh::Vector areaOf(std::size_t face) const {
        std::array<mesh::Vector, 3> corners;
        for (int i = 0; i < 3; ++i) {
            const Units at = quantised_.corner(face, i);
            corners[i] = {static_cast<double>(at[0]), static_cast<double>(at[1]), static_cast<double>(at[2])};
        }
        return mesh::cross(mesh::difference(corners[1], corners[0]), mesh::difference(corners[2], corners[0]));
    }

    void take(Leaf& leaf, int vertex, std::uint32_t face, int corner) const {
        const Units at = quantised_.corner(face, corner);
        leaf.vertices[vertex] = {at[0], at[1], at[2]};
        leaf.normals[vertex] = codes_[face][corner];
    }

    bool isSame(std::uint32_t one, int i, std::uint32_t other, int j) const {
        return quantised_.corner(one, i) == quantised_.corner(other, j) && codes_[one][i] == codes_[other][j] &&
               (!bends_ || quantised_.faces[one][i] == quantised_.faces[other][j]) &&
               (!attributes_.colours || attributes_.colours[meshFace(one)][i] == attributes_.colours[meshFace(other)][j]);
    }

    const QuantisedMesh& quantised_;
    const FaceAttributes attributes_;
    const LeafFields fields_;
    const int normalFraction_;
    const bool bends_;
    std::vector<std::array<Octahedral, 3>> codes_;
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
    const auto isPair = [&](std::uint32_t one, std::uint32_t other) {
        std::array<int, 2> begins;
        return pairing.pair(one, other, begins).has_value();
    };
    return bvh::build(boxes, isPair, static_cast<unsigned>(format.children), static_cast<unsigned>(format.boxBits), static_cast<unsigned>(format.stackDepth),
                      static_cast<unsigned>(attributes.leafRecords()));
}

} // namespace colonnade::packer
