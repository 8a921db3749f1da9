// ray/RayGenerator.scala: the rays of pixels, one after the other.
#pragma once
#include "common.hpp"
#include "design.hpp"

namespace colonnade::cycles {

/// ray/RayGenerator.scala: how many cycles a pixel takes behind the one before it.
class RayGenerator {
public:
    RayGenerator(const Design& design)
        : topBit_(design.coordinateBits), tileSize_(static_cast<unsigned>(design.tileSize)) {}

    bool isReady(bool rayLeaves) const { return !inFront_ || moves(rayLeaves); }
    bool hasRay() const { return inBack_; }
    int ray() const { return back_; }

    void step(bool rayLeaves, bool accepts, int path, unsigned x, unsigned y, bool inObjectTile) {
        const bool sums = inFront_ && (!inBack_ || rayLeaves), moved = moves(rayLeaves), wasBusy = inFront_ || inBack_;
        if (sums) --left_;
        if (rayLeaves) inBack_ = false;
        if (moved) {
            inBack_ = true;
            back_ = front_;
            inFront_ = false;
        }
        const bool isNew = empty_ == emptyCycles;
        if (wasBusy) empty_ = 0;
        else if (!isNew) ++empty_;
        if (!accepts) return;
        inFront_ = true;
        front_ = path;
        if (isNew) last_[0].isKnown = last_[1].isKnown = false;
        Last& last = last_[inObjectTile];
        const unsigned tile = y / tileSize_ << 16 | x / tileSize_;
        const int code = morton(x % tileSize_, y % tileSize_), behind = code - last.code;
        left_ = last.isKnown && last.tile == tile && behind > 0 && behind <= topBit_ + 1 ? behind : topBit_ + 1;
        last = {true, tile, code};
    }

    static int morton(unsigned x, unsigned y) {
        int code = 0;
        for (int bit = 0; bit < 8; ++bit)
            code |= static_cast<int>((x >> bit & 1) << (2 * bit) | (y >> bit & 1) << (2 * bit + 1));
        return code;
    }

private:
    struct Last {
        bool isKnown;
        unsigned tile;
        int code;
    };

    bool moves(bool rayLeaves) const { return inFront_ && (!inBack_ || rayLeaves) && left_ == 1; }

    static constexpr int emptyCycles = 8; // without a pixel: then the camera may be another one

    int topBit_, empty_ = emptyCycles;
    unsigned tileSize_;
    bool inFront_ = false, inBack_ = false;
    int front_ = -1, back_ = -1, left_ = 0;
    Last last_[2] = {};
};

} // namespace colonnade::cycles
