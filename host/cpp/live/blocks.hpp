/// Blocks of 4×4 pixels: each with the plane that fits it, and how flat it is.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "kernels.hpp"
#include "planes.hpp"

namespace colonnade::live {

/// The mean of w times 16, its slopes (of 2^-34 a half pixel), its error against this plane, and the errors of a unit
/// of w.
struct Block {
    std::int32_t sum, alongX, alongY, residual, metres;
    std::int64_t slopeX, slopeY;
};

/// Depth of a frame: w of each pixel, and the blocks. The picture is whole tiles of 16 pixels.
class DepthBlocks {
public:
    DepthBlocks(int width, int height, int columns, int rows)
        : width_(width), height_(height), stride_(16 * columns), lines_(16 * rows),
          depth_(static_cast<std::size_t>(stride_) * lines_), w_(depth_.size()), lengths_(depth_.size()),
          blocks_(static_cast<std::size_t>(4 * columns) * 4 * rows) {}

    void read(const std::uint32_t* depth, const Camera& camera) {
        if (camera.fx != fx_ || camera.fy != fy_ || camera.cx != cx_ || camera.cy != cy_) measureRays(camera);
        std::uint32_t least = largestDepth;
        for (std::size_t i = 0; i < depth_.size(); ++i) {
            const std::uint32_t z = depth[i] < leastDepth     ? leastDepth
                                    : depth[i] > largestDepth ? largestDepth
                                                              : depth[i];
            depth_[i] = z;
            least = z < least ? z : least;
        }
        unitLog_ = 6;
        while (std::uint32_t{2} << unitLog_ <= least) ++unitLog_;
        for (int y = 0; y < lines_; ++y)
            inverseDepth(&depth_[offset(0, y)], stride_, std::uint32_t{1} << unitLog_, &w_[offset(0, y)]);
        for (int y = 0; y < blockRows(); ++y)
            for (int x = 0; x < blockColumns(); ++x) fit(x, y);
    }

    int blockColumns() const { return stride_ / 4; }
    int blockRows() const { return lines_ / 4; }
    int count() const { return static_cast<int>(blocks_.size()); }
    const Block& operator[](int block) const { return blocks_[block]; }
    /// Twice the distance of a block's centre from the picture's centre.
    std::int64_t xOf(int block) const { return 8 * (block % blockColumns()) + 4 - width_; }
    std::int64_t yOf(int block) const { return 8 * (block / blockColumns()) + 4 - height_; }

    /// Depth of w = 1: a power of two, at most the least depth.
    double unit() const { return std::ldexp(1.0, unitLog_ - 16); }

    /// The plane through a block's pixels.
    Plane planeOf(int block) const {
        const Block& b = blocks_[block];
        Plane plane{b.slopeX, b.slopeY, 0};
        plane.c = (static_cast<std::int64_t>(b.sum) << (planeBits - wBits - 4)) - plane.at(xOf(block), yOf(block));
        return plane;
    }

    /// By how much a block is off a plane: at its corner that is off most, steps of 2^-17 m.
    std::int64_t error(int block, const Plane& plane) const {
        const Block& b = blocks_[block];
        const std::int64_t middle =
            std::abs(plane.at(xOf(block), yOf(block)) - (static_cast<std::int64_t>(b.sum) << (planeBits - wBits - 4)));
        const std::int64_t slopes = std::abs(plane.a - b.slopeX) + std::abs(plane.b - b.slopeY);
        return std::min<std::int64_t>((middle + 4 * slopes) >> (planeBits - wBits), 1 << 28) * b.metres >> 14;
    }

    void add(PlaneSums& sums, int block) const {
        const Block& b = blocks_[block];
        const std::int64_t x = xOf(block), y = yOf(block);
        sums.n += 16;
        sums.x += 16 * x;
        sums.y += 16 * y;
        sums.xx += 16 * x * x + 80;
        sums.xy += 16 * x * y;
        sums.yy += 16 * y * y + 80;
        sums.w += b.sum;
        sums.xw += x * b.sum + b.alongX;
        sums.yw += y * b.sum + b.alongY;
        sums.blocks += 1;
    }

