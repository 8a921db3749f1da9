/// The records of the column memory by the manifest's layouts: the tree from record 0, without one its leaves alone in
/// the same order, and behind each leaf its companion if the mesh has colours. Addresses in nodes are absolute.
#pragma once

#include "tree.hpp"

namespace colonnade::packer {

/// The records of the column memory, and the bounds of its triangles, vertex units.
struct Sections {
    std::size_t recordCount = 0, nodes = 0, leaves = 0;
    Units boundsLow{}, boundsHigh{};
    std::int32_t largestTriangle = 0;  ///< greatest extent of a triangle along an axis
};

/// Writes the records of a tree.
class RecordPacker {
public:
    RecordPacker(const QuantisedMesh& quantised, const FaceAttributes& attributes, const bvh::Bvh& tree,
                 const RecordFormat& format)
        : quantised_(quantised), attributes_(attributes), pairing_(quantised, attributes, format), tree_(tree),
          format_(format), leafFirst_(tree.tree.leafFirst), leafCount_(tree.tree.leafTriangleCount) {
        sections_.nodes = format.bvh ? tree.tree.nodes() : 0;
        sections_.leaves = tree.tree.leaves();
        sections_.recordCount = sections_.nodes + sections_.leaves * attributes.leafRecords();
        findBounds();
    }

    const Sections& sections() const { return sections_; }

    /// The position in the order of the tree of each packed id; −1 where there is none.
    std::vector<std::int64_t> indices() const {
        std::vector<std::int64_t> indices(leafTriangles * sections_.recordCount, -1);
        for (std::size_t leaf = 0; leaf < sections_.leaves; ++leaf)
            for (std::uint32_t k = 0; k < leafCount_[leaf]; ++k)
                indices[leafTriangles * addressOf(leaf) + k] = leafFirst_[leaf] + k;
        return indices;
    }

    /// The corner of its quantised face that is corner 0 of each triangle, by position in the order.
    std::vector<std::uint8_t> rotations() const {
        std::vector<std::uint8_t> rotations(tree_.order.size());
        for (std::size_t leaf = 0; leaf < sections_.leaves; ++leaf) {
            if (leafCount_[leaf] == 1) continue;
            std::array<int, 2> begins{};
            const std::uint32_t first = leafFirst_[leaf];
            pairing_.pair(tree_.order[first], tree_.order[first + 1], begins);
            for (int k = 0; k < leafTriangles; ++k)
                rotations[first + static_cast<std::uint32_t>(k)] = static_cast<std::uint8_t>(begins[k]);
        }
        return rotations;
    }

    /// The corner of a quantised face that is each of the four vertices of a leaf, in the order of leaves: 3 · face +
    /// corner; −1 for the fourth of a triangle.
    std::vector<std::int64_t> leafCorners() const {
        std::vector<std::int64_t> corners;
        for (std::size_t leaf = 0; leaf < sections_.leaves; ++leaf) {
            std::array<int, 2> begins{};
            const std::uint32_t* const faces = &tree_.order[leafFirst_[leaf]];
            const bool isPair = leafCount_[leaf] == leafTriangles;
            if (isPair) pairing_.pair(faces[0], faces[1], begins);
            for (int i = 0; i < 3; ++i) corners.push_back(std::int64_t{3} * faces[0] + (begins[0] + i) % 3);
            corners.push_back(isPair ? std::int64_t{3} * faces[1] + (begins[1] + 2) % 3 : -1);
        }
        return corners;
    }

    /// The quantised face of each packed id; −1 where there is none.
    std::vector<std::int64_t> faces() const {
        std::vector<std::int64_t> faces = indices();
        for (std::int64_t& face : faces)
            if (face >= 0) face = tree_.order[face];
        return faces;
    }

    /// All records. Throws std::invalid_argument for a value that does not fit its field.
    std::vector<std::uint8_t> records() const {
        std::vector<std::uint8_t> records(sections_.recordCount * format_.recordBytes());
        if (format_.bvh) writeNodes(records.data());
        writeLeaves(records.data());
        return records;
    }

private:
    using Vector = std::array<const Field*, 3>;

    const Field& field(const char* record, const std::string& name) const {
        return format_.layouts.at(record).at(name);
    }

