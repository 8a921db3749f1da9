/// Samples of pictures at texture coordinates (host/colonnade/mesh/materials/texture.py), summed in a fixed order.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace colonnade::mesh {

/// A position (u, v), or a size: to the right and down.
using Pair = std::array<double, 2>;
/// Positions (u, v) of the corners of a face.
using Triangle = std::array<Pair, 3>;

/// What lies beyond a picture.
enum class Wrap { repeat, mirror, clamp };

/// A pixel of a row of so many, for one that may lie beyond it.
inline std::int64_t wrapped(std::int64_t index, std::int64_t count, Wrap wrap) {
    if (index >= 0 && index < count) return index;
    if (wrap == Wrap::clamp) return index < 0 ? 0 : count - 1;
    const std::int64_t period = wrap == Wrap::mirror ? 2 * count : count;
    std::int64_t folded = index % period;
    if (folded < 0) folded += period;
    return folded < count ? folded : 2 * count - 1 - folded;
}

/// The two pixels between whose centres a position lies along an axis, and the weight of each.
struct Taps {
    std::int64_t pixels[2];
    double weights[2];

    Taps(double at, std::int64_t count, Wrap wrap, double centre) {
        at = at * static_cast<double>(count) - centre;
        const double low = std::floor(at);
        // Positions that are no numbers have a pixel, too
        const std::int64_t index = std::fabs(low) < 1e15 ? static_cast<std::int64_t>(low) : 0;
        pixels[0] = wrapped(index, count, wrap);
        pixels[1] = wrapped(index + 1, count, wrap);
        weights[1] = at - low;
        weights[0] = 1 - weights[1];
    }
};

/// A picture of rows of pixels.
template <class Pixel> struct Picture {
    const Pixel* pixels;
    std::int64_t height, width, channels;
    Wrap wrapU, wrapV;
    bool isNearest;

    /// The value at a position (u, v): bilinear between the centres of pixels, or that of the pixel there.
    template <class Value> void sample(const double* uv, Value valueOf, double* out) const {
        const double centre = isNearest ? 0.0 : 0.5;
        const Taps across(uv[0], width, wrapU, centre), down(uv[1], height, wrapV, centre);
        std::fill(out, out + channels, 0.0);
        for (int x = 0; x < (isNearest ? 1 : 2); ++x)
            for (int y = 0; y < (isNearest ? 1 : 2); ++y) {
                const Pixel* pixel = pixels + (down.pixels[y] * width + across.pixels[x]) * channels;
                const double weight = isNearest ? 1.0 : across.weights[x] * down.weights[y];
                for (std::int64_t channel = 0; channel < channels; ++channel)
                    out[channel] += weight * valueOf(pixel[channel]);
            }
    }

    /// The mean on a face with positions of its corners, of ten points.
    template <class Value> void mean(const double* uvs, Value valueOf, double* out) const {
        constexpr int points = 4;
        double value[4], count = 0;
        std::fill(out, out + channels, 0.0);
        for (int i = 0; i < points; ++i)
            for (int j = 0; i + j < points; ++j, ++count) {
                const double a = (i + 1.0 / 3) / points, b = (j + 1.0 / 3) / points, c = 1 - a - b;
                const double at[] = {a * uvs[0] + b * uvs[2] + c * uvs[4], a * uvs[1] + b * uvs[3] + c * uvs[5]};
                sample(at, valueOf, value);
                for (std::int64_t channel = 0; channel < channels; ++channel) out[channel] += value[channel];
            }
        for (std::int64_t channel = 0; channel < channels; ++channel) out[channel] /= count;
    }
};

} // namespace colonnade::mesh
