/// Which triangles share a leaf.
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

/// Recognises pairs: two triangles that share an edge in opposite directions, with one material, whose codes of normals
/// and colours are equal at its ends, and whose vertices a leaf can hold.
class Pairing {
public:
    Pairing(const QuantisedMesh& quantised, const FaceAttributes& attributes, const RecordFormat& format)
        : quantised_(quantised), attributes_(attributes), fields_(format.layouts),
          normalFraction_(format.normalFraction), bends_(format.bends), codes_(quantised.faces.size()) {
        for (std::size_t face = 0; face < codes_.size(); ++face)
            for (int i = 0; i < 3; ++i) {
                const mesh::Vector& normal = attributes_.cornerNormals[meshFace(face)][i];
                codes_[face][i] = octahedralOf(normal == mesh::Vector{} ? areaOf(face) : normal);
            }
    }

    const LeafFields& fields() const { return fields_; }

    /// A face alone.
    Leaf triangle(std::uint32_t face) const {
        Leaf leaf{LeafFormat::triangle,
                  attributes_.isClear[meshFace(face)] != 0,
                  attributes_.materials[meshFace(face)],
                  {},
                  {}};
        for (int i = 0; i < 3; ++i) take(leaf, i, face, i);
        return leaf;
    }

    /// Two faces; none if they are no pair. `begins` are the corners at which each begins their common edge.
    std::optional<Leaf> pair(std::uint32_t one, std::uint32_t other, std::array<int, 2>& begins) const {
        if (attributes_.materials[meshFace(one)] != attributes_.materials[meshFace(other)] ||
            attributes_.isClear[meshFace(one)] != attributes_.isClear[meshFace(other)])
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
               (!attributes_.colours ||
                attributes_.colours[meshFace(one)][i] == attributes_.colours[meshFace(other)][j]);
    }

    const QuantisedMesh& quantised_;
    const FaceAttributes attributes_;
    const LeafFields fields_;
    const int normalFraction_;
    const bool bends_;
    std::vector<std::array<Octahedral, 3>> codes_;
};

/// Divides triangles among leaves, two to each if they are a pair. A pair costs the area of its box, in proportion to
/// the boxes of its triangles. The cheapest ones are joined first. Then a triangle that is left takes a neighbour from
/// its pair, if the other one of that pair also has a neighbour that is left.
class Matching {
public:
    Matching(const QuantisedMesh& quantised, const std::vector<bvh::Box>& boxes, const Pairing& pairing)
        : boxes_(boxes), pairOf_(boxes.size(), none) {
        findPairs(quantised, pairing);
        for (std::uint32_t pair = 0; pair < pairs_.size(); ++pair)
            if (isAlone(pairs_[pair].faces[0]) && isAlone(pairs_[pair].faces[1])) join(pair);
        for (bool isChanged = true; isChanged;) {
            isChanged = false;
            for (std::uint32_t face = 0; face < boxes_.size(); ++face) isChanged |= isAlone(face) && exchange(face);
        }
    }

    /// The triangles of each leaf, by the first of them.
    std::vector<bvh::LeafTriangles> leaves() const {
        std::vector<bvh::LeafTriangles> leaves;
        for (std::uint32_t face = 0; face < boxes_.size(); ++face)
            if (isAlone(face)) leaves.push_back({face, bvh::noTriangle});
            else if (const std::uint32_t other = partnerOf(face); face < other) leaves.push_back({face, other});
        return leaves;
    }

private:
    static constexpr std::uint32_t none = UINT32_MAX;
    static constexpr int costFraction = 20;
    static constexpr std::size_t window = 4;  ///< faces at an edge, of which each may be paired with the next ones

    using Cost = __int128;

    /// Two triangles that may share a leaf.
    struct Pair {
        Cost cost;
        std::array<std::uint32_t, 2> faces;

        std::uint32_t beyond(std::uint32_t face) const { return faces[faces[0] == face]; }
    };

    /// An edge of a face, by the positions of its ends.
    struct Side {
        std::uint64_t ends;
        std::uint32_t face;
    };

