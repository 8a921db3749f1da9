/// The table of planes: of the frame before, moved with the camera, and of regions that none of these fits.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "blocks.hpp"
#include "planes.hpp"

namespace colonnade::live {

/// Most planes of a table; the last entry of a layout is the plane at infinity.
constexpr int maxPlanes = 128;
constexpr int noPlane = -1;

/// The planes of a frame by id. A plane keeps its id from frame to frame.
struct PlaneTable {
    std::array<Plane, maxPlanes> planes{};
    std::array<int, maxPlanes> area{}; // blocks; 0: the entry is free
    /// Ids by descending area.
    std::vector<std::uint8_t> bySize() const {
        std::vector<std::uint8_t> ids;
        for (int id = 0; id < maxPlanes; ++id)
            if (area[id] > 0) ids.push_back(static_cast<std::uint8_t>(id));
        std::stable_sort(ids.begin(), ids.end(), [&](int a, int b) { return area[a] > area[b]; });
        return ids;
    }
};

class RegionFinder {
public:
    /// At most `most` planes, 1 to 127; `columns` tiles in a row.
    RegionFinder(int most, int columns, int rows)
        : most_(most), columns_(columns), rows_(rows), labels_(static_cast<std::size_t>(16) * columns * rows) {}

    /// The plane of each block, or `noPlane`.
    const std::vector<std::int32_t>& labels() const { return labels_; }

    /// Updates the table, whose planes are in this frame's view already. `near[t]` are ids that tile t may show;
    /// tolerance in steps of 2^-17 m.
    void find(const DepthBlocks& blocks, std::int64_t tolerance, const std::vector<std::vector<std::uint8_t>>& near,
              PlaneTable& table) {
        std::fill(labels_.begin(), labels_.end(), noPlane);
        regions_.assign(maxPlanes, Region{});
        keep(blocks, 2 * tolerance, near, table);
        grow(blocks, tolerance);
        const std::vector<int> merged = merge(blocks, tolerance * 4 / 3);
        choose(blocks, merged, table);
    }

private:
    struct Region {
        PlaneSums sums;
        Plane plane;
    };

    /// Blocks take a plane of the frame before that a tile around them showed.
    void keep(const DepthBlocks& blocks, std::int64_t reach, const std::vector<std::vector<std::uint8_t>>& near,
              const PlaneTable& table) {
        for (int row = 0; row < rows_; ++row)
            for (int column = 0; column < columns_; ++column) {
                std::uint8_t ids[64];
                int count = 0;
                bool seen[maxPlanes] = {};
                for (int y = std::max(0, row - 1); y <= std::min(rows_ - 1, row + 1); ++y)
                    for (int x = std::max(0, column - 1); x <= std::min(columns_ - 1, column + 1); ++x)
                        for (const std::uint8_t id : near[static_cast<std::size_t>(y) * columns_ + x])
                            if (!seen[id] && table.area[id] > 0 && count < 64) {
                                seen[id] = true;
                                ids[count++] = id;
                            }
                if (count == 0) continue;
                for (int j = 0; j < 4; ++j)
                    for (int i = 0; i < 4; ++i) {
                        const int block = (4 * row + j) * 4 * columns_ + 4 * column + i;
                        if (blocks[block].residual > reach) continue;
                        std::int64_t least = reach;
                        for (int k = 0; k < count; ++k) {
                            const std::int64_t error = blocks.error(block, table.planes[ids[k]]);
                            if (error < least) {
                                least = error;
                                labels_[block] = ids[k];
                            }
                        }
                    }
            }
        for (int block = 0; block < blocks.count(); ++block)
            if (labels_[block] >= 0) blocks.add(regions_[labels_[block]].sums, block);
        for (int id = 0; id < maxPlanes; ++id) {
            Region& region = regions_[id];
            region.plane = table.planes[id];
            if (region.sums.blocks < 2) region.sums = PlaneSums{};
            else if (region.sums.blocks >= 3) region.sums.solve(region.plane);
        }
        for (std::int32_t& label : labels_)
            if (label >= 0 && regions_[label].sums.blocks == 0) label = noPlane;
    }

