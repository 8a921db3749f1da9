/// The tree in the hardware's layout: nodes of up to four children with boxes quantised relative to their node.
#pragma once

#include <unordered_map>

#include "model/formats.hpp"
#include "reinsertion.hpp"

namespace colonnade::bvh {

/// Flat arrays of the nodes and of the leaves, by rising address. The children of a node are at consecutive addresses:
/// nodes, then leaves. Subtrees follow depth first.
struct WideTree {
    std::vector<std::uint32_t> nodeAddress;        ///< the root's is 0
    std::vector<std::uint32_t> origin;             ///< nodes × 3, vertex units
    std::vector<std::uint8_t> exponent;            ///< nodes × 3
    std::vector<std::uint16_t> low, high;          ///< nodes × nodeChildren × 3
    std::vector<std::uint32_t> first;              ///< nodes; address of the first child
    std::vector<std::uint8_t> nodeCount, leafCount; ///< nodes; children of each kind
    std::vector<std::uint32_t> leafAddress;
    std::vector<std::uint32_t> leafFirst,
        leafTriangleCount;  ///< leaves: position of the first triangle in the order, and their number
    unsigned depth = 0;                                      ///< nodes on the longest path from the root
    unsigned stackBound = 0;                                 ///< largest number of stack entries that a ray can need
    double cost = 0; ///< expected record reads of a random ray through the root box

    std::size_t nodes() const { return first.size(); }
    std::size_t leaves() const { return leafFirst.size(); }
};

/// Replaces the binary nodes by wide nodes with the least sum of areas, which is the expected number of node reads
/// (Ylitie, Karras and Laine 2017, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs"). Dynamic
/// programming over the binary tree finds it, within a limit of the stack.
class Collapser {
public:
    /// `most`: children of a node, 2 to `nodeChildren`. `stackDepth`: at least the height of the tree, which is the
    /// least stack bound of all collapses. `leafRecords`: records of a leaf.
    Collapser(const BinaryTree& tree, unsigned most, unsigned boxBits, unsigned stackDepth, unsigned leafRecords)
        : tree_(tree), most_(most), boxBits_(boxBits), stackDepth_(stackDepth), leafRecords_(leafRecords),
          heights_(heights(tree)), free_(tree.nodes.size()) {
        for (std::size_t i = tree.nodes.size(); i-- > 0;)
            if (!tree.nodes[i].isLeaf())
                for (unsigned slots = 1; slots < most_; ++slots)
                    free_[i][slots - 1] = findForm(static_cast<std::int32_t>(i), slots, unlimited);
    }

    WideTree collapse() {
        WideTree wide;
        const double rootArea = std::max<double>(1.0, static_cast<double>(tree_.nodes[0].box.halfArea()));

        struct Task {
            std::int32_t binary;
            std::size_t index;
            unsigned depth, stack;
        };
        std::vector<Task> tasks{{0, 0, 1, stackDepth_}};
        std::uint32_t end = 0; // of the addresses that are taken
        append(wide, end++);
        while (!tasks.empty()) {
            const Task task = tasks.back();
            tasks.pop_back();
            wide.depth = std::max(wide.depth, task.depth);
            wide.cost += static_cast<double>(tree_.nodes[task.binary].box.halfArea()) / rootArea;
            std::vector<std::int32_t> children = childrenOf(task.binary, task.stack);
            const auto leaves = std::stable_partition(children.begin(), children.end(),
                                                      [&](std::int32_t child) { return !tree_.nodes[child].isLeaf(); });
            const unsigned below = task.stack - static_cast<unsigned>(children.size() - 1);
            quantise(wide, task.index, tree_.nodes[task.binary].box, children);
            wide.first[task.index] = end;
            wide.nodeCount[task.index] = static_cast<std::uint8_t>(leaves - children.begin());
            wide.leafCount[task.index] = static_cast<std::uint8_t>(children.end() - leaves);

            std::vector<Task> pending;
            for (auto child = children.begin(); child != leaves; ++child) {
                pending.push_back({*child, wide.nodes(), task.depth + 1, below});
                append(wide, end++);
            }
            for (auto child = leaves; child != children.end(); ++child) {
                const BinaryNode& leaf = tree_.nodes[*child];
                wide.leafAddress.push_back(end);
                end += leafRecords_;
                wide.leafFirst.push_back(leaf.begin);
                wide.leafTriangleCount.push_back(leaf.end - leaf.begin);
                wide.cost += static_cast<double>(leaf.box.halfArea()) / rootArea;
            }
            tasks.insert(tasks.end(), pending.rbegin(), pending.rend());
        }
        wide.stackBound = stackBound(wide);
        return wide;
    }

private:
    void append(WideTree& wide, std::uint32_t address) const {
        wide.nodeAddress.push_back(address);
        wide.origin.insert(wide.origin.end(), 3, 0);
        wide.exponent.insert(wide.exponent.end(), 3, 0);
        wide.low.insert(wide.low.end(), nodeChildren * 3, 0);
        wide.high.insert(wide.high.end(), nodeChildren * 3, 0);
        wide.first.push_back(0);
        wide.nodeCount.push_back(0);
        wide.leafCount.push_back(0);
    }

