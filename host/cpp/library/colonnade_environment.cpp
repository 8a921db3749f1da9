#include "colonnade_environment.h"

#include <cstring>

#include "environment/fitted_depth.hpp"
#include "environment/light_cube.hpp"

using namespace colonnade::environment;

namespace {

const Vector* vectors(const double* values) { return reinterpret_cast<const Vector*>(values); }

template <class Values> void copy(const Values& values, void* out) {
    std::memcpy(out, values.data(), values.size() * sizeof values[0]);
}

} // namespace

void colonnade_environment_nearest(const std::uint8_t* missing, std::int32_t width, std::int32_t height,
                                   std::int32_t* nearest) {
    copy(nearestKnown(missing, width, height), nearest);
}

void colonnade_environment_depth(const double* depth, const std::int32_t* size, const std::int32_t* whole,
                                 const double* part, std::int32_t width, std::int32_t height, double* fitted) {
    copy(PhotoDepth(depth, size[0], size[1]).fitted({part[0], part[1], part[2], whole[0], whole[1]}, width, height),
         fitted);
}

double colonnade_environment_normals(const double* depth, const std::uint8_t* holes, std::int32_t width,
                                     std::int32_t height, const double* lens, double* normals) {
    DepthMap map(depth, holes, {lens[0], lens[1], lens[2], lens[3]}, width, height);
    const double noise = map.noise();
    copy(map.normals(noise).normals, normals);
    return noise;
}

void colonnade_environment_plane(const double* points, std::uint32_t count, double* plane) {
    copy(fittedPlane(vectors(points), count), plane);
}

void colonnade_environment_cube(const double* radiance, const double* rotation, std::uint32_t* words) {
    for (const Vector& texel : rotatedCube(vectors(radiance), fineFace, rotation)) *words++ = cubeWord(texel, false);
}

void colonnade_environment_radiance(const std::uint32_t* words, std::uint32_t count, double* radiance) {
    for (std::uint32_t i = 0; i < count; ++i) copy(radianceOf(words[i]), radiance + 3 * i);
}

double colonnade_environment_seen(const double* points, const double* normals, const double* colours,
                                  std::uint32_t count, const double* point, double* radiance) {
    SeenLight light = seenLight(vectors(points), vectors(normals), vectors(colours), count, *vectors(point));
    const double share = fillSeen(light);
    copy(light.radiance, radiance);
    return share;
}

std::int32_t colonnade_environment_parallax(const double* bounds, const double* point, double edge) {
    return parallaxOf(boxDistance(vectors(bounds)[0], vectors(bounds)[1], *vectors(point)), edge);
}
