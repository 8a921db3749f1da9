/// Faces that show one colour of their texture: the colour moves to their corners, and they leave the texture.
///
/// Swatch maps paint models so: each face lies in one texel. Corner colours are exact and take no texture memory.
#pragma once

#include "pixel_boxes.hpp"
#include "relief.hpp"

namespace colonnade::mesh {

class Swatches {
public:
    /// `linear`: values of the codes of a texture's pixels.
    Swatches(const Picture<std::uint8_t>& texture, const double* linear)
        : texture_(texture), linear_(linear),
          size_{static_cast<double>(texture.width), static_cast<double>(texture.height)},
          changes_{changes(1, 0), changes(0, 1)} {}

    /// The linear colours at the corners of a face; nothing if it shows several.
    std::optional<Corners> colours(const Triangle& uvs) const {
        PixelBox box(uvs, size_);
        const std::int64_t width = box.last[0] - box.first[0], height = box.last[1] - box.first[1];
        if (!isEqual(box.first[0], box.first[1], box.last[0], box.last[1])) return {};
        for (int axis = 0; axis < 2; ++axis) {
            PixelBox inner = box;
            --inner.last[axis];
            if (changes_[axis].within(inner) != 0) return {};
        }
        Corners found;
        const std::uint8_t* pixel = pixelAt(box.first[0], box.first[1]);
        const auto valueOf = [this](std::uint8_t code) { return linear_[code]; };
        for (int corner = 0; corner < 3; ++corner)
            // Within a texel the filter of the texture may still blend it with its neighbours
            if (width == 0 && height == 0) texture_.sample(uvs[corner].data(), valueOf, found[corner].data());
            else
                for (int channel = 0; channel < 3; ++channel) found[corner][channel] = valueOf(pixel[channel]);
        return found;
    }

private:
    const std::uint8_t* pixelAt(std::int64_t x, std::int64_t y) const {
        return texture_.pixels + 3 * (wrapped(y, texture_.height, texture_.wrapV) * texture_.width +
                                      wrapped(x, texture_.width, texture_.wrapU));
    }
    bool isEqual(std::int64_t x, std::int64_t y, std::int64_t otherX, std::int64_t otherY) const {
        const std::uint8_t *one = pixelAt(x, y), *other = pixelAt(otherX, otherY);
        return std::equal(one, one + 3, other);
    }
    PixelCounts changes(int right, int down) const {
        return {texture_, [&](std::int64_t x, std::int64_t y) { return !isEqual(x, y, x + right, y + down); }};
    }

    const Picture<std::uint8_t> texture_;
    const double* linear_;
    Pair size_;
    PixelCounts changes_[2];
};

} // namespace colonnade::mesh
