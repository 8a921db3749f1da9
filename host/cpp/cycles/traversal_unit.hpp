// unit/TraversalUnit.scala: rays in contexts, box unit and stack, with the records that they visit as the model found
// them.
#pragma once
#include "record_fetch.hpp"
#include "triangles.hpp"

namespace colonnade::cycles {

class TraversalUnit {
public:
    TraversalUnit(const Design& design, const FrameWork& work, int row)
        : design_(design), work_(work), fetch(design, row, design.contexts, design.recordBuffers),
          queueDepth_((4 + (design.extraSlices ? 1 : 0) + 2 + 2 * design.boxBeats() - 1) / design.boxBeats()),
          latency_(5 + (design.extraSlices ? 1 : 0) + design.boxBeats()), all_((1u << design.contexts) - 1) {}

    bool isFree() const { return used_ != all_; }
    bool isIdle() const { return used_ == 0 && fetch.isIdle(); }

    /// The record that comes to the triangle units in this cycle, if any.
    const Candidate* candidate() const {
        return grant_.context >= 0 && grant_.kind == RecordKind::leaf ? &candidate_ : nullptr;
    }

    /// A ray comes from the bus: the context of its path, and its step.
    struct Arrival {
        int path = -1;
        std::uint32_t step = 0;
    };

    /// A cycle. `ray`: that arrives, if any; `tested`: the context whose leaf has its last result, or -1;
    /// `mayGrantLeaf`: the group lets this row grant.
    void step(Cycle now, const Broadcasts& broadcasts, const Arrival& ray, int tested, bool mayGrantLeaf) {
        if (used_ == 0 && ray.path < 0 && fetch.isIdle()) {
            isTaken_ = false;
            return;
        }
        std::uint32_t ends = 0;
        contextsBox += static_cast<std::uint64_t>(inBox_);
        contextsTriangles += static_cast<std::uint64_t>(inTriangles_);

        // Results of rays: read in one cycle, and in a queue in the next
        std::uint32_t freed = 0;
        if (resultContext_ >= 0) {
            freed = 1u << resultContext_;
            queued_ = owners_[static_cast<std::size_t>(resultContext_)];
            hasQueued_ = true;
            resultContext_ = -1;
        } else if (ended_ && !hasQueued_ && !isTaken_) {
            resultContext_ = __builtin_ctz(ended_);
            ended_ &= ended_ - 1;
        }
        isTaken_ = false;

        // A shadow ray that is occluded ends a cycle after its last result
        if (occluded_ >= 0) ends |= 1u << occluded_;
        occluded_ = -1;

        // The box unit takes the node that was granted
        const bool takesNode = grant_.context >= 0 && grant_.kind == RecordKind::node;
        inTriangles_ += candidate() != nullptr;
        waitUnit += grant_.context >= 0;
        if (takesNode) {
            ++nodes;
            ++inBox_;
            beatsLeft_ = design_.boxBeats();
            boxes_.push({now + latency_, static_cast<std::int8_t>(grant_.context)});
        }
        busyBox += beatsLeft_ > 0;
        if (beatsLeft_ > 0) --beatsLeft_;

        // The stack
        int stepped = -1, done = -1;
        bool popsAgain = false;
        if (secondLeft_ > 0) {
            popsAgain = --secondLeft_ > 0;
            if (!popsAgain) (endsRay_ ? done : stepped) = operation_;
        }
        const bool hasResult = !boxes_.isEmpty() && boxes_.front().ready <= now, hasResume = !resumes_.isEmpty();
        if (!popsAgain && (hasResult || hasResume)) {
            const bool isResult = hasResult && (!hasResume || resumedLast_ || pushesDone_ != 0);
            const int context = isResult ? boxes_.front().context : resumes_.front();
            const RecordVisit& visit = at(context);
            const int count = isResult ? visit.children : 0;
            const bool isLastPush = pushesDone_ + 2 >= count;
            if (count <= 1 || isLastPush) {
                pushesDone_ = 0;
                resumedLast_ = !isResult;
                operation_ = context;
                endsRay_ = next_[static_cast<std::size_t>(context)] + 1 == last_[static_cast<std::size_t>(context)];
                // A pop reads an entry, and another one for each that is dropped
                secondLeft_ = count > 0 ? 1 : endsRay_ ? std::max<int>(1, visit.dropped) : visit.dropped + 1;
                if (isResult) boxes_.pop();
                else resumes_.pop();
            } else ++pushesDone_;
        }
        if (done >= 0) ends |= 1u << done;
        inBox_ -= done >= 0 || stepped >= 0;

        // A leaf is tested
        if (tested >= 0) {
            const auto context = static_cast<std::size_t>(tested);
            --inTriangles_;
            if (isShadow_ >> tested & 1 && next_[context] + 1 == last_[context] && work_.steps[steps_[context]].isHit)
                occluded_ = tested;
            else {
                ++inBox_;
                resumes_.push(static_cast<std::int8_t>(tested));
            }
        }

        // Records
        const bool nodesReady = beatsLeft_ == 0 && static_cast<int>(boxes_.count()) != queueDepth_;
        waitRecord += static_cast<std::uint64_t>(__builtin_popcount(fetch.pending()));
        waitUnit += static_cast<std::uint64_t>(__builtin_popcount(fetch.ready()));
        grant_ = fetch.step(broadcasts, design_.banks, {nodesReady, mayGrantLeaf, false});
        if (grant_.context >= 0 && grant_.kind == RecordKind::leaf) {
            const RecordVisit& visit = at(grant_.context);
            candidate_ = {0, static_cast<std::int8_t>(grant_.context), visit.triangles, visit.crossed};
        }

        // New fetches
        if (stepped >= 0) {
            ++next_[static_cast<std::size_t>(stepped)];
            begin(stepped);
        }
        if (ray.path >= 0) {
            const int context = __builtin_ctz(~used_);
            const PathStep& step = work_.steps[ray.step];
            used_ |= 1u << context;
            const auto i = static_cast<std::size_t>(context);
            owners_[i] = ray.path, steps_[i] = ray.step;
            next_[i] = step.first, last_[i] = step.first + step.count;
            isShadow_ = (isShadow_ & ~(1u << context)) | static_cast<std::uint32_t>(step.isShadow) << context;
            if (step.count == 0) ends |= 1u << context; // its root is illegal
            else begin(context);
        }
        ended_ |= ends;
        used_ &= ~freed;
    }

