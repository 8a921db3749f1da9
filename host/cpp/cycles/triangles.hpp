// column/TriangleGroup.scala and traversal/TriangleUnit.scala: the triangle units of some rows.
#pragma once
#include "common.hpp"
#include "design.hpp"
#include "model/work_log.hpp"

#include <vector>

namespace colonnade::cycles {

/// A leaf on its way through a triangle unit.
struct Candidate {
    std::int8_t row, context;
    std::uint8_t triangles, crossed;
};

/// A result that ends a record.
struct RecordEnd {
    std::int8_t row = -1, context = -1;
};

/// One triangle unit, slot by slot.
class TriangleUnit {
public:
    explicit TriangleUnit(const Design& design)
        : divisionCycles_(design.divisionSteps + 1), waitsForIssue_(design.extraSlices) {}

    bool isOpen() const { return isOpen_; }
    bool isBusy() const { return step_ != Step::idle; }

    /// The result that is offered in this cycle, if any.
    bool offers() const { return !pending_.isEmpty() && (!pending_.front().crossesTriangle || hit_ == Hit::offering); }
    struct Pending {
        std::int8_t row, context;
        bool isLast, crossesTriangle;
    };
    const Pending& offered() const { return pending_.front(); }

    /// A cycle. `isTaken`: the result that is offered leaves; `candidate` comes, if any. Returns whether it takes a
    /// candidate in the next cycle.
    bool step(Cycle now, bool isTaken, const Candidate* candidate) {
        // Distances
        if (hit_ != Hit::none || isDividing_ || hasNumerator_ || hasWeights_) {
            const bool hitLeaves = isTaken && pending_.front().crossesTriangle;
            const bool collects = isDividing_ && now >= divisionEnd_ && (hit_ == Hit::none || hitLeaves);
            const bool divides = hasNumerator_ && now >= numeratorEnd_ && !isDividing_;
            const bool weighed = hasWeights_ && now >= weightsEnd_ && (!hasNumerator_ || divides);
            if (hit_ == Hit::adding) hit_ = Hit::offering;
            if (hitLeaves) hit_ = Hit::none;
            if (collects) {
                hit_ = Hit::adding;
                isDividing_ = false;
            }
            if (divides) {
                isDividing_ = true;
                divisionEnd_ = now + divisionCycles_;
                hasNumerator_ = false;
            }
            if (weighed) {
                hasNumerator_ = true;
                numeratorEnd_ = now + 7;
                hasWeights_ = false;
            }
        }

        // Decisions
        bool advances = true;
        const bool pendingIsFull = pending_.count() == 8;
        if (isTaken) pending_.pop();
        if (!decisions_.isEmpty() && decisions_.front().due == slots_) {
            const Decision& decision = decisions_.front();
            if (pendingIsFull || (decision.crossesTriangle && hasWeights_)) advances = false;
            else {
                if (decision.crossesTriangle) {
                    hasWeights_ = true;
                    weightsEnd_ = now + 7;
                }
                pending_.push({decision.row, decision.context, decision.isLast, decision.crossesTriangle});
                decisions_.pop();
            }
        }

        // Slots
        const Step was = step_;
        const bool issues = was == Step::last && !isLoaded_;
        const bool ends = waitsForIssue_ ? issues : was == Step::gap && advances;
        const bool readyNext = ends || (!hasRecord_ && !isOpen_);
        if (issues) {
            const Candidate& c = current_;
            // A decision follows the last vertex by so many moves of the pipeline
            if (c.triangles == 2) decisions_.push({slots_ + 4, c.row, c.context, false, (c.crossed & 1) != 0});
            decisions_.push({slots_ + 6, c.row, c.context, true, (c.crossed >> (c.triangles - 1) & 1) != 0});
        }
        if (was == Step::idle) {
            if (candidate) step_ = Step::first;
        } else if (advances) {
            switch (was) {
            case Step::first: step_ = Step::second; break;
            case Step::second: step_ = current_.triangles == 2 ? Step::third : Step::gap; break;
            case Step::third: step_ = Step::gap; break;
            case Step::gap: step_ = Step::last; break;
            default: step_ = (!issues && hasRecord_) || candidate ? Step::first : Step::idle;
            }
        }
        isLoaded_ = was == Step::last && !advances;
        if (issues) hasRecord_ = false;
        if (candidate) {
            current_ = *candidate;
            hasRecord_ = true;
        }
        isOpen_ = readyNext;
        slots_ += advances;
        return readyNext;
    }

private:
    enum class Step : std::uint8_t { idle, first, second, third, gap, last };
    enum class Hit : std::uint8_t { none, adding, offering };
    struct Decision {
        std::int64_t due;
        std::int8_t row, context;
        bool isLast, crossesTriangle;
    };

