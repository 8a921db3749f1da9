// ray/RaySetup.scala and SequentialRaySetup.scala: how long a ray takes to the traversal units.
#pragma once
#include <vector>

#include "common.hpp"
#include "design.hpp"
#include "model/work_log.hpp"

namespace colonnade::cycles {

/// ray/RaySetup.scala: a ray a cycle, all stages in step; or SequentialRaySetup.scala: up to three rays, in a
/// normaliser, dividers and the entry.
class RaySetup {
public:
    RaySetup(const Design& design) : design_(design), stages_(static_cast<std::size_t>(design.setupStages), -1) {}

    /// The path whose ray is offered, or -1.
    int offered(Cycle now) const {
        if (!design_.isSequentialSetup) return stages_[last_];
        return entry_.path >= 0 && entry_.hasQuotients && now >= entry_.ends ? entry_.path : -1;
    }

    /// A ray enters if it can. `leaves`: the offered ray is taken.
    bool isReady(Cycle now, bool leaves) const {
        if (!design_.isSequentialSetup) return stages_[last_] < 0 || leaves;
        return normaliser_.path < 0 || isLeft(now, leaves);
    }

    void step(Cycle now, bool leaves, int entering, const PathStep* ray) {
        if (design_.isSequentialSetup) return stepSequential(now, leaves, entering, ray);
        if (stages_[last_] >= 0 && !leaves) return;
        stages_[last_] = entering; // the place of the last stage becomes that of the first
        last_ = last_ == 0 ? stages_.size() - 1 : last_ - 1;
        busy += entering >= 0;
    }

    std::uint64_t busy = 0;

private:
    struct Normaliser {
        int path = -1;
        bool isInBox, hasMantissas, hasRay;
        Cycle settles;
    };
    struct Entry {
        int path = -1;
        bool isInBox, hasQuotients;
        Cycle begins, ends;
    };

    bool divides() const { return divisionEnds_ >= 0; }
    bool isSettled(Cycle now) const { return normaliser_.path >= 0 && now >= normaliser_.settles; }
    bool entryIsOpen(bool leaves) const { return entry_.path < 0 || leaves; }
    bool isLeft(Cycle now, bool leaves) const {
        return isSettled(now) && (!normaliser_.hasMantissas || !divides() || divisionTaken_) &&
               (!normaliser_.hasRay || entryIsOpen(leaves));
    }

    void stepSequential(Cycle now, bool leaves, int entering, const PathStep* ray) {
        busy += entry_.path >= 0;
        const bool settled = isSettled(now), left = isLeft(now, leaves),
                   loads = settled && normaliser_.hasRay && entryIsOpen(leaves),
                   starts = settled && normaliser_.hasMantissas && (!divides() || divisionTaken_);
        const bool isAnswered =
            entry_.path >= 0 && !entry_.hasQuotients && now >= entry_.begins + 3 && divides() && now >= divisionEnds_;
        if (isAnswered) {
            // Behind the quotients, all steps but those before
            entry_.hasQuotients = true;
            entry_.ends = now + (entry_.isInBox ? design_.entryCycles : design_.missCycles) - 4;
        }
        // They leave the dividers a cycle later
        if (divisionTaken_) divisionEnds_ = -1;
        divisionTaken_ = isAnswered;
        if (leaves) entry_.path = -1;
        if (loads) {
            entry_ = {normaliser_.path, normaliser_.isInBox, false, now + 1, 0};
            normaliser_.hasRay = false;
        }
        if (starts) {
            divisionEnds_ = now + design_.quotientCycles;
            normaliser_.hasMantissas = false;
        }
        if (left) normaliser_.path = -1;
        // The axes rotate by one or two steps unless z is dominant: one on average
        if (entering >= 0) normaliser_ = {entering, ray->isInBox, true, true, now + 5};
    }

    const Design& design_;
    std::vector<int> stages_;
    std::size_t last_ = 0;
    Normaliser normaliser_{};
    Entry entry_{};
    Cycle divisionEnds_ = -1;
    bool divisionTaken_ = false;
};

} // namespace colonnade::cycles
