/// The atlas: the parts of textures that faces show, in one square picture for the texture memory (docs/textures.md).
#pragma once

#include <map>
#include <optional>
#include <tuple>
#include <utility>

#include "../environment/nearest.hpp"
#include "atlas_regions.hpp"
#include "texture.hpp"

namespace colonnade::mesh {

/// What the faces of a material show: a texture times a colour.
struct Paint {
    std::int32_t texture;  ///< -1: none
    Vector factor;
    bool operator<(const Paint& other) const {
        return std::tie(texture, factor) < std::tie(other.texture, other.factor);
    }
};

struct Atlas {
    std::vector<Vector> colours;  ///< linear, row by row
    std::vector<Triangle> uvs;    ///< texels from the upper left corner, of each face; 0 on faces without a texture
    double scale;                 ///< texels for each pixel of a texture that is not enlarged, along an axis
};

/// Each paint has a region: the part of its texture that faces use, with repeats, resampled. Regions begin at tiles and
/// share one scale; where there is space it is above 1, and small ones are enlarged further, as a tile holds two or
/// four colours.
class AtlasMaker {
public:
    AtlasMaker(std::vector<Picture<std::uint8_t>> textures, const double* linear, std::int64_t edge)
        : textures_(std::move(textures)), linear_(linear), edge_(edge) {}

    /// `faces`: positions of the corners; `paints` of each face. Nothing if there are more paints than tiles.
    std::optional<Atlas> make(const std::vector<Triangle>& faces, const std::vector<Paint>& paints) {
        std::map<Paint, std::size_t> numbers;
        for (std::size_t i = 0; i < faces.size(); ++i) {
            if (paints[i].texture < 0) continue;
            const auto [found, isNew] = numbers.emplace(paints[i], regions_.size());
            if (isNew) regions_.push_back({paints[i]});
            regions_[found->second].faces.push_back(i);
        }
        const std::int64_t tiles = edge_ / atlasTile;
        if (static_cast<std::int64_t>(regions_.size()) > tiles * tiles) return std::nullopt;
        for (Region& region : regions_) unwrap(region, faces);
        std::vector<Pair> pixels;
        for (const Region& region : regions_) pixels.push_back(pixelsOf(region));
        AtlasRegions packing(pixels, edge_);
        Atlas atlas{std::vector<Vector>(edge_ * edge_), std::vector<Triangle>(faces.size()), packing.scale()};
        for (std::size_t i = 0; i < regions_.size(); ++i) {
            regions_[i].corner = packing.corner(i);
            regions_[i].size = packing.size(i);
        }
        std::vector<std::uint8_t> isHidden(edge_ * edge_, 1);
        for (const Region& region : regions_) {
            paint(region, atlas.colours);
            for (std::size_t i = 0; i < region.faces.size(); ++i) {
                Triangle& uvs = atlas.uvs[region.faces[i]];
                for (int corner = 0; corner < 3; ++corner)
                    for (int axis = 0; axis < 2; ++axis) {
                        const double share = (region.unwrapped[i][corner][axis] - region.low[axis]) /
                                             (region.high[axis] - region.low[axis]);
                        uvs[corner][axis] =
                            static_cast<double>(region.corner[axis]) + share * static_cast<double>(region.size[axis]);
                    }
                show(uvs, isHidden);
            }
        }
        simplify(isHidden, atlas.colours);
        return atlas;
    }

private:
    struct Region {
        Paint paint;
        std::vector<std::size_t> faces{};
        std::vector<Triangle> unwrapped{};
        Pair low{}, high{};  ///< the part of the texture
        Cell corner{}, size{};  ///< texels
    };

    /// Samples of the texture along each axis of a texel, at most; texels around faces that count as shown, as
    /// positions are rounded.
    static constexpr int maxSamples = 8, margin = 1;

    /// Moves positions by whole periods, so that they cover a small part.
    void unwrap(Region& region, const std::vector<Triangle>& faces) const {
        const Picture<std::uint8_t>& texture = textures_[region.paint.texture];
        for (const std::size_t face : region.faces) region.unwrapped.push_back(faces[face]);
        for (int axis = 0; axis < 2; ++axis) {
            const Wrap wrap = axis == 0 ? texture.wrapU : texture.wrapV;
            const double period = wrap == Wrap::mirror ? 2 : 1;
            const auto lowOf = [axis](const Triangle& face) {
                return std::min({face[0][axis], face[1][axis], face[2][axis]});
            };
            double least = HUGE_VAL;
            for (const Triangle& face : region.unwrapped) least = std::min(least, lowOf(face));
            // All faces by one shift, or each by its own
            double extent[2];
            const auto shifted = [&](double at, double low) { return at - period * std::floor(low / period); };
            for (const bool isOwn : {false, true}) {
                double low = HUGE_VAL, high = -HUGE_VAL;
                for (const Triangle& face : region.unwrapped)
                    for (const Pair& corner : face) {
                        const double at = shifted(corner[axis], isOwn ? lowOf(face) : least);
                        low = std::min(low, at);
                        high = std::max(high, at);
                    }
                extent[isOwn] = high - low;
            }
            double low = HUGE_VAL, high = -HUGE_VAL;
            for (Triangle& face : region.unwrapped) {
                const double own = extent[true] < extent[false] ? lowOf(face) : least;
                for (Pair& corner : face) {
                    if (wrap != Wrap::clamp) corner[axis] = shifted(corner[axis], own);
                    low = std::min(low, corner[axis]);
                    high = std::max(high, corner[axis]);
                }
            }
            region.low[axis] = low;
            region.high[axis] = std::max(high, low + 1.0 / static_cast<double>(sizeOf(texture)[axis]));
        }
    }

