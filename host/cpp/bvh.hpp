/// The binary tree over leaves, from which every tree layout is derived.
///
/// Splits are binned by a surface-area heuristic, and exact sweeps of few leaves. All costs are exact integers, so a
/// mesh gives the same tree on every machine. The order of the leaves, left first, defines the triangles' packed ids.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace colonnade::bvh {

using Cost = unsigned __int128;

/// A box in vertex units with inclusive bounds; initially empty.
struct Box {
    std::array<std::int32_t, 3> low{INT32_MAX, INT32_MAX, INT32_MAX};
    std::array<std::int32_t, 3> high{INT32_MIN, INT32_MIN, INT32_MIN};

    void add(const Box& other) {
        for (int a = 0; a < 3; ++a) {
            low[a] = std::min(low[a], other.low[a]);
            high[a] = std::max(high[a], other.high[a]);
        }
    }

    /// Half the surface area, square units; 0 for an empty box.
    std::uint64_t halfArea() const {
        if (low[0] > high[0]) return 0;
        const std::uint64_t x = high[0] - low[0], y = high[1] - low[1], z = high[2] - low[2];
        return x * y + y * z + z * x;
    }

    /// Twice the centre, which is an integer.
    std::int32_t centre2(int axis) const { return low[axis] + high[axis]; }
};

/// A node over `order[begin, end)`; a leaf has no children. Children follow their parent in the array.
struct BinaryNode {
    Box box;
    std::int32_t left = -1, right = -1;
    std::uint32_t begin = 0, end = 0;
    bool isLeaf() const { return left < 0; }
};

struct BinaryTree {
    std::vector<BinaryNode> nodes;      ///< the root is node 0
    std::vector<std::uint32_t> order;   ///< the leaves, left first
};

/// Fraction bits of `readWeights`.
constexpr int readWeightFraction = 8;

/// Height of a balanced tree over `leaves` leaves; 0 for one.
inline unsigned balancedHeight(std::uint64_t leaves) {
    unsigned height = 0;
    while ((std::uint64_t{1} << height) < leaves) ++height;
    return height;
}

/// Expected reads in a subtree of each number of leaf records up to `most`, relative to one: the power 3/5, as an
/// integer. Rays stop at a hit, so they do not read in proportion to the records.
inline std::vector<std::uint32_t> readWeights(std::uint64_t most) {
    std::vector<std::uint32_t> weights{0};
    Cost weight = 0;
    for (Cost records = 1; records <= most; ++records) {
        const Cost power = records * records * records << 5 * readWeightFraction;
        while ((weight + 1) * (weight + 1) * (weight + 1) * (weight + 1) * (weight + 1) <= power) ++weight;
        weights.push_back(static_cast<std::uint32_t>(weight));
    }
    return weights;
}

/// Builds the binary tree. No leaf is deeper than `heightLimit` (0: no limit), which must be at least the balanced
/// height.
class BinaryBuilder {
public:
    BinaryBuilder(const std::vector<Box>& boxes, unsigned heightLimit)
        : boxes_(boxes), heightLimit_(heightLimit ? heightLimit : UINT32_MAX), weights_(readWeights(boxes.size())) {}

    BinaryTree build() {
        const auto count = static_cast<std::uint32_t>(boxes_.size());
        tree_.order.resize(count);
        for (std::uint32_t i = 0; i < count; ++i) tree_.order[i] = i;
        scratch_.resize(count);
        tree_.nodes.reserve(2 * static_cast<std::size_t>(count));
        addNode(0, count);

        struct Task {
            std::int32_t node;
            unsigned depth;
        };
        std::vector<Task> tasks{{0, 0}};
        while (!tasks.empty()) {
            const Task task = tasks.back();
            tasks.pop_back();
            const std::uint32_t begin = tree_.nodes[task.node].begin, end = tree_.nodes[task.node].end;
            if (end - begin == 1) continue;
            const std::uint32_t middle = partition(begin, end, heightLimit_ - task.depth - 1);
            const std::int32_t left = addNode(begin, middle), right = addNode(middle, end);
            tree_.nodes[task.node].left = left;
            tree_.nodes[task.node].right = right;
            tasks.push_back({right, task.depth + 1});
            tasks.push_back({left, task.depth + 1});
        }
        return std::move(tree_);
    }

private:
    static constexpr int bins = 64;
    static constexpr std::uint32_t sweepBelow = 33;  ///< ranges of fewer leaves are split by an exact sweep
    static constexpr Cost worst = ~Cost{0};

    struct Split {
        Cost cost = worst;
        int axis = -1;
        std::uint32_t at = 0;  ///< last bin of the left side, or number of leaves on the left side of a sweep
    };

    std::int32_t addNode(std::uint32_t begin, std::uint32_t end) {
        BinaryNode node;
        node.begin = begin;
        node.end = end;
        for (std::uint32_t i = begin; i < end; ++i) node.box.add(boxes_[tree_.order[i]]);
        tree_.nodes.push_back(node);
        return static_cast<std::int32_t>(tree_.nodes.size() - 1);
    }

    Cost cost(std::uint64_t leftArea, std::uint64_t leftRecords, std::uint64_t rightArea,
              std::uint64_t rightRecords) const {
        return Cost{leftArea} * weights_[leftRecords] + Cost{rightArea} * weights_[rightRecords];
    }

