/// The records of the column memory: nodes, triangles and attributes, in this order, by the manifest's layouts.
/// Addresses in nodes are absolute.
#pragma once

#include "tree.hpp"

namespace colonnade::packer {

/// The sections of the column memory, in records, and the bounds of its triangles, vertex units.
struct Sections {
    std::size_t recordCount = 0, triangleBase = 0, triangleRecords = 0, attributeBase = 0;
    Units boundsLow{}, boundsHigh{};
    std::int32_t largestTriangle = 0;  ///< greatest extent of a triangle along an axis
};

/// Writes the records of a tree.
class RecordPacker {
public:
    RecordPacker(const QuantisedMesh& quantised, const FaceAttributes& attributes, const bvh::Bvh& tree, const RecordFormat& format)
        : quantised_(quantised), attributes_(attributes), pairing_(quantised, attributes, format), tree_(tree), format_(format), leafFirst_(tree.tree.leafFirst),
          leafCount_(tree.tree.leafCount) {
        const auto perRecord = static_cast<std::size_t>(format.facesPerRecord());
        sections_.triangleBase = format.bvh ? tree.tree.nodes() : 0;
        sections_.triangleRecords = leafFirst_.size();
        sections_.attributeBase = sections_.triangleBase + leafFirst_.size();
        sections_.recordCount = sections_.attributeBase + leafFirst_.size() * leafTriangles / perRecord;
        orderCorners();
        findBounds();
    }

    const Sections& sections() const { return sections_; }

    /// The corner of the mesh's face that is each corner of a packed triangle. The second triangle of a pair starts with the
    /// first one's corners 1 and 0, by which the triangle unit recognises the edge.
    int cornerOf(std::size_t packed, int corner) const { return (rotation_[packed] + corner) % 3; }

    /// The index of each packed id in the order of the tree; −1 where there is none.
    std::vector<std::int64_t> indices() const {
        std::vector<std::int64_t> indices(leafTriangles * sections_.attributeBase, -1);
        for (std::size_t leaf = 0; leaf < leafFirst_.size(); ++leaf)
            for (std::uint32_t k = 0; k < leafCount_[leaf]; ++k) indices[leafTriangles * (sections_.triangleBase + leaf) + k] = leafFirst_[leaf] + k;
        return indices;
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
        writeTriangles(records.data() + sections_.triangleBase * format_.recordBytes());
        writeAttributes(records.data() + sections_.attributeBase * format_.recordBytes());
        return records;
    }

    /// Unit normals of a quantised triangle by its winding; the cross product is exact.
    mesh::Vector geometricNormal(std::size_t face) const {
        std::array<mesh::Row<std::int64_t>, 3> corners;
        for (int corner = 0; corner < 3; ++corner) {
            const Units at = quantised_.corner(face, corner);
            corners[corner] = {at[0], at[1], at[2]};
        }
        const mesh::Row<std::int64_t> area = mesh::cross(mesh::difference(corners[1], corners[0]), mesh::difference(corners[2], corners[0]));
        return mesh::unit({static_cast<double>(area[0]), static_cast<double>(area[1]), static_cast<double>(area[2])});
    }

private:
    using Vector = std::array<const Field*, 3>;

    const Field& field(const char* record, const std::string& name) const { return format_.layouts.at(record).at(name); }

    Vector vectorOf(const char* record, const std::string& name, const char* components = "xyz") const {
        return {&field(record, name + "." + components[0]), &field(record, name + "." + components[1]), &field(record, name + "." + components[2])};
    }

    static void write(const Field& field, std::uint8_t* record, std::int64_t value) {
        if (!field.holds(value)) throw std::invalid_argument("a value does not fit " + std::to_string(field.width) + " bits of a record");
        field.write(record, value);
    }

    template <class T> static void write(const Vector& fields, std::uint8_t* record, const T& values) {
        for (int axis = 0; axis < 3; ++axis) write(*fields[axis], record, values[axis]);
    }

    Units corner(std::size_t packed, int corner) const { return quantised_.corner(tree_.order[packed], cornerOf(packed, corner)); }

    void orderCorners() {
        rotation_.assign(tree_.order.size(), 0);
        for (std::size_t leaf = 0; leaf < leafFirst_.size(); ++leaf) {
            if (leafCount_[leaf] != 2) continue;
            const std::uint32_t first = leafFirst_[leaf];
            const std::array<int, 2> edge = pairing_.edge(tree_.order[first], tree_.order[first + 1]).value();
            std::copy(edge.begin(), edge.end(), rotation_.begin() + first);
        }
    }

    void findBounds() {
        bvh::Box bounds;
        for (std::size_t packed = 0; packed < tree_.order.size(); ++packed) {
            bvh::Box box;
            for (int i = 0; i < 3; ++i) box.add({corner(packed, i), corner(packed, i)});
            for (int axis = 0; axis < 3; ++axis) sections_.largestTriangle = std::max(sections_.largestTriangle, box.high[axis] - box.low[axis]);
            bounds.add(box);
        }
        sections_.boundsLow = bounds.low;
        sections_.boundsHigh = bounds.high;
    }