    /// Connected blocks on a plane, from the flattest block on; three times, each less exact than the one before.
    void grow(const DepthBlocks& blocks, std::int64_t finest) {
        static constexpr int times[3] = {1, 3, 8}, least[3] = {6, 3, 2};
        const int across = blocks.blockColumns();
        for (int pass = 0; pass < 3; ++pass) {
            const std::int64_t tolerance = finest * times[pass];
            const std::int32_t tooSmall = maxTooSmall - pass; // does not seed a region of this pass again
            std::array<std::vector<int>, 16> bins;
            for (int block = 0; block < blocks.count(); ++block)
                if (labels_[block] < 0 && blocks[block].residual < tolerance)
                    bins[blocks[block].residual * 16 / tolerance].push_back(block);
            for (const std::vector<int>& bin : bins)
                for (const int seed : bin) {
                    if (labels_[seed] >= 0 || labels_[seed] == tooSmall) continue;
                    const std::int32_t id = static_cast<std::int32_t>(regions_.size());
                    Region region;
                    region.plane = blocks.planeOf(seed);
                    int refit = 4;
                    stack_.assign(1, seed);
                    members_.clear();
                    labels_[seed] = id;
                    while (!stack_.empty()) {
                        const int block = stack_.back();
                        stack_.pop_back();
                        blocks.add(region.sums, block);
                        members_.push_back(block);
                        if (region.sums.blocks >= refit) {
                            region.sums.solve(region.plane);
                            refit *= 2;
                        }
                        const int x = block % across;
                        const int neighbours[4] = {x > 0 ? block - 1 : -1, x + 1 < across ? block + 1 : -1,
                                                   block - across, block + across};
                        for (const int next : neighbours) {
                            if (next < 0 || next >= blocks.count() || labels_[next] >= 0 || labels_[next] == tooSmall)
                                continue;
                            if (blocks[next].residual < tolerance &&
                                blocks.error(next, region.plane) * 2 < tolerance * 3) {
                                labels_[next] = id;
                                stack_.push_back(next);
                            }
                        }
                    }
                    if (region.sums.blocks >= least[pass]) {
                        region.sums.solve(region.plane);
                        regions_.push_back(region);
                    } else {
                        for (const int block : members_) labels_[block] = tooSmall;
                    }
                }
        }
    }

    /// Adds new regions to larger ones on the same plane; where each region went.
    std::vector<int> merge(const DepthBlocks& blocks, std::int64_t tolerance) {
        const int count = static_cast<int>(regions_.size());
        members_.clear();
        starts_.assign(count + 1, 0);
        for (const std::int32_t label : labels_)
            if (label >= 0) ++starts_[label + 1];
        for (int i = 0; i < count; ++i) starts_[i + 1] += starts_[i];
        members_.resize(starts_[count]);
        std::vector<int> next(starts_.begin(), starts_.end() - 1);
        for (int block = 0; block < blocks.count(); ++block)
            if (labels_[block] >= 0) members_[next[labels_[block]]++] = block;
        std::vector<int> order, into(count, noPlane), kept;
        for (int i = 0; i < count; ++i)
            if (regions_[i].sums.blocks > 0) order.push_back(i);
        std::stable_sort(order.begin(), order.end(),
                         [&](int a, int b) { return regions_[a].sums.blocks > regions_[b].sums.blocks; });
        for (const int i : order) {
            const int size = starts_[i + 1] - starts_[i], step = std::max(1, size / 12);
            const auto isOn = [&](const Plane& plane) {
                for (int k = 0; k < size; k += step)
                    if (blocks.error(members_[starts_[i] + k], plane) >= tolerance) return false;
                return true;
            };
            into[i] = i;
            if (i >= maxPlanes) // planes of the frame before stay as they are
                for (const int other : kept)
                    if (isOn(regions_[other].plane)) {
                        into[i] = other;
                        break;
                    }
            if (into[i] == i) {
                kept.push_back(i);
            } else {
                Region& target = regions_[into[i]];
                target.sums.add(regions_[i].sums);
                if (target.sums.blocks < 4 * regions_[i].sums.blocks) target.sums.solve(target.plane);
            }
        }
        return into;
    }

