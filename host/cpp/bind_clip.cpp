/// Clips (cpp/mesh/clip.hpp), their numbers on a grid and their files (cpp/packer) for Python.
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/vector.h>

#include <cstring>
#include <optional>

#include "binding.hpp"
#include "mesh/clip_faces.hpp"
#include "packer/clip_file.hpp"

using namespace nanobind::literals;
using namespace colonnade;
using namespace colonnade::binding;

namespace {

template <class T> using Array = nb::ndarray<const T, nb::c_contig, nb::device::cpu>;
using Whole = Array<std::int64_t>;
using Numbers64 = Array<double>;
/// Node, path, interpolation, times and values of a track.
using TrackTuple = std::tuple<std::int64_t, std::int32_t, std::int32_t, Numbers64, Numbers64>;

/// The rows of an array, each of as many numbers as `Row` has.
template <class Row, class T> std::vector<Row> rowsOf(const Array<T>& array) {
    if (array.size() * sizeof(T) % sizeof(Row) != 0) throw std::invalid_argument("an array has rows of another length");
    std::vector<Row> rows(array.size() * sizeof(T) / sizeof(Row));
    std::memcpy(rows.data(), array.data(), array.size() * sizeof(T));
    return rows;
}

template <class T, class Rows> nb::object arrayOf(const Rows& rows, std::initializer_list<std::size_t> shape) {
    T* data;
    auto result = makeArray<T>(shape, data);
    std::memcpy(data, rows.data(), rows.size() * sizeof rows[0]);
    return nb::cast(result);
}

template <class Index> void checkIndices(const std::vector<Index>& indices, std::size_t end) {
    for (const Index index : indices)
        if (index < 0 || static_cast<std::size_t>(index) >= end)
            throw std::invalid_argument("a clip names what does not exist");
}

class Clip {
public:
    Clip(double duration, const Whole& parents, const Whole& order, const Numbers64& matrices,
         const Numbers64& translations, const Numbers64& rotations, const Numbers64& scales,
         const std::vector<TrackTuple>& tracks, const Whole& joints, const Numbers64& inverses,
         const Numbers64& positions, const Whole& bones, const Numbers64& weights,
         const std::tuple<Whole, Whole, Numbers64, Whole, Whole, Numbers64, Numbers64>& morphs) {
        clip_.duration = duration;
        clip_.nodes = {rowsOf<std::int64_t>(parents),       rowsOf<std::int64_t>(order),
                       rowsOf<mesh::Matrix>(matrices),      rowsOf<mesh::Vector>(translations),
                       rowsOf<mesh::Quaternion>(rotations), rowsOf<mesh::Vector>(scales)};
        for (const auto& [node, path, interpolation, times, values] : tracks)
            clip_.tracks.push_back({node, static_cast<mesh::Path>(path),
                                    static_cast<mesh::Interpolation>(interpolation), rowsOf<double>(times),
                                    rowsOf<double>(values)});
        clip_.joints = rowsOf<std::int64_t>(joints);
        clip_.inverses = rowsOf<mesh::Matrix>(inverses);
        clip_.positions = rowsOf<mesh::Vector>(positions);
        clip_.bones = rowsOf<std::array<std::int64_t, mesh::influences>>(bones);
        clip_.shares = rowsOf<std::array<double, mesh::influences>>(weights);
        const auto& [nodes, slots, rest, targets, vertices, added, normals] = morphs;
        clip_.morphs = {rowsOf<std::int64_t>(nodes),   rowsOf<std::int64_t>(slots),    rowsOf<double>(rest),
                        rowsOf<std::int64_t>(targets), rowsOf<std::int64_t>(vertices), rowsOf<mesh::Vector>(added),
                        rowsOf<mesh::Vector>(normals)};
        checkIndices(clip_.nodes.order, clip_.nodes.matrices.size());
        checkIndices(clip_.joints, clip_.nodes.matrices.size());
        for (const auto& own : clip_.bones)
            checkIndices(std::vector<std::int64_t>(own.begin(), own.end()), clip_.joints.size());
        checkIndices(clip_.morphs.targets, clip_.morphs.weights.size());
        checkIndices(clip_.morphs.vertices, clip_.positions.size());
    }

