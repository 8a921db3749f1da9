/// The records of the column memory: nodes, triangles and attributes, in this order, by the manifest's layouts.
/// Addresses in nodes are absolute.
#pragma once

#include "model/formats.hpp"
#include "quantise.hpp"
#include "wide_bvh.hpp"

namespace colonnade::packer {

/// What the configuration says of records.
struct RecordFormat {
    std::map<std::string, Layout> layouts;
    int recordBits = 0, vertexBits = 0, boxBits = 0, arity = 0, trianglesPerRecord = 0, stackDepth = 0, normalFraction = 0;
    bool bvh = true;

    std::size_t recordBytes() const { return static_cast<std::size_t>(recordBits / 8); }

    /// Faces of a record of attributes.
    int facesPerRecord() const {
        int count = 0;
        while (layouts.at("attributes").count("faces[" + std::to_string(count) + "].material")) ++count;
        return count;
    }
};

/// The tree over quantised triangles. Without one, every leaf but the last is full.
inline bvh::Bvh buildTree(const QuantisedMesh& quantised, const RecordFormat& format) {
    std::vector<bvh::Box> boxes(quantised.faces.size());
    for (std::size_t i = 0; i < boxes.size(); ++i)
        for (int corner = 0; corner < 3; ++corner) {
            const Units at = quantised.corner(i, corner);
            boxes[i].add({at, at});
        }
    return bvh::build(boxes, format.trianglesPerRecord, format.arity, format.boxBits, format.stackDepth);
}

/// The sections of the column memory, in records, and the bounds of its triangles, vertex units.
struct Sections {
    std::size_t recordCount = 0, triangleBase = 0, triangleRecords = 0, attributeBase = 0;
    Units boundsLow{}, boundsHigh{};
    std::int32_t largestTriangle = 0;  ///< greatest extent of a triangle along an axis
};

/// The attributes of the mesh's faces.
struct FaceAttributes {
    const std::array<mesh::Vector, 3>* cornerNormals;    ///< unit length, or 0
    const std::uint8_t* materials;                       ///< entries of the material table
    const std::uint8_t* isClear;                         ///< faces that let light through
    const std::array<mesh::Row<std::int64_t>, 3>* colours;  ///< red, green, blue at the corners; null: a design without
};

/// Writes the records of a tree.
class RecordPacker {
public:
    RecordPacker(const QuantisedMesh& quantised, const bvh::Bvh& tree, const RecordFormat& format)
        : quantised_(quantised), tree_(tree), format_(format), leafFirst_(tree.tree.leafFirst), leafCount_(tree.tree.leafCount) {
        const std::size_t triangles = tree.order.size();
        if (!format.bvh) {
            leafFirst_.clear();
            leafCount_.clear();
            const auto perRecord = static_cast<std::size_t>(format.trianglesPerRecord);
            for (std::size_t first = 0; first < triangles; first += perRecord) {
                leafFirst_.push_back(static_cast<std::uint32_t>(first));
                leafCount_.push_back(static_cast<std::uint32_t>(std::min(perRecord, triangles - first)));
            }
        }
        const auto perRecord = static_cast<std::size_t>(format.facesPerRecord());
        sections_.triangleBase = format.bvh ? tree.tree.nodes() : 0;
        sections_.triangleRecords = leafFirst_.size();
        sections_.attributeBase = sections_.triangleBase + leafFirst_.size();
        sections_.recordCount = sections_.attributeBase + (triangles + perRecord - 1) / perRecord;
        orderCorners();
        findBounds();
    }

    const Sections& sections() const { return sections_; }

    /// The corner of the mesh's face that is each corner of a packed triangle. The second triangle of a leaf whose triangles
    /// share an edge starts with the first one's corners 1 and 0, by which the triangle unit recognises the edge.
    int cornerOf(std::size_t packed, int corner) const { return (rotation_[packed] + corner) % 3; }

