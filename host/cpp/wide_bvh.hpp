// SPDX-License-Identifier: Apache-2.0
/// The tree in the hardware's layout: nodes of two or four children with boxes quantised relative to their node.
///
/// Collapsing the binary tree keeps the order of the leaves, so the packed ids do not depend on the arity.
#pragma once

#include "bvh.hpp"

namespace colonnade::bvh {

enum class Kind : std::uint8_t { empty = 0, node = 1, leaf = 2 };

/// Selects the child of a wide node that is replaced by its own two children.
enum class PullUp { largest, tallest };

/// Flat arrays with one entry per node, times the arity where stated. `firstTriangles` counts from the first leaf record.
struct WideTree {
    unsigned arity = 0;
    std::vector<std::uint32_t> origin;                       ///< nodes × 3, vertex units
    std::vector<std::uint8_t> exponent;                      ///< nodes × 3
    std::vector<std::uint8_t> kinds;                         ///< nodes × arity
    std::vector<std::uint16_t> low, high;                    ///< nodes × arity × 3
    std::vector<std::uint32_t> firstChild, firstTriangles;   ///< nodes; 0 without such a child
    std::vector<std::uint32_t> leafFirst, leafCount;         ///< leaf records: packed id of the first triangle, number of triangles
    unsigned depth = 0;                                      ///< nodes on the longest path from the root
    unsigned stackBound = 0;                                 ///< largest number of stack entries that a ray can need
    double cost = 0;                                         ///< expected record reads of a random ray through the root box

    std::size_t nodes() const { return firstChild.size(); }
};

class Collapser {
public:
    Collapser(const BinaryTree& tree, unsigned arity, unsigned boxBits) : tree_(tree), arity_(arity), boxBits_(boxBits) {
        height_.assign(tree.nodes.size(), 0);
        for (std::size_t i = tree.nodes.size(); i-- > 0;)
            if (const BinaryNode& node = tree.nodes[i]; !node.isLeaf()) height_[i] = 1 + std::max(height_[node.left], height_[node.right]);
    }

    WideTree collapse(PullUp policy) const {
        WideTree wide;
        wide.arity = arity_;
        const double rootArea = std::max<double>(1.0, static_cast<double>(tree_.nodes[0].box.halfArea()));

        struct Task { std::int32_t binary; std::uint32_t index; unsigned depth; };
        std::vector<Task> tasks{{0, 0, 1}};
        append(wide);
        while (!tasks.empty()) {
            const Task task = tasks.back();
            tasks.pop_back();
            wide.depth = std::max(wide.depth, task.depth);
            wide.cost += static_cast<double>(tree_.nodes[task.binary].box.halfArea()) / rootArea;
            const std::vector<std::int32_t> children = childrenOf(task.binary, policy);
            quantise(wide, task.index, tree_.nodes[task.binary].box, children);

            // Siblings are adjacent and a subtree follows its root, which keeps spatial neighbours close in memory
            std::vector<Task> pending;
            for (std::size_t slot = 0; slot < children.size(); ++slot) {
                const BinaryNode& child = tree_.nodes[children[slot]];
                if (child.isLeaf()) {
                    if (!hasKind(wide, task.index, slot, Kind::leaf)) wide.firstTriangles[task.index] = static_cast<std::uint32_t>(wide.leafFirst.size());
                    wide.kinds[task.index * arity_ + slot] = static_cast<std::uint8_t>(Kind::leaf);
                    wide.leafFirst.push_back(child.begin);
                    wide.leafCount.push_back(child.end - child.begin);
                    wide.cost += static_cast<double>(child.box.halfArea()) / rootArea;
                } else {
                    if (!hasKind(wide, task.index, slot, Kind::node)) wide.firstChild[task.index] = static_cast<std::uint32_t>(wide.nodes());
                    wide.kinds[task.index * arity_ + slot] = static_cast<std::uint8_t>(Kind::node);
                    pending.push_back({children[slot], static_cast<std::uint32_t>(wide.nodes()), task.depth + 1});
                    append(wide);
                }
            }
            tasks.insert(tasks.end(), pending.rbegin(), pending.rend());
        }
        wide.stackBound = stackBound(wide);
        return wide;
    }

private:
    void append(WideTree& wide) const {
        wide.origin.insert(wide.origin.end(), 3, 0);
        wide.exponent.insert(wide.exponent.end(), 3, 0);
        wide.kinds.insert(wide.kinds.end(), arity_, 0);
        wide.low.insert(wide.low.end(), arity_ * 3, 0);
        wide.high.insert(wide.high.end(), arity_ * 3, 0);
        wide.firstChild.push_back(0);
        wide.firstTriangles.push_back(0);
    }

    /// Whether a slot before `slot` has a child of this kind.
    bool hasKind(const WideTree& wide, std::uint32_t node, std::size_t slot, Kind kind) const {
        for (std::size_t i = 0; i < slot; ++i)
            if (wide.kinds[node * arity_ + i] == static_cast<std::uint8_t>(kind)) return true;
        return false;
    }