    /// Chooses the regions that gain most, and gives the blocks of the others the closest of them.
    void choose(const DepthBlocks& blocks, const std::vector<int>& into, PlaneTable& table) {
        constexpr std::int64_t worst = (std::int64_t{3} << errorBits) / 10; // an error counts up to 0.3 m
        const int count = static_cast<int>(regions_.size());
        std::vector<int> kept, closest(count, noPlane);
        for (int i = 0; i < count; ++i)
            if (into[i] == i) kept.push_back(i);
        std::stable_sort(kept.begin(), kept.end(),
                         [&](int a, int b) { return regions_[a].sums.blocks > regions_[b].sums.blocks; });
        if (static_cast<int>(kept.size()) > most_) {
            const int all = static_cast<int>(kept.size());
            std::vector<std::array<int, 4>> samples(all);
            std::vector<std::int64_t> errors(all, worst);
            std::vector<char> isSelected(all, 0);
            for (int i = 0; i < all; ++i)
                for (int k = 0; k < 4; ++k) {
                    const int size = starts_[kept[i] + 1] - starts_[kept[i]];
                    samples[i][k] = members_[starts_[kept[i]] + (2 * k + 1) * size / 8];
                }
            std::vector<int> selected;
            for (int round = 0; round < most_; ++round) {
                int best = -1;
                std::int64_t gain = -1;
                for (int i = 0; i < all; ++i)
                    if (!isSelected[i] && errors[i] * regions_[kept[i]].sums.blocks > gain) {
                        gain = errors[i] * regions_[kept[i]].sums.blocks;
                        best = i;
                    }
                isSelected[best] = 1;
                selected.push_back(kept[best]);
                for (int i = 0; i < all; ++i) {
                    if (isSelected[i]) continue;
                    std::int64_t error = 0;
                    for (const int block : samples[i])
                        error += std::min(worst, blocks.error(block, regions_[kept[best]].plane));
                    if (error / 4 < errors[i]) {
                        errors[i] = error / 4;
                        closest[kept[i]] = kept[best];
                    }
                }
            }
            for (int i = 0; i < all; ++i)
                if (isSelected[i] || errors[i] >= worst * 9 / 10) closest[kept[i]] = noPlane;
            kept = selected;
        }
        std::vector<int> idOf(count, noPlane);
        std::array<bool, maxPlanes> isTaken{};
        for (const int i : kept)
            if (i < maxPlanes) {
                idOf[i] = i;
                isTaken[i] = true;
            }
        int next = 0;
        for (const int i : kept)
            if (i >= maxPlanes) {
                while (isTaken[next]) ++next;
                isTaken[next] = true;
                idOf[i] = next;
            }
        table.area.fill(0);
        for (const int i : kept) {
            Region& region = regions_[i];
            if (region.sums.blocks >= 3) region.sums.solve(region.plane);
            table.planes[idOf[i]] = region.plane;
            table.area[idOf[i]] = region.sums.blocks;
        }
        for (std::int32_t& label : labels_) {
            if (label < 0) {
                label = noPlane;
                continue;
            }
            const int region = into[label];
            label = idOf[region] >= 0 ? idOf[region] : closest[region] >= 0 ? idOf[closest[region]] : noPlane;
        }
    }

    /// Labels of blocks whose region was too small, by pass.
    static constexpr std::int32_t maxTooSmall = -2;

    int most_, columns_, rows_;
    std::vector<std::int32_t> labels_;
    std::vector<Region> regions_;
    std::vector<int> stack_, members_, starts_;
};

} // namespace colonnade::live