    nb::tuple rest() const { return poseOf(clip_.rest()); }
    nb::tuple pose(double time, bool before) const { return poseOf(clip_.pose(time, before)); }

    nb::object vertices(const Numbers64& matrices, const Numbers64& weights) const {
        const std::vector<mesh::BoneMatrix> bones = rowsOf<mesh::BoneMatrix>(matrices);
        const mesh::Values shares = rowsOf<double>(weights);
        if (bones.size() != clip_.joints.size() || shares.size() != clip_.morphs.weights.size())
            throw std::invalid_argument("a pose of another clip");
        return arrayOf<double>(clip_.vertices(bones, shares), {clip_.positions.size(), 3});
    }

    nb::tuple restSurface(const Array<std::int32_t>& faces, const std::optional<Numbers64>& normals) const {
        const std::vector<mesh::Face> rows = facesOf(faces, clip_.positions.size());
        std::vector<mesh::Corners> rotated = normals ? rowsOf<mesh::Corners>(*normals) : std::vector<mesh::Corners>();
        if (normals && rotated.size() != rows.size()) throw std::invalid_argument("a face has no normals");
        const mesh::RestSurface found = mesh::restSurface(clip_, rows, rotated);
        const std::vector<std::uint8_t> isMirrored(found.isMirrored.begin(), found.isMirrored.end());
        return nb::make_tuple(found.isFinite, arrayOf<double>(found.vertices, {found.vertices.size(), 3}),
                              normals ? arrayOf<double>(rotated, {rotated.size(), 3, 3}) : nb::none(),
                              arrayOf<std::uint8_t>(isMirrored, {isMirrored.size()}));
    }

    /// Vertices and changes with vertices at the corners of parts of faces, and these.
    nb::tuple parts(const Array<std::int32_t>& faces, const Whole& owners, const Numbers64& weights) const {
        const std::vector<mesh::Face> rows = facesOf(faces, clip_.positions.size());
        const std::vector<std::int64_t> own = rowsOf<std::int64_t>(owners);
        const std::vector<mesh::Corners> points = rowsOf<mesh::Corners>(weights);
        checkIndices(own, rows.size());
        if (own.size() != points.size()) throw std::invalid_argument("a part of a face has no weights");
        mesh::Clip clip = clip_;
        mesh::ClipPoints added(clip, own.size());
        std::vector<mesh::Face> corners;
        for (std::size_t i = 0; i < own.size(); ++i)
            corners.push_back(added.part(rows[static_cast<std::size_t>(own[i])], points[i]));
        const mesh::Morphs& morphs = clip.morphs;
        const std::size_t count = clip.positions.size(), changes = morphs.targets.size();
        return nb::make_tuple(
            arrayOf<double>(clip.positions, {count, 3}), arrayOf<std::int64_t>(clip.bones, {count, mesh::influences}),
            arrayOf<double>(clip.shares, {count, mesh::influences}), arrayOf<std::int64_t>(morphs.targets, {changes}),
            arrayOf<std::int64_t>(morphs.vertices, {changes}), arrayOf<double>(morphs.positions, {changes, 3}),
            arrayOf<double>(morphs.normals, {changes, 3}), arrayOf<std::int32_t>(corners, {corners.size(), 3}));
    }

    /// Times, matrices and weights of keys within a tolerance.
    nb::tuple keys(double tolerance) const {
        return tupleOf(released([&] { return mesh::KeyChooser(clip_, tolerance).make(); }));
    }

    /// Those within the clip's own tolerance, and the box of all poses.
    nb::tuple bake() {
        const mesh::BakedClip& baked = bakedClip();
        return nb::make_tuple(tupleOf(baked.keys), arrayOf<double>(baked.box.low, {3}),
                              arrayOf<double>(baked.box.high, {3}));
    }