    Vector vectorOf(const char* record, const std::string& name, const char* components = "xyz") const {
        return {&field(record, name + "." + components[0]), &field(record, name + "." + components[1]),
                &field(record, name + "." + components[2])};
    }

    static void write(const Field& field, std::uint8_t* record, std::int64_t value) {
        if (!field.holds(value))
            throw std::invalid_argument("a value does not fit " + std::to_string(field.width) + " bits of a record");
        field.write(record, value);
    }

    template <class T> static void write(const Vector& fields, std::uint8_t* record, const T& values) {
        for (int axis = 0; axis < 3; ++axis) write(*fields[axis], record, values[axis]);
    }

    void findBounds() {
        bvh::Box bounds;
        for (std::size_t packed = 0; packed < tree_.order.size(); ++packed) {
            bvh::Box box;
            for (int i = 0; i < 3; ++i) {
                const Units at = quantised_.corner(tree_.order[packed], i);
                box.add({at, at});
            }
            for (int axis = 0; axis < 3; ++axis)
                sections_.largestTriangle = std::max(sections_.largestTriangle, box.high[axis] - box.low[axis]);
            bounds.add(box);
        }
        sections_.boundsLow = bounds.low;
        sections_.boundsHigh = bounds.high;
    }

    std::size_t addressOf(std::size_t leaf) const {
        return format_.bvh ? tree_.tree.leafAddress[leaf] : leaf * attributes_.leafRecords();
    }

    std::uint8_t* recordAt(std::uint8_t* records, std::size_t address) const {
        return records + address * format_.recordBytes();
    }

    void writeNodes(std::uint8_t* records) const {
        const bvh::WideTree& tree = tree_.tree;
        const Field &first = field("node", "first"), &nodes = field("node", "nodes"), &leaves = field("node", "leaves");
        const Vector corner = vectorOf("node", "corner");
        std::vector<Vector> low, high;
        for (int slot = 0; slot < nodeChildren; ++slot) {
            const std::string prefix = "children[" + std::to_string(slot) + "].";
            low.push_back(vectorOf("node", prefix + "low"));
            high.push_back(vectorOf("node", prefix + "high"));
        }
        for (std::size_t node = 0; node < tree.nodes(); ++node) {
            std::uint8_t* const record = recordAt(records, tree.nodeAddress[node]);
            for (int slot = 0; slot < nodeChildren; ++slot) {
                const std::size_t child = node * nodeChildren + slot;
                write(low[slot], record, &tree.low[3 * child]);
                write(high[slot], record, &tree.high[3 * child]);
            }
            for (int axis = 0; axis < 3; ++axis)
                write(*corner[axis], record,
                      std::int64_t{2} * tree.origin[3 * node + axis] +
                          (std::int64_t{1} << tree.exponent[3 * node + axis]));
            write(first, record, tree.first[node]);
            write(nodes, record, tree.nodeCount[node]);
            write(leaves, record, tree.leafCount[node]);
        }
    }

    void writeLeaves(std::uint8_t* records) const {
        for (std::size_t leaf = 0; leaf < sections_.leaves; ++leaf) {
            const std::uint32_t* const faces = &tree_.order[leafFirst_[leaf]];
            std::array<int, 2> begins{};
            const Leaf written =
                leafCount_[leaf] == 1 ? pairing_.triangle(faces[0]) : pairing_.pair(faces[0], faces[1], begins).value();
            writeLeaf(pairing_.fields(), written, recordAt(records, addressOf(leaf)));
            if (!attributes_.colours) continue;
            std::uint8_t* const companion = recordAt(records, addressOf(leaf) + 1);
            for (int i = 0; i < written.corners(); ++i) {
                const std::uint32_t face = faces[i / 3];
                const int corner = i < 3 ? (begins[0] + i) % 3 : (begins[1] + 2) % 3;
                for (int channel = 0; channel < 3; ++channel)
                    write(pairing_.fields().colours[i][channel], companion,
                          attributes_.colours[quantised_.meshFaces[face]][corner][channel]);
            }
        }
    }

    const QuantisedMesh& quantised_;
    const FaceAttributes attributes_;
    const Pairing pairing_;
    const bvh::Bvh& tree_;
    const RecordFormat& format_;
    const std::vector<std::uint32_t>&leafFirst_, &leafCount_;
    Sections sections_;
};

} // namespace colonnade::packer