    bool fits(std::uint64_t left, std::uint64_t right, unsigned height) const {
        return balancedHeight(left) <= height && balancedHeight(right) <= height;
    }

    /// Partitions `order[begin, end)` into two sides that each fit a tree of `height`; returns the start of the right
    /// side.
    std::uint32_t partition(std::uint32_t begin, std::uint32_t end, unsigned height) {
        const std::uint32_t count = end - begin;
        if (count < sweepBelow) {
            const Split split = sweep(begin, end, height);
            sortAlong(begin, end, split.axis);
            return begin + split.at;
        }
        std::array<std::int32_t, 3> low{INT32_MAX, INT32_MAX, INT32_MAX}, high{INT32_MIN, INT32_MIN, INT32_MIN};
        for (std::uint32_t i = begin; i < end; ++i)
            for (int a = 0; a < 3; ++a) {
                const std::int32_t centre = boxes_[tree_.order[i]].centre2(a);
                low[a] = std::min(low[a], centre);
                high[a] = std::max(high[a], centre);
            }
        const Split split = binned(begin, end, low, high, height);
        if (split.axis >= 0) {
            std::uint32_t left = begin, right = 0;
            for (std::uint32_t i = begin; i < end; ++i) {
                const std::uint32_t leaf = tree_.order[i];
                if (binOf(leaf, split.axis, low, high) <= static_cast<int>(split.at)) tree_.order[left++] = leaf;
                else scratch_[right++] = leaf;
            }
            std::copy_n(scratch_.begin(), right, tree_.order.begin() + left);
            return left;
        }
        // No binned split fits: halve the leaves along the longest axis, by index where centres coincide
        int axis = 0;
        for (int a = 1; a < 3; ++a)
            if (high[a] - low[a] > high[axis] - low[axis]) axis = a;
        sortAlong(begin, end, axis);
        return begin + (count + 1) / 2;
    }

    int binOf(std::uint32_t leaf, int axis, const std::array<std::int32_t, 3>& low,
              const std::array<std::int32_t, 3>& high) const {
        const std::int64_t offset = std::int64_t{boxes_[leaf].centre2(axis)} - low[axis];
        return static_cast<int>(offset * bins / (std::int64_t{high[axis]} - low[axis] + 1));
    }

    Split binned(std::uint32_t begin, std::uint32_t end, const std::array<std::int32_t, 3>& low,
                 const std::array<std::int32_t, 3>& high, unsigned height) const {
        Split best;
        for (int axis = 0; axis < 3; ++axis) {
            if (low[axis] == high[axis]) continue;
            std::array<Box, bins> box;
            std::array<std::uint32_t, bins> count{};
            for (std::uint32_t i = begin; i < end; ++i) {
                const std::uint32_t leaf = tree_.order[i];
                const int bin = binOf(leaf, axis, low, high);
                box[bin].add(boxes_[leaf]);
                ++count[bin];
            }
            std::array<std::uint64_t, bins> rightArea{};
            Box side;
            for (int bin = bins - 1; bin > 0; --bin) {
                side.add(box[bin]);
                rightArea[bin] = side.halfArea();
            }
            side = Box{};
            std::uint32_t left = 0;
            for (int bin = 0; bin + 1 < bins; ++bin) {
                side.add(box[bin]);
                left += count[bin];
                const std::uint32_t right = end - begin - left;
                if (left == 0 || right == 0 || !fits(left, right, height)) continue;
                const Cost value = cost(side.halfArea(), left, rightArea[bin + 1], right);
                if (value < best.cost) best = {value, axis, static_cast<std::uint32_t>(bin)};
            }
        }
        return best;
    }

    /// The best split of a few leaves along any axis; the balanced split always fits.
    Split sweep(std::uint32_t begin, std::uint32_t end, unsigned height) {
        const std::uint32_t count = end - begin;
        std::array<std::uint64_t, sweepBelow> rightArea{};
        Split best;
        for (int axis = 0; axis < 3; ++axis) {
            sortAlong(begin, end, axis);
            Box side;
            for (std::uint32_t i = count - 1; i > 0; --i) {
                side.add(boxes_[tree_.order[begin + i]]);
                rightArea[i] = side.halfArea();
            }
            side = Box{};
            for (std::uint32_t left = 1; left < count; ++left) {
                side.add(boxes_[tree_.order[begin + left - 1]]);
                if (!fits(left, count - left, height)) continue;
                const Cost value = cost(side.halfArea(), left, rightArea[left], count - left);
                if (value < best.cost) best = {value, axis, left};
            }
        }
        return best;
    }

    void sortAlong(std::uint32_t begin, std::uint32_t end, int axis) {
        std::sort(tree_.order.begin() + begin, tree_.order.begin() + end, [&](std::uint32_t one, std::uint32_t other) {
            const std::int32_t a = boxes_[one].centre2(axis), b = boxes_[other].centre2(axis);
            return a != b ? a < b : one < other;
        });
    }

    const std::vector<Box>& boxes_;
    const unsigned heightLimit_;
    const std::vector<std::uint32_t> weights_;
    BinaryTree tree_;
    std::vector<std::uint32_t> scratch_;
};

}  // namespace colonnade::bvh
