/// A level of the filter of noise (docs/gather.md, "Denoising"): an edge-stopping a-trous wavelet.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "light_cube.hpp"

namespace colonnade::environment {

/// The surface that pixels show, row by row: positions, normals of the surface and of its shading, where it is seen,
/// and how much of their distance two pixels may lie off a plane.
struct Guide {
    const Vector* position;
    const Vector* planes;
    const Vector* normals;
    const std::uint8_t* mask;
    int width, height;
    double plane;
};

/// Colours, their luminance, its variance, and how much it may differ, of each pixel.
struct NoisyPixels {
    const Vector* colour;
    const double* light;
    const double* variance;
    const double* deviation;
};

struct FilteredPixels {
    std::vector<Vector> colour;
    std::vector<double> variance;
};

/// Means over 5 by 5 pixels that lie `step` apart, by weights of a cubic B-spline and of likeness; 0 outside the mask.
inline FilteredPixels wavelet(const Guide& guide, const NoisyPixels& noisy, int step) {
    constexpr double spline[] = {3.0 / 8, 1.0 / 4, 1.0 / 16};
    const auto dot = [](const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; };
    const std::size_t count = static_cast<std::size_t>(guide.width) * guide.height;
    FilteredPixels found{std::vector<Vector>(count, Vector{}), std::vector<double>(count)};
    for (int y = 0; y < guide.height; ++y)
        for (int x = 0; x < guide.width; ++x) {
            const std::size_t here = static_cast<std::size_t>(y) * guide.width + x;
            if (!guide.mask[here]) continue;
            Vector sum{};
            double weights = 0, squares = 0;
            for (int down = -2; down <= 2; ++down)
                for (int across = -2; across <= 2; ++across) {
                    const int row = y + down * step, column = x + across * step;
                    if (row < 0 || column < 0 || row >= guide.height || column >= guide.width) continue;
                    const std::size_t there = static_cast<std::size_t>(row) * guide.width + column;
                    if (!guide.mask[there]) continue;
                    double weight = spline[std::abs(down)] * spline[std::abs(across)];
                    if (there != here) {
                        Vector way;
                        for (int i = 0; i < 3; ++i) way[i] = guide.position[there][i] - guide.position[here][i];
                        const double off = std::abs(dot(way, guide.planes[here])),
                                     far = guide.plane * std::sqrt(dot(way, way)) + 1e-9;
                        double facing = std::max(0.0, dot(guide.normals[there], guide.normals[here]));
                        for (int square = 0; square < 3; ++square) facing *= facing;
                        if (facing == 0) continue;
                        weight *= facing * std::exp(-off / far - std::abs(noisy.light[there] - noisy.light[here]) /
                                                                     noisy.deviation[here]);
                    }
                    for (int i = 0; i < 3; ++i) sum[i] += weight * noisy.colour[there][i];
                    weights += weight;
                    squares += weight * weight * noisy.variance[there];
                }
            for (int i = 0; i < 3; ++i) found.colour[here][i] = sum[i] / weights;
            found.variance[here] = squares / (weights * weights);
        }
    return found;
}

} // namespace colonnade::environment
