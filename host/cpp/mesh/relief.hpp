/// The normals of normal maps at points of faces (docs/textures.md, "Normal maps").
#pragma once

#include <optional>

#include "normals.hpp"
#include "texture.hpp"

namespace colonnade::mesh {

/// Weights of a face's corners at points that are spread evenly over it.
inline std::vector<Vector> trianglePoints(int steps) {
    std::vector<Vector> points;
    for (int i = 0; i < steps; ++i)
        for (int j = 0; i + j < steps; ++j) {
            const double first = (i + 1.0 / 3) / steps, second = (j + 1.0 / 3) / steps;
            points.push_back({first, second, 1 - first - second});
        }
    return points;
}

/// The sum of three values of any kind of array by weights.
template <class Values> Values weighted(const Vector& weights, const std::array<Values, 3>& values) {
    Values sum{};
    for (std::size_t i = 0; i < sum.size(); ++i)
        sum[i] = weights[0] * values[0][i] + weights[1] * values[1][i] + weights[2] * values[2][i];
    return sum;
}

/// Values at the corners of a part of a face, by the weights of its corners.
template <class Values> std::array<Values, 3> weighted(const Corners& weights, const std::array<Values, 3>& values) {
    return {weighted(weights[0], values), weighted(weights[1], values), weighted(weights[2], values)};
}

/// Unit normals of pixels, along u, against v, along the surface's own normal, and their means over squares of 2, 4, …
/// pixels.
class NormalMap {
public:
    /// Codes 0 to 255 stand for -1 to 1; `scale` is a factor of both tangential components.
    NormalMap(const Picture<std::uint8_t>& picture, float scale)
        : size_{static_cast<double>(picture.width), static_cast<double>(picture.height)} {
        std::vector<float> level(static_cast<std::size_t>(picture.width * picture.height * 3));
        for (std::size_t i = 0; i < level.size(); i += 3) {
            float own[3];
            for (int axis = 0; axis < 3; ++axis)
                own[axis] = static_cast<float>(2.0 / 255) * static_cast<float>(picture.pixels[i + axis]) - 1.0f;
            own[0] *= scale;
            own[1] *= scale;
            own[2] = std::max(own[2], 0.0f);
            const float length = std::sqrt(own[0] * own[0] + own[1] * own[1] + own[2] * own[2]);
            for (int axis = 0; axis < 3; ++axis)
                level[i + axis] = length > 0 ? own[axis] / std::max(length, 1e-6f) : static_cast<float>(axis == 2);
        }
        add(std::move(level),
            {nullptr, picture.height, picture.width, 3, picture.wrapU, picture.wrapV, picture.isNearest});
        while (std::max(levels_.back().width, levels_.back().height) > 1) addHalved();
    }

    /// Width and height, pixels.
    const Pair& size() const { return size_; }

    /// The mean of the map near a position, bilinear in a level; that of unit normals that differ is shorter than 1.
    Vector normal(const Pair& uv, std::size_t level) const {
        Vector found;
        levels_[std::min(level, levels_.size() - 1)].sample(
            uv.data(), [](float value) { return static_cast<double>(value); }, found.data());
        return found;
    }

private:
    void add(std::vector<float> pixels, Picture<float> level) {
        pixels_.push_back(std::move(pixels));
        level.pixels = pixels_.back().data();
        levels_.push_back(level);
    }

    void addHalved() {
        const Picture<float> from = levels_.back();
        const std::int64_t width = (from.width + 1) / 2, height = (from.height + 1) / 2;
        std::vector<float> pixels(static_cast<std::size_t>(width * height * 3));
        const auto at = [&](std::int64_t x, std::int64_t y) {
            return from.pixels + 3 * (std::min(y, from.height - 1) * from.width + std::min(x, from.width - 1));
        };
        for (std::int64_t y = 0; y < height; ++y)
            for (std::int64_t x = 0; x < width; ++x)
                for (int axis = 0; axis < 3; ++axis)
                    pixels[3 * (y * width + x) + axis] =
                        ((at(2 * x, 2 * y)[axis] + at(2 * x, 2 * y + 1)[axis]) +
                         (at(2 * x + 1, 2 * y)[axis] + at(2 * x + 1, 2 * y + 1)[axis])) /
                        4.0f;
        add(std::move(pixels), {nullptr, height, width, 3, from.wrapU, from.wrapV, false});
    }

