// The readers of mesh files (cpp/mesh/files) for Python. Texts of files are bytes: their encoding is theirs.
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/vector.h>

#include <cstring>
#include <memory>
#include <optional>

#include "binding.hpp"
#include "mesh/files/files.hpp"
#include "mesh/files/gltf_nodes.hpp"
#include "mesh/teapot.hpp"

using namespace nanobind::literals;
using namespace colonnade;
using namespace colonnade::binding;

namespace {

nb::bytes bytesOf(const std::string& text) { return nb::bytes(text.data(), text.size()); }
mesh::Text textOf(const nb::bytes& bytes) { return {bytes.c_str(), bytes.size()}; }

/// A numpy array that takes rows, which are numbers side by side; None for none.
template <class T, class Row> nb::object rowsOf(std::vector<Row>&& rows, std::initializer_list<std::size_t> inner) {
    if (rows.empty()) return nb::none();
    std::vector<std::size_t> shape{rows.size()};
    shape.insert(shape.end(), inner.begin(), inner.end());
    auto* own = new std::vector<Row>(std::move(rows));
    const nb::capsule owner(own, [](void* memory) noexcept { delete static_cast<std::vector<Row>*>(memory); });
    return nb::cast(Pixels<T>(reinterpret_cast<T*>(own->data()), shape.size(), shape.data(), owner));
}

/// Of each loss subject and verb in the singular and the plural, what is done instead, number and name.
nb::list linesOf(const mesh::Losses& losses) {
    nb::list found;
    for (const mesh::Losses::Entry& entry : losses.entries)
        found.append(
            nb::make_tuple(entry.one, entry.several, bytesOf(entry.instead), entry.count, bytesOf(entry.name)));
    return found;
}

class MeshFile {
public:
    MeshFile(const std::string& format, const nb::bytes& where)
        : reader_(mesh::readerOf(format, std::string(textOf(where)))) {
        if (!reader_) throw std::invalid_argument("no such format");
    }

    void begin(const nb::bytes& data) {
        refuse(released([&] { return reader_->begin(textOf(data)); }));
    }
    std::optional<nb::bytes> nextLibrary() {
        std::string name;
        if (!reader_->nextLibrary(name)) return {};
        return bytesOf(name);
    }
    void giveLibrary(const std::optional<nb::bytes>& data, const nb::bytes& where) {
        refuse(reader_->giveLibrary(data ? std::optional(textOf(*data)) : std::nullopt, std::string(textOf(where))));
    }
    nb::list pictures() {
        refuse(reader_->needPictures());
        nb::list found;
        for (const auto& [name, isClamped] : reader_->pictures) found.append(nb::make_tuple(bytesOf(name), isClamped));
        return found;
    }
    /// The surface as numpy arrays, None for those that are empty.
    nb::dict finish(const std::vector<std::int32_t>& pictures) {
        if (pictures.size() != reader_->pictures.size()) throw std::invalid_argument("the number of pictures differs");
        refuse(released([&] { return reader_->finish(pictures); }));
        mesh::FileSurface surface = std::move(reader_->surface);
        nb::dict found;
        found["vertices"] = rowsOf<double>(std::move(surface.vertices), {3});
        found["faces"] = rowsOf<std::int32_t>(std::move(surface.faces), {3});
        found["normals"] = rowsOf<double>(std::move(surface.normals), {3, 3});
        found["colours"] = rowsOf<double>(std::move(surface.colours), {3, 3});
        found["uvs"] = rowsOf<double>(std::move(surface.uvs), {3, 2});
        found["face_materials"] = rowsOf<std::int32_t>(std::move(surface.faceMaterials), {});
        nb::list materials, textures;
        for (const mesh::FileMaterial& one : surface.materials)
            materials.append(nb::make_tuple(static_cast<int>(one.kind), one.albedo, one.ior, one.roughness,
                                            one.emission, one.alpha, one.texture));
        for (const mesh::FileTexture& one : surface.textures)
            textures.append(nb::make_tuple(one.picture, one.mask, one.isWhite));
        found["materials"] = materials;
        found["textures"] = textures;
        return found;
    }
    /// What is lost since the last call.
    nb::list losses() {
        nb::list found = linesOf(reader_->losses);
        reader_->losses.entries.clear();
        return found;
    }
    nb::bytes refusal() const { return bytesOf(reader_->refusal); }

private:
    void refuse(bool isRead) {
        if (!isRead) throw nb::value_error("the file is refused");
    }

    std::unique_ptr<mesh::MeshReader> reader_;
};

using GivenRows = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

class GltfFile {
public:
    GltfFile(const nb::bytes& where, const std::string& kind) : document_(std::string(textOf(where)), kind) {}

    void begin(const nb::bytes& data) {
        kept_.push_back(data);
        refuse(released([&] { return document_.begin(textOf(data)); }));
    }
    void checkExtensions() { refuse(document_.checkExtensions()); }
    nb::bytes text() const { return nb::bytes(document_.text().data(), document_.text().size()); }

