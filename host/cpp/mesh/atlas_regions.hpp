/// The corners and sizes of an atlas's regions: whole tiles, in rows.
#pragma once

#include <utility>

#include "texture.hpp"
#include "topology.hpp"

namespace colonnade::mesh {

using Cell = std::array<std::int64_t, 2>;

/// Edge of a tile, texels.
constexpr std::int64_t atlasTile = 16;

inline std::int64_t tiled(std::int64_t length) { return (length + atlasTile - 1) / atlasTile * atlasTile; }

/// Regions of one scale. Where there is space it is above 1, and small ones are enlarged further, as a tile holds two
/// or four colours.
class AtlasRegions {
public:
    /// `pixels`: of the parts of textures that are shown, width and height; at most as many as tiles. `edge`: of the
    /// atlas, texels.
    AtlasRegions(const std::vector<Pair>& pixels, std::int64_t edge)
        : edge_(edge), sizes_(pixels.size()), corners_(pixels.size()), scale_(fitted(pixels)) {}

    /// Texels for each pixel of a texture that is not enlarged, along an axis.
    double scale() const { return scale_; }
    Cell corner(std::size_t index) const { return corners_[index]; }
    Cell size(std::size_t index) const { return sizes_[index]; }

private:
    /// Regions of fewer pixels along both axes are enlarged further, if the scale of the others stays so large.
    static constexpr double small = 64, least = 0.9;
    /// Scales that are tried first. Above 1 the filter of the texture smooths it, and a tile holds fewer colours.
    static constexpr double scales[] = {16, 8, 4, 2, 1};
    /// Steps in the search for the scale.
    static constexpr int steps = 24;

    /// Places the regions at the largest scale at which they fit, small ones enlarged where that costs the others
    /// little.
    double fitted(std::vector<Pair> pixels) {
        std::vector<bool> isSmall;
        for (const Pair& each : pixels) isSmall.push_back(each[0] <= small && each[1] <= small);
        double scale = placed(pixels);
        const bool hasSmall = std::find(isSmall.begin(), isSmall.end(), true) != isSmall.end();
        for (const double whole : scales) {
            if (!hasSmall) break;
            std::vector<Pair> enlarged = pixels;
            const double gain = std::max(whole / scale, 1.0);
            for (std::size_t i = 0; i < pixels.size(); ++i)
                if (isSmall[i]) enlarged[i] = {pixels[i][0] * gain, pixels[i][1] * gain};
            if (const double found = placed(enlarged); found >= least * scale) {
                pixels = std::move(enlarged);
                scale = found;
                break;
            }
        }
        shelve(pixels, scale);
        return scale;
    }

    /// The largest scale at which regions of so many pixels fit.
    double placed(const std::vector<Pair>& pixels) {
        double low = 0, high = 1;
        for (const double whole : scales)
            if (shelve(pixels, whole)) {
                low = whole;
                high = 2 * whole;
                break;
            }
        for (int step = 0; step < steps && low < scales[0]; ++step) {
            const double middle = (low + high) / 2;
            (shelve(pixels, middle) ? low : high) = middle;
        }
        return low;
    }

    /// Puts the regions into rows, the highest first, at a scale; false if they do not fit.
    bool shelve(const std::vector<Pair>& pixels, double scale) {
        for (std::size_t i = 0; i < pixels.size(); ++i)
            for (int axis = 0; axis < 2; ++axis) {
                const double length = pixels[i][axis] * scale;
                if (length > static_cast<double>(edge_) + 1e-6) return false;
                sizes_[i][axis] =
                    std::clamp<std::int64_t>(static_cast<std::int64_t>(std::ceil(length - 1e-6)), 1, edge_);
            }
        const auto order = sortedIndices(sizes_.size(), [&](std::int64_t a, std::int64_t b) {
            const Cell &one = sizes_[a], &other = sizes_[b];
            return std::pair{tiled(one[1]), tiled(one[0])} > std::pair{tiled(other[1]), tiled(other[0])};
        });
        std::int64_t x = 0, y = 0, shelf = 0;
        for (const std::int64_t index : order) {
            const std::int64_t width = tiled(sizes_[index][0]), height = tiled(sizes_[index][1]);
            if (x + width > edge_) {
                x = 0;
                y += std::exchange(shelf, 0);
            }
            if (y + height > edge_) return false;
            corners_[index] = {x, y};
            x += width;
            shelf = std::max(shelf, height);
        }
        return true;
    }

    std::int64_t edge_;
    std::vector<Cell> sizes_, corners_;
    double scale_;
};

} // namespace colonnade::mesh