    /// Child addresses are 0 without a child of that kind.
    void writeNodes(std::uint8_t* record) const {
        const bvh::WideTree& tree = tree_.tree;
        const Field &firstChild = field("node", "firstChild"), &firstTriangles = field("node", "firstTriangles");
        const Vector origin = vectorOf("node", "origin"), exponent = vectorOf("node", "exponent");
        std::vector<const Field*> kinds;
        std::vector<Vector> low, high;
        for (int slot = 0; slot < nodeChildren; ++slot) {
            const std::string index = "[" + std::to_string(slot) + "]";
            kinds.push_back(&field("node", "kinds" + index));
            low.push_back(vectorOf("node", "low" + index));
            high.push_back(vectorOf("node", "high" + index));
        }
        for (std::size_t node = 0; node < tree.nodes(); ++node, record += format_.recordBytes()) {
            bool hasNodes = false, hasLeaves = false;
            for (int slot = 0; slot < nodeChildren; ++slot) {
                const std::size_t child = node * nodeChildren + slot;
                const auto kind = static_cast<bvh::Kind>(tree.kinds[child]);
                hasNodes = hasNodes || kind == bvh::Kind::node;
                hasLeaves = hasLeaves || kind == bvh::Kind::leaf;
                write(*kinds[slot], record, tree.kinds[child]);
                write(low[slot], record, &tree.low[3 * child]);
                write(high[slot], record, &tree.high[3 * child]);
            }
            write(origin, record, &tree.origin[3 * node]);
            write(exponent, record, &tree.exponent[3 * node]);
            if (hasNodes) write(firstChild, record, tree.firstChild[node]);
            if (hasLeaves) write(firstTriangles, record, static_cast<std::int64_t>(tree.firstTriangles[node] + sections_.triangleBase));
        }
    }

    void writeTriangles(std::uint8_t* record) const {
        const Field& count = field("triangles", "count");
        std::vector<Vector> vertices;
        std::vector<const Field*> isClear;
        for (int i = 0; i < 3 * leafTriangles; ++i) vertices.push_back(vectorOf("triangles", "vertices[" + std::to_string(i) + "]"));
        for (int i = 0; i < leafTriangles; ++i) isClear.push_back(&field("triangles", "isClear[" + std::to_string(i) + "]"));
        for (std::size_t leaf = 0; leaf < leafFirst_.size(); ++leaf, record += format_.recordBytes()) {
            write(count, record, leafCount_[leaf]);
            for (std::uint32_t i = 0; i < leafCount_[leaf]; ++i) {
                const std::size_t packed = leafFirst_[leaf] + i;
                write(*isClear[i], record, attributes_.isClear[quantised_.meshFaces[tree_.order[packed]]] != 0);
                for (int j = 0; j < 3; ++j) write(vertices[3 * i + j], record, corner(packed, j));
            }
        }
    }

    /// In the order of leaves, two slots for each.
    void writeAttributes(std::uint8_t* records) const {
        const int perRecord = format_.facesPerRecord();
        for (int slot = 0; slot < perRecord; ++slot) {
            const std::string prefix = "faces[" + std::to_string(slot) + "].";
            std::array<Vector, 3> normals, colours{};
            for (int j = 0; j < 3; ++j) {
                const std::string index = "[" + std::to_string(j) + "]";
                normals[j] = vectorOf("attributes", prefix + "normals" + index);
                if (attributes_.colours) colours[j] = vectorOf("attributes", prefix + "colours" + index, "rgb");
            }
            const Vector geometric = vectorOf("attributes", prefix + "geometricNormal");
            const Field& material = field("attributes", prefix + "material");
            for (std::size_t at = slot; at < leafTriangles * leafFirst_.size(); at += perRecord) {
                if (at % leafTriangles >= leafCount_[at / leafTriangles]) continue;
                const std::size_t packed = leafFirst_[at / leafTriangles] + at % leafTriangles;
                std::uint8_t* const record = records + at / perRecord * format_.recordBytes();
                const std::int64_t face = quantised_.meshFaces[tree_.order[packed]];
                for (int j = 0; j < 3; ++j) {
                    write(normals[j], record, pairing_.normal(tree_.order[packed], cornerOf(packed, j)));
                    if (attributes_.colours) write(colours[j], record, attributes_.colours[face][cornerOf(packed, j)]);
                }
                write(geometric, record, pairing_.rounded(geometricNormal(tree_.order[packed])));
                write(material, record, attributes_.materials[face]);
            }
        }
    }

    const QuantisedMesh& quantised_;
    const FaceAttributes attributes_;
    const Pairing pairing_;
    const bvh::Bvh& tree_;
    const RecordFormat& format_;
    const std::vector<std::uint32_t>&leafFirst_, &leafCount_;
    std::vector<int> rotation_;
    Sections sections_;
};

} // namespace colonnade::packer
