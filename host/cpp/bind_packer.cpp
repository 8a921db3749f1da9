/// The packer (cpp/packer) and the operations on meshes (cpp/mesh) for Python.
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/vector.h>

#include <cstring>
#include <memory>
#include <optional>

#include "binding.hpp"
#include "mesh/alpha_cut.hpp"
#include "mesh/atlas.hpp"
#include "mesh/baking.hpp"
#include "mesh/cleaning.hpp"
#include "mesh/emission.hpp"
#include "mesh/roughness.hpp"
#include "mesh/swatches.hpp"
#include "packer/records.hpp"
#include "packer/surface_offset.hpp"

using namespace nanobind::literals;
using namespace colonnade;
using namespace colonnade::binding;

namespace {

template <class T> using Rows = nb::ndarray<const T, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
template <class T> using CornerRows = nb::ndarray<const T, nb::shape<-1, 3, 3>, nb::c_contig, nb::device::cpu>;
template <class T> using Column = nb::ndarray<const T, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

template <class Row, class Array> const Row* rowsOf(const Array& array) {
    return reinterpret_cast<const Row*>(array.data());
}

template <class Row, class Array> std::vector<Row> vectorOf(const Array& array) {
    return {rowsOf<Row>(array), rowsOf<Row>(array) + array.shape(0)};
}

template <class T, class Values> nb::object arrayOf(const Values& values, std::initializer_list<std::size_t> shape) {
    T* data;
    auto result = makeArray<T>(shape, data);
    std::memcpy(data, values.data(), values.size() * sizeof values[0]);
    return nb::cast(result);
}

void checkFaces(const Rows<std::int32_t>& faces, std::size_t vertices) {
    for (std::size_t i = 0; i < 3 * faces.shape(0); ++i)
        if (faces.data()[i] < 0 || static_cast<std::size_t>(faces.data()[i]) >= vertices)
            throw std::invalid_argument("a face names a vertex that does not exist");
}

nb::dict quantise(const Rows<double>& vertices, const Rows<std::int32_t>& faces, int vertexBits) {
    checkFaces(faces, vertices.shape(0));
    const packer::QuantisedMesh mesh = released([&] {
        return packer::quantise(rowsOf<mesh::Vector>(vertices), vertices.shape(0), rowsOf<mesh::Face>(faces),
                                faces.shape(0), vertexBits);
    });
    nb::dict result;
    result["vertices"] = arrayOf<std::int32_t>(mesh.vertices, {mesh.vertices.size(), 3});
    result["faces"] = arrayOf<std::int32_t>(mesh.faces, {mesh.faces.size(), 3});
    result["mesh_faces"] = arrayOf<std::int64_t>(mesh.meshFaces, {mesh.meshFaces.size()});
    result["scale"] = mesh.scale;
    result["offset"] = mesh.offset;
    return result;
}

/// A quantised mesh and its tree, ready to be written as records.
class Packing {
public:
    Packing(const Rows<std::int32_t>& vertices, const Rows<std::int32_t>& faces, const Column<std::int64_t>& meshFaces,
            const CornerRows<double>& normals, const Column<std::uint8_t>& materials, const Column<bool>& isClear,
            const std::optional<CornerRows<std::int64_t>>& colours, const Values& format, const FieldTuples& layouts)
        : format_{layoutsOf(layouts),          valueOf(format, "recordBits"), valueOf(format, "vertexBits"),
                  valueOf(format, "boxBits"),  valueOf(format, "stackDepth"), valueOf(format, "normalFraction"),
                  valueOf(format, "children"), valueOf(format, "bvh") != 0,   valueOf(format, "bends") != 0},
          normals_(normals), materials_(materials), isClear_(isClear), colours_(colours) {
        checkFaces(faces, vertices.shape(0));
        if (faces.shape(0) == 0 || meshFaces.shape(0) != faces.shape(0))
            throw std::invalid_argument("the numbers of faces differ, or are 0");
        if (format_.children < 2 || format_.children > nodeChildren)
            throw std::invalid_argument("a node has 2 to 4 children");
        mesh_.vertices = vectorOf<packer::Units>(vertices);
        mesh_.faces = vectorOf<mesh::Face>(faces);
        mesh_.meshFaces = vectorOf<std::int64_t>(meshFaces);
        const auto count =
            static_cast<std::size_t>(1 + *std::max_element(mesh_.meshFaces.begin(), mesh_.meshFaces.end()));
        if (std::min({normals.shape(0), materials.shape(0), isClear.shape(0)}) < count ||
            (colours && colours->shape(0) < count))
            throw std::invalid_argument("a face has no attributes");
        const packer::FaceAttributes attributes{
            rowsOf<std::array<mesh::Vector, 3>>(normals_), materials_.data(),
            reinterpret_cast<const std::uint8_t*>(isClear_.data()),
            colours_ ? rowsOf<std::array<mesh::Row<std::int64_t>, 3>>(*colours_) : nullptr};
        nb::gil_scoped_release release;
        tree_ = packer::buildTree(mesh_, attributes, format_);
        packer_ = std::make_unique<packer::RecordPacker>(mesh_, attributes, tree_, format_);
    }

