/// The pixels of a picture that faces show, as boxes, and counts of marked pixels in them.
#pragma once

#include <vector>

#include "texture.hpp"

namespace colonnade::mesh {

/// The first and last pixels (x, y); those beyond the picture count on.
struct PixelBox {
    std::int64_t first[2], last[2];

    /// Those that a face shows in a picture of this width and height.
    PixelBox(const Triangle& uvs, const Pair& size) {
        constexpr double near = 1e-4;  // positions so near to the border of a pixel do not show the pixel beyond
        for (int axis = 0; axis < 2; ++axis) {
            const auto [low, high] =
                std::minmax({uvs[0][axis] * size[axis], uvs[1][axis] * size[axis], uvs[2][axis] * size[axis]});
            first[axis] = static_cast<std::int64_t>(std::floor(low + near));
            last[axis] = std::max(first[axis], static_cast<std::int64_t>(std::ceil(high - near)) - 1);
        }
    }
};

/// Counts of the marked pixels of a picture in boxes of any size and place.
class PixelCounts {
public:
    /// `isMarked` of the pixel (x, y) of the picture as it repeats without being mirrored, whose size `size()` is.
    template <class Pixel, class Marks> PixelCounts(const Picture<Pixel>& picture, Marks isMarked)
        : wraps_{picture.wrapU, picture.wrapV}, counts_{picture.width, picture.height},
          size_{picture.width * (picture.wrapU == Wrap::mirror ? 2 : 1),
                picture.height * (picture.wrapV == Wrap::mirror ? 2 : 1)},
          sums_(static_cast<std::size_t>((size_[0] + 1) * (size_[1] + 1))) {
        for (std::int64_t y = 0; y < size_[1]; ++y) {
            std::int32_t row = 0;
            for (std::int64_t x = 0; x < size_[0]; ++x) {
                row += isMarked(x, y) ? 1 : 0;
                sums_[static_cast<std::size_t>((y + 1) * (size_[0] + 1) + x + 1)] = at(x + 1, y) + row;
            }
        }
    }

    /// Marked pixels of a box; those of a clamped border count once.
    std::int64_t within(const PixelBox& box) const {
        std::int64_t low[2], high[2];
        for (int axis = 0; axis < 2; ++axis) {
            low[axis] = box.first[axis];
            high[axis] = box.last[axis] + 1;
            if (wraps_[axis] != Wrap::clamp) continue;
            const bool isEmpty = high[axis] <= low[axis];
            low[axis] = std::clamp<std::int64_t>(low[axis], 0, counts_[axis] - 1);
            high[axis] = isEmpty ? low[axis] : std::clamp(high[axis], low[axis] + 1, counts_[axis]);
        }
        return before(high[0], high[1]) - before(low[0], high[1]) - before(high[0], low[1]) + before(low[0], low[1]);
    }

private:
    std::int32_t at(std::int64_t x, std::int64_t y) const {
        return sums_[static_cast<std::size_t>(y * (size_[0] + 1) + x)];
    }

    /// Marked pixels from 0 to x and y of the repeated picture; signed.
    std::int64_t before(std::int64_t x, std::int64_t y) const {
        const auto [width, height] = size_;
        const std::int64_t restX = (x % width + width) % width, restY = (y % height + height) % height,
                           columns = (x - restX) / width, rows = (y - restY) / height;
        return rows * columns * at(width, height) + rows * at(restX, height) + columns * at(width, restY) +
               at(restX, restY);
    }

    std::array<Wrap, 2> wraps_;
    std::array<std::int64_t, 2> counts_, size_;
    std::vector<std::int32_t> sums_;
};

} // namespace colonnade::mesh
