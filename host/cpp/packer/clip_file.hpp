/// Clip files: what bends a mesh on a target (docs/driver.md).
#pragma once

#include "grid_clip.hpp"
#include "model/normals.hpp"

namespace colonnade::packer {

/// The clip's vertices of a leaf, the fourth of a triangle −1.
using ClipLeaf = std::array<std::int64_t, 4>;

/// The records of a mesh that bends.
struct ClipTree {
    int vertexBits, deltaBits, boxBits, addressBits;
    int leafRecords;
    std::size_t records, depth;  ///< nodes and leaves; nodes on the longest path from the root
    std::vector<ClipLeaf> leaves;
};

/// The lowest bit of each field that a target writes, in the order of a clip file.
inline std::vector<std::uint8_t> fieldLows(const std::map<std::string, Layout>& layouts) {
    std::vector<std::uint8_t> lows;
    const auto add = [&](const std::string& layout, const std::string& name) {
        lows.push_back(static_cast<std::uint8_t>(layouts.at(layout).at(name).offset));
    };
    const auto addEach = [&](const std::string& layout, const std::string& list, int count,
                             const std::string& components) {
        for (int i = 0; i < count; ++i)
            for (const char component : components) add(layout, list + "[" + std::to_string(i) + "]." + component);
    };
    for (int child = 0; child < nodeChildren; ++child)
        for (const char* plane : {"low", "high"})
            for (const char axis : std::string("xyz"))
                add("node", "children[" + std::to_string(child) + "]." + plane + "." + axis);
    for (const char* name : {"corner.x", "corner.y", "corner.z", "first", "leaves", "nodes"}) add("node", name);
    addEach("flatPair", "body.vertices", 4, "xyz");
    addEach("nearPair", "body.deltas", 3, "xyz");
    addEach("farPair", "body.signs", 3, "xyz");
    addEach("triangle", "body.normals", 3, "uv");
    addEach("nearPair", "body.normals", 4, "uv");
    addEach("nearPair", "body.lowBits", 4, "uv");
    for (const char* name : {"format", "material", "isClear"}) add("nearPair", name);
    return lows;
}

/// Puts vertices where leaves need them first: a leaf's are near each other in memory.
inline void orderByUse(GridClip& clip, std::vector<ClipLeaf>& leaves) {
    const auto isUsed = [](std::int64_t vertex) { return vertex >= 0; };
    std::vector<std::int64_t> numbers(clip.vertices.size(), -1);
    std::int64_t next = 0;
    const auto number = [&](std::int64_t vertex) {
        if (numbers[vertex] < 0) numbers[vertex] = next++;
    };
    for (const ClipLeaf& leaf : leaves)
        for (const std::int64_t vertex : leaf)
            if (isUsed(vertex)) number(vertex);
    for (std::size_t vertex = 0; vertex < numbers.size(); ++vertex) number(static_cast<std::int64_t>(vertex));
    const std::vector<std::array<std::int64_t, 13>> vertices = clip.vertices;
    for (std::size_t vertex = 0; vertex < vertices.size(); ++vertex)
        clip.vertices[static_cast<std::size_t>(numbers[vertex])] = vertices[vertex];
    for (auto& change : clip.changes) change[0] = numbers[static_cast<std::size_t>(change[0])];
    std::stable_sort(clip.changes.begin(), clip.changes.end(),
                     [](const auto& one, const auto& other) { return one[0] < other[0]; });
    for (mesh::Face& face : clip.corners)
        for (std::int32_t& corner : face) corner = static_cast<std::int32_t>(numbers[static_cast<std::size_t>(corner)]);
    for (ClipLeaf& leaf : leaves)
        for (std::int64_t& vertex : leaf)
            if (isUsed(vertex)) vertex = numbers[static_cast<std::size_t>(vertex)];
}

/// The bytes of a clip file, for a design of these layouts and this hash of its formats.
inline std::vector<std::uint8_t> clipFile(const GridClip& clip, const ClipTree& tree,
                                          const std::map<std::string, Layout>& layouts,
                                          const std::array<std::uint32_t, 8>& hash) {
    std::vector<std::uint8_t> bytes;
    const auto addWord = [&](std::int64_t value) {
        for (int byte = 0; byte < 4; ++byte) bytes.push_back(static_cast<std::uint8_t>(value >> (8 * byte)));
    };
    const auto addHalves = [&](const std::int64_t* values, int count) {
        for (int i = 0; i < count; i += 2) addWord((values[i] & 0xFFFF) + 65536 * values[i + 1]);
    };
    const auto addWords = [&](const auto& values, std::size_t count) {
        for (std::size_t i = 0; i < count; ++i) addWord(static_cast<std::int64_t>(values[i]));
    };
    for (const char letter : std::string("CLNDCLIP")) bytes.push_back(static_cast<std::uint8_t>(letter));
    addWords(std::array<std::int64_t, 2>{1, 0}, 2); // version; the size follows
    addWords(hash, hash.size());
    addWords(
        std::array<std::int64_t, 5>{tree.vertexBits, tree.deltaBits, tree.boxBits, tree.addressBits, tree.leafRecords},
        5);
    addWords(std::array<std::size_t, 8>{tree.records, tree.depth, clip.vertices.size(), tree.leaves.size(), clip.bones,
                                        clip.targets, clip.changes.size(), clip.times.size()},
             8);
    addWords(std::array<std::int64_t, 3>{clip.times.back(), clip.linearShift, clip.shift}, 3);
    const std::vector<std::uint8_t> lows = fieldLows(layouts);
    bytes.insert(bytes.end(), lows.begin(), lows.end());
    bytes.resize((bytes.size() + 3) / 4 * 4);
    for (const auto& vertex : clip.vertices) {
        addWords(vertex, 3);
        addHalves(vertex.data() + 3, 10);
    }
    for (const ClipLeaf& leaf : tree.leaves) addWords(leaf, leaf.size());
    for (const auto& change : clip.changes) {
        addWords(change, 4);
        addHalves(change.data() + 4, 4);
    }
    for (std::size_t key = 0; key < clip.times.size(); ++key) {
        addWord(clip.times[key]);
        addWords(clip.poses[key], clip.poses[key].size());
    }
    for (int byte = 0; byte < 4; ++byte)
        bytes[12 + static_cast<std::size_t>(byte)] = static_cast<std::uint8_t>(bytes.size() >> (8 * byte));
    return bytes;
}

/// The direction of an octahedral code, of any length.
inline mesh::Vector directionOf(std::int16_t u, std::int16_t v) {
    const double x = u, y = v, one = octahedralOne, z = one - std::fabs(x) - std::fabs(y);
    if (z >= 0) return {x, y, z};
    return {std::copysign(one - std::fabs(y), x), std::copysign(one - std::fabs(x), y), z};
}

} // namespace colonnade::packer
