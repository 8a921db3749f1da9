// Records that rays read, in their order, and the lines of them that the caches of an array read from DRAM.
#pragma once
#include <algorithm>
#include <cstdint>
#include <vector>

#include "colonnade_rays.h"

namespace colonnade::rays {

/// The caches of an array, and the rays that are in flight in a column.
struct CacheShape {
    std::size_t columns, flight, lines, ways, sharedLines, sharedWays, recordsOfALine;
};

/// Reads of records by columns, where rays that want a record at the same time share it, and of lines from DRAM.
struct Traffic {
    std::size_t reads = 0, lines = 0;
};

/// The records that each ray reads in the model of a committed scene, in their order. Throws Failure.
std::vector<std::vector<std::uint32_t>> readsOf(const colonnade_rays_scene& scene, const colonnade_rays_ray* rays,
                                                std::size_t count, std::uint32_t mode, std::uint32_t mask,
                                                bool isOcclusion);

/// Tags of a cache whose sets replace the line that was least recently used.
class LineCache {
public:
    LineCache(std::size_t lines, std::size_t ways) : ways_(ways), sets_(std::max<std::size_t>(1, lines / ways)) {}

    /// Whether the cache has a line, which it then has.
    bool holds(std::size_t line) {
        std::vector<std::size_t>& set = sets_[line % sets_.size()];
        const auto found = std::find(set.begin(), set.end(), line);
        const bool isHit = found != set.end();
        if (isHit) set.erase(found);
        else if (set.size() == ways_) set.erase(set.begin());
        set.push_back(line);
        return isHit;
    }

private:
    std::size_t ways_;
    std::vector<std::vector<std::size_t>> sets_;
};

/// What columns read that take the rays in runs of a tile, and of whose rays in flight each reads its next record in
/// turn.
inline Traffic trafficOf(const std::vector<std::vector<std::uint32_t>>& reads, const CacheShape& shape) {
    constexpr std::size_t run = 64;
    struct Cursor {
        std::size_t ray, read;
    };
    struct ColumnState {
        LineCache cache;
        std::vector<Cursor> flight;
        std::size_t next;
    };
    std::vector<ColumnState> columns;
    for (std::size_t c = 0; c < shape.columns; ++c)
        columns.push_back({LineCache(shape.lines, shape.ways), {}, c * run});
    LineCache shared(shape.sharedLines, shape.sharedWays);
    Traffic traffic;
    for (bool isBusy = true; isBusy;) {
        isBusy = false;
        for (ColumnState& column : columns) {
            for (; column.flight.size() < shape.flight && column.next < reads.size();
                 column.next += (column.next + 1) % run != 0 ? 1 : run * (shape.columns - 1) + 1)
                if (!reads[column.next].empty()) column.flight.push_back({column.next, 0});
            std::vector<std::uint32_t> addresses;
            for (Cursor& cursor : column.flight) addresses.push_back(reads[cursor.ray][cursor.read++]);
            std::sort(addresses.begin(), addresses.end());
            addresses.erase(std::unique(addresses.begin(), addresses.end()), addresses.end());
            traffic.reads += addresses.size();
            for (const std::uint32_t address : addresses) {
                const std::size_t line = address / shape.recordsOfALine;
                if (!column.cache.holds(line) && (shape.sharedLines == 0 || !shared.holds(line))) ++traffic.lines;
            }
            const auto isDone = [&](const Cursor& cursor) { return cursor.read == reads[cursor.ray].size(); };
            column.flight.erase(std::remove_if(column.flight.begin(), column.flight.end(), isDone),
                                column.flight.end());
            isBusy = isBusy || !column.flight.empty() || column.next < reads.size();
        }
    }
    return traffic;
}

} // namespace colonnade::rays