    static Cell sizeOf(const Picture<std::uint8_t>& texture) { return {texture.width, texture.height}; }

    /// Pixels of a texture that a region shows.
    Pair pixelsOf(const Region& region) const {
        const Cell size = sizeOf(textures_[region.paint.texture]);
        return {(region.high[0] - region.low[0]) * static_cast<double>(size[0]),
                (region.high[1] - region.low[1]) * static_cast<double>(size[1])};
    }

    /// Paints the tiles of a region: means of samples of the texture, and beyond its last column and row these.
    void paint(const Region& region, std::vector<Vector>& colours) const {
        const Picture<std::uint8_t>& texture = textures_[region.paint.texture];
        const Pair pixels = pixelsOf(region);
        const auto [width, height] = region.size;
        const double ratio = std::max(pixels[0] / static_cast<double>(width), pixels[1] / static_cast<double>(height));
        const int samples = std::clamp(static_cast<int>(std::ceil(ratio)), 1, maxSamples);
        const auto along = [&](std::int64_t texel, int sample, int axis) {
            const double at = (static_cast<double>(texel * samples + sample) + 0.5) / samples /
                              static_cast<double>(region.size[axis]);
            return region.low[axis] + at * (region.high[axis] - region.low[axis]);
        };
        for (std::int64_t y = 0; y < tiled(height); ++y)
            for (std::int64_t x = 0; x < tiled(width); ++x) {
                Vector& colour = colours[(region.corner[1] + y) * edge_ + region.corner[0] + x];
                if (x >= width || y >= height) {
                    colour = colours[(region.corner[1] + std::min(y, height - 1)) * edge_ + region.corner[0] +
                                     std::min(x, width - 1)];
                    continue;
                }
                for (int down = 0; down < samples; ++down)
                    for (int right = 0; right < samples; ++right) {
                        const double uv[] = {along(x, right, 0), along(y, down, 1)};
                        double found[3];
                        texture.sample(uv, [this](std::uint8_t code) { return linear_[code]; }, found);
                        for (int channel = 0; channel < 3; ++channel) colour[channel] += found[channel];
                    }
                for (int channel = 0; channel < 3; ++channel)
                    colour[channel] = colour[channel] / (samples * samples) * region.paint.factor[channel];
            }
    }

    /// Marks the texels that a face touches, with a margin.
    void show(const Triangle& face, std::vector<std::uint8_t>& isHidden) const {
        const auto texel = [this](double at) {
            return std::clamp<std::int64_t>(static_cast<std::int64_t>(std::floor(at)), 0, edge_ - 1);
        };
        const double top = std::min({face[0][1], face[1][1], face[2][1]}),
                     bottom = std::max({face[0][1], face[1][1], face[2][1]});
        for (std::int64_t row = texel(top); row <= texel(bottom); ++row) {
            // The part of each edge within the row
            double left = HUGE_VAL, right = -HUGE_VAL;
            for (int i = 0; i < 3; ++i) {
                Pair from = face[i], to = face[(i + 1) % 3];
                if (from[1] > to[1]) std::swap(from, to);
                const double first = std::max(from[1], static_cast<double>(row)),
                             last = std::min(to[1], static_cast<double>(row + 1));
                if (first > last) continue;
                for (const double y : {first, last}) {
                    const double share = to[1] > from[1] ? (y - from[1]) / (to[1] - from[1]) : 0;
                    const double x = from[0] + share * (to[0] - from[0]);
                    left = std::min({left, x, to[1] > from[1] ? x : to[0]});
                    right = std::max({right, x, to[1] > from[1] ? x : to[0]});
                }
            }
            if (left > right) continue;
            for (std::int64_t y = std::max<std::int64_t>(row - margin, 0); y <= std::min(row + margin, edge_ - 1);
                 ++y) {
                const std::int64_t start = std::max<std::int64_t>(texel(left) - margin, 0),
                                   end = std::min(texel(right) + margin, edge_ - 1);
                std::fill(isHidden.begin() + y * edge_ + start, isHidden.begin() + y * edge_ + end + 1, 0);
            }
        }
    }

    /// Simple colours where no face shows them, so that the encoder spends no bytes there: that of the nearest texel
    /// that one shows; in tiles without any the mean.
    void simplify(const std::vector<std::uint8_t>& isHidden, std::vector<Vector>& colours) const {
        const std::vector<std::int32_t> nearest = environment::nearestKnown(isHidden.data(), edge_, edge_);
        Vector mean{};
        double count = 0;
        const std::int64_t across = edge_ / atlasTile;
        std::vector<bool> isUsed(across * across);
        const auto tileOf = [&](std::int64_t i) { return i / edge_ / atlasTile * across + i % edge_ / atlasTile; };
        const std::vector<Vector> before = colours;
        for (std::int64_t i = 0; i < edge_ * edge_; ++i)
            if (!isHidden[i]) {
                for (int channel = 0; channel < 3; ++channel) mean[channel] += before[i][channel];
                ++count;
                isUsed[tileOf(i)] = true;
            }
        for (double& channel : mean) channel /= count;
        for (std::int64_t i = 0; i < edge_ * edge_; ++i) colours[i] = isUsed[tileOf(i)] ? before[nearest[i]] : mean;
    }

    std::vector<Picture<std::uint8_t>> textures_;
    const double* linear_;
    std::int64_t edge_;
    std::vector<Region> regions_;
};

} // namespace colonnade::mesh
