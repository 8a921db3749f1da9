/// Reinsertion: moves subtrees of the binary tree to where they add the least area (Bittner, Hapala and Havran 2013,
/// "Fast Insertion-Based Optimization of Bounding Volume Hierarchies"; search of Meister and Bittner 2018, "Parallel
/// Reinsertion for Bounding Volume Hierarchy Optimization").
///
/// Areas are exact integers and subtrees move one by one, so the result is the same on every machine. Leaves keep their
/// triangles.
#pragma once

#include <numeric>
#include <utility>

#include "bvh.hpp"

namespace colonnade::bvh {

/// The levels below each node: 0 for a leaf.
inline std::vector<unsigned> heights(const BinaryTree& tree) {
    std::vector<unsigned> height(tree.nodes.size(), 0);
    for (std::size_t i = tree.nodes.size(); i-- > 0;)
        if (const BinaryNode& node = tree.nodes[i]; !node.isLeaf())
            height[i] = 1 + std::max(height[node.left], height[node.right]);
    return height;
}

class Reinsertion {
public:
    /// No leaf becomes deeper than `heightLimit`, which must be at least the height of the tree.
    Reinsertion(BinaryTree&& tree, unsigned heightLimit)
        : heightLimit_(heightLimit), height_(heights(tree)), order_(std::move(tree.order)),
          nodes_(std::move(tree.nodes)), parent_(nodes_.size(), -1) {
        for (std::size_t i = 0; i < nodes_.size(); ++i)
            if (!nodes_[i].isLeaf()) parent_[nodes_[i].left] = parent_[nodes_[i].right] = static_cast<std::int32_t>(i);
    }

    /// Moves each subtree once, the largest first; a second pass gains little.
    BinaryTree optimise() {
        std::vector<std::uint64_t> area(nodes_.size());
        for (std::size_t i = 0; i < nodes_.size(); ++i) area[i] = nodes_[i].box.halfArea();
        std::vector<std::int32_t> subtrees(nodes_.size());
        std::iota(subtrees.begin(), subtrees.end(), 0);
        std::stable_sort(subtrees.begin(), subtrees.end(),
                         [&](std::int32_t one, std::int32_t other) { return area[one] > area[other]; });
        for (const std::int32_t subtree : subtrees)
            if (subtree != root_) reinsert(subtree);
        return inDepthFirstOrder();
    }

private:
    using Area = __int128;

    /// Nodes that a search visits at most: more than it needs in a surface, and a bound where everything overlaps.
    static constexpr unsigned searchLimit = 128;

    /// A node in reach of a search. A subtree of area 0 beside it would save `saving`.
    struct Candidate {
        std::int32_t node;
        Area saving;
        unsigned level;
    };

    static Area areaOf(const Box& box) { return static_cast<Area>(box.halfArea()); }

    void updateHeight(std::int32_t node) {
        height_[node] = 1 + std::max(height_[nodes_[node].left], height_[nodes_[node].right]);
    }

    std::int32_t siblingOf(std::int32_t node) const {
        const BinaryNode& parent = nodes_[parent_[node]];
        return parent.left == node ? parent.right : parent.left;
    }

