/// Emission of faces by a map: a face emits one of a few colours, as a table of materials has room for.
#pragma once

#include <map>
#include <vector>

#include "texture.hpp"

namespace colonnade::mesh {

/// Colours of the emission that a map has, darkness among them.
constexpr std::size_t emissionColours = 4;

using Rgb = std::array<double, 3>;

/// What each face emits: its mean of a map, then the mean of faces of a similar colour (Ward's clustering of eighths).
/// @param uvs positions of the corners in the map, six for a face
/// @param areas of the faces
/// @param linear values of the map's codes
inline std::vector<Rgb> emissionOf(const Picture<std::uint8_t>& map, const double* uvs, const double* areas, std::size_t count, const double* linear) {
    struct Group {
        double weight;
        Rgb sum;
        std::vector<std::size_t> faces;

        double at(int channel) const { return weight > 0 ? sum[channel] / weight : 0; }
        double costOf(const Group& other) const {
            double apart = 0;
            for (int channel = 0; channel < 3; ++channel) apart += (at(channel) - other.at(channel)) * (at(channel) - other.at(channel));
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

} // namespace colonnade::mesh
