// The column BVH memory: records decoded by the section that they are in (docs/errors.md).
#pragma once
#include <algorithm>

#include "formats.hpp"

namespace colonnade {

/// Reads outside a record's section return null. Records that were never loaded are zero.
class ColumnMemory {
public:
    ColumnMemory(const std::map<std::string, Layout>& layouts, const Numbers& numbers) : decoder_(layouts, numbers), unwritten_(emptyRecords()) {}

    void load(const std::uint8_t* records, std::size_t count, std::size_t bytes) {
        bytes_.assign(records, records + count * bytes);
        recordBytes_ = bytes;
        isDecoded_ = false;
    }

    /// Sets the sections: nodes from 0, triangles from `triangleBase`, attributes from `attributeBase` up to `recordCount`. No base may be larger
    /// than the next one.
    void divide(std::size_t recordCount, std::size_t triangleBase, std::size_t attributeBase) {
        if (isDecoded_ && recordCount == recordCount_ && triangleBase == triangleBase_ && attributeBase == attributeBase_) return;
        recordCount_ = recordCount;
        triangleBase_ = triangleBase;
        attributeBase_ = attributeBase;
        const std::size_t end = std::min(recordCount, recordBytes_ == 0 ? 0 : bytes_.size() / recordBytes_);
        nodes_.clear();
        triangles_.clear();
        faces_.clear();
        for (std::size_t i = 0; i < std::min(triangleBase, end); ++i) nodes_.push_back(decoder_.node(at(i), i));
        for (std::size_t i = triangleBase; i < std::min(attributeBase, end); ++i) triangles_.push_back(decoder_.triangles(at(i)));
        for (std::size_t i = attributeBase; i < end; ++i)
            for (int slot = 0; slot < decoder_.facesPerRecord(); ++slot) faces_.push_back(decoder_.face(at(i), slot));
        isDecoded_ = true;
    }

    std::uint32_t addressMask() const { return decoder_.addressMask(); }

    const Node* nodeAt(std::size_t address) const {
        if (address >= triangleBase_) return nullptr;
        return address < nodes_.size() ? &nodes_[address] : &unwritten_.node;
    }

    const Triangles* trianglesAt(std::size_t address) const {
        if (address < triangleBase_ || address >= attributeBase_) return nullptr;
        const std::size_t index = address - triangleBase_;
        return index < triangles_.size() ? &triangles_[index] : &unwritten_.triangles;
    }

    const Face* faceOf(std::uint64_t id) const {
        const std::size_t index = id - leafTriangles * triangleBase_;
        if (attributeBase_ + index / static_cast<std::size_t>(decoder_.facesPerRecord()) >= recordCount_) return nullptr;
        return index < faces_.size() ? &faces_[index] : &unwritten_.face;
    }

private:
    struct Unwritten {
        Node node;
        Triangles triangles;
        Face face;
    };

    static Unwritten emptyRecords() {
        Unwritten empty{};
        empty.node.isLegal = true; // a node without children
        return empty;
    }

    const std::uint8_t* at(std::size_t address) const { return bytes_.data() + address * recordBytes_; }

    RecordDecoder decoder_;
    Unwritten unwritten_;
    std::vector<std::uint8_t> bytes_;
    std::size_t recordBytes_ = 0, recordCount_ = 0, triangleBase_ = 0, attributeBase_ = 0;
    bool isDecoded_ = false;
    std::vector<Node> nodes_;
    std::vector<Triangles> triangles_;
    std::vector<Face> faces_;
};

} // namespace colonnade