    nb::dict sections() const {
        const packer::Sections& sections = packer_->sections();
        nb::dict result;
        result["record_count"] = sections.recordCount;
        result["nodes"] = sections.nodes;
        result["leaves"] = sections.leaves;
        result["bounds_low"] = nb::make_tuple(sections.boundsLow[0], sections.boundsLow[1], sections.boundsLow[2]);
        result["bounds_high"] = nb::make_tuple(sections.boundsHigh[0], sections.boundsHigh[1], sections.boundsHigh[2]);
        result["largest_triangle"] = sections.largestTriangle;
        return result;
    }

    nb::dict statistics() const {
        nb::dict result;
        result["nodes"] = tree_.tree.nodes();
        result["leaves"] = tree_.tree.leaves();
        result["depth"] = tree_.tree.depth;
        result["stack_bound"] = tree_.tree.stackBound;
        result["cost"] = tree_.tree.cost;
        result["height_limit"] = tree_.heightLimit;
        return result;
    }

    nb::object faces() const {
        const std::vector<std::int64_t> faces = packer_->faces();
        return arrayOf<std::int64_t>(faces, {faces.size()});
    }

    nb::object leafCorners() const {
        const std::vector<std::int64_t> corners = packer_->leafCorners();
        return arrayOf<std::int64_t>(corners, {corners.size() / 4, 4});
    }

    nb::object records() const {
        const std::vector<std::uint8_t> records = released([&] { return packer_->records(); });
        return arrayOf<std::uint8_t>(records, {packer_->sections().recordCount, format_.recordBytes()});
    }

private:
    static int valueOf(const Values& values, const char* key) { return static_cast<int>(lookUp(values, key)); }

