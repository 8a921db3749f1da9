/// Normals of depth maps, light cubes and the filter of noise (cpp/environment) for Python.
#include <nanobind/stl/array.h>

#include <cstring>

#include "binding.hpp"
#include "environment/fitted_depth.hpp"
#include "environment/light_cube.hpp"
#include "environment/wavelet.hpp"

using namespace nanobind::literals;
using namespace colonnade;
using namespace colonnade::binding;

namespace {

template <class T> using Map = nb::ndarray<const T, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Rows = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Rotation = nb::ndarray<const double, nb::shape<3, 3>, nb::c_contig, nb::device::cpu>;

const environment::Vector* vectorsOf(const Rows& rows) {
    return reinterpret_cast<const environment::Vector*>(rows.data());
}

template <class T, class Values> nb::object arrayOf(const Values& values, std::initializer_list<std::size_t> shape) {
    T* data;
    auto result = makeArray<T>(shape, data);
    std::memcpy(data, values.data(), values.size() * sizeof values[0]);
    return nb::cast(result);
}

environment::DepthMap mapOf(const Map<double>& depth, const Map<bool>& holes, const std::array<double, 4>& lens) {
    if (holes.shape(0) != depth.shape(0) || holes.shape(1) != depth.shape(1) || depth.size() == 0)
        throw std::invalid_argument("depth and holes have different sizes, or none");
    return {depth.data(),
            reinterpret_cast<const std::uint8_t*>(holes.data()),
            {lens[0], lens[1], lens[2], lens[3]},
            static_cast<int>(depth.shape(1)),
            static_cast<int>(depth.shape(0))};
}

nb::tuple depthNormals(const Map<double>& depth, const Map<bool>& holes, const std::array<double, 4>& lens,
                       double noise, int maxPlanes) {
    environment::DepthMap map = mapOf(depth, holes, lens);
    const environment::DepthNormals found = released([&] { return map.normals(noise, maxPlanes); });
    return nb::make_tuple(arrayOf<double>(found.normals, {depth.shape(0), depth.shape(1), 3}), found.planes,
                          found.onPlanes);
}

nb::object fittedDepth(const Map<double>& depth, const std::array<int, 2>& photo, const std::array<double, 3>& part,
                       int width, int height) {
    if (depth.size() == 0 || photo[0] < 1 || photo[1] < 1 || width < 1 || height < 1)
        throw std::invalid_argument("depth, photo and maps have pixels");
    const environment::PhotoDepth whole(depth.data(), static_cast<int>(depth.shape(1)),
                                        static_cast<int>(depth.shape(0)));
    const auto fitted =
        released([&] { return whole.fitted({part[0], part[1], part[2], photo[0], photo[1]}, width, height); });
    return arrayOf<double>(fitted, {static_cast<std::size_t>(height), static_cast<std::size_t>(width)});
}

nb::object nearestKnown(const Map<bool>& missing) {
    const auto* pixels = reinterpret_cast<const std::uint8_t*>(missing.data());
    return arrayOf<std::int32_t>(
        released([&] { return environment::nearestKnown(pixels, missing.shape(1), missing.shape(0)); }),
        {missing.size()});
}

nb::object rotatedCube(const Rows& radiance, int size, const Rotation& rotation) {
    if (radiance.shape(0) != environment::texelCount(size)) throw std::invalid_argument("a cube has six square faces");
    return arrayOf<double>(environment::rotatedCube(vectorsOf(radiance), size, rotation.data()),
                           {6, environment::cubeFace, environment::cubeFace, 3});
}

nb::object cubeWords(const Rows& radiance,
                     const nb::ndarray<const bool, nb::ndim<1>, nb::c_contig, nb::device::cpu>& lights) {
    if (lights.shape(0) != radiance.shape(0)) throw std::invalid_argument("the numbers of texels differ");
    std::uint32_t* words;
    auto result = makeArray<std::uint32_t>({radiance.shape(0)}, words);
    for (std::size_t i = 0; i < radiance.shape(0); ++i)
        words[i] = environment::cubeWord(vectorsOf(radiance)[i], lights.data()[i]);
    return nb::cast(result);
}

nb::tuple seenLight(const Rows& points, const Rows& normals, const Rows& colours, const environment::Vector& point) {
    const std::size_t count = points.shape(0), texels = environment::texelCount(environment::fineFace);
    if (normals.shape(0) != count || colours.shape(0) != count)
        throw std::invalid_argument("the numbers of pixels differ");
    const environment::SeenLight light = released([&] {
        return environment::seenLight(vectorsOf(points), vectorsOf(normals), vectorsOf(colours), count, point);
    });
    return nb::make_tuple(arrayOf<double>(light.radiance, {texels, 3}), arrayOf<std::uint32_t>(light.pixels, {texels}),
                          arrayOf<bool>(light.isBright, {texels}), arrayOf<double>(light.distance, {texels}));
}

using Pixels3 = nb::ndarray<const double, nb::shape<-1, -1, 3>, nb::c_contig, nb::device::cpu>;

nb::tuple wavelet(const std::array<Pixels3, 3>& surface, const Map<bool>& mask, double plane, const Pixels3& colour,
                  const std::array<Map<double>, 3>& light, int step) {
    const std::size_t height = mask.shape(0), width = mask.shape(1);
    const auto vectors = [&](const Pixels3& pixels) {
        if (pixels.shape(0) != height || pixels.shape(1) != width)
            throw std::invalid_argument("the sizes of pictures differ");
        return reinterpret_cast<const environment::Vector*>(pixels.data());
    };
    for (const auto& one : light)
        if (one.shape(0) != height || one.shape(1) != width)
            throw std::invalid_argument("the sizes of pictures differ");
    const environment::Guide guide{vectors(surface[0]),
                                   vectors(surface[1]),
                                   vectors(surface[2]),
                                   reinterpret_cast<const std::uint8_t*>(mask.data()),
                                   static_cast<int>(width),
                                   static_cast<int>(height),
                                   plane};
    const environment::NoisyPixels noisy{vectors(colour), light[0].data(), light[1].data(), light[2].data()};
    const environment::FilteredPixels found = released([&] { return environment::wavelet(guide, noisy, step); });
    return nb::make_tuple(arrayOf<double>(found.colour, {height, width, 3}),
                          arrayOf<double>(found.variance, {height, width}));
}

} // namespace

void bind_surroundings(nb::module_& module) {
    module.def(
        "depth_noise",
        [](const Map<double>& depth, const Map<bool>& holes) { return mapOf(depth, holes, {1, 1, 0, 0}).noise(); },
        "depth"_a, "holes"_a);
    module.def("depth_normals", &depthNormals, "depth"_a, "holes"_a, "lens"_a, "noise"_a, "max_planes"_a);
    module.def("fitted_depth", &fittedDepth, "depth"_a, "photo"_a, "part"_a, "width"_a, "height"_a);
    module.def("nearest_known", &nearestKnown, "missing"_a);
    module.def("rotated_cube", &rotatedCube, "radiance"_a, "size"_a, "rotation"_a);
    module.def("cube_words", &cubeWords, "radiance"_a, "lights"_a);
    module.def("seen_light", &seenLight, "points"_a, "normals"_a, "colours"_a, "point"_a);
    module.def("wavelet", &wavelet, "surface"_a, "mask"_a, "plane"_a, "colour"_a, "light"_a, "step"_a);
    module.def("box_distance", &environment::boxDistance, "low"_a, "high"_a, "point"_a);
}