    Pair size_;
    std::vector<std::vector<float>> pixels_;
    std::vector<Picture<float>> levels_;
};

/// What a face has of a normal map. A tangent of the file has a fourth component 1, or -1 where the bitangent is that
/// of a mirrored map; one of 0 is none.
struct ReliefFace {
    std::int32_t map = -1;  ///< -1: none
    Triangle uvs{};
    std::array<std::array<double, 4>, 3> tangents{};
};

/// Tangent, bitangent and normal at the corners of a face.
using Frames = std::array<std::array<double, 9>, 3>;

/// The frames of faces with these corner normals: tangents of the file, or as in MikkTSpace; 0 where a map has no
/// direction.
inline std::vector<Frames> framesOf(const std::vector<Vector>& vertices, const std::vector<Face>& faces,
                                    const std::vector<Corners>& normals, const std::vector<ReliefFace>& relief) {
    const std::size_t count = 3 * faces.size();
    std::vector<std::array<double, 7>> keys(count);
    std::vector<Vector> along(faces.size());
    for (std::size_t i = 0; i < faces.size(); ++i) {
        const Vector& corner = vertices[faces[i][0]];
        const Vector first = difference(vertices[faces[i][1]], corner),
                     second = difference(vertices[faces[i][2]], corner);
        const Triangle& uvs = relief[i].uvs;
        const Pair one{uvs[1][0] - uvs[0][0], uvs[1][1] - uvs[0][1]},
            other{uvs[2][0] - uvs[0][0], uvs[2][1] - uvs[0][1]};
        const double signedArea = one[0] * other[1] - one[1] * other[0], sign = (signedArea > 0) - (signedArea < 0),
                     area = length(cross(first, second));
        for (int axis = 0; axis < 3; ++axis) along[i][axis] = (first[axis] * other[1] - second[axis] * one[1]) * sign;
        along[i] = unit(along[i]);
        for (double& component : along[i]) component *= area;
        // v goes down, so a map that is not mirrored has a negative area
        for (int c = 0; c < 3; ++c) {
            const Vector& own = normals[i][c];
            keys[3 * i + c] = {static_cast<double>(faces[i][c]),
                               own[0] + 0.0,
                               own[1] + 0.0,
                               own[2] + 0.0,
                               uvs[c][0] + 0.0,
                               uvs[c][1] + 0.0,
                               0.0 - sign};
        }
    }
    // Corners of one vertex, normal, position in the map and side have one tangent, the mean of their faces by area
    const std::vector<std::int64_t> order =
        sortedIndices(count, [&](std::int64_t a, std::int64_t b) { return keys[a] < keys[b]; });
    std::vector<Frames> frames(faces.size());
    for (std::size_t begin = 0, end; begin < count; begin = end) {
        Vector sum{};
        for (end = begin; end < count && keys[order[end]] == keys[order[begin]]; ++end)
            for (int axis = 0; axis < 3; ++axis) sum[axis] += along[order[end] / 3][axis];
        for (std::size_t i = begin; i < end; ++i) {
            const std::size_t face = order[i] / 3, c = order[i] % 3;
            const auto& given = relief[face].tangents[c];
            const bool isGiven = given[0] != 0 || given[1] != 0 || given[2] != 0;
            const double side = isGiven ? (given[3] > 0) - (given[3] < 0) : keys[order[i]][6];
            Vector tangent = isGiven ? Vector{given[0], given[1], given[2]} : sum;
            const Vector& normal = normals[face][c];
            const double share = dot(tangent, normal);
            for (int axis = 0; axis < 3; ++axis) tangent[axis] -= share * normal[axis];
            tangent = unit(tangent);
            const Vector across = cross(normal, tangent);
            for (int axis = 0; axis < 3; ++axis) {
                frames[face][c][axis] = tangent[axis];
                frames[face][c][3 + axis] = across[axis] * side;
                frames[face][c][6 + axis] = normal[axis];
            }
        }
    }
    return frames;
}

} // namespace colonnade::mesh