    /// The path whose result waits for the bus.
    bool hasResult() const { return hasQueued_; }
    int result() const { return queued_; }
    void takeResult() {
        hasQueued_ = false;
        isTaken_ = true;
    }

private:
    const Design& design_;
    const FrameWork& work_;

public:
    RecordFetch fetch;
    std::uint64_t nodes = 0, busyBox = 0, waitRecord = 0, waitUnit = 0, contextsBox = 0, contextsTriangles = 0;

private:
    const RecordVisit& at(int context) const { return work_.visits[next_[static_cast<std::size_t>(context)]]; }

    void begin(int context) {
        const RecordVisit& visit = at(context);
        fetch.begin(context, visit.triangles ? RecordKind::leaf : RecordKind::node, visit.address);
    }

    struct Tested {
        Cycle ready;
        std::int8_t context;
    };

    int queueDepth_, latency_;
    std::uint32_t all_, used_ = 0, ended_ = 0, isShadow_ = 0;
    std::array<int, 16> owners_{};
    std::array<std::uint32_t, 16> steps_{}, next_{}, last_{};
    RecordFetch::Grant grant_;
    Candidate candidate_{};
    Ring<Tested, 16> boxes_;
    Ring<std::int8_t, 16> resumes_;
    int inBox_ = 0, inTriangles_ = 0, beatsLeft_ = 0, secondLeft_ = 0, operation_ = -1, pushesDone_ = 0,
        resultContext_ = -1, occluded_ = -1, queued_ = -1;
    bool endsRay_ = false, resumedLast_ = false, hasQueued_ = false, isTaken_ = false;
};

} // namespace colonnade::cycles