    /// w, error scales and caps of a tile's 256 pixels.
    void tile(int column, int row, std::int32_t* w, std::int32_t* metres, std::int32_t* cap) const {
        for (int y = 0; y < 16; ++y) {
            const std::size_t at = offset(16 * column, 16 * row + y);
            std::copy_n(&w_[at], 16, w + 16 * y);
            errorScales(&depth_[at], &lengths_[at], 16, scaleShift(), metres + 16 * y, cap + 16 * y);
        }
    }
    /// The distance along the view ray from a pixel's surface to one at another w, steps of 2^-17 m: z · |1 - w z /
    /// unit| / w.
    std::int32_t rayError(int x, int y, std::int32_t w) const {
        const std::size_t at = offset(x, y);
        if (w <= 0) return INT32_MAX;
        const std::int64_t difference = std::abs(w - w_[at]), along = difference * depth_[at] / w;
        return static_cast<std::int32_t>(std::min<std::int64_t>(
            (std::min<std::int64_t>(along, INT32_MAX) * lengths_[at]) >> (8 + 16 - errorBits), INT32_MAX));
    }
    int width() const { return width_; }
    int height() const { return height_; }

private:
    std::size_t offset(int x, int y) const { return static_cast<std::size_t>(y) * stride_ + x; }
    /// z² (2^-16 m²) times a ray's length (2^-8), by the unit, in steps of 2^-9 m.
    int scaleShift() const { return 16 + 8 - 9 + unitLog_ - 16; }

    /// Lengths of the rays to all pixels with z = 1: elementary operations alone, and a correctly rounded root.
    void measureRays(const Camera& camera) {
        fx_ = camera.fx;
        fy_ = camera.fy;
        cx_ = camera.cx;
        cy_ = camera.cy;
        for (int y = 0; y < lines_; ++y)
            for (int x = 0; x < stride_; ++x) {
                const double u = (x + 0.5 - cx_) / fx_, v = (y + 0.5 - cy_) / fy_;
                const double across = u * u, down = v * v;
                lengths_[offset(x, y)] =
                    static_cast<std::uint16_t>(std::min(65535.0, 256 * std::sqrt(1 + across + down) + 0.5));
            }
    }

    void fit(int column, int row) {
        const std::int32_t* first = &w_[offset(4 * column, 4 * row)];
        std::int32_t sum = 0, alongX = 0, alongY = 0;
        for (int y = 0; y < 4; ++y)
            for (int x = 0; x < 4; ++x) {
                const std::int32_t value = first[static_cast<std::size_t>(y) * stride_ + x];
                sum += value;
                alongX += (2 * x - 3) * value;
                alongY += (2 * y - 3) * value;
            }
        std::int64_t residual = 0;
        for (int y = 0; y < 4; ++y)
            for (int x = 0; x < 4; ++x) { // 80 times the distance from the plane
                const std::int32_t on = 5 * sum + (2 * x - 3) * alongX + (2 * y - 3) * alongY;
                residual +=
                    std::abs(80 * static_cast<std::int64_t>(first[static_cast<std::size_t>(y) * stride_ + x]) - on);
            }
        Block& block = blocks_[static_cast<std::size_t>(row) * blockColumns() + column];
        const std::size_t centre = offset(4 * column + 2, 4 * row + 2);
        std::int32_t cap;
        errorScales(&depth_[centre], &lengths_[centre], 1, scaleShift(), &block.metres, &cap);
        block.sum = sum;
        block.alongX = alongX;
        block.alongY = alongY;
        block.slopeX = static_cast<std::int64_t>(alongX) * (1 << (planeBits - wBits)) / 80;
        block.slopeY = static_cast<std::int64_t>(alongY) * (1 << (planeBits - wBits)) / 80;
        block.residual =
            static_cast<std::int32_t>(std::min<std::int64_t>(residual / 1280 * block.metres >> 14, INT32_MAX));
    }

    int width_, height_, stride_, lines_;
    double fx_ = 0, fy_ = 0, cx_ = 0, cy_ = 0;
    std::vector<std::uint32_t> depth_;
    std::vector<std::int32_t> w_;
    std::vector<std::uint16_t> lengths_;
    std::vector<Block> blocks_;
    int unitLog_ = 16;
};

} // namespace colonnade::live