    static Box joined(Box one, const Box& other) {
        one.add(other);
        return one;
    }
    /// Moves a subtree beside the node where the tree's area shrinks most, if it shrinks at all.
    void reinsert(std::int32_t subtree) {
        const Box& box = nodes_[subtree].box;
        const Area area = areaOf(box);
        const std::int32_t parent = parent_[subtree];
        unsigned level = 0;
        for (std::int32_t node = parent; node != root_; node = parent_[node]) ++level;

        // Search beside each ancestor, the pivot. Removing the subtree saves its parent, and shrinks the ancestors
        // below the pivot
        Area best = 0, saving = areaOf(nodes_[parent].box);
        std::int32_t target = -1;
        unsigned visited = 0;
        Box rest; // the pivot without the subtree
        for (std::int32_t child = subtree, pivot = parent;; child = pivot, pivot = parent_[pivot], --level) {
            const std::int32_t other = siblingOf(child);
            // The sibling takes the level of the parent, which is removed
            candidates_.assign(1, {other, saving, pivot == parent ? level : level + 1});
            while (!candidates_.empty() && visited < searchLimit) {
                const Candidate candidate = candidates_.back();
                candidates_.pop_back();
                if (candidate.saving - area <= best) continue;
                ++visited;
                const BinaryNode& node = nodes_[candidate.node];
                const Area saving = candidate.saving - areaOf(joined(node.box, box));
                if (saving > best &&
                    candidate.level + 1 + std::max(height_[subtree], height_[candidate.node]) <= heightLimit_) {
                    best = saving;
                    target = candidate.node;
                }
                const Area below = saving + areaOf(node.box);
                if (node.isLeaf() || below - area <= best) continue;
                candidates_.push_back({node.right, below, candidate.level + 1});
                candidates_.push_back({node.left, below, candidate.level + 1});
            }
            rest.add(nodes_[other].box);
            if (pivot == root_) break;
            if (pivot != parent) saving += areaOf(nodes_[pivot].box) - areaOf(rest);
        }
        if (target >= 0) move(subtree, target);
    }

    void move(std::int32_t subtree, std::int32_t target) {
        const std::int32_t parent = parent_[subtree], sibling = siblingOf(subtree), grandparent = parent_[parent];
        replaceChild(grandparent, parent, sibling);
        refit(grandparent);
        const std::int32_t above = parent_[target];
        replaceChild(above, target, parent);
        nodes_[parent].left = target;
        nodes_[parent].right = subtree;
        parent_[target] = parent_[subtree] = parent;
        refit(parent);
    }

    void replaceChild(std::int32_t node, std::int32_t old, std::int32_t child) {
        parent_[child] = node;
        if (node < 0) root_ = child;
        else (nodes_[node].left == old ? nodes_[node].left : nodes_[node].right) = child;
    }

    void refit(std::int32_t node) {
        for (; node >= 0; node = parent_[node]) {
            nodes_[node].box = joined(nodes_[nodes_[node].left].box, nodes_[nodes_[node].right].box);
            updateHeight(node);
        }
    }

    /// Renumbers the nodes and the order of the triangles: parents before children, left subtrees first.
    BinaryTree inDepthFirstOrder() const {
        BinaryTree tree;
        tree.nodes.reserve(nodes_.size());
        tree.order.reserve(order_.size());
        struct Task {
            std::int32_t node, parent;
        };
        std::vector<Task> tasks{{root_, -1}};
        while (!tasks.empty()) {
            const Task task = tasks.back();
            tasks.pop_back();
            const auto index = static_cast<std::int32_t>(tree.nodes.size());
            BinaryNode node = nodes_[task.node];
            if (task.parent >= 0)
                (tree.nodes[task.parent].left < 0 ? tree.nodes[task.parent].left : tree.nodes[task.parent].right) =
                    index;
            if (node.isLeaf()) {
                const auto begin = static_cast<std::uint32_t>(tree.order.size());
                tree.order.insert(tree.order.end(), order_.begin() + node.begin, order_.begin() + node.end);
                node.begin = begin;
                node.end = static_cast<std::uint32_t>(tree.order.size());
            } else {
                tasks.push_back({node.right, index});
                tasks.push_back({node.left, index});
                node.left = node.right = -1;
            }
            tree.nodes.push_back(node);
        }
        return tree;
    }

    const unsigned heightLimit_;
    std::vector<unsigned> height_;
    std::vector<std::uint32_t> order_;
    std::vector<BinaryNode> nodes_;
    std::vector<std::int32_t> parent_;
    std::vector<Candidate> candidates_;
    std::int32_t root_ = 0;
};

} // namespace colonnade::bvh
