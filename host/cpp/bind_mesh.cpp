// colonnade._core.TargetMesh: driver/src/colonnade_mesh.c, which bends meshes on a target, for Python.
// Without the model's headers: its namespace has the name of the driver's structure.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/tuple.h>

#include <stdexcept>
#include <string>
#include <vector>

#include "colonnade_mesh.h"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace {

template <class T, class Shape> using Given = nb::ndarray<const T, Shape, nb::c_contig, nb::device::cpu>;
using Corner = std::array<std::int32_t, 3>;

constexpr std::size_t recordWords = 8;

void check(colonnade_error error) {
    if (error != COLONNADE_OK) throw std::invalid_argument(colonnade_error_name(error));
}

/// A numpy array [rows, columns] that owns its memory; of one dimension if there are no columns.
template <class T> nb::ndarray<nb::numpy, T> makeRows(std::size_t rows, std::size_t columns, T*& data) {
    data = new T[rows * std::max<std::size_t>(columns, 1)]();
    nb::capsule owner(data, [](void* memory) noexcept { delete[] static_cast<T*>(memory); });
    const std::size_t shape[]{rows, columns};
    return nb::ndarray<nb::numpy, T>(data, columns == 0 ? 1 : 2, shape, owner);
}

class TargetMesh {
public:
    TargetMesh(const std::array<std::uint32_t, 8>& formatHash, const nb::bytes& file)
        : file_(file.c_str(), file.size()) {
        colonnade_design design{};
        std::copy(formatHash.begin(), formatHash.end(), design.format_hash);
        check(colonnade_mesh_open(&mesh_, &design, file_.data(), file_.size()));
    }

    auto pose(std::uint32_t time) const {
        std::int32_t* to;
        auto result = makeRows<std::int32_t>(colonnade_mesh_pose_words(&mesh_), 0, to);
        colonnade_mesh_pose(&mesh_, time, to);
        return result;
    }

    auto skin(const Given<std::int32_t, nb::ndim<1>>& pose) const {
        if (pose.shape(0) != colonnade_mesh_pose_words(&mesh_)) throw std::invalid_argument("a pose of another clip");
        std::vector<colonnade_vertex> vertices(mesh_.vertices);
        check(colonnade_mesh_skin(&mesh_, pose.data(), vertices.data()));
        std::int32_t* positions;
        std::int16_t* normals;
        auto result = std::make_tuple(makeRows<std::int32_t>(vertices.size(), 3, positions),
                                      makeRows<std::int16_t>(vertices.size(), 2, normals));
        for (const colonnade_vertex& vertex : vertices) {
            positions = std::copy(vertex.position, vertex.position + 3, positions);
            normals = std::copy(vertex.normal, vertex.normal + 2, normals);
        }
        return result;
    }

    auto refit(const Given<std::int32_t, nb::shape<-1, 3>>& positions,
               const Given<std::int16_t, nb::shape<-1, 2>>& normals,
               const nb::ndarray<std::uint32_t, nb::shape<-1, recordWords>, nb::c_contig, nb::device::cpu>& copy,
               std::uint32_t root) const {
        if (positions.shape(0) != mesh_.vertices || normals.shape(0) != mesh_.vertices || copy.shape(0) < mesh_.records)
            throw std::invalid_argument("vertices or records of another clip");
        std::vector<colonnade_vertex> vertices(mesh_.vertices);
        for (std::size_t i = 0; i < vertices.size(); ++i) {
            std::copy(positions.data() + 3 * i, positions.data() + 3 * i + 3, vertices[i].position);
            std::copy(normals.data() + 2 * i, normals.data() + 2 * i + 2, vertices[i].normal);
        }
        std::vector<colonnade_mesh_node> path(mesh_.depth);
        colonnade_refit found;
        check(colonnade_mesh_refit(&mesh_, vertices.data(), copy.data(), root, path.data(), &found));
        return std::make_tuple(Corner{found.low[0], found.low[1], found.low[2]},
                               Corner{found.high[0], found.high[1], found.high[2]}, found.flat_pairs);
    }

    auto plan(const Given<std::uint32_t, nb::shape<-1, recordWords>>& copy, std::uint32_t root) const {
        if (copy.shape(0) < mesh_.records) throw std::invalid_argument("records of another clip");
        std::vector<colonnade_mesh_node> path(mesh_.depth);
        std::vector<std::uint32_t> lines(mesh_.vertices / COLONNADE_LINE_VERTICES + 1);
        std::uint32_t entries;
        check(colonnade_mesh_plan(&mesh_, copy.data(), root, path.data(), lines.data(), nullptr, &entries));
        std::uint32_t* words;
        auto result = makeRows<std::uint32_t>(entries, COLONNADE_PLAN_WORDS, words);
        check(colonnade_mesh_plan(&mesh_, copy.data(), root, path.data(), lines.data(), words, &entries));
        return result;
    }

private:
    std::string file_;
    colonnade_mesh mesh_;
};

} // namespace

void bind_mesh(nb::module_& module) {
    nb::class_<TargetMesh>(module, "TargetMesh")
        .def(nb::init<const std::array<std::uint32_t, 8>&, const nb::bytes&>(), "format_hash"_a, "file"_a)
        .def("pose", &TargetMesh::pose, "time"_a)
        .def("skin", &TargetMesh::skin, "pose"_a)
        .def("refit", &TargetMesh::refit, "positions"_a, "normals"_a, "copy"_a, "root"_a)
        .def("plan", &TargetMesh::plan, "copy"_a, "root"_a);
}