    nb::dict grid(const Numbers64& vertices, const Array<std::int32_t>& faces, const Numbers64& normals,
                  const Array<std::int32_t>& clipCorners, int vertexBits) {
        const std::vector<mesh::Vector> points = rowsOf<mesh::Vector>(vertices);
        const std::vector<mesh::Face> rows = facesOf(faces, points.size()),
                                      corners = facesOf(clipCorners, clip_.positions.size());
        const std::vector<mesh::Corners> own = rowsOf<mesh::Corners>(normals);
        if (rows.size() != corners.size() || rows.size() != own.size())
            throw std::invalid_argument("a face has no corners of the clip, or no normals");
        const mesh::BakedClip& baked = bakedClip();
        const packer::GridClip made = released(
            [&] { return packer::GridClipMaker({clip_, points, rows, own, corners}, baked, vertexBits).make(); });
        nb::dict result;
        result["error"] = made.error;
        if (!made.error.empty()) return result;
        std::vector<std::int64_t> poses;
        for (const auto& pose : made.poses) poses.insert(poses.end(), pose.begin(), pose.end());
        result["scale"] = made.scale;
        result["offset"] = nb::make_tuple(made.offset[0], made.offset[1], made.offset[2]);
        result["low"] = nb::make_tuple(made.low[0], made.low[1], made.low[2]);
        result["high"] = nb::make_tuple(made.high[0], made.high[1], made.high[2]);
        result["corners"] = arrayOf<std::int32_t>(made.corners, {made.corners.size(), 3});
        result["vertices"] = arrayOf<std::int64_t>(made.vertices, {made.vertices.size(), 13});
        result["changes"] = arrayOf<std::int64_t>(made.changes, {made.changes.size(), 8});
        result["times"] = arrayOf<std::int64_t>(made.times, {made.times.size()});
        result["poses"] = arrayOf<std::int64_t>(poses, {made.poses.size(), made.rest.size()});
        result["rest"] = arrayOf<std::int64_t>(made.rest, {made.rest.size()});
        result["bones"] = made.bones;
        result["targets"] = made.targets;
        result["linear_shift"] = made.linearShift;
        result["shift"] = made.shift;
        return result;
    }

private:
    nb::tuple tupleOf(const std::vector<mesh::ClipKey>& keys) const {
        double *times, *matrices, *weights;
        auto result = nb::make_tuple(makeArray({keys.size()}, times),
                                     makeArray({keys.size(), clip_.joints.size(), 3, 4}, matrices),
                                     makeArray({keys.size(), clip_.morphs.weights.size()}, weights));
        for (const mesh::ClipKey& key : keys) {
            *times++ = key.time;
            for (const mesh::BoneMatrix& bone : key.pose.matrices)
                matrices = std::copy(bone.begin(), bone.end(), matrices);
            weights = std::copy(key.pose.weights.begin(), key.pose.weights.end(), weights);
        }
        return result;
    }

    nb::tuple poseOf(const mesh::ClipPose& pose) const {
        return nb::make_tuple(arrayOf<double>(pose.matrices, {pose.matrices.size(), 3, 4}),
                              arrayOf<double>(pose.weights, {pose.weights.size()}));
    }

    static std::vector<mesh::Face> facesOf(const Array<std::int32_t>& faces, std::size_t vertices) {
        std::vector<mesh::Face> rows = rowsOf<mesh::Face>(faces);
        for (const mesh::Face& face : rows) checkIndices(std::vector<std::int32_t>(face.begin(), face.end()), vertices);
        return rows;
    }

    const mesh::BakedClip& bakedClip() {
        if (!baked_) baked_ = released([&] { return mesh::BakedClip::of(clip_); });
        return *baked_;
    }

