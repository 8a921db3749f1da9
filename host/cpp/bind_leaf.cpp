// Leaves and their normals, for tests and studies of scene images.
#include "binding.hpp"
#include "packer/leaf.hpp"

using namespace nanobind::literals;
using namespace colonnade;
using namespace colonnade::binding;

namespace {

template <class T, int Columns> using Table =
    nb::ndarray<const T, nb::shape<-1, Columns>, nb::c_contig, nb::device::cpu>;

/// Rows of a result, each from a row of values.
template <class Array, class Row>
Pixels<std::int64_t> rowsOf(const Array& values, std::size_t columns, const Row& row) {
    std::int64_t* to;
    auto result = makeArray<std::int64_t>({values.shape(0), columns}, to);
    nb::gil_scoped_release release;
    for (std::size_t i = 0; i < values.shape(0); ++i, to += columns) {
        const auto numbers = row(values.data() + i * values.shape(1));
        std::copy(numbers.begin(), numbers.end(), to);
    }
    return result;
}

nb::dict leavesOf(const Records& records, const FieldTuples& layouts, int fraction) {
    const LeafFields fields(layoutsOf(layouts));
    const std::size_t count = records.shape(0);
    std::int64_t *triangles, *materials, *vertices, *normals, *geometric;
    nb::dict result;
    result["triangles"] = makeArray<std::int64_t>({count}, triangles);
    result["material"] = makeArray<std::int64_t>({count}, materials);
    result["vertices"] = makeArray<std::int64_t>({count, leafTriangles, 3, 3}, vertices);
    result["normals"] = makeArray<std::int64_t>({count, leafTriangles, 3, 3}, normals);
    result["geometric"] = makeArray<std::int64_t>({count, leafTriangles, 3}, geometric);
    const auto copy = [](const Vector& from, std::int64_t*& to) { to = std::copy(from.begin(), from.end(), to); };
    for (std::size_t i = 0; i < count; ++i) {
        const Leaf leaf = readLeaf(fields, records.data() + i * records.shape(1));
        triangles[i] = leaf.triangles();
        materials[i] = leaf.material;
        for (int triangle = 0; triangle < leafTriangles; ++triangle) {
            const Face face = faceOf(leaf, triangle, fraction);
            for (const Vector& vertex : leaf.verticesOf(triangle)) copy(vertex, vertices);
            for (const Vector& normal : face.normals) copy(normal, normals);
            copy(face.geometricNormal, geometric);
        }
    }
    return result;
}

} // namespace

void bind_leaf(nb::module_& module) {
    module.def(
        "corner_codes",
        [](const Table<double, 3>& normals) {
            return rowsOf(normals, 2, [](const double* n) {
                const Octahedral code = packer::octahedralOf({n[0], n[1], n[2]});
                return std::array<std::int64_t, 2>{code.u, code.v};
            });
        },
        "normals"_a, "Codes of corner normals [n, 3] of any length but 0: int64 [n, 2].");
    module.def(
        "corner_normals",
        [](const Table<std::int64_t, 2>& codes, int fraction) {
            return rowsOf(codes, 3,
                          [fraction](const std::int64_t* code) { return directionOf({code[0], code[1]}, fraction); });
        },
        "codes"_a, "fraction"_a, "Normals of codes int64 [n, 2], with so many fraction bits: int64 [n, 3].");
    module.def(
        "geometric_normals",
        [](const Table<std::int64_t, 9>& triangles, int fraction) {
            return rowsOf(triangles, 3, [fraction](const std::int64_t* v) {
                return geometricNormal({Vector{v[0], v[1], v[2]}, Vector{v[3], v[4], v[5]}, Vector{v[6], v[7], v[8]}},
                                       fraction);
            });
        },
        "triangles"_a, "fraction"_a,
        "Normals of triangles by their vertices, vertex units, int64 [n, 9]: int64 [n, 3].");
    module.def("leaves", &leavesOf, "records"_a, "layouts"_a, "fraction"_a,
               "What leaf records uint8 [n, bytes] hold: triangles and material int64 [n], vertices and normals int64 "
               "[n, 2, 3, 3] by triangle and corner, geometric "
               "normals int64 [n, 2, 3]. Of a leaf of one triangle the second one means nothing.");
}