    /// All records. Throws std::invalid_argument for a value that does not fit its field.
    std::vector<std::uint8_t> records(const FaceAttributes& attributes) const {
        std::vector<std::uint8_t> records(sections_.recordCount * format_.recordBytes());
        if (format_.bvh) writeNodes(records.data());
        writeTriangles(records.data() + sections_.triangleBase * format_.recordBytes(), attributes);
        writeAttributes(records.data() + sections_.attributeBase * format_.recordBytes(), attributes);
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
            const auto at = [&](std::size_t packed, int corner) { return quantised_.corner(tree_.order[packed], corner % 3); };
            for (int i = 0; i < 3; ++i)
                for (int j = 0; j < 3; ++j)
                    if (at(first, i) == at(first + 1, j + 1) && at(first, i + 1) == at(first + 1, j)) {
                        rotation_[first] = i;
                        rotation_[first + 1] = j;
                    }
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
        for (unsigned slot = 0; slot < tree.arity; ++slot) {
            const std::string index = "[" + std::to_string(slot) + "]";
            kinds.push_back(&field("node", "kinds" + index));
            low.push_back(vectorOf("node", "low" + index));
            high.push_back(vectorOf("node", "high" + index));
        }
        for (std::size_t node = 0; node < tree.nodes(); ++node, record += format_.recordBytes()) {
            bool hasNodes = false, hasLeaves = false;
            for (unsigned slot = 0; slot < tree.arity; ++slot) {
                const std::size_t child = node * tree.arity + slot;
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

    void writeTriangles(std::uint8_t* record, const FaceAttributes& attributes) const {
        const Field &firstTriangle = field("triangles", "firstTriangle"), &count = field("triangles", "count");
        std::vector<Vector> vertices;
        std::vector<const Field*> isClear;
        for (int i = 0; i < 3 * format_.trianglesPerRecord; ++i) vertices.push_back(vectorOf("triangles", "vertices[" + std::to_string(i) + "]"));
        for (int i = 0; i < format_.trianglesPerRecord; ++i) isClear.push_back(&field("triangles", "isClear[" + std::to_string(i) + "]"));
        for (std::size_t leaf = 0; leaf < leafFirst_.size(); ++leaf, record += format_.recordBytes()) {
            write(firstTriangle, record, leafFirst_[leaf]);
            write(count, record, leafCount_[leaf]);
            for (std::uint32_t i = 0; i < leafCount_[leaf]; ++i) {
                const std::size_t packed = leafFirst_[leaf] + i;
                write(*isClear[i], record, attributes.isClear[quantised_.meshFaces[tree_.order[packed]]] != 0);
                for (int j = 0; j < 3; ++j) write(vertices[3 * i + j], record, corner(packed, j));
            }
        }
    }

    /// In the order of packed ids; the last record may have empty slots.
    void writeAttributes(std::uint8_t* records, const FaceAttributes& attributes) const {
        const double one = (1 << format_.normalFraction) - 1;
        const int perRecord = format_.facesPerRecord();
        const auto rounded = [&](const mesh::Vector& normal) {
            mesh::Row<std::int64_t> values;
            for (int axis = 0; axis < 3; ++axis) values[axis] = static_cast<std::int64_t>(std::rint(normal[axis] * one));
            return values;
        };
        for (int slot = 0; slot < perRecord; ++slot) {
            const std::string prefix = "faces[" + std::to_string(slot) + "].";
            std::array<Vector, 3> normals, colours{};
            for (int j = 0; j < 3; ++j) {
                const std::string index = "[" + std::to_string(j) + "]";
                normals[j] = vectorOf("attributes", prefix + "normals" + index);
                if (attributes.colours) colours[j] = vectorOf("attributes", prefix + "colours" + index, "rgb");
            }
            const Vector geometric = vectorOf("attributes", prefix + "geometricNormal");
            const Field& material = field("attributes", prefix + "material");
            for (std::size_t packed = slot; packed < tree_.order.size(); packed += perRecord) {
                std::uint8_t* const record = records + packed / perRecord * format_.recordBytes();
                const std::int64_t face = quantised_.meshFaces[tree_.order[packed]];
                for (int j = 0; j < 3; ++j) {
                    write(normals[j], record, rounded(attributes.cornerNormals[face][cornerOf(packed, j)]));
                    if (attributes.colours) write(colours[j], record, attributes.colours[face][cornerOf(packed, j)]);
                }
                write(geometric, record, rounded(geometricNormal(tree_.order[packed])));
                write(material, record, attributes.materials[face]);
            }
        }
    }

    const QuantisedMesh& quantised_;
    const bvh::Bvh& tree_;
    const RecordFormat& format_;
    std::vector<std::uint32_t> leafFirst_, leafCount_;
    std::vector<int> rotation_;
    Sections sections_;
};

} // namespace colonnade::packer
