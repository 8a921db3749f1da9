/// What the alpha of a material shows of a face (docs/textures.md, "Alpha"): all, nothing, a part, or a pane.
///
/// The alpha of corners multiplies that of the picture. Without a picture it is linear on a face.
#pragma once

#include "../environment/nearest.hpp"
#include "pixel_boxes.hpp"
#include "relief.hpp"

namespace colonnade::mesh {

/// A face of the material, or a part of one: where it is, where it is in the picture, and the alpha of its corners.
struct CoveredFace {
    Corners corners;
    Triangle uvs;
    Vector alphas;
};

/// A face of which nothing is opaque, as a pane: its alpha, and the mean colour of its texture by alpha.
struct Pane {
    double alpha;
    Vector colour;
};
static_assert(sizeof(Pane) == 4 * sizeof(double));

/// Answers for the faces of one material.
class Coverage {
public:
    /// `alpha` has one channel, and the size of `colours`; a picture that is not there has no pixels. `factor` of
    /// alpha, which is shown from `cutoff` on.
    Coverage(const Picture<std::uint8_t>& colours, const Picture<std::uint8_t>& alpha, const double* linear,
             double factor, double cutoff)
        : colours_(colours), alpha_(alpha), linear_(linear), factor_(factor), least_(cutoff / std::max(factor, 1e-6)),
          size_{static_cast<double>(alpha.width), static_cast<double>(alpha.height)} {
        if (!hasPicture()) return;
        hidden_.emplace(alpha_, [&](std::int64_t x, std::int64_t y) { return !isOpaque(x, y); });
        visible_.emplace(alpha_, [&](std::int64_t x, std::int64_t y) { return isOpaque(x, y); });
    }

    /// 1 for a face that is shown, -1 for one that is hidden, 0 for others.
    int kindOf(const CoveredFace& face) const {
        const auto share = [&](const std::vector<Vector>& points) {
            std::size_t visible = 0;
            for (const Vector& point : points) visible += excess(face, point) >= 0;
            return visible == points.size() ? 1 : visible == 0 ? -1 : 0;
        };
        if (!hasPicture()) return share({{1, 0, 0}, {0, 1, 0}, {0, 0, 1}});
        if (face.alphas == Vector{1, 1, 1}) {
            const PixelBox box(face.uvs, size_);
            if (!(hidden_->within(box) > 0)) return visible_->within(box) > 0 ? 1 : -1;
            if (!(visible_->within(box) > 0)) return -1;
        }
        // The box of a face is larger than the face: look at its own texels
        const double extent = texels(face.uvs);
        int steps = 2;
        while (steps < maxSteps && steps < extent) steps *= 2;
        return extent <= 2 * steps ? share(trianglePoints(steps)) : 0;
    }

    /// By how much alpha exceeds the cutoff, both without the factor, at a point by the weights of a face's corners.
    double excess(const CoveredFace& face, const Vector& point) const { return alphaAt(face, point) - least_; }

    /// The larger of the width and height of a face in the picture, in texels; 0 without a picture.
    double texels(const Triangle& uvs) const {
        double longest = 0;
        for (int axis = 0; axis < 2 && hasPicture(); ++axis) {
            const auto [low, high] =
                std::minmax({uvs[0][axis] * size_[axis], uvs[1][axis] * size_[axis], uvs[2][axis] * size_[axis]});
            longest = std::max(longest, high - low);
        }
        return longest;
    }

    /// Whether a face shows texels, or points between its corners, that are neither opaque nor invisible.
    bool isBlended(const CoveredFace& face) {
        if (!hasPicture() || face.alphas != Vector{1, 1, 1}) {
            const auto [low, high] =
                std::minmax({face.alphas[0] * factor_, face.alphas[1] * factor_, face.alphas[2] * factor_});
            if (high > 0.01 && low < 0.99) return true;
        }
        if (!hasPicture()) return false;
        if (!blended_)
            blended_.emplace(alpha_, [&](std::int64_t x, std::int64_t y) {
                const double alpha = alphaAt(x, y) * factor_;
                return alpha > 2 && alpha < 253;
            });
        return blended_->within(PixelBox(face.uvs, size_)) > 0;
    }

    /// A face as a pane, whose alpha has this factor.
    Pane paneOf(const CoveredFace& face, double factor) const {
        const std::vector<Vector> points = trianglePoints(4);
        Pane pane{0, {1, 1, 1}};
        Vector sums{};
        for (const Vector& point : points) {
            const double alpha = factor * alphaAt(face, point);
            pane.alpha += alpha;
            if (!colours_.pixels) continue;
            Vector colour;
            colours_.sample(
                weighted(point, face.uvs).data(), [this](std::uint8_t code) { return linear_[code]; }, colour.data());
            for (int channel = 0; channel < 3; ++channel) sums[channel] += colour[channel] * alpha;
        }
        if (colours_.pixels)
            for (int channel = 0; channel < 3; ++channel)
                pane.colour[channel] = sums[channel] / std::max(pane.alpha, 1e-12);
        pane.alpha /= static_cast<double>(points.size());
        return pane;
    }

    /// The texture with the nearest shown colour where it is hidden, so that filters find no other.
    std::vector<std::uint8_t> filled() const {
        std::vector<std::uint8_t> pixels(colours_.pixels, colours_.pixels + 3 * colours_.width * colours_.height),
            missing;
        for (std::int64_t i = 0; i < alpha_.width * alpha_.height; ++i)
            missing.push_back(!(alpha_.pixels[i] >= least_ * 255));
        const std::vector<std::int32_t> nearest =
            environment::nearestKnown(missing.data(), alpha_.width, alpha_.height);
        for (std::size_t i = 0; i < nearest.size(); ++i)
            if (nearest[i] >= 0)
                std::copy_n(colours_.pixels + 3 * nearest[i], 3, pixels.begin() + 3 * static_cast<std::ptrdiff_t>(i));
        return pixels;
    }

private:
    /// Steps of samples along an edge of a face, at most.
    static constexpr int maxSteps = 32;

    bool hasPicture() const { return alpha_.pixels != nullptr; }
    double alphaAt(std::int64_t x, std::int64_t y) const {
        return alpha_
            .pixels[wrapped(y, alpha_.height, alpha_.wrapV) * alpha_.width + wrapped(x, alpha_.width, alpha_.wrapU)];
    }
    bool isOpaque(std::int64_t x, std::int64_t y) const { return alphaAt(x, y) >= least_ * 255; }

    /// Without the factor, at a point by the weights of a face's corners.
    double alphaAt(const CoveredFace& face, const Vector& point) const {
        double alpha = 1;
        if (hasPicture())
            alpha_.sample(weighted(point, face.uvs).data(), [](std::uint8_t code) { return code / 255.0; }, &alpha);
        return alpha * (point[0] * face.alphas[0] + point[1] * face.alphas[1] + point[2] * face.alphas[2]);
    }

    Picture<std::uint8_t> colours_, alpha_;
    const double* linear_;
    double factor_, least_;
    Pair size_;
    std::optional<PixelCounts> hidden_, visible_, blended_;
};

} // namespace colonnade::mesh
