// The column BVH memory: records decoded as what a ray reads them for (docs/errors.md).
#pragma once
#include <algorithm>
#include <optional>

#include "leaf.hpp"

namespace colonnade {

/// Records are decoded as what the tree reads them for. Addresses outside the scene give null. Records that were never
/// loaded are zero.
class ColumnMemory {
public:
    ColumnMemory(const std::map<std::string, Layout>& layouts, const Numbers& numbers)
        : nodeDecoder_(layouts, numbers), leafFields_(layouts), normalFraction_(numbers.normalFraction) {}

    void load(const std::uint8_t* records, std::size_t count, std::size_t bytes) {
        bytes_.assign(records, records + count * bytes);
        recordBytes_ = bytes;
        zero_.assign(bytes, 0);
        isDecoded_ = false;
    }

    /// Sets the number of records, and decodes what a ray can reach from the roots; without a tree the leaves, from
    /// record 0.
    void divide(std::size_t recordCount, const std::vector<std::size_t>& roots, bool bvh, std::size_t leafRecords) {
        const std::array<std::size_t, 3> given{recordCount, bvh, leafRecords};
        if (isDecoded_ && given == given_ && roots == roots_) return;
        given_ = given;
        roots_ = roots;
        recordCount_ = recordCount;
        leaves_.clear();
        slots_.assign(recordCount, Slot());
        leafAt_.assign(recordCount, none);
        if (bvh) reach(roots, leafRecords);
        else
            for (std::size_t address = 0; address < recordCount; address += leafRecords) addLeaf(address);
        isDecoded_ = true;
    }

    std::uint32_t addressMask() const { return nodeDecoder_.addressMask(); }

    /// `other` is where a record is decoded that the tree also reads as a leaf.
    const Node* nodeAt(std::size_t address, Node& other) const {
        if (address >= recordCount_) return nullptr;
        const Slot& slot = slots_[address];
        if (slot.kind == Slot::Kind::node) return &slot.node;
        other = nodeDecoder_.node(at(address), address);
        return &other;
    }

    /// `other` is where a record is decoded that the tree also reads as a node.
    const LeafTriangles* leafAt(std::size_t address, std::optional<LeafTriangles>& other) const {
        if (address >= recordCount_) return nullptr;
        const Slot& slot = slots_[address];
        if (slot.kind == Slot::Kind::leaf) return &slot.leaf;
        return &other.emplace(leaves_[leafAt_[address]]);
    }

    /// Fetches the records that the children of a node begin with, while they are tested.
    void prefetch(std::size_t address) const {
        const Slot* const first = slots_.data() + std::min(address, recordCount_);
        for (int i = 0; i < nodeChildren; ++i) __builtin_prefetch(first + i);
    }

    /// The attributes of a hit triangle, without colours.
    Face faceOf(std::uint64_t id) const {
        return colonnade::faceOf(leaves_[leafAt_[id / leafTriangles]], static_cast<int>(id % leafTriangles),
                                 normalFraction_);
    }

    /// Reads the colours of a hit triangle; false if they are outside the scene.
    bool readColours(std::uint64_t id, Face& face) const {
        const std::size_t companion = id / leafTriangles + 1;
        if (companion >= recordCount_) return false;
        colonnade::readColours(leafFields_, at(companion), static_cast<int>(id % leafTriangles), face);
        return true;
    }

private:
    static constexpr std::uint32_t none = UINT32_MAX;

    /// A record as what it is reached for first, in a line of a processor's cache.
    struct alignas(64) Slot {
        enum class Kind : std::uint8_t { none, node, leaf };

        Slot() : node{} {}
        union {
            Node node;
            LeafTriangles leaf;
        };
        Kind kind = Kind::none;
    };
    static_assert(sizeof(Slot) == 64);

    const std::uint8_t* at(std::size_t address) const {
        return (address + 1) * recordBytes_ <= bytes_.size() ? bytes_.data() + address * recordBytes_ : zero_.data();
    }

    void addLeaf(std::size_t address) {
        if (address >= recordCount_ || leafAt_[address] != none) return;
        leafAt_[address] = static_cast<std::uint32_t>(leaves_.size());
        leaves_.push_back(readLeaf(leafFields_, at(address)));
        Slot& slot = slots_[address];
        if (slot.kind != Slot::Kind::none) return;
        slot.leaf = LeafTriangles(leaves_.back());
        slot.kind = Slot::Kind::leaf;
    }

    void reach(const std::vector<std::size_t>& roots, std::size_t leafRecords) {
        std::vector<std::size_t> waiting(roots);
        std::vector<bool> isReached(recordCount_);
        while (!waiting.empty()) {
            const std::size_t address = waiting.back();
            waiting.pop_back();
            if (address >= recordCount_ || isReached[address]) continue;
            isReached[address] = true;
            const Node node = nodeDecoder_.node(at(address), address);
            if (Slot& slot = slots_[address]; slot.kind == Slot::Kind::none) {
                slot.node = node;
                slot.kind = Slot::Kind::node;
            }
            if (!node.isLegal) continue;
            for (std::size_t i = 0; i < node.nodes; ++i) waiting.push_back(node.first + i);
            for (std::size_t i = 0; i < node.leaves; ++i)
                addLeaf((node.first + node.nodes + i * leafRecords) & addressMask());
        }
    }

    NodeDecoder nodeDecoder_;
    LeafFields leafFields_;
    int normalFraction_;
    std::vector<std::uint8_t> bytes_, zero_;
    std::size_t recordBytes_ = 0, recordCount_ = 0;
    std::array<std::size_t, 3> given_{};
    std::vector<std::size_t> roots_;
    bool isDecoded_ = false;
    std::vector<Slot> slots_;           ///< by address
    std::vector<std::uint32_t> leafAt_; ///< by address: index of a leaf
    std::vector<Leaf> leaves_;
};

} // namespace colonnade
