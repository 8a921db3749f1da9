/// `colonnade._core.build_bvh`: the tree builder on numpy arrays, for tests of its structure.

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>

#include <stdexcept>
#include <utility>

#include "binding.hpp"
#include "packer/tree.hpp"

namespace nb = nanobind;
using namespace nb::literals;
namespace bvh = colonnade::bvh;
namespace packer = colonnade::packer;
using colonnade::nodeChildren;

namespace {

using Integers = nb::ndarray<const std::int32_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;

/// Moves a vector into a numpy array without a copy.
template <typename T> nb::object array(std::vector<T>&& values, std::initializer_list<std::size_t> shape) {
    auto* owned = new std::vector<T>(std::move(values));
    nb::capsule owner(owned, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
    return nb::cast(nb::ndarray<nb::numpy, T>(owned->data(), shape, owner));
}

packer::QuantisedMesh meshOf(const Integers& vertices, const Integers& faces) {
    packer::QuantisedMesh mesh;
    for (std::size_t i = 0; i < vertices.shape(0); ++i) {
        mesh.vertices.push_back({vertices(i, 0), vertices(i, 1), vertices(i, 2)});
        for (const std::int32_t coordinate : mesh.vertices.back())
            if (coordinate < 0 || coordinate > 1 << 28) throw std::invalid_argument("a coordinate is out of range");
    }
    for (std::size_t i = 0; i < faces.shape(0); ++i) {
        mesh.faces.push_back({faces(i, 0), faces(i, 1), faces(i, 2)});
        mesh.meshFaces.push_back(static_cast<std::int64_t>(i));
        for (const std::int32_t vertex : mesh.faces.back())
            if (vertex < 0 || static_cast<std::size_t>(vertex) >= vertices.shape(0))
                throw std::invalid_argument("a face names a vertex that does not exist");
    }
    return mesh;
}

nb::dict buildBvh(const Integers& vertices, const Integers& faces, int children, int boxBits, int stackDepth,
                  const colonnade::binding::FieldTuples& layouts, int normalFraction) {
    if (faces.shape(0) == 0) throw std::invalid_argument("no triangles");
    if (children < 2 || children > nodeChildren || boxBits < 1 || boxBits > 16)
        throw std::invalid_argument("unsupported tree parameters");
    const packer::QuantisedMesh mesh = meshOf(vertices, faces);
    const std::vector<std::array<colonnade::mesh::Vector, 3>> normals(mesh.faces.size());
    const std::vector<std::uint8_t> zeros(mesh.faces.size());
    packer::RecordFormat format;
    format.layouts = colonnade::binding::layoutsOf(layouts);
    format.normalFraction = normalFraction;
    format.children = children;
    format.boxBits = boxBits;
    format.stackDepth = stackDepth;
    bvh::Bvh built;
    {
        nb::gil_scoped_release release;
        built = packer::buildTree(mesh, {normals.data(), zeros.data(), zeros.data(), nullptr}, format);
    }
    bvh::WideTree& tree = built.tree;
    const std::size_t nodes = tree.nodes(), leaves = tree.leaves(), triangles = built.order.size();
    nb::dict out;
    out["node_address"] = array(std::move(tree.nodeAddress), {nodes});
    out["origin"] = array(std::move(tree.origin), {nodes, 3});
    out["exponent"] = array(std::move(tree.exponent), {nodes, 3});
    out["low"] = array(std::move(tree.low), {nodes, std::size_t{nodeChildren}, 3});
    out["high"] = array(std::move(tree.high), {nodes, std::size_t{nodeChildren}, 3});
    out["first"] = array(std::move(tree.first), {nodes});
    out["node_count"] = array(std::move(tree.nodeCount), {nodes});
    out["leaf_children"] = array(std::move(tree.leafCount), {nodes});
    out["leaf_address"] = array(std::move(tree.leafAddress), {leaves});
    out["leaf_first"] = array(std::move(tree.leafFirst), {leaves});
    out["leaf_count"] = array(std::move(tree.leafTriangleCount), {leaves});
    out["order"] = array(std::move(built.order), {triangles});
    out["depth"] = tree.depth;
    out["stack_bound"] = tree.stackBound;
    out["cost"] = tree.cost;
    out["height_limit"] = built.heightLimit;
    return out;
}

}  // namespace

void bind_bvh(nb::module_& module) {
    module.def("build_bvh", &buildBvh, "vertices"_a, "faces"_a, "children"_a, "box_bits"_a, "stack_depth"_a,
               "layouts"_a, "normal_fraction"_a,
               "Builds the tree over triangles: vertices int32 [n, 3] in vertex units, faces int32 [m, 3]. Returns the "
               "arrays of tests/trees.py.");
}
