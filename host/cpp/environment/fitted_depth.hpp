/// Depth of a part of a photo, in the size of maps.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace colonnade::environment {

/// The part of a photo that maps show: its first pixel, and pixels of the photo per pixel of the maps.
struct PhotoPart {
    double left, top, scale;
    int photoWidth, photoHeight;
};

/// Depth of the whole photo, metres, row by row; what is not positive and finite is a hole.
class PhotoDepth {
public:
    PhotoDepth(const double* values, int width, int height) : values_(values), width_(width), height_(height) {}

    /// Depth of a part at the pixels of maps of this size. A hole is 0.
    std::vector<double> fitted(const PhotoPart& part, int width, int height) const {
        std::vector<double> result;
        result.reserve(static_cast<std::size_t>(width) * height);
        const double across = static_cast<double>(width_) / part.photoWidth,
                     down = static_cast<double>(height_) / part.photoHeight;
        for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x)
                result.push_back(at(std::clamp((part.left + (x + 0.5) * part.scale) * across - 0.5, 0.0, width_ - 1.0),
                                    std::clamp((part.top + (y + 0.5) * part.scale) * down - 0.5, 0.0, height_ - 1.0)));
        return result;
    }

private:
    /// Neighbouring samples that differ by more than this share lie on different surfaces.
    static constexpr double sameSurface = 0.05;

    double sample(int x, int y) const {
        return values_[static_cast<std::size_t>(std::min(y, height_ - 1)) * width_ + std::min(x, width_ - 1)];
    }

    /// On one surface linear in inverse depth, as planes are, else the nearest sample.
    double at(double u, double v) const {
        const int x = static_cast<int>(u), y = static_cast<int>(v);
        const double s = u - x, t = v - y;
        const std::array<double, 4> corners{sample(x, y), sample(x + 1, y), sample(x, y + 1), sample(x + 1, y + 1)};
        const std::array<double, 4> weights{(1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t};
        const auto [least, most] = std::minmax_element(corners.begin(), corners.end());
        if (!std::all_of(corners.begin(), corners.end(), isDepth) || *most > *least * (1 + sameSurface)) {
            const double nearest = sample(static_cast<int>(std::nearbyint(u)), static_cast<int>(std::nearbyint(v)));
            return isDepth(nearest) ? nearest : 0;
        }
        double inverse = 0;
        for (std::size_t i = 0; i < corners.size(); ++i) inverse += 1 / corners[i] * weights[i];
        return 1 / inverse;
    }
    static bool isDepth(double value) { return value > 0 && std::isfinite(value); }

    const double* values_;
    int width_, height_;
};

} // namespace colonnade::environment
