// colonnade._core.LiveRoom and LiveColours: the live encoder (cpp/live) for Python.
#include <memory>
#include <stdexcept>

#include "binding.hpp"
#include "live/live.h"
#include "live/vector_map.hpp"

using namespace nanobind::literals;
using namespace colonnade::binding;

namespace {

using Codes = nb::ndarray<const std::uint8_t, nb::shape<-1, -1, 3>, nb::c_contig, nb::device::cpu>;
using Pose = nb::ndarray<const double, nb::shape<3, 4>, nb::c_contig, nb::device::cpu>;
using Lens = std::tuple<double, double, double, double>;
using Depth = nb::ndarray<const std::uint32_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

template <class T> T* array(nb::dict& into, const char* name, std::size_t size) {
    T* data;
    into[name] = makeArray({size}, data);
    return data;
}

class LiveRoom {
public:
    explicit LiveRoom(const Values& sizes) {
        const auto size = [&](const char* name) { return static_cast<std::int32_t>(sizes.at(name)); };
        sizes_ = {size("width"),  size("height"),           size("palette_size"),   size("heap_words"),
                  size("planes"), size("plane_heap_words"), size("bounding_planes")};
        live_.reset(colonnade_live_create(&sizes_));
        if (!live_) throw std::invalid_argument("a size of the live encoder is out of range");
    }

    nb::dict encode(const Codes& albedo, const Codes& normals, const Depth& depth, const Lens& lens,
                    const Pose& toWorld, double tolerance) {
        const std::size_t columns = (sizes_.width + 15) / 16, rows = (sizes_.height + 15) / 16, tiles = columns * rows;
        for (const auto* map : {&albedo, &normals})
            if (map->shape(0) != 16 * rows || map->shape(1) != 16 * columns)
                throw std::invalid_argument("the maps are not whole tiles of the encoder's size");
        if (depth.shape(0) != 16 * rows || depth.shape(1) != 16 * columns)
            throw std::invalid_argument("the depth is not whole tiles of the encoder's size");
        colonnade_live_frame frame{albedo.data(),     normals.data(),    depth.data(),      std::get<0>(lens),
                                   std::get<1>(lens), std::get<2>(lens), std::get<3>(lens), {},
                                   tolerance};
        std::copy(toWorld.data(), toWorld.data() + 12, frame.to_world);
        nb::dict result, ofAlbedo, ofNormals, ofPlanes;
        const auto vectors = [&](nb::dict& into) {
            return colonnade_live_vectors{array<std::uint32_t>(into, "descriptors", tiles),
                                          array<std::uint64_t>(into, "palette", sizes_.palette_size),
                                          array<std::uint16_t>(into, "heap", sizes_.heap_words)};
        };
        colonnade_live_maps maps{};
        maps.albedo = vectors(ofAlbedo);
        maps.normals = vectors(ofNormals);
        maps.plane_descriptors = array<std::uint16_t>(ofPlanes, "descriptors", tiles);
        maps.planes = array<std::uint64_t>(ofPlanes, "planes", sizes_.planes);
        maps.plane_heap = array<std::uint16_t>(ofPlanes, "heap", sizes_.plane_heap_words);
        ofPlanes["bounding"] = makeArray({static_cast<std::size_t>(sizes_.bounding_planes), 3}, maps.bounding);
        maps.tile_error = array<float>(result, "tile_error", tiles);
        maps.tile_nearest = array<float>(result, "tile_nearest", tiles);
        maps.tile_furthest = array<float>(result, "tile_furthest", tiles);
        {
            nb::gil_scoped_release release;
            colonnade_live_encode(live_.get(), &frame, &maps);
        }
        result["albedo"] = ofAlbedo;
        result["normals"] = ofNormals;
        result["planes"] = ofPlanes;
        result["depth_unit"] = maps.depth_unit;
        return result;
    }

private:
    struct Destroy {
        void operator()(colonnade_live* live) const { colonnade_live_destroy(live); }
    };
    colonnade_live_sizes sizes_;
    std::unique_ptr<colonnade_live, Destroy> live_;
};

class LiveColours {
public:
    LiveColours(int columns, int rows, int tileSize, int paletteSize, int heapWords)
        : sizes_(checked({columns, rows, tileSize, paletteSize, heapWords})), map_(sizes_) {}

    nb::dict encode(const Codes& codes) {
        if (codes.shape(0) != static_cast<std::size_t>(sizes_.rows) * sizes_.tileSize ||
            codes.shape(1) != static_cast<std::size_t>(sizes_.columns) * sizes_.tileSize)
            throw std::invalid_argument("the map is not whole tiles of the encoder's size");
        nb::dict result;
        auto* descriptors = array<std::uint32_t>(result, "descriptors", sizes_.tiles());
        auto* palette = array<std::uint64_t>(result, "palette", sizes_.paletteSize);
        auto* heap = array<std::uint16_t>(result, "heap", sizes_.heapWords);
        nb::gil_scoped_release release;
        map_.encode(codes.data(), descriptors, palette, heap);
        return result;
    }

private:
    static colonnade::live::VectorSizes checked(const colonnade::live::VectorSizes& s) {
        const bool isTile = s.tileSize == 8 || s.tileSize == 16 || s.tileSize == 32;
        if (s.columns < 1 || s.rows < 1 || s.columns > 512 || s.rows > 512 || !isTile || s.paletteSize < 4 ||
            s.paletteSize > 256 || s.heapWords < 0 || s.heapWords > 8192)
            throw std::invalid_argument("a size of the live encoder is out of range");
        return s;
    }

    colonnade::live::VectorSizes sizes_;
    colonnade::live::VectorMap<colonnade::live::ColourFields> map_;
};

} // namespace

void bind_live(nb::module_& module) {
    nb::class_<LiveRoom>(module, "LiveRoom", "Encodes a room's maps from frame to frame.")
        .def(nb::init<const Values&>(), "sizes"_a,
             "width, height, palette_size, heap_words, planes, plane_heap_words, bounding_planes; tiles of 16 pixels.")
        .def("encode", &LiveRoom::encode, "albedo"_a, "normals"_a, "depth"_a, "lens"_a, "to_world"_a, "tolerance"_a,
             "Encodes a frame of whole tiles: uint8 [h, w, 3] sRGB, uint8 [h, w, 3] camera space, uint32 [h, w] steps "
             "of 2^-16 m; (fx, fy, cx, cy); float64 [3, 4]; metres. "
             "Returns the memories of albedo, normals and planes by name, depth_unit, and tile_error, tile_nearest and "
             "tile_furthest.");
    nb::class_<LiveColours>(module, "LiveColours", "Encodes a two-level map of colours from frame to frame.")
        .def(nb::init<int, int, int, int, int>(), "columns"_a, "rows"_a, "tile_size"_a, "palette_size"_a,
             "heap_words"_a)
        .def("encode", &LiveColours::encode, "codes"_a,
             "Encodes uint8 [h, w, 3], sRGB, whole tiles. Returns descriptors, palette and heap.");
}