    static constexpr unsigned unlimited = UINT16_MAX;

    /// The wide nodes of a binary subtree: the sum of their areas, and the stack entries that they need.
    struct Form {
        Cost cost = ~Cost{0};
        unsigned bound = unlimited;
        bool isFeasible() const { return bound != unlimited; }
        bool operator<(const Form& other) const { return cost != other.cost ? cost < other.cost : bound < other.bound; }
    };

    /// The best form of both subtrees of a binary node, which together take some slots, and the slots of the left one.
    struct Split {
        Form form;
        unsigned left = 0;
    };

    /// The best form of a subtree in at most `slots` slots of a wide node, each within `stack` entries.
    Form form(std::int32_t index, unsigned slots, unsigned stack) {
        if (tree_.nodes[index].isLeaf()) return {0, 0};
        if (heights_[index] > stack + slots - 1) return {};
        // Without a limit the best form is known, and most subtrees fit with it
        if (const Form& best = free_[index][slots - 1]; best.bound <= stack) return best;
        const std::uint64_t key = (static_cast<std::uint64_t>(index) << 2 | slots) << 16 | stack;
        if (const auto known = limited_.find(key); known != limited_.end()) return known->second;
        return limited_[key] = findForm(index, slots, stack);
    }

    Form findForm(std::int32_t index, unsigned slots, unsigned stack) {
        if (slots > 1) return std::min(form(index, slots - 1, stack), split(index, slots, stack).form);
        return asNode(index, stack).form;
    }

    Split split(std::int32_t index, unsigned slots, unsigned stack) {
        const BinaryNode& node = tree_.nodes[index];
        Split best;
        for (unsigned left = 1; left < slots; ++left) {
            if (freeCost(node.left, left) + freeCost(node.right, slots - left) > best.form.cost) continue;
            const Form one = form(node.left, left, stack), other = form(node.right, slots - left, stack);
            if (!one.isFeasible() || !other.isFeasible()) continue;
            const Form both{one.cost + other.cost, std::max(one.bound, other.bound)};
            if (both < best.form) best = {both, left};
        }
        return best;
    }

    /// The cost without a limit of the stack, which no form within a limit goes below.
    Cost freeCost(std::int32_t index, unsigned slots) const {
        return tree_.nodes[index].isLeaf() ? 0 : free_[index][slots - 1].cost;
    }

    /// A wide node in place of a binary node.
    struct WideNode {
        Form form;
        unsigned children = 0;
    };

    WideNode asNode(std::int32_t index, unsigned stack) {
        WideNode best;
        for (unsigned children = std::min(most_, stack + 1); children >= 2; --children) {
            if (stack != unlimited &&
                split(index, children, unlimited).form.cost + tree_.nodes[index].box.halfArea() > best.form.cost)
                continue;
            const Form below = split(index, children, stack - (children - 1)).form;
            if (!below.isFeasible()) continue;
            const Form whole{below.cost + tree_.nodes[index].box.halfArea(), below.bound + children - 1};
            if (whole < best.form) best = {whole, children};
        }
        return best;
    }

    /// The children in the order of their leaves. A root that is a leaf gets itself as its only child.
    std::vector<std::int32_t> childrenOf(std::int32_t index, unsigned stack) {
        if (tree_.nodes[index].isLeaf()) return {index};
        if (free_[index][0].bound <= stack) stack = unlimited;
        const unsigned count = asNode(index, stack).children;
        std::vector<std::int32_t> children;
        addSplit(index, count, stack - (count - 1), children);
        return children;
    }

    void addSplit(std::int32_t index, unsigned slots, unsigned stack, std::vector<std::int32_t>& children) {
        const unsigned left = split(index, slots, stack).left;
        addForm(tree_.nodes[index].left, left, stack, children);
        addForm(tree_.nodes[index].right, slots - left, stack, children);
    }

    void addForm(std::int32_t index, unsigned slots, unsigned stack, std::vector<std::int32_t>& children) {
        if (slots == 1 || tree_.nodes[index].isLeaf()) children.push_back(index);
        else if (split(index, slots, stack).form < form(index, slots - 1, stack))
            addSplit(index, slots, stack, children);
        else addForm(index, slots - 1, stack, children);
    }