    /// The elements of an accessor; None: the buffer is needed.
    nb::object array(std::size_t index, const std::optional<GivenRows>& decoded, bool isWhole) {
        require(index, mesh::gltf::GltfDocument::accessors);
        mesh::gltf::Array array;
        std::optional<mesh::gltf::Decoded> given;
        if (decoded) given = {decoded->data(), decoded->shape(0), static_cast<int>(decoded->shape(1)), isWhole};
        if (!isFound(document_.array(index, array, given ? &*given : nullptr))) return nb::none();
        return array.isWhole ? filled<std::int64_t>(array) : filled<double>(array);
    }
    /// The bytes of a buffer view, such as a picture; None: the buffer is needed.
    nb::object viewBytes(std::size_t index) {
        require(index, mesh::gltf::GltfDocument::bufferViews);
        std::string bytes;
        return isFound(document_.viewBytes(index, bytes)) ? nb::object(bytesOf(bytes)) : nb::none();
    }
    /// The bytes of an image, or None, and its file, or None; None: the buffer is needed.
    nb::object image(std::size_t index) {
        require(index, mesh::gltf::GltfDocument::images);
        std::string bytes;
        std::optional<std::string> file;
        if (!isFound(document_.image(index, bytes, file))) return nb::none();
        return file ? nb::make_tuple(nb::none(), bytesOf(*file)) : nb::make_tuple(bytesOf(bytes), nb::none());
    }
    /// Parents, order, matrices to the parents, translations, rotations and scales of all nodes.
    nb::tuple nodes() {
        mesh::Nodes nodes;
        refuse(mesh::gltf::NodeReader(document_).readAll(nodes));
        return nb::make_tuple(arrayOf<std::int64_t>(nodes.parents, {}), arrayOf<std::int64_t>(nodes.order, {}),
                              arrayOf<double>(nodes.matrices, {4, 4}), arrayOf<double>(nodes.translations, {3}),
                              arrayOf<double>(nodes.rotations, {4}), arrayOf<double>(nodes.scales, {3}));
    }
    /// Each node with a mesh of the default scene, and its transforms to the scene; and losses. None: the buffer is
    /// needed.
    nb::object placements(bool isAnimated) {
        std::vector<mesh::gltf::Placement> found;
        mesh::Losses losses;
        if (!isFound(mesh::gltf::NodeReader(document_).read(isAnimated, found, losses))) return nb::none();
        nb::list placed;
        for (const auto& [node, matrices] : found)
            placed.append(nb::make_tuple(node, arrayOf<double>(matrices, {4, 4})));
        return nb::make_tuple(placed, linesOf(losses));
    }
    /// The triangles of the default scene by the counts of accessors.
    double triangles() {
        const std::optional<double> count = mesh::gltf::NodeReader(document_).triangles();
        refuse(count.has_value());
        return *count;
    }
    nb::bytes bufferFile() const { return bytesOf(document_.bufferFile.value_or("")); }
    void give(const std::optional<nb::bytes>& data) {
        if (data) kept_.push_back(*data);
        refuse(document_.give(data ? std::optional(textOf(*data)) : std::nullopt));
    }
    nb::bytes refusal() const { return bytesOf(document_.refusal); }

private:
    template <class Value, class Row>
    static nb::object arrayOf(const std::vector<Row>& rows, std::initializer_list<std::size_t> inner) {
        std::vector<std::size_t> shape{rows.size()};
        shape.insert(shape.end(), inner.begin(), inner.end());
        auto* own = new std::vector<Row>(rows);
        own->reserve(1);
        const nb::capsule owner(own, [](void* memory) noexcept { delete static_cast<std::vector<Row>*>(memory); });
        return nb::cast(Pixels<Value>(reinterpret_cast<Value*>(own->data()), shape.size(), shape.data(), owner));
    }
    static void refuse(bool isRead) {
        if (!isRead) throw nb::value_error("the file is refused");
    }
    static bool isFound(mesh::gltf::Found found) {
        refuse(found != mesh::gltf::Found::refused);
        return found == mesh::gltf::Found::yes;
    }
    void require(std::size_t index, mesh::gltf::GltfDocument::List list) const {
        if (index >= document_.count(list)) throw nb::index_error("no such entry");
    }
    template <class Value> static nb::object filled(const mesh::gltf::Array& array) {
        Value* to;
        auto result = makeArray<Value>({array.count, static_cast<std::size_t>(array.width)}, to);
        released([&] { array.copy(to); });
        return nb::cast(result);
    }

