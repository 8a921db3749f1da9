// A model that is not evaluated while it stands still.
#pragma once
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

/// A Verilator model that clocks on both edges.
///
/// If an even number of edges with equal inputs and outputs leaves its whole state as it was, more of them do the same:
/// it sleeps, and only counts edges, until an input changes. It then does the edges that its last period lacked.
/// This is exact, since state and inputs determine the next state. Counters that run freely only lengthen the period.
template <class Model> class Still {
public:
    Model& operator*() { return *model_; }
    Model* operator->() { return model_.get(); }

    bool isStill() const { return isStill_; }

    /// It never sleeps.
    void stayAwake() { isAwake_ = true; }

    /// Call if an input or output has changed since the last edge.
    void changed() { isQuiet_ = false; }

    /// Call before an input changes, which ends the sleep.
    void wake() {
        isQuiet_ = false;
        if (!isStill_) return;
        flip(missed_);
        isStill_ = false;
    }

    /// A clock edge.
    void edge() {
        if (isStill_) {
            if (++missed_ == period_) missed_ = 0;
            return;
        }
        flip(1);
        if (!isQuiet_ || isAwake_) {
            isQuiet_ = true;
            period_ = none;
        } else if (period_ == none) {
            saved_.resize(sizeof *model_->rootp);
            std::memcpy(saved_.data(), model_->rootp, saved_.size());
            period_ = 0;
        } else if (++period_ % 2 == 0) {
            if (isSaved()) {
                isStill_ = true;
                missed_ = 0;
            } else if (period_ >= longest) period_ = none;
        }
    }

    /// Throws if a period of the sleep changes the state.
    void check(const char* name) {
        if (!isStill_) return;
        flip(period_); // from the begin of a period: the missing ones are still to be done
        if (!isSaved())
            throw std::runtime_error(std::string("the simulator let ") + name + " sleep, which does not stand still");
    }

private:
    /// Edges in a period: at most, which catching up may cost; and if none is being looked for.
    static constexpr unsigned longest = 12, none = ~0u;

    void flip(unsigned edges) {
        for (; edges != 0; --edges) {
            model_->clock = !model_->clock;
            model_->eval();
        }
    }

    bool isSaved() const { return std::memcmp(saved_.data(), model_->rootp, saved_.size()) == 0; }

    std::unique_ptr<Model> model_ = std::make_unique<Model>();
    std::vector<unsigned char> saved_;
    bool isStill_ = false, isQuiet_ = false, isAwake_ = false;
    unsigned period_ = none, missed_ = 0;
};