    /// Rounds child boxes outward to multiples of 2^exponent, and the node's low corner down to one. The lattice of a
    /// child lies in its parent's, so the rounded boxes of children give the same node as their exact boxes.
    void quantise(WideTree& wide, std::size_t index, const Box& box, const std::vector<std::int32_t>& children) const {
        const std::int64_t maximum = (std::int64_t{1} << boxBits_) - 1;
        for (int a = 0; a < 3; ++a) {
            int exponent = 0;
            const auto floored = [&](std::int64_t at) { return at >> exponent; };
            const auto raised = [&](std::int64_t at) { return (at + (std::int64_t{1} << exponent) - 1) >> exponent; };
            while (raised(box.high[a]) - floored(box.low[a]) > maximum) ++exponent;
            const std::int64_t origin = floored(box.low[a]);
            wide.origin[index * 3 + a] = static_cast<std::uint32_t>(origin << exponent);
            wide.exponent[index * 3 + a] = static_cast<std::uint8_t>(exponent);
            for (std::size_t slot = 0; slot < children.size(); ++slot) {
                const Box& child = tree_.nodes[children[slot]].box;
                const std::size_t at = (index * nodeChildren + slot) * 3 + a;
                wide.low[at] = static_cast<std::uint16_t>(floored(child.low[a]) - origin);
                wide.high[at] = static_cast<std::uint16_t>(raised(child.high[a]) - origin);
            }
        }
    }

    /// The largest sum of (children − 1) over all paths: the siblings that a ray hitting every box pushes.
    unsigned stackBound(const WideTree& wide) const {
        std::vector<unsigned> bound(wide.nodes(), 0);
        for (std::size_t node = wide.nodes(); node-- > 0;) {
            const auto child =
                bound.begin() + (std::lower_bound(wide.nodeAddress.begin(), wide.nodeAddress.end(), wide.first[node]) -
                                 wide.nodeAddress.begin());
            const unsigned deepest = wide.nodeCount[node] ? *std::max_element(child, child + wide.nodeCount[node]) : 0;
            bound[node] = wide.nodeCount[node] + wide.leafCount[node] - 1u + deepest;
        }
        return bound[0];
    }

    const BinaryTree& tree_;
    const unsigned most_, boxBits_, stackDepth_, leafRecords_;
    const std::vector<unsigned> heights_;
    std::vector<std::array<Form, 3>> free_; ///< forms without a limit of the stack, by node and slots
    std::unordered_map<std::uint64_t, Form> limited_; ///< forms within a stack, by node, slots and stack
};

/// The triangles of a leaf; the second one may be `noTriangle`.
using LeafTriangles = std::array<std::uint32_t, 2>;
constexpr std::uint32_t noTriangle = UINT32_MAX;

/// A wide tree and the order of its triangles.
struct Bvh {
    WideTree tree;
    std::vector<std::uint32_t> order; ///< the triangle index of each packed id
    unsigned heightLimit = 0; ///< height limit that the stack required; 0 for none
};

/// The triangles in the order of their leaves, of which the nodes have their ranges then.
inline std::vector<std::uint32_t> orderOfTriangles(BinaryTree& tree, const std::vector<LeafTriangles>& leaves) {
    std::vector<std::uint32_t> order, starts{0};
    for (const std::uint32_t leaf : tree.order) {
        for (const std::uint32_t triangle : leaves[leaf])
            if (triangle != noTriangle) order.push_back(triangle);
        starts.push_back(static_cast<std::uint32_t>(order.size()));
    }
    for (BinaryNode& node : tree.nodes) {
        node.begin = starts[node.begin];
        node.end = starts[node.end];
    }
    return order;
}

/// Builds the tree over leaves; `boxes` are the triangles'. If the binary tree is higher than the stack is deep, it is
/// built again with that limit. The caller must check whether the returned tree fits the stack.
inline Bvh build(const std::vector<Box>& boxes, const std::vector<LeafTriangles>& leaves, unsigned most,
                 unsigned boxBits, unsigned stackDepth, unsigned leafRecords) {
    std::vector<Box> boxesOfLeaves(leaves.size());
    for (std::size_t leaf = 0; leaf < leaves.size(); ++leaf)
        for (const std::uint32_t triangle : leaves[leaf])
            if (triangle != noTriangle) boxesOfLeaves[leaf].add(boxes[triangle]);
    const unsigned limit = std::max(stackDepth, balancedHeight(leaves.size()));
    BinaryTree tree = BinaryBuilder(boxesOfLeaves, 0).build();
    const bool isTooHigh = heights(tree)[0] > limit;
    if (isTooHigh) tree = BinaryBuilder(boxesOfLeaves, limit).build();
    tree = Reinsertion(std::move(tree), limit).optimise();
    std::vector<std::uint32_t> order = orderOfTriangles(tree, leaves);
    WideTree wide = Collapser(tree, most, boxBits, limit, leafRecords).collapse();
    return {std::move(wide), std::move(order), isTooHigh ? limit : 0};
}

} // namespace colonnade::bvh
