// SPDX-License-Identifier: Apache-2.0
/// The tree as the hardware walks it: nodes of two or four children whose boxes are small integers relative to their node.
///
/// Collapsing moves no leaf, so the packed ids are those of the binary tree whatever the arity.
#pragma once

#include "bvh.hpp"

namespace colonnade::bvh {

enum class Kind : std::uint8_t { empty = 0, node = 1, leaf = 2 };

/// Which child a wide node replaces by its own two children.
enum class PullUp { largest, tallest };

/// Flat arrays, one entry a node (times the arity where it says so). `firstTriangles` counts leaf records from the first one.
struct WideTree {
    unsigned arity = 0;
    std::vector<std::uint32_t> origin;                       ///< nodes × 3, units
    std::vector<std::uint8_t> exponent;                      ///< nodes × 3
    std::vector<std::uint8_t> kinds;                         ///< nodes × arity
    std::vector<std::uint16_t> low, high;                    ///< nodes × arity × 3
    std::vector<std::uint32_t> firstChild, firstTriangles;   ///< nodes; 0 where there is no such child
    std::vector<std::uint32_t> leafFirst, leafCount;         ///< leaf records: packed id of triangle 0, triangles
    unsigned depth = 0;                                      ///< nodes on the longest path
    unsigned stackBound = 0;                                 ///< most siblings that can wait while a ray descends
    double cost = 0;                                         ///< records that a random ray through the root box reads

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

            // Siblings lie side by side and a subtree's blocks follow its root: neighbours in space are neighbours in memory.
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

    /// Whether a slot before `slot` holds a child of that kind.
    bool hasKind(const WideTree& wide, std::uint32_t node, std::size_t slot, Kind kind) const {
        for (std::size_t i = 0; i < slot; ++i)
            if (wide.kinds[node * arity_ + i] == static_cast<std::uint8_t>(kind)) return true;
        return false;
    }

    /// The children in the order of their leaves. A tree that is one leaf has a root with one child.
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

    /// Child boxes rounded outward to multiples of 2^exponent from the node's low corner.
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

    /// Over all paths, the sum of (children − 1): a ray that meets every box leaves that many siblings waiting.
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

/// A wide tree with the order of its triangles.
struct Bvh {
    WideTree tree;
    std::vector<std::uint32_t> order;  ///< the triangle of each packed id
    unsigned heightLimit = 0;          ///< 0: nothing was traded for the stack
};

/// Builds the tree for one arity. When the surface-area tree needs a deeper stack than there is, ever more balanced ones are
/// tried. A tree is taken when both arities fit, so that the packed ids do not depend on the arity; whether the returned tree fits is
/// for the caller to see.
inline Bvh build(const std::vector<Box>& boxes, unsigned perRecord, unsigned arity, unsigned boxBits, unsigned stackDepth) {
    const unsigned least = std::max(1u, balancedHeight(boxes.size(), perRecord));
    std::vector<unsigned> limits{0};
    for (unsigned limit = stackDepth; limit > least; limit = limit * 3 / 4) limits.push_back(limit);
    limits.push_back(least);

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
        if (fits || limit == least) return {std::move(chosen), tree.order, limit};
    }
    return {};
}

}  // namespace colonnade::bvh
