/// `colonnade._core.build_bvh`: the tree builder on numpy arrays, for tests of its structure.

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>

#include <stdexcept>
#include <utility>

#include "wide_bvh.hpp"

namespace nb = nanobind;
using namespace nb::literals;
namespace bvh = colonnade::bvh;

namespace {

using Integers = nb::ndarray<const std::int32_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;

/// Moves a vector into a numpy array without a copy.
template <typename T> nb::object array(std::vector<T>&& values, std::initializer_list<std::size_t> shape) {
    auto* owned = new std::vector<T>(std::move(values));
    nb::capsule owner(owned, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
    return nb::cast(nb::ndarray<nb::numpy, T>(owned->data(), shape, owner));
}

std::vector<bvh::Box> boxesOf(const Integers& vertices, const Integers& faces) {
    std::vector<bvh::Box> boxes(faces.shape(0));
    const std::int32_t limit = 1 << 28;
    for (std::size_t i = 0; i < faces.shape(0); ++i)
        for (std::size_t corner = 0; corner < 3; ++corner) {
            const std::int32_t vertex = faces(i, corner);
            if (vertex < 0 || static_cast<std::size_t>(vertex) >= vertices.shape(0)) throw std::invalid_argument("a face names a vertex that does not exist");
            bvh::Box point;
            for (std::size_t a = 0; a < 3; ++a) {
                if (vertices(vertex, a) < 0 || vertices(vertex, a) > limit) throw std::invalid_argument("a coordinate is out of range");
                point.low[a] = point.high[a] = vertices(vertex, a);
            }
            boxes[i].add(point);
        }
    return boxes;
}

nb::dict buildBvh(const Integers& vertices, const Integers& faces, unsigned perRecord, unsigned arity, unsigned boxBits, unsigned stackDepth) {
    if (faces.shape(0) == 0) throw std::invalid_argument("no triangles");
    if (perRecord < 1 || (arity != 2 && arity != 4) || boxBits < 1 || boxBits > 16) throw std::invalid_argument("unsupported tree parameters");
    const std::vector<bvh::Box> boxes = boxesOf(vertices, faces);
    bvh::Bvh built;
    {
        nb::gil_scoped_release release;
        built = bvh::build(boxes, perRecord, arity, boxBits, stackDepth);
    }
    bvh::WideTree& tree = built.tree;
    const std::size_t nodes = tree.nodes(), leaves = tree.leafFirst.size(), triangles = built.order.size();
    nb::dict out;
    out["origin"] = array(std::move(tree.origin), {nodes, 3});
    out["exponent"] = array(std::move(tree.exponent), {nodes, 3});
    out["kinds"] = array(std::move(tree.kinds), {nodes, arity});
    out["low"] = array(std::move(tree.low), {nodes, arity, 3});
    out["high"] = array(std::move(tree.high), {nodes, arity, 3});
    out["first_child"] = array(std::move(tree.firstChild), {nodes});
    out["first_triangles"] = array(std::move(tree.firstTriangles), {nodes});
    out["leaf_first"] = array(std::move(tree.leafFirst), {leaves});
    out["leaf_count"] = array(std::move(tree.leafCount), {leaves});
    out["order"] = array(std::move(built.order), {triangles});
    out["depth"] = tree.depth;
    out["stack_bound"] = tree.stackBound;
    out["cost"] = tree.cost;
    out["height_limit"] = built.heightLimit;
    return out;
}

}  // namespace

void bind_bvh(nb::module_& module) {
    module.def("build_bvh", &buildBvh, "vertices"_a, "faces"_a, "triangles_per_record"_a, "arity"_a, "box_bits"_a, "stack_depth"_a,
               "Builds the tree over triangles: vertices int32 [n, 3] in vertex units, faces int32 [m, 3]. Returns the arrays of tests/trees.py.");
}
