/// What the encoder keeps of a tile: the means of its cells on four levels, and the errors that stay within them.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "kernels.hpp"

namespace colonnade::live {

/// Level l has 2^(l+1) cells on a tile's edge.
constexpr int levels = 4;
constexpr int cellsOf(int level) { return 4 << 2 * level; }
/// An error of 1/256 squared code in a tile of weight 1 << 24 costs 1 << (24 - costShift).
constexpr int costShift = 16;

/// How the bytes of a map become points: code · gain + bias on each axis, 8.4 fixed point.
struct PointSpace {
    std::int16_t gain[3], bias[3];
};

class TileSums {
public:
    /// Reads the pixels of a tile of `size` by `size` pixels; `stride` bytes a row of the map.
    void read(const std::uint8_t* codes, std::size_t stride, int size, const PointSpace& space) {
        finest_ = size >= 16 ? 3 : 2;
        std::int64_t pairs = 0; // squared distances of pixels from the means of 2×2
        if (size <= 16) {
            for (int y = 0; y < size; ++y, codes += stride)
                for (int x = 0; x < size; ++x)
                    for (int a = 0; a < 3; ++a)
                        points_[offset(finest_, a) + y * size + x] =
                            static_cast<std::int16_t>(codes[3 * x + a] * space.gain[a] + space.bias[a]);
        } else { // the finest cells are the means of 2×2 pixels
            for (int y = 0; y < 16; ++y, codes += 2 * stride)
                for (int x = 0; x < 16; ++x)
                    for (int a = 0; a < 3; ++a) {
                        const std::uint8_t* code = codes + 6 * x + a;
                        const auto value = [&](std::size_t at) {
                            return static_cast<std::int16_t>(code[at] * space.gain[a] + space.bias[a]);
                        };
                        const std::int16_t four[4] = {value(0), value(3), value(stride), value(stride + 3)};
                        pairs += halveCells(four, 2, &points_[offset(3, a) + 16 * y + x]);
                    }
        }
        const int pixels = size * size;
        std::int64_t between[levels] = {}; // squared distances of a level's cells from the coarser level's
        std::int16_t mean;
        for (int level = finest_; level >= 0; --level) {
            for (int a = 0; a < 3; ++a)
                between[level] += halveCells(&points_[offset(level, a)], 2 << level,
                                             level > 0 ? &points_[offset(level - 1, a)] : &mean);
            between[level] *= pixels / cellsOf(level);
            sumCells(cells(level), sums_[level].data(), squares_[level]);
        }
        // Detail within 2×2 pixels counts half in cells larger than a pixel
        std::int64_t variance = pairs;
        within_[finest_] = pairs / 2;
        for (int level = finest_; level >= 0; --level) {
            variance += between[level];
            if (level > 0)
                within_[level - 1] =
                    within_[level] + (level == finest_ && size <= 16 ? between[level] / 2 : between[level]);
        }
        variance /= 3 * 256 * pixels;
        weight_ = (1 << 24) / static_cast<std::int32_t>(variance + 150);
        pixels_ = pixels;
    }

    Cells cells(int level) const {
        return {{&points_[offset(level, 0)], &points_[offset(level, 1)], &points_[offset(level, 2)]}, cellsOf(level)};
    }
    Point point(int level, int cell) const {
        return {{points_[offset(level, 0) + cell], points_[offset(level, 1) + cell], points_[offset(level, 2) + cell]}};
    }
    /// Sum of the points of a level, and of their squared lengths.
    const std::array<std::int32_t, 3>& sum(int level) const { return sums_[level]; }
    std::int64_t squares(int level) const { return squares_[level]; }
    /// The error within the cells of a level, which no entry can remove: 1/256 squared code.
    std::int64_t within(int level) const { return within_[level]; }
    int finest() const { return finest_; }
    /// 2^24 / (variance + 150), variance in squared codes.
    std::int32_t weight() const { return weight_; }
    int pixelsOf(int level) const { return pixels_ / cellsOf(level); }
    /// The cost of an error of 1/256 squared code.
    std::int64_t cost(std::int64_t error) const { return error * weight_ >> costShift; }

private:
    static constexpr int offset(int level, int axis) {
        return 3 * (4 * ((1 << 2 * level) - 1) / 3) + axis * cellsOf(level);
    }

    alignas(64) std::int16_t points_[3 * (4 + 16 + 64 + 256)];
    std::array<std::int32_t, 3> sums_[levels];
    std::int64_t squares_[levels], within_[levels];
    std::int32_t weight_;
    int finest_, pixels_;
};

} // namespace colonnade::live
