/// Metal and roughness of faces by a map, and fewer roughnesses for a table of materials.
#pragma once

#include "texture.hpp"
#include "topology.hpp"

namespace colonnade::mesh {

/// Whether a face is metal, and its mean roughness in sixteenths, 0 to 1.
struct FaceMetal {
    bool isMetal;
    double roughness;
};

/// `uvs`: positions of the corners in a metallic-roughness map, two each; `factors` of metallic and roughness.
inline FaceMetal metalOf(const Picture<std::uint8_t>& map, const double* uvs, const double* factors) {
    constexpr int steps = 16;
    double codes[3];
    map.mean(uvs, [](std::uint8_t code) { return static_cast<double>(code); }, codes);
    const double metallic = codes[2] / 255, roughness = codes[1] / 255;
    return {metallic * factors[0] >= 0.5, std::rint(steps * std::clamp(roughness * factors[1], 0.0, 1.0)) / steps};
}

/// Values in groups of one kind become means until so many groups are left: the two go first whose difference, squared,
/// times their weight is least (Ward's clustering). Returns the value of each.
inline std::vector<double> mergedValues(const std::vector<double>& values, const std::vector<double>& weights,
                                        const std::vector<std::int64_t>& kinds, std::size_t count) {
    struct Group {
        std::int64_t kind;
        double weight, value;
        std::vector<std::int64_t> members;
    };
    std::vector<Group> groups;
    for (const std::int64_t i : sortedIndices(values.size(), [&](std::int64_t a, std::int64_t b) {
             return std::pair{kinds[a], values[a]} < std::pair{kinds[b], values[b]};
         }))
        groups.push_back({kinds[i], weights[i], values[i], {i}});
    while (groups.size() > count) {
        std::size_t best = 0;
        double least = HUGE_VAL;
        for (std::size_t i = 1; i < groups.size(); ++i) {
            const Group &one = groups[i - 1], &other = groups[i];
            if (one.kind != other.kind) continue;
            const double apart = one.value - other.value,
                         cost = one.weight * other.weight * apart * apart / std::max(one.weight + other.weight, 1e-300);
            if (cost < least) {
                least = cost;
                best = i;
            }
        }
        if (best == 0) break;
        Group &into = groups[best - 1], &from = groups[best];
        into.members.insert(into.members.end(), from.members.begin(), from.members.end());
        double total = 0, sum = 0;
        for (const std::int64_t member : into.members) {
            total += weights[member];
            sum += weights[member] * values[member];
        }
        if (total > 0) into.value = sum / total;
        into.weight = total;
        groups.erase(groups.begin() + static_cast<std::ptrdiff_t>(best));
    }
    std::vector<double> found(values.size());
    for (const Group& group : groups)
        for (const std::int64_t member : group.members)
            found[member] = group.members.size() > 1 ? group.value : values[member];
    return found;
}

} // namespace colonnade::mesh