    int divisionCycles_;
    bool waitsForIssue_;
    Step step_ = Step::idle;
    Hit hit_ = Hit::none;
    bool isOpen_ = false, hasRecord_ = false, isLoaded_ = false, hasWeights_ = false, hasNumerator_ = false,
         isDividing_ = false;
    Cycle weightsEnd_ = 0, numeratorEnd_ = 0, divisionEnd_ = 0;
    std::int64_t slots_ = 0; // moves of the pipeline
    Candidate current_{};
    Ring<Decision, 8> decisions_;
    Ring<Pending, 8> pending_;
};

/// The triangle units of a group of rows, with its arbiter.
class TriangleGroup {
public:
    TriangleGroup(const Design& design, int rows) : rows_(rows), isShared_(design.sharesTriangles()) {
        for (int i = 0; i < design.triangleLanes; ++i) units_.emplace_back(design);
    }

    /// A cycle. `candidate` comes in it, or null; `waits`: by row, whether a record waits. Returns the record whose
    /// last result its row takes.
    RecordEnd step(Cycle now, const Candidate* candidate, std::uint32_t waits) {
        // Results: one is taken, and a group passes it on in the next cycle
        RecordEnd end;
        if (isShared_ && hasResult_ && result_.isLast) end = {result_.row, result_.context};
        std::uint32_t offers = 0, open = 0;
        for (std::size_t i = 0; i < units_.size(); ++i) {
            offers |= static_cast<std::uint32_t>(units_[i].offers()) << i;
            open |= static_cast<std::uint32_t>(units_[i].isOpen()) << i;
        }
        const int taken = results_.grant(offers);
        hasResult_ = taken >= 0;
        if (hasResult_) {
            results_.take(taken);
            ++tests;
            result_ = units_[static_cast<std::size_t>(taken)].offered();
            if (!isShared_ && result_.isLast) end = {result_.row, result_.context};
        }

        // Dispatch the record that is queued, or else the one that comes
        const bool hasPlace = static_cast<int>(hasQueued_) + static_cast<int>(isSent_) < 1 + static_cast<int>(moves_);
        const Candidate* const item = hasQueued_ ? &queued_ : candidate;
        const int to = item ? dispatch_.grant(open) : -1;
        const Candidate sent = to >= 0 ? *item : Candidate{};
        if (to >= 0) dispatch_.take(to);
        if (hasQueued_ && to >= 0) hasQueued_ = false;
        if (candidate && (item != candidate || to < 0)) {
            queued_ = *candidate;
            hasQueued_ = true;
        }
        bool readyNext = false;
        for (std::size_t i = 0; i < units_.size(); ++i) {
            busy += units_[i].isBusy();
            readyNext |= units_[i].step(now, static_cast<int>(i) == taken, static_cast<int>(i) == to ? &sent : nullptr);
        }

        // Choose a row for the next cycle (column/TriangleGroup.scala)
        if (!isShared_) {
            grantedRow_ = readyNext ? 0 : -1;
            return end;
        }
        grantedRow_ = hasPlace ? chosen_ : -1;
        isSent_ = grantedRow_ >= 0;
        if (hasPlace || chosen_ < 0) {
            chosen_ = rowArbiter_.grant(grantedRow_ >= 0 ? waits & ~(1u << grantedRow_) : waits);
            if (chosen_ >= 0) rowArbiter_.take(chosen_);
        }
        moves_ = readyNext;
        return end;
    }

    /// The row of the group that may grant a record in this cycle, after `step`; -1: none.
    int grantedRow() const { return grantedRow_; }

    int rows() const { return rows_; }
    std::uint64_t tests = 0, busy = 0;

private:
    int rows_;
    bool isShared_;
    std::vector<TriangleUnit> units_;
    RoundRobin rowArbiter_, dispatch_, results_;
    int chosen_ = -1, grantedRow_ = -1;
    bool isSent_ = false, moves_ = false, hasQueued_ = false, hasResult_ = false;
    Candidate queued_{};
    TriangleUnit::Pending result_{};
};

} // namespace colonnade::cycles