    packer::RecordFormat format_;
    const CornerRows<double> normals_;  // the packer refers to these
    const Column<std::uint8_t> materials_;
    const Column<bool> isClear_;
    const std::optional<CornerRows<std::int64_t>> colours_;
    packer::QuantisedMesh mesh_;
    bvh::Bvh tree_;
    std::unique_ptr<packer::RecordPacker> packer_;
};

nb::tuple mergeRows(const Rows<double>& rows) {
    const mesh::MergedRows<double> merged =
        released([&] { return mesh::mergeRows(rowsOf<mesh::Vector>(rows), rows.shape(0)); });
    return nb::make_tuple(arrayOf<double>(merged.rows, {merged.rows.size(), 3}),
                          arrayOf<std::int64_t>(merged.index, {merged.index.size()}));
}

nb::object clean(const Rows<double>& vertices, const Rows<std::int32_t>& faces,
                 const std::optional<CornerRows<double>>& normals, double leastCosine, std::size_t sourceFaces) {
    if (normals && normals->shape(0) != faces.shape(0)) throw std::invalid_argument("a face has no normals");
    const mesh::CleanMesh mesh = released([&] {
        return mesh::clean({vectorOf<mesh::Vector>(vertices), vectorOf<mesh::Face>(faces),
                            normals ? vectorOf<mesh::Corners>(*normals) : std::vector<mesh::Corners>()},
                           leastCosine, sourceFaces);
    });
    if (!mesh.error.empty()) return nb::cast(mesh.error);
    const std::size_t count = mesh.faces.size();
    return nb::make_tuple(arrayOf<double>(mesh.vertices, {mesh.vertices.size(), 3}),
                          arrayOf<std::int32_t>(mesh.faces, {count, 3}), arrayOf<std::int64_t>(mesh.sources, {count}),
                          arrayOf<double>(mesh.normals.normals, {count, 3, 3}),
                          arrayOf<bool>(mesh.winding.reversed, {count}), arrayOf<bool>(mesh.winding.isOpen, {count}),
                          nb::make_tuple(mesh.winding.mixed, mesh.winding.inverted, mesh.normals.flipped,
                                         mesh.normals.replaced, mesh.normals.missing));
}

template <class Pixel>
Pixels<double> sampled(const nb::ndarray<const Pixel, nb::ndim<3>, nb::c_contig, nb::device::cpu>& pixels,
                       const nb::ndarray<const double, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>& uvs, int wrapU,
                       int wrapV, bool isNearest, const std::optional<Column<double>>& values) {
    const auto extent = [&](std::size_t axis) { return static_cast<std::int64_t>(pixels.shape(axis)); };
    if (pixels.size() == 0 || (values && (sizeof(Pixel) > 1 || values->shape(0) < 256)))
        throw std::invalid_argument("there are no pixels, or too few values");
    const mesh::Picture<Pixel> picture{
        pixels.data(), extent(0), extent(1), extent(2), static_cast<mesh::Wrap>(wrapU), static_cast<mesh::Wrap>(wrapV),
        isNearest};
    double* out;
    auto result = makeArray<double>({uvs.shape(0), pixels.shape(2)}, out);
    const double *table = values ? values->data() : nullptr, *uv = uvs.data();
    nb::gil_scoped_release release;
    for (std::size_t i = 0; i < uvs.shape(0); ++i, uv += 2, out += picture.channels)
        if (table) picture.sample(uv, [table](Pixel code) { return table[static_cast<std::uint8_t>(code)]; }, out);
        else picture.sample(uv, [](Pixel value) { return static_cast<double>(value); }, out);
    return result;
}

using Positions = nb::ndarray<const double, nb::shape<-1, 3, 2>, nb::c_contig, nb::device::cpu>;
using Texture =
    std::tuple<nb::ndarray<const std::uint8_t, nb::shape<-1, -1, 3>, nb::c_contig, nb::device::cpu>, int, int, bool>;

mesh::Picture<std::uint8_t> pictureOf(const Texture& texture) {
    const auto& [pixels, wrapU, wrapV, isNearest] = texture;
    return {pixels.data(),
            static_cast<std::int64_t>(pixels.shape(0)),
            static_cast<std::int64_t>(pixels.shape(1)),
            3,
            static_cast<mesh::Wrap>(wrapU),
            static_cast<mesh::Wrap>(wrapV),
            isNearest};
}

nb::tuple metalOf(const Texture& map, const Positions& uvs, double metallic, double roughness) {
    bool* isMetal;
    double *found, factors[] = {metallic, roughness};
    nb::tuple result = nb::make_tuple(makeArray({uvs.shape(0)}, isMetal), makeArray({uvs.shape(0)}, found));
    const mesh::Picture<std::uint8_t> picture = pictureOf(map);
    for (std::size_t i = 0; i < uvs.shape(0); ++i) {
        const mesh::FaceMetal metal = mesh::metalOf(picture, uvs.data() + 6 * i, factors);
        isMetal[i] = metal.isMetal;
        found[i] = metal.roughness;
    }
    return result;
}

auto emissionOf(const Texture& map, const Positions& uvs, const Column<double>& areas, const Column<double>& linear) {
    if (areas.shape(0) < uvs.shape(0) || linear.shape(0) < 256) throw std::invalid_argument("a face has no area");
    double* found;
    auto result = makeArray({uvs.shape(0), 3}, found);
    const std::vector<mesh::Rgb> colours =
        mesh::emissionOf(pictureOf(map), uvs.data(), areas.data(), uvs.shape(0), linear.data());
    std::memcpy(found, colours.data(), colours.size() * sizeof colours[0]);
    return result;
}

/// Owners and weights of pieces, as arrays.
template <class Piece> std::pair<nb::object, nb::object> arraysOf(const std::vector<Piece>& pieces) {
    std::vector<std::int64_t> owners;
    std::vector<mesh::Corners> weights;
    for (const Piece& piece : pieces) {
        owners.push_back(piece.owner);
        weights.push_back(piece.weights);
    }
    return {arrayOf<std::int64_t>(owners, {owners.size()}), arrayOf<double>(weights, {weights.size(), 3, 3})};
}

nb::tuple emissionPieces(const Texture& map, const Column<double>& factor, const Rows<double>& vertices,
                         const Rows<std::int32_t>& faces, const Column<std::uint8_t>& shows, const Positions& uvs,
                         std::int64_t budget, const Column<double>& linear) {
    checkFaces(faces, vertices.shape(0));
    if (std::min(shows.shape(0), uvs.shape(0)) < faces.shape(0) || factor.shape(0) < 3 || linear.shape(0) < 256)
        throw std::invalid_argument("a face has no emission");
    const std::vector<mesh::Piece> pieces = released([&] {
        return mesh::emissionPieces(pictureOf(map), {factor.data()[0], factor.data()[1], factor.data()[2]},
                                    vectorOf<mesh::Vector>(vertices), vectorOf<mesh::Face>(faces), shows.data(),
                                    uvs.data(), budget, linear.data());
    });
    const auto [owners, weights] = arraysOf(pieces);
    return nb::make_tuple(owners, weights);
}

nb::tuple cutAlpha(
    const CornerRows<double>& corners, const Positions& uvs, const Rows<double>& alphas,
    const std::optional<Texture>& texture,
    const std::optional<nb::ndarray<const std::uint8_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>>& alpha,
    const Column<double>& linear, double factor, double cutoff, std::optional<double> paneFactor, double smallest,
    std::int64_t budget) {
    std::vector<mesh::CoveredFace> faces(corners.shape(0));
    if (std::min(uvs.shape(0), alphas.shape(0)) < faces.size() || linear.shape(0) < 256)
        throw std::invalid_argument("a face has no alpha");
    for (std::size_t i = 0; i < faces.size(); ++i) {
        std::memcpy(&faces[i].corners, corners.data() + 9 * i, sizeof faces[i].corners);
        std::memcpy(&faces[i].uvs, uvs.data() + 6 * i, sizeof faces[i].uvs);
        std::memcpy(&faces[i].alphas, alphas.data() + 3 * i, sizeof faces[i].alphas);
    }
    mesh::Picture<std::uint8_t> colours{nullptr, 0, 0, 3, {}, {}, false}, visible = colours;
    if (texture) colours = pictureOf(*texture);
    if (texture && alpha) {
        visible = colours;
        visible.pixels = alpha->data();
        visible.channels = 1;
        if (visible.height != static_cast<std::int64_t>(alpha->shape(0)) ||
            visible.width != static_cast<std::int64_t>(alpha->shape(1)))
            throw std::invalid_argument("alpha is not of the picture's size");
    }
    std::vector<std::uint8_t> filled;
    const mesh::AlphaCut cut = released([&] {
        mesh::Coverage coverage(colours, visible, linear.data(), factor, cutoff);
        if (alpha) filled = coverage.filled();
        return mesh::cutAlpha(coverage, faces, smallest, budget, paneFactor);
    });
    const auto [owners, weights] = arraysOf(cut.pieces);
    std::vector<double> panes;
    for (const mesh::Pane& pane : cut.panes)
        panes.insert(panes.end(), {pane.alpha, pane.colour[0], pane.colour[1], pane.colour[2]});
    const auto width = static_cast<std::size_t>(visible.width), height = static_cast<std::size_t>(visible.height);
    return nb::make_tuple(arrayOf<std::int8_t>(cut.kinds, {faces.size()}), owners, weights,
                          arrayOf<double>(panes, {cut.panes.size(), 4}), cut.isCoarse, cut.isBlended,
                          arrayOf<std::uint8_t>(filled, {height, width, 3}));
}

nb::tuple swatches(const Texture& texture, const Positions& uvs, const Column<double>& linear) {
    const std::size_t count = uvs.shape(0);
    if (linear.shape(0) < 256) throw std::invalid_argument("there are too few values");
    std::vector<std::uint8_t> isPlain(count);
    std::vector<mesh::Corners> colours(count);
    released([&] {
        const mesh::Swatches own(pictureOf(texture), linear.data());
        for (std::size_t i = 0; i < count; ++i)
            if (const auto found = own.colours(rowsOf<mesh::Triangle>(uvs)[i])) {
                isPlain[i] = 1;
                colours[i] = *found;
            }
    });
    return nb::make_tuple(arrayOf<bool>(isPlain, {count}), arrayOf<double>(colours, {count, 3, 3}));
}

nb::tuple baked(const Rows<double>& vertices, const Rows<std::int32_t>& faces, const CornerRows<double>& normals,
                const std::vector<std::tuple<Texture, double>>& maps, const Column<std::int32_t>& index,
                const Positions& uvs,
                const nb::ndarray<const double, nb::shape<-1, 3, 4>, nb::c_contig, nb::device::cpu>& tangents,
                std::int64_t budget) {
    checkFaces(faces, vertices.shape(0));
    const std::size_t count = faces.shape(0);
    if (count == 0 || std::min({normals.shape(0), index.shape(0), uvs.shape(0), tangents.shape(0)}) < count)
        throw std::invalid_argument("a face has no relief");
    const mesh::BakedMesh mesh = released([&] {
        std::vector<mesh::NormalMap> own;
        for (const auto& [texture, scale] : maps) own.emplace_back(pictureOf(texture), static_cast<float>(scale));
        std::vector<mesh::ReliefFace> relief(count);
        for (std::size_t i = 0; i < count; ++i) {
            relief[i].map = index.data()[i];
            if (relief[i].map >= static_cast<std::int32_t>(own.size()))
                throw std::invalid_argument("a face has a map that does not exist");
            std::memcpy(&relief[i].uvs, uvs.data() + 6 * i, sizeof relief[i].uvs);
            std::memcpy(&relief[i].tangents, tangents.data() + 12 * i, sizeof relief[i].tangents);
        }
        return mesh::NormalBaker(vectorOf<mesh::Vector>(vertices), vectorOf<mesh::Face>(faces),
                                 vectorOf<mesh::Corners>(normals), own, relief)
            .make(budget);
    });
    const std::size_t parts = mesh.pieces.size();
    std::vector<mesh::Face> corners;
    for (const mesh::Piece& piece : mesh.pieces) corners.push_back(piece.face);
    const auto [owners, weights] = arraysOf(mesh.pieces);
    return nb::make_tuple(arrayOf<double>(mesh.vertices, {mesh.vertices.size(), 3}),
                          arrayOf<std::int32_t>(corners, {parts, 3}), arrayOf<double>(mesh.normals, {parts, 3, 3}),
                          owners, weights, mesh.error);
}

nb::object atlas(const Positions& uvs, const Column<std::int32_t>& textures, const Rows<double>& factors,
                 const std::vector<Texture>& pictures, const Column<double>& linear, std::int64_t edge) {
    std::vector<mesh::Picture<std::uint8_t>> own;
    for (const Texture& each : pictures) own.push_back(pictureOf(each));
    std::vector<mesh::Paint> paints;
    for (std::size_t i = 0; i < textures.shape(0); ++i)
        paints.push_back({textures.data()[i], rowsOf<mesh::Vector>(factors)[i]});
    const auto made = released(
        [&] { return mesh::AtlasMaker(own, linear.data(), edge).make(vectorOf<mesh::Triangle>(uvs), paints); });
    if (!made) return nb::none();
    const auto side = static_cast<std::size_t>(edge);
    return nb::make_tuple(arrayOf<double>(made->colours, {side, side, 3}),
                          arrayOf<double>(made->uvs, {made->uvs.size(), 3, 2}), made->scale);
}

} // namespace