    void findPairs(const QuantisedMesh& quantised, const Pairing& pairing) {
        const std::vector<std::int64_t> position =
            mesh::mergeRows(quantised.vertices.data(), quantised.vertices.size()).index;
        std::vector<Side> sides;
        for (std::uint32_t face = 0; face < boxes_.size(); ++face)
            for (int i = 0; i < 3; ++i) {
                const auto one = static_cast<std::uint64_t>(position[quantised.faces[face][i]]),
                           other = static_cast<std::uint64_t>(position[quantised.faces[face][(i + 1) % 3]]);
                sides.push_back({std::min(one, other) << 32 | std::max(one, other), face});
            }
        std::stable_sort(sides.begin(), sides.end(),
                         [](const Side& one, const Side& other) { return one.ends < other.ends; });
        std::array<int, 2> begins;
        for (std::size_t one = 0; one < sides.size(); ++one)
            for (std::size_t other = one + 1;
                 other < std::min(sides.size(), one + window) && sides[other].ends == sides[one].ends; ++other)
                if (pairing.pair(sides[one].face, sides[other].face, begins))
                    pairs_.push_back(
                        {costOf(sides[one].face, sides[other].face), {sides[one].face, sides[other].face}});
        std::stable_sort(pairs_.begin(), pairs_.end(),
                         [](const Pair& one, const Pair& other) { return one.cost < other.cost; });

        // The pairs of each face
        starts_.assign(boxes_.size() + 1, 0);
        for (const Pair& pair : pairs_)
            for (const std::uint32_t face : pair.faces) ++starts_[face + 1];
        std::partial_sum(starts_.begin(), starts_.end(), starts_.begin());
        pairsOf_.resize(2 * pairs_.size());
        std::vector<std::uint32_t> end(starts_);
        for (std::uint32_t pair = 0; pair < pairs_.size(); ++pair)
            for (const std::uint32_t face : pairs_[pair].faces) pairsOf_[end[face]++] = pair;
    }

    Cost costOf(std::uint32_t one, std::uint32_t other) const {
        bvh::Box both = boxes_[one];
        both.add(boxes_[other]);
        return (Cost{both.halfArea()} << costFraction) / (Cost{boxes_[one].halfArea()} + boxes_[other].halfArea() + 1);
    }

    bool isAlone(std::uint32_t face) const { return pairOf_[face] == none; }
    std::uint32_t partnerOf(std::uint32_t face) const { return pairs_[pairOf_[face]].beyond(face); }

    void join(std::uint32_t pair) {
        for (const std::uint32_t face : pairs_[pair].faces) pairOf_[face] = pair;
    }

    /// Replaces a pair by one with `face` and one with another triangle that is left, at the least cost, if there is
    /// one.
    bool exchange(std::uint32_t face) {
        Cost least = 0;
        std::array<std::uint32_t, 2> best{none, none};
        for (std::uint32_t i = starts_[face]; i < starts_[face + 1]; ++i) {
            const std::uint32_t neighbour = pairs_[pairsOf_[i]].beyond(face), partner = partnerOf(neighbour);
            for (std::uint32_t j = starts_[partner]; j < starts_[partner + 1]; ++j) {
                const std::uint32_t last = pairs_[pairsOf_[j]].beyond(partner);
                if (last == face || !isAlone(last)) continue;
                const Cost more = pairs_[pairsOf_[i]].cost + pairs_[pairsOf_[j]].cost - pairs_[pairOf_[neighbour]].cost;
                if (best[0] != none && more >= least) continue;
                least = more;
                best = {pairsOf_[i], pairsOf_[j]};
            }
        }
        if (best[0] == none) return false;
        for (const std::uint32_t pair : best) join(pair);
        return true;
    }

    const std::vector<bvh::Box>& boxes_;
    std::vector<Pair> pairs_;                     ///< by rising cost
    std::vector<std::uint32_t> starts_, pairsOf_; ///< by face: where its pairs begin, and they
    std::vector<std::uint32_t> pairOf_;           ///< by face: the pair that it is in
};

} // namespace colonnade::packer