    mesh::Clip clip_;
    std::optional<mesh::BakedClip> baked_;
};

nb::bytes clipFile(const Whole& vertices, const Whole& changes, const Whole& times, const Whole& poses,
                   const std::array<std::int64_t, 4>& numbers, const std::array<std::int64_t, 7>& tree,
                   const Whole& leaves, const FieldTuples& layouts, const std::array<std::uint32_t, 8>& hash,
                   bool isOrdered) {
    packer::GridClip clip;
    clip.vertices = rowsOf<std::array<std::int64_t, 13>>(vertices);
    clip.changes = rowsOf<std::array<std::int64_t, 8>>(changes);
    clip.times = rowsOf<std::int64_t>(times);
    for (std::size_t key = 0, words = poses.size() / std::max<std::size_t>(clip.times.size(), 1);
         key < clip.times.size(); ++key)
        clip.poses.emplace_back(poses.data() + key * words, poses.data() + (key + 1) * words);
    clip.bones = static_cast<std::size_t>(numbers[0]);
    clip.targets = static_cast<std::size_t>(numbers[1]);
    clip.linearShift = static_cast<int>(numbers[2]);
    clip.shift = static_cast<int>(numbers[3]);
    packer::ClipTree of{static_cast<int>(tree[0]),         static_cast<int>(tree[1]),
                        static_cast<int>(tree[2]),         static_cast<int>(tree[3]),
                        static_cast<int>(tree[4]),         static_cast<std::size_t>(tree[5]),
                        static_cast<std::size_t>(tree[6]), rowsOf<packer::ClipLeaf>(leaves)};
    if (clip.times.empty()) throw std::invalid_argument("a clip has no keys");
    for (const packer::ClipLeaf& leaf : of.leaves)
        for (const std::int64_t vertex : leaf)
            if (vertex >= static_cast<std::int64_t>(clip.vertices.size()))
                throw std::invalid_argument("a leaf names a vertex that does not exist");
    if (isOrdered) packer::orderByUse(clip, of.leaves);
    const std::vector<std::uint8_t> bytes = packer::clipFile(clip, of, layoutsOf(layouts), hash);
    return nb::bytes(reinterpret_cast<const char*>(bytes.data()), bytes.size());
}

} // namespace

void bind_clip(nb::module_& module) {
    nb::class_<Clip>(module, "Clip")
        .def(nb::init<double, const Whole&, const Whole&, const Numbers64&, const Numbers64&, const Numbers64&,
                      const Numbers64&, const std::vector<TrackTuple>&, const Whole&, const Numbers64&,
                      const Numbers64&, const Whole&, const Numbers64&,
                      const std::tuple<Whole, Whole, Numbers64, Whole, Whole, Numbers64, Numbers64>&>(),
             "duration"_a, "parents"_a, "order"_a, "matrices"_a, "translations"_a, "rotations"_a, "scales"_a,
             "tracks"_a, "joints"_a, "inverses"_a, "positions"_a, "bones"_a, "weights"_a, "morphs"_a)
        .def("rest", &Clip::rest)
        .def("pose", &Clip::pose, "time"_a, "before"_a)
        .def("vertices", &Clip::vertices, "matrices"_a, "weights"_a)
        .def("rest_surface", &Clip::restSurface, "faces"_a, "normals"_a.none())
        .def("parts", &Clip::parts, "faces"_a, "owners"_a, "weights"_a)
        .def("keys", &Clip::keys, "tolerance"_a)
        .def("bake", &Clip::bake)
        .def("grid", &Clip::grid, "vertices"_a, "faces"_a, "normals"_a, "clip_corners"_a, "vertex_bits"_a);
    module.def("clip_file", &clipFile, "vertices"_a, "changes"_a, "times"_a, "poses"_a, "numbers"_a, "tree"_a,
               "leaves"_a, "layouts"_a, "format_hash"_a, "is_ordered"_a);
    module.def(
        "field_lows",
        [](const FieldTuples& layouts) {
            const std::vector<std::uint8_t> lows = packer::fieldLows(layoutsOf(layouts));
            return std::vector<int>(lows.begin(), lows.end());
        },
        "layouts"_a);
    module.def(
        "directions",
        [](const Array<std::int16_t>& codes) {
            std::vector<mesh::Vector> found;
            for (const auto& code : rowsOf<std::array<std::int16_t, 2>>(codes))
                found.push_back(packer::directionOf(code[0], code[1]));
            return arrayOf<double>(found, {found.size(), 3});
        },
        "codes"_a);
    module.attr("CLIP_TOLERANCE") = mesh::clipTolerance;
}
