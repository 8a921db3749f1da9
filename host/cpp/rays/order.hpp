// An order of rays in which near ones follow each other.
#pragma once
#include "colonnade_rays.h"
#include "mesh/topology.hpp"

namespace colonnade::rays {

/// The indices of the rays by their keys: origins on a grid of 32³ in Morton order, then the octant of the direction.
inline void orderOf(const mesh::Vector& low, const mesh::Vector& high, const colonnade_rays_ray* rays,
                    std::size_t count, std::uint32_t* order) {
    constexpr int levels = 5;
    std::vector<std::uint32_t> keys(count), first((std::size_t{1} << (3 * levels + 3)) + 1);
    for (std::size_t i = 0; i < count; ++i) {
        std::uint32_t key = 0;
        for (int a = 0; a < 3; ++a) {
            const double position = (rays[i].origin[a] - low[a]) / (high[a] - low[a]) * (1 << levels);
            const auto cell =
                static_cast<std::uint32_t>(position > 0 ? std::min(position, double((1 << levels) - 1)) : 0);
            for (int bit = 0; bit < levels; ++bit) key |= (cell >> bit & 1) << (3 * bit + 3 + a);
            key |= static_cast<std::uint32_t>(rays[i].direction[a] < 0) << a;
        }
        keys[i] = key;
        ++first[key + 1];
    }
    for (std::size_t key = 1; key < first.size(); ++key) first[key] += first[key - 1];
    for (std::size_t i = 0; i < count; ++i) order[first[keys[i]]++] = static_cast<std::uint32_t>(i);
}

} // namespace colonnade::rays
