// environment/EnvironmentMarches.scala and EnvironmentRays.scala: the marches of a column, and its pipeline of directly
// seen pixels.
#pragma once
#include <vector>

#include "common.hpp"
#include "design.hpp"
#include "model/work_log.hpp"

namespace colonnade::cycles {

/// The channel for tiles and cells of the maps that some columns share: environment/PhysicalAttributeMemory.scala,
/// CellLookup.scala. A cell of a tile of several planes takes two cycles.
class CellChannel {
public:
    /// A request of a cycle, or of two: returns how long it waits for those before it.
    Cycle ask(Cycle now, Cycle cycles) {
        const Cycle waits = std::max<Cycle>(0, openFrom_ - now);
        openFrom_ = now + waits + cycles;
        return waits;
    }

    /// The arbiter's queue has a place, without which a directly seen pixel does not go on.
    bool hasPlace(Cycle now) const { return openFrom_ - now <= queuePlaces; }

private:
    static constexpr Cycle queuePlaces = 2;

    Cycle openFrom_ = 0;
};

class Environment {
public:
    Environment(const Design& design, CellChannel& cells)
        : squareCycles_(design.columnsPerCopy > 1 ? 11 : 9), fetchCycles_(8), cells_(cells),
          marches_(static_cast<std::size_t>(design.marches)) {}

    /// A request of each kind is accepted.
    bool acceptsDirect() const { return directWaits_ < 0; }
    bool acceptsMarch() const { return marchWaits_ < 0; }

    /// A cycle. `request`: the path whose request comes, or -1; `isStored`: a ray is stored, so that no answer is
    /// taken. Returns the path that is answered, or -1.
    int step(Cycle now, int request, const PathStep* lookup, const FrameWork& work, bool isStored) {
        // Answers of the last stage, in its order
        int answered = -1;
        if (!answers_.isEmpty() && answers_.front().at <= now && !isStored) {
            answered = answers_.front().path;
            if (answers_.front().isDirect) --inPipeline_;
            answers_.pop();
        }

        // The last stage takes a point every four cycles, those of marches first
        if (now >= pointOpens_ && answers_.count() < 3) {
            const bool hasMarch = hitPath_ >= 0 && hitEnds_ <= now;
            if (hasMarch || (!depths_.isEmpty() && depths_.front().at <= now)) {
                pointOpens_ = now + 4;
                answers_.push({now + 6, hasMarch ? hitPath_ : depths_.front().path, !hasMarch});
                if (hasMarch) hitPath_ = -1;
                else depths_.pop();
            }
        }

        // Hits of marches, one at a time
        if (hitPath_ < 0) {
            std::uint32_t finished = 0;
            for (std::size_t i = 0; i < marches_.size(); ++i)
                finished |= static_cast<std::uint32_t>(marches_[i].path >= 0 && marches_[i].ends <= now) << i;
            const int granted = hits_.grant(finished);
            if (granted >= 0) {
                hits_.take(granted);
                hitPath_ = marches_[static_cast<std::size_t>(granted)].path;
                hitEnds_ = now + hitCycles;
                marches_[static_cast<std::size_t>(granted)].path = -1;
            }
        }

        // Requests that wait go into the pipeline, or else to an empty march
        isTaken_ = false;
        for (March& march : marches_) {
            busy += march.path >= 0;
            if (march.path >= 0 && march.requests > 0 && march.asks <= now) {
                // Spread over the march: tiles, then cells
                march.asks += march.interval;
                march.ends += cells_.ask(now, march.requests-- > march.cells ? 1 : 2);
            }
        }
        if (directWaits_ >= 0 && now >= directOpens_ && inPipeline_ < pipelinePlaces && cells_.hasPlace(now)) {
            isTaken_ = true;
            directOpens_ = now + 4;
            ++inPipeline_;
            depths_.push({now + directCycles + cells_.ask(now, directIsFlat_ ? 1 : 2), directWaits_});
            directWaits_ = -1;
        } else if (marchWaits_ >= 0)
            for (March& march : marches_)
                if (march.path < 0) {
                    isTaken_ = true;
                    march = {marchWaits_, now + marchCycles_};
                    march.requests = marchRequests_;
                    march.cells = marchCells_;
                    march.interval = marchCycles_ / (marchRequests_ + 1);
                    march.asks = now + march.interval;
                    marchWaits_ = -1;
                    break;
                }
        if (request >= 0) {
            if (lookup->isDirect) {
                directWaits_ = request;
                directIsFlat_ = lookup->isFlat;
            } else {
                const MarchWork& march = work.marches[lookup->first];
                marchWaits_ = request;
                marchCycles_ = cyclesOf(march);
                marchCells_ = march.cells;
                marchRequests_ = march.flatTiles + march.tiles + march.cells;
            }
        }
        return answered;
    }

    /// A request has been taken: the table of rays is read.
    bool isTaken() const { return isTaken_; }

    std::uint64_t busy = 0;

private:
    struct Item {
        Cycle at;
        int path;
        bool isDirect = true;
    };
    struct March {
        int path = -1;
        Cycle ends = 0, asks = 0, interval = 0;
        int requests = 0, cells = 0;
    };

    /// docs/march.md, cycles; TileProgram.scala, CellProgram.scala, PlaneTest.scala. A row of steps without a plane of
    /// the maps ends at the bounding planes.
    Cycle cyclesOf(const MarchWork& march) const {
        const Cycle before = march.isFromCamera ? 66 + 13 * Cycle(march.outside) + (march.outside ? 9 : 0) : 92;
        const Cycle squares = squareCycles_ * Cycle(march.flatTiles + march.cells) + 3 * Cycle(march.tiles) +
                              6 * Cycle(march.planes) + 22 * Cycle(march.cellTiles);
        return before + squares + fetchCycles_ * Cycle(march.fetches) + 4 * Cycle(march.behind) +
               11 * Cycle(march.boundingPlanes) + 12 * Cycle(march.approached) + 23;
    }

    static constexpr int pipelinePlaces = 15;
    static constexpr Cycle directCycles = 34, hitCycles = 14;

    Cycle squareCycles_, fetchCycles_;
    CellChannel& cells_;
    bool directIsFlat_ = false;
    int marchRequests_ = 0, marchCells_ = 0;
    int directWaits_ = -1, marchWaits_ = -1, hitPath_ = -1, inPipeline_ = 0;
    Cycle marchCycles_ = 0, directOpens_ = 0, pointOpens_ = 0, hitEnds_ = 0;
    bool isTaken_ = false;
    Ring<Item, 32> depths_;
    Ring<Item, 8> answers_;
    std::vector<March> marches_;
    RoundRobin hits_;
};

} // namespace colonnade::cycles
