// shading/BounceQueue.scala, BouncePipeline.scala, and the one bounce unit of SequentialShader.scala: hits on mirrors
// and glass.
#pragma once
#include <vector>

#include "bounce_program.hpp"
#include "design.hpp"
#include "model/work_log.hpp"

namespace colonnade::cycles {

class Bounces {
public:
    explicit Bounces(const Design& design)
        : hasMirrorPipeline_(!design.isSequentialShader), cycles_(design.bounceCycles),
          idleFrom_(design.isSequentialShader ? 1 : glassUnits) {}

    /// A hit comes from the shader, at a cycle that is not before those of other hits.
    void push(Cycle at, int path, const PathStep& surface) { queue_.push(at, {path, &surface}); }
    bool hasPlace() const { return queue_.count() < queuePlaces; }

    /// A hit of this cycle waits for a unit.
    bool isBlocked(Cycle now) const { return queue_.has(now); }

    /// A cycle: returns the path whose bounce is complete, or -1.
    int step(Cycle now) {
        if (queue_.has(now)) take(now, queue_.front());
        for (std::size_t i = 0; i < underWay_.size(); ++i) {
            if (underWay_[i].at > now) continue;
            const int path = underWay_[i].path;
            underWay_.erase(underWay_.begin() + static_cast<std::ptrdiff_t>(i));
            return path;
        }
        return -1;
    }

private:
    struct Hit {
        int path;
        const PathStep* surface;
    };
    struct UnderWay {
        Cycle at;
        int path;
    };

    void take(Cycle now, const Hit& hit) {
        Cycle latency = mirrorPipelineCycles;
        if (hit.surface->material == PathStep::Material::glass || !hasMirrorPipeline_) {
            const auto idle = std::find_if(idleFrom_.begin(), idleFrom_.end(), [&](Cycle from) { return from <= now; });
            if (idle == idleFrom_.end()) return;
            latency = cyclesOf(*hit.surface);
            *idle = now + latency + 1;
        } else if (now % 3 != 2) return;
        underWay_.push_back({now + latency + answerCycles, hit.path});
        queue_.pop();
    }

    Cycle cyclesOf(const PathStep& surface) const {
        if (surface.material == PathStep::Material::mirror) return cycles_.mirror;
        if (!surface.isRefraction) return cycles_.totalReflection;
        return surface.isBehind ? cycles_.glassFromBehind : cycles_.glassFromFront;
    }

    /// BouncePipeline.units; ShadingPipeline.scala: places of its BounceQueue; MirrorPipeline.scala: four intervals of
    /// three cycles, and two to its queue's output.
    static constexpr int glassUnits = 4, queuePlaces = 6;
    static constexpr Cycle mirrorPipelineCycles = 4 * 3 + 2;
    /// BouncePipeline.scala chooses a result, BounceQueue.scala reads what it has stored of the surface, and
    /// BounceScheduler.scala takes it.
    static constexpr Cycle answerCycles = 3;

    bool hasMirrorPipeline_;
    BounceCycles cycles_;
    std::vector<Cycle> idleFrom_;
    Delayed<Hit, 256> queue_;
    std::vector<UnderWay> underWay_;
};

} // namespace colonnade::cycles