    mesh::gltf::GltfDocument document_;
    std::vector<nb::bytes> kept_; ///< what the document refers to
};

using Given = nb::ndarray<const std::uint8_t, nb::shape<-1, -1, 3>, nb::c_contig, nb::device::cpu>;
using GivenAlpha = nb::ndarray<const std::uint8_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

auto maskOf(const Given& pixels, const std::optional<GivenAlpha>& alpha, std::size_t height, std::size_t width) {
    const mesh::Picture<std::uint8_t> picture{pixels.data(),
                                              static_cast<std::int64_t>(pixels.shape(0)),
                                              static_cast<std::int64_t>(pixels.shape(1)),
                                              3,
                                              {},
                                              {},
                                              false};
    const std::vector<std::uint8_t> mask = mesh::maskOf(
        picture, alpha ? alpha->data() : nullptr, static_cast<std::int64_t>(height), static_cast<std::int64_t>(width));
    std::uint8_t* to;
    auto result = makeArray<std::uint8_t>({height, width}, to);
    std::copy(mask.begin(), mask.end(), to);
    return result;
}

nb::dict losses() {
    nb::dict found;
    for (const auto& [name, loss] : mesh::lost::shared)
        found[name] = nb::make_tuple(loss->one, loss->several, loss->instead);
    return found;
}

nb::tuple triangulate(const nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>& points,
                      const nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>& sizes) {
    const auto* rows = reinterpret_cast<const mesh::Vector*>(points.data());
    std::size_t left = points.shape(0);
    for (std::size_t i = 0; i < sizes.shape(0); left -= static_cast<std::size_t>(sizes.data()[i++]))
        if (sizes.data()[i] < 0 || static_cast<std::size_t>(sizes.data()[i]) > left)
            throw std::invalid_argument("a polygon has no such corners");
    std::vector<mesh::Row<std::int64_t>> corners;
    std::vector<std::int64_t> polygons;
    mesh::PolygonSplitter splitter;
    released([&] {
        std::int64_t polygon = 0, start = 0;
        for (; polygon < static_cast<std::int64_t>(sizes.shape(0)); start += sizes.data()[polygon++]) {
            if (!splitter.split({rows + start, rows + start + sizes.data()[polygon]})) return;
            for (const auto& [a, b, c] : splitter.triangles) {
                const auto at = [&](std::size_t corner) { return start + static_cast<std::int64_t>(corner); };
                corners.push_back({at(a), at(b), at(c)});
                polygons.push_back(polygon);
            }
        }
    });
    return nb::make_tuple(rowsOf<std::int64_t>(std::move(corners), {3}), rowsOf<std::int64_t>(std::move(polygons), {}),
                          splitter.shorts, splitter.crossed, splitter.tests, splitter.error);
}

nb::tuple teapot(int level) {
    mesh::RawMesh mesh = mesh::teapot(level);
    return nb::make_tuple(rowsOf<double>(std::move(mesh.vertices), {3}),
                          rowsOf<std::int32_t>(std::move(mesh.faces), {3}));
}

} // namespace

void bind_files(nb::module_& module) {
    nb::class_<MeshFile>(module, "MeshFile",
                         "The reader of a file in steps (mesh/files/reader.hpp); a ValueError has the line `refusal`.")
        .def(nb::init<const std::string&, const nb::bytes&>(), "format"_a, "where"_a)
        .def("begin", &MeshFile::begin, "data"_a)
        .def("next_library", &MeshFile::nextLibrary)
        .def("give_library", &MeshFile::giveLibrary, "data"_a.none(), "where"_a)
        .def("pictures", &MeshFile::pictures)
        .def("finish", &MeshFile::finish, "pictures"_a)
        .def("losses", &MeshFile::losses)
        .def("refusal", &MeshFile::refusal);
    nb::class_<GltfFile>(module, "GltfFile",
                         "The document of a glTF file (mesh/files/gltf_document.hpp); a ValueError has the line "
                         "`refusal`, and None the `buffer_file` to `give`.")
        .def(nb::init<const nb::bytes&, const std::string&>(), "where"_a, "kind"_a)
        .def("begin", &GltfFile::begin, "data"_a)
        .def("check_extensions", &GltfFile::checkExtensions)
        .def("text", &GltfFile::text)
        .def("array", &GltfFile::array, "index"_a, "decoded"_a.none() = nb::none(), "is_whole"_a = false)
        .def("view_bytes", &GltfFile::viewBytes, "index"_a)
        .def("image", &GltfFile::image, "index"_a)
        .def("nodes", &GltfFile::nodes)
        .def("placements", &GltfFile::placements, "is_animated"_a)
        .def("triangles", &GltfFile::triangles)
        .def("buffer_file", &GltfFile::bufferFile)
        .def("give", &GltfFile::give, "data"_a.none())
        .def("refusal", &GltfFile::refusal);
    module.def("mask_of", &maskOf, "pixels"_a, "alpha"_a.none(), "height"_a, "width"_a,
               "The alpha of a texture by another picture, uint8 [height, width].");
    module.def("teapot", &teapot, "level"_a, "Vertices and faces of the teapot.");
    module.def("losses", &losses, "The words of losses that several readers count, by name.");
    module.def("triangulate", &triangulate, "points"_a, "sizes"_a,
               "Corners and polygon of each triangle, polygons that are short, or cross themselves, tests for ears, "
               "and an error.");
}
