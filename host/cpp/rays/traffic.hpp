// Records that rays read, in their order, and the lines of them that the caches of an array read from DRAM.
#pragma once
#include <algorithm>

#include "tracer.hpp"

namespace colonnade::rays {

/// The caches of an array, and the rays that are in flight in a column.
struct CacheShape {
    std::size_t columns, flight, lines, ways, sharedLines, sharedWays, recordsOfALine;
};

/// Reads of records by columns, where rays that want a record at the same time share it, and of lines from DRAM.
struct Traffic {
    std::size_t reads = 0, lines = 0;
};

/// The model as a backend that can also keep the addresses of the records which each ray reads.
class ReadingModel {
public:
    ReadingModel(const Numbers& numbers, int directionBits, const std::map<std::string, Layout>& layouts)
        : model_(*new Model(numbers, directionBits, layouts)), calls_(model_.backend()) {}
    ~ReadingModel() { calls_.close(calls_.context); }
    ReadingModel(const ReadingModel&) = delete;

    /// It does not own this object.
    colonnade_rays_backend backend() {
        return {this,
                [](void* own, const colonnade_rays_image* image) { return of(own).calls_.load(of(own).calls_.context, image); },
                [](void* own, const colonnade_rays_batch* batch) { return of(own).submit(*batch); },
                [](void* own) { return of(own).calls_.wait(of(own).calls_.context); },
                [](void* own, colonnade_rays_sums* sums) { of(own).calls_.counters(of(own).calls_.context, sums); },
                nullptr};
    }

    /// Reads of the rays of batches go to the end of `reads`; null: nowhere. These batches have whole rays.
    void writeTo(std::vector<std::vector<std::uint32_t>>* reads) { reads_ = reads; }

private:
    static ReadingModel& of(void* own) { return *static_cast<ReadingModel*>(own); }

    int submit(const colonnade_rays_batch& batch) {
        if (const int status = calls_.submit(calls_.context, &batch); status != COLONNADE_RAYS_OK || !reads_) return status;
        RayTracer tracer(model_.tracer());
        std::vector<RayStep> steps;
        tracer.log.writeTo(&steps);
        for (std::size_t i = 0; i < batch.count; ++i) {
            steps.clear();
            tracer.response(reinterpret_cast<const colonnade_rays_record*>(batch.rays)[i], batch.mode);
            reads_->emplace_back();
            for (const RayStep& step : steps)
                if (step.kind == RayStep::Kind::node || step.kind == RayStep::Kind::record) reads_->back().push_back(static_cast<std::uint32_t>(step.value));
        }
        return COLONNADE_RAYS_OK;
    }

    Model& model_;
    colonnade_rays_backend calls_;
    std::vector<std::vector<std::uint32_t>>* reads_ = nullptr;
};

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

/// What columns read that take the rays in runs of a tile, and of whose rays in flight each reads its next record in turn.
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
    for (std::size_t c = 0; c < shape.columns; ++c) columns.push_back({LineCache(shape.lines, shape.ways), {}, c * run});
    LineCache shared(shape.sharedLines, shape.sharedWays);
    Traffic traffic;
    for (bool isBusy = true; isBusy;) {
        isBusy = false;
        for (ColumnState& column : columns) {
            for (; column.flight.size() < shape.flight && column.next < reads.size(); column.next += (column.next + 1) % run != 0 ? 1 : run * (shape.columns - 1) + 1)
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
            column.flight.erase(std::remove_if(column.flight.begin(), column.flight.end(), isDone), column.flight.end());
            isBusy = isBusy || !column.flight.empty() || column.next < reads.size();
        }
    }
    return traffic;
}

} // namespace colonnade::rays