    /// The children in the order of their leaves. A root that is a leaf gets itself as its only child.
    std::vector<std::int32_t> childrenOf(std::int32_t index, PullUp policy) const {
        const BinaryNode& node = tree_.nodes[index];
        if (node.isLeaf()) return {index};
        std::vector<std::int32_t> children{node.left, node.right};
        while (children.size() < arity_) {
            int chosen = -1;
            for (std::size_t i = 0; i < children.size(); ++i)
                if (!tree_.nodes[children[i]].isLeaf() && (chosen < 0 || before(children[i], children[chosen], policy))) chosen = static_cast<int>(i);
            if (chosen < 0) break;
            const BinaryNode& pulled = tree_.nodes[children[chosen]];
            children[chosen] = pulled.left;
            children.insert(children.begin() + chosen + 1, pulled.right);
        }
        return children;
    }

    bool before(std::int32_t one, std::int32_t other, PullUp policy) const {
        if (policy == PullUp::tallest && height_[one] != height_[other]) return height_[one] > height_[other];
        return tree_.nodes[one].box.halfArea() > tree_.nodes[other].box.halfArea();
    }

    /// Rounds child boxes outward to multiples of 2^exponent from the node's low corner.
    void quantise(WideTree& wide, std::uint32_t index, const Box& box, const std::vector<std::int32_t>& children) const {
        const std::int64_t maximum = (std::int64_t{1} << boxBits_) - 1;
        for (int a = 0; a < 3; ++a) {
            const std::int64_t origin = box.low[a], extent = box.high[a] - origin;
            int exponent = 0;
            while (((extent + (std::int64_t{1} << exponent) - 1) >> exponent) > maximum) ++exponent;
            wide.origin[index * 3 + a] = static_cast<std::uint32_t>(origin);
            wide.exponent[index * 3 + a] = static_cast<std::uint8_t>(exponent);
            for (std::size_t slot = 0; slot < children.size(); ++slot) {
                const Box& child = tree_.nodes[children[slot]].box;
                const std::size_t at = (index * std::size_t{arity_} + slot) * 3 + a;
                wide.low[at] = static_cast<std::uint16_t>((child.low[a] - origin) >> exponent);
                wide.high[at] = static_cast<std::uint16_t>((child.high[a] - origin + (std::int64_t{1} << exponent) - 1) >> exponent);
            }
        }
    }

    /// The largest sum of (children − 1) over all paths: the siblings that a ray hitting every box pushes.
    unsigned stackBound(const WideTree& wide) const {
        std::vector<unsigned> bound(wide.nodes(), 0);
        for (std::size_t node = wide.nodes(); node-- > 0;) {
            unsigned children = 0, deepest = 0, nodeChild = 0;
            for (unsigned slot = 0; slot < arity_; ++slot) {
                const auto kind = static_cast<Kind>(wide.kinds[node * arity_ + slot]);
                if (kind == Kind::empty) continue;
                ++children;
                if (kind == Kind::node) deepest = std::max(deepest, bound[wide.firstChild[node] + nodeChild++]);
            }
            bound[node] = children - 1 + deepest;
        }
        return bound[0];
    }

    const BinaryTree& tree_;
    const unsigned arity_, boxBits_;
    std::vector<unsigned> height_;
};

/// A wide tree and the order of its triangles.
struct Bvh {
    WideTree tree;
    std::vector<std::uint32_t> order;  ///< the triangle index of each packed id
    unsigned heightLimit = 0;          ///< height limit that the stack required; 0 for none
};

/// Builds the tree for one arity. If the tree of lowest cost needs a deeper stack, more balanced trees are tried. A tree is
/// accepted if it fits with both arities, so that the packed ids do not depend on the arity. The caller must check
/// whether the returned tree fits the stack.
inline Bvh build(const std::vector<Box>& boxes, unsigned perRecord, unsigned arity, unsigned boxBits, unsigned stackDepth) {
    const unsigned minimum = std::max(1u, balancedHeight(boxes.size(), perRecord));
    std::vector<unsigned> limits{0};
    for (unsigned limit = stackDepth; limit > minimum; limit = limit * 3 / 4) limits.push_back(limit);
    limits.push_back(minimum);

    for (const unsigned limit : limits) {
        const BinaryTree tree = BinaryBuilder(boxes, perRecord, limit).build();
        bool fits = true;
        WideTree chosen;
        for (const unsigned width : {2u, 4u}) {
            const Collapser collapser(tree, width, boxBits);
            WideTree wide = collapser.collapse(PullUp::largest);
            if (wide.stackBound > stackDepth) wide = collapser.collapse(PullUp::tallest);
            fits = fits && wide.stackBound <= stackDepth;
            if (width == arity) chosen = std::move(wide);
        }
        if (fits || limit == minimum) return {std::move(chosen), tree.order, limit};
    }
    return {};
}

}  // namespace colonnade::bvh