void bind_packer(nb::module_& module) {
    module.def("quantise", &quantise, "vertices"_a, "faces"_a, "vertex_bits"_a);
    nb::class_<Packing>(module, "Packing")
        .def(nb::init<const Rows<std::int32_t>&, const Rows<std::int32_t>&, const Column<std::int64_t>&,
                      const CornerRows<double>&, const Column<std::uint8_t>&, const Column<bool>&,
                      const std::optional<CornerRows<std::int64_t>>&, const Values&, const FieldTuples&>(),
             "vertices"_a, "faces"_a, "mesh_faces"_a, "normals"_a, "materials"_a, "is_clear"_a, "colours"_a.none(),
             "format"_a, "layouts"_a)
        .def("sections", &Packing::sections)
        .def("statistics", &Packing::statistics)
        .def("faces", &Packing::faces)
        .def("leaf_corners", &Packing::leafCorners)
        .def("records", &Packing::records);
    module.def(
        "surface_offset",
        [](int gridFraction, int weightBits, int mantissaBits, int distanceDigits, int largestTriangle) {
            return packer::surfaceOffset({gridFraction, weightBits, mantissaBits, distanceDigits}, largestTriangle);
        },
        "grid_fraction"_a, "weight_bits"_a, "mantissa_bits"_a, "distance_digits"_a, "largest_triangle"_a);
    module.def("merge_rows", &mergeRows, "rows"_a);
    module.def("clean", &clean, "vertices"_a, "faces"_a, "normals"_a.none(), "least_cosine"_a, "source_faces"_a);
    module.def("sampled", &sampled<std::uint8_t>, "pixels"_a, "uvs"_a, "wrap_u"_a, "wrap_v"_a, "is_nearest"_a,
               "values"_a.none());
    module.def("sampled", &sampled<float>, "pixels"_a, "uvs"_a, "wrap_u"_a, "wrap_v"_a, "is_nearest"_a,
               "values"_a.none());
    module.def("atlas", &atlas, "uvs"_a, "textures"_a, "factors"_a, "pictures"_a, "linear"_a, "edge"_a,
               "Colours, texture coordinates and scale of an atlas; None for more paints than tiles. `textures` and "
               "`factors` are each face's, -1 for none.");
    module.def("cut_alpha", &cutAlpha, "corners"_a, "uvs"_a, "alphas"_a, "texture"_a.none(), "alpha"_a.none(),
               "linear"_a, "factor"_a, "cutoff"_a, "pane_factor"_a.none(), "smallest"_a, "budget"_a,
               "Kinds of faces, owners and weights of pieces, panes, whether cuts are coarse, whether blending is not "
               "visible, and the filled picture.");
    module.def("swatches", &swatches, "texture"_a, "uvs"_a, "linear"_a,
               "Which faces show one colour, and the linear colours of their corners.");
    module.def("baked", &baked, "vertices"_a, "faces"_a, "normals"_a, "maps"_a, "index"_a, "uvs"_a, "tangents"_a,
               "budget"_a);
    module.def("metal_of", &metalOf, "map"_a, "uvs"_a, "metallic"_a, "roughness"_a);
    module.def("emission_of", &emissionOf, "map"_a, "uvs"_a, "areas"_a, "linear"_a);
    module.def("emission_pieces", &emissionPieces, "map"_a, "factor"_a, "vertices"_a, "faces"_a, "shows"_a, "uvs"_a,
               "budget"_a, "linear"_a,
               "Owners and weights of the pieces of faces, bisected where what they emit by a map varies.");
    module.def("merged_values", &mesh::mergedValues, "values"_a, "weights"_a, "kinds"_a, "count"_a);
}
