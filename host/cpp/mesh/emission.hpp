/// Emission of faces by a map: a face emits one of a few colours, as a table of materials has room for.
#pragma once

#include <cstring>
#include <map>
#include <vector>

#include "bisection.hpp"
#include "relief.hpp"
#include "texture.hpp"

namespace colonnade::mesh {

/// Colours of the emission that a map has, darkness among them.
constexpr std::size_t emissionColours = 4;

using Rgb = std::array<double, 3>;

/// What each face emits: its mean of a map, then the mean of faces of a similar colour (Ward's clustering of eighths).
/// @param uvs positions of the corners in the map, six for a face
/// @param areas of the faces
/// @param linear values of the map's codes
inline std::vector<Rgb> emissionOf(const Picture<std::uint8_t>& map, const double* uvs, const double* areas,
                                   std::size_t count, const double* linear) {
    struct Group {
        double weight;
        Rgb sum;
        std::vector<std::size_t> faces;

        double at(int channel) const { return weight > 0 ? sum[channel] / weight : 0; }
        double costOf(const Group& other) const {
            double apart = 0;
            for (int channel = 0; channel < 3; ++channel)
                apart += (at(channel) - other.at(channel)) * (at(channel) - other.at(channel));
            return weight * other.weight * apart / std::max(weight + other.weight, 1e-300);
        }
    };
    std::map<std::array<int, 3>, Group> cells;
    for (std::size_t face = 0; face < count; ++face) {
        Rgb mean;
        map.mean(uvs + 6 * face, [&](std::uint8_t code) { return linear[code]; }, mean.data());
        std::array<int, 3> cell;
        for (int channel = 0; channel < 3; ++channel) cell[channel] = static_cast<int>(std::lrint(8 * mean[channel]));
        Group& group = cells.try_emplace(cell, Group{0, {}, {}}).first->second;
        group.weight += areas[face];
        for (int channel = 0; channel < 3; ++channel) group.sum[channel] += areas[face] * mean[channel];
        group.faces.push_back(face);
    }
    std::vector<Group> groups;
    for (auto& [cell, group] : cells) groups.push_back(std::move(group));
    while (groups.size() > emissionColours) {
        std::size_t into = 0, from = 1;
        double least = HUGE_VAL;
        for (std::size_t i = 0; i < groups.size(); ++i)
            for (std::size_t j = i + 1; j < groups.size(); ++j)
                if (const double cost = groups[i].costOf(groups[j]); cost < least) {
                    least = cost;
                    into = i;
                    from = j;
                }
        groups[into].weight += groups[from].weight;
        for (int channel = 0; channel < 3; ++channel) groups[into].sum[channel] += groups[from].sum[channel];
        groups[into].faces.insert(groups[into].faces.end(), groups[from].faces.begin(), groups[from].faces.end());
        groups.erase(groups.begin() + static_cast<std::ptrdiff_t>(from));
    }
    std::vector<Rgb> found(count);
    for (const Group& group : groups) {
        Rgb colour{group.at(0), group.at(1), group.at(2)};
        // What no one sees takes no entry of the table
        if (std::max({colour[0], colour[1], colour[2]}) < 1.0 / 64) colour = {};
        for (const std::size_t face : group.faces) found[face] = colour;
    }
    return found;
}

/// Bisects the faces of a surface on which the emission by a map varies, at most so many more; vertices at the same
/// place stay together.
/// @param factor of the map's values
/// @param shows which faces show the map
/// @param uvs positions of the corners in it, six for a face
/// @return the pieces of all faces, in their order
inline std::vector<Piece> emissionPieces(const Picture<std::uint8_t>& map, const Rgb& factor,
                                         const std::vector<Vector>& vertices, std::vector<Face> faces,
                                         const std::uint8_t* shows, const double* uvs, std::int64_t budget,
                                         const double* linear) {
    /// Sum of the variances of the channels on a piece that is not split: a channel differs by 1/16.
    constexpr double flat = 1.0 / 256;
    const bool isFinite = std::all_of(vertices.begin(), vertices.end(),
                                      [](const Vector& at) { return std::isfinite(at[0] + at[1] + at[2]); });
    // What is not finite is refused when the mesh is cleaned
    if (!isFinite || faces.empty()) return Pieces(vertices, faces).pieces;
    const MergedRows<double> merged = mergeRows(vertices.data(), vertices.size());
    for (Face& face : faces)
        for (std::int32_t& vertex : face) vertex = static_cast<std::int32_t>(merged.index[vertex]);
    Pieces surface(merged.rows, faces);
    const auto errorOf = [&](const Piece& piece, const std::vector<Vector>& points) {
        Triangle corners;
        std::memcpy(&corners, uvs + 6 * piece.owner, sizeof corners);
        corners = weighted(piece.weights, corners);
        Rgb sum{};
        double squares = 0;
        for (const Vector& point : points) {
            const Pair at = weighted(point, corners);
            Rgb found;
            map.sample(at.data(), [&](std::uint8_t code) { return linear[code]; }, found.data());
            for (int channel = 0; channel < 3; ++channel) found[channel] *= factor[channel];
            const double scale = std::max({1.0, found[0], found[1], found[2]});
            for (int channel = 0; channel < 3; ++channel) {
                sum[channel] += found[channel] / scale;
                squares += found[channel] / scale * (found[channel] / scale);
            }
        }
        const auto count = static_cast<double>(points.size());
        const double variance =
            squares / count - (sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]) / (count * count);
        return variance > flat ? variance * surface.area(piece) : 0.0;
    };
    bisectWorst(surface, surface.shortest(), budget, [&](std::size_t first) {
        std::size_t users = 0;
        for (std::size_t i = first; i < surface.pieces.size(); ++i) users += shows[surface.pieces[i].owner];
        int steps = 16;
        while (steps > 4 && users * static_cast<std::size_t>(steps * (steps + 1) / 2) > 1u << 22) steps /= 2;
        const std::vector<Vector> points = trianglePoints(steps);
        std::vector<double> errors;
        for (std::size_t i = first; i < surface.pieces.size(); ++i)
            errors.push_back(shows[surface.pieces[i].owner] ? errorOf(surface.pieces[i], points) : 0.0);
        return errors;
    });
    surface.sort();
    return std::move(surface.pieces);
}

} // namespace colonnade::mesh
