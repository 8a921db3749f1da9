/// The light cube of an object (docs/gather.md): radiance by direction, 6 faces of n × n texels. Face 2 a + s has
/// directions whose largest component is a, with sign s, 1 for a negative one. Rows part the slope of the next axis,
/// columns of the one after it, from -1 to 1.
#pragma once

#include <numeric>

#include "depth_normals.hpp"

namespace colonnade::environment {

/// Texels along the edge of a face: of the device's cube, and while light is collected; directions averaged along one's
/// edge.
constexpr int cubeFace = 16, fineFace = 32, subsamples = 4;
/// Pixels of a texel that are farther than its nearest one by this factor are behind it.
constexpr double behind = 1.1;
/// The value 1.0 in the device's cube, its largest mantissa and exponent.
constexpr int cubeOne = 4096, cubeMantissa = 127, cubeExponent = 9;

inline std::size_t texelCount(int size) { return std::size_t{6} * size * size; }

/// A direction, and its weight by solid angle.
struct Texel {
    Vector direction;
    double weight;
};

/// The middle of a texel of a cube with `size` texels along the edge of a face.
inline Texel texelAt(int face, int row, int column, int size) {
    const auto slope = [size](int index) { return (index + 0.5) * (2.0 / size) - 1; };
    const double down = slope(row), across = slope(column), squares = 1 + down * down + across * across,
                 length = std::sqrt(squares);
    Texel texel{{}, 1 / (squares * length)};
    texel.direction[face / 2] = (1 - 2 * (face % 2)) / length;
    texel.direction[(face / 2 + 1) % 3] = down / length;
    texel.direction[(face / 2 + 2) % 3] = across / length;
    return texel;
}

inline Texel texelAt(std::size_t index, int size) {
    const int face = size * size, within = static_cast<int>(index) % face;
    return texelAt(static_cast<int>(index) / face, within / size, within % size, size);
}

/// The texel that a direction of any length meets.
inline std::size_t texelOf(const Vector& direction, int size) {
    int axis = 0;
    for (int other = 1; other < 3; ++other)
        if (std::fabs(direction[other]) > std::fabs(direction[axis])) axis = other;
    const double length = std::fabs(direction[axis]);
    std::size_t index = 2 * axis + (direction[axis] < 0);
    for (int step = 1; step < 3; ++step) {
        const double texel = std::floor((direction[(axis + step) % 3] / length + 1) * (size / 2.0));
        index = index * size + static_cast<std::size_t>(std::min(std::max(texel, 0.0), size - 1.0));
    }
    return index;
}

/// The device's cube of another space: a direction d of it is `rotation` · d of this one, row by row. A texel has the
/// mean over its solid angle.
inline std::vector<Vector> rotatedCube(const Vector* radiance, int size, const double* rotation) {
    std::vector<Vector> texels(texelCount(cubeFace));
    for (std::size_t i = 0; i < texels.size(); ++i) {
        const int column = static_cast<int>(i) % cubeFace, row = static_cast<int>(i) / cubeFace % cubeFace,
                  face = static_cast<int>(i) / (cubeFace * cubeFace);
        double total = 0;
        for (int down = 0; down < subsamples; ++down) {
            double line = 0;
            for (int across = 0; across < subsamples; ++across) {
                const Texel sub =
                    texelAt(face, subsamples * row + down, subsamples * column + across, subsamples * cubeFace);
                Vector rotated;
                for (int axis = 0; axis < 3; ++axis)
                    rotated[axis] =
                        dot({rotation[3 * axis], rotation[3 * axis + 1], rotation[3 * axis + 2]}, sub.direction);
                const Vector& light = radiance[texelOf(rotated, size)];
                for (int channel = 0; channel < 3; ++channel) texels[i][channel] += light[channel] * sub.weight;
                line += sub.weight;
            }
            total += line;
        }
        for (double& channel : texels[i]) channel /= total;
    }
    return texels;
}

/// The word of the device's memory: from the highest field, a light, the exponent, and the mantissas of red, green and
/// blue.
inline std::uint32_t cubeWord(const Vector& radiance, bool isLight) {
    const double largest = std::max({radiance[0], radiance[1], radiance[2]}) * cubeOne;
    int exponent = 0;
    while (exponent < cubeExponent && std::nearbyint(std::ldexp(largest, -exponent)) > cubeMantissa) ++exponent;
    std::uint32_t word = exponent | isLight << 4;
    for (const double channel : radiance)
        word = word << 7 | static_cast<std::uint32_t>(std::clamp<double>(
                               std::nearbyint(std::ldexp(channel * cubeOne, -exponent)), 0, cubeMantissa));
    return word;
}

/// The radiance of such a word, without a light.
inline Vector radianceOf(std::uint32_t word) {
    Vector radiance;
    for (int channel = 0; channel < 3; ++channel)
        radiance[channel] =
            static_cast<double>((word >> (14 - 7 * channel) & cubeMantissa) << (word >> 21 & 15)) / cubeOne;
    return radiance;
}

/// What surfaces send to a point, by the texels of a cube with `fineFace` texels along an edge.
struct SeenLight {
    std::vector<Vector> radiance;        ///< linear; 0 where nothing is seen
    std::vector<std::uint32_t> pixels;   ///< their number
    std::vector<std::uint8_t> isBright;  ///< a pixel is as bright as a photo can be
    std::vector<double> distance;        ///< of the nearest surface, metres; infinite where nothing is seen
};

/// `points`, `normals` and linear `colours` of pixels; those count that face the point, and are not behind others.
inline SeenLight seenLight(const Vector* points, const Vector* normals, const Vector* colours, std::size_t count,
                           const Vector& point) {
    const std::size_t texels = texelCount(fineFace);
    SeenLight light{std::vector<Vector>(texels), std::vector<std::uint32_t>(texels), std::vector<std::uint8_t>(texels),
                    std::vector<double>(texels, std::numeric_limits<double>::infinity())};
    struct Found {
        std::size_t pixel, texel;
        double distance;
    };
    std::vector<Found> found;
    for (std::size_t i = 0; i < count; ++i) {
        const Vector way{points[i][0] - point[0], points[i][1] - point[1], points[i][2] - point[2]};
        if (!(dot(normals[i], way) < 0)) continue;
        found.push_back({i, texelOf(way, fineFace), std::sqrt(dot(way, way))});
        double& nearest = light.distance[found.back().texel];
        nearest = std::min(nearest, found.back().distance);
    }
    for (const auto& [pixel, texel, distance] : found) {
        if (distance > behind * light.distance[texel]) continue;
        ++light.pixels[texel];
        for (int channel = 0; channel < 3; ++channel) {
            light.radiance[texel][channel] += colours[pixel][channel];
            light.isBright[texel] |= colours[pixel][channel] >= 1.0;
        }
    }
    for (std::size_t i = 0; i < texels; ++i)
        for (double& channel : light.radiance[i]) channel /= std::max(light.pixels[i], 1u);
    return light;
}

/// Gives the texels that show nothing the mean of the others; returns the share of these, 0 to 1.
inline double fillSeen(SeenLight& light) {
    double seen = 0, all = 0;
    Vector mean{};
    for (std::size_t i = 0; i < light.pixels.size(); ++i) {
        const double weight = texelAt(i, fineFace).weight;
        all += weight;
        if (light.pixels[i] == 0) continue;
        seen += weight;
        for (int channel = 0; channel < 3; ++channel) mean[channel] += weight * light.radiance[i][channel];
    }
    for (std::size_t i = 0; i < light.pixels.size(); ++i)
        for (int channel = 0; channel < 3 && seen > 0 && light.pixels[i] == 0; ++channel)
            light.radiance[i][channel] = mean[channel] / seen;
    return seen / all;
}

/// The median of the distances from a point to a box around it, along the largest component of a direction, by solid
/// angle.
inline double boxDistance(const Vector& low, const Vector& high, const Vector& point) {
    std::vector<double> distances(texelCount(fineFace)), shares(distances.size());
    for (std::size_t i = 0; i < distances.size(); ++i) {
        const Vector direction = texelAt(i, fineFace).direction;
        double step = std::numeric_limits<double>::infinity(), largest = 0;
        for (int axis = 0; axis < 3; ++axis) {
            step = std::min(step, (direction[axis] > 0 ? high[axis] - point[axis] : point[axis] - low[axis]) /
                                      std::fabs(direction[axis]));
            largest = std::max(largest, std::fabs(direction[axis]));
        }
        distances[i] = step * largest;
    }
    std::vector<std::size_t> order(distances.size());
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t one, std::size_t other) { return distances[one] < distances[other]; });
    double sum = 0;
    for (std::size_t i = 0; i < order.size(); ++i) shares[i] = sum += texelAt(order[i], fineFace).weight;
    return distances[order[std::lower_bound(shares.begin(), shares.end(), sum / 2) - shares.begin()]];
}

/// The register `gather.parallax`: what is at this distance, for an object whose cube has this edge; 0 if it is too far
/// away.
inline int parallaxOf(double distance, double edge) {
    for (int parallax = 1; parallax <= 3; ++parallax)
        if (distance < std::ldexp(edge, parallax - 1) * std::sqrt(2.0)) return parallax;
    return 0;
}

} // namespace colonnade::environment
