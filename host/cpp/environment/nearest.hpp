/// The nearest known pixel of each pixel: the feature transform of Maurer, Qi and Raghavan, PAMI 2003.
#pragma once

#include <cstdint>
#include <vector>

namespace colonnade::environment {

/// Passes features along one line of pixels. Features are numbers of pixels, or -1; `across` is the line's own
/// coordinate.
class FeatureLine {
public:
    FeatureLine(std::int32_t* features, std::int64_t count, bool isRow, std::int64_t width, std::int64_t across)
        : features_(features), count_(count), stride_(isRow ? 1 : width), isRow_(isRow), width_(width),
          across_(across) {}

    void pass() {
        for (std::int64_t i = 0; i < count_; ++i) {
            const std::int32_t feature = features_[i * stride_];
            if (feature < 0) continue;
            while (kept_.size() > 1 && isHidden(kept_[kept_.size() - 2], kept_.back(), feature)) kept_.pop_back();
            kept_.push_back(feature);
        }
        if (kept_.empty()) return;
        std::size_t nearest = 0;
        for (std::int64_t i = 0; i < count_; ++i) {
            while (nearest + 1 < kept_.size() && squaredTo(kept_[nearest + 1], i) < squaredTo(kept_[nearest], i))
                ++nearest;
            features_[i * stride_] = kept_[nearest];
        }
    }

private:
    std::int64_t along(std::int32_t feature) const { return isRow_ ? feature % width_ : feature / width_; }
    std::int64_t across(std::int32_t feature) const {
        const std::int64_t distance = (isRow_ ? feature / width_ : feature % width_) - across_;
        return distance * distance;
    }
    std::int64_t squaredTo(std::int32_t feature, std::int64_t i) const {
        return (along(feature) - i) * (along(feature) - i) + across(feature);
    }
    /// Whether no pixel of the line is nearer to the feature between two others.
    bool isHidden(std::int32_t before, std::int32_t feature, std::int32_t after) const {
        const std::int64_t a = along(feature) - along(before), b = along(after) - along(feature), c = a + b;
        return c * across(feature) - b * across(before) - a * across(after) - a * b * c > 0;
    }

    std::int32_t* features_;
    std::int64_t count_, stride_;
    bool isRow_;
    std::int64_t width_, across_;
    std::vector<std::int32_t> kept_;
};

/// Numbers of the nearest pixels that are not missing, row by row; -1 if all are.
inline std::vector<std::int32_t> nearestKnown(const std::uint8_t* missing, std::int64_t width, std::int64_t height) {
    std::vector<std::int32_t> features(width * height);
    for (std::size_t i = 0; i < features.size(); ++i) features[i] = missing[i] ? -1 : static_cast<std::int32_t>(i);
    for (std::int64_t x = 0; x < width; ++x) FeatureLine(&features[x], height, false, width, x).pass();
    for (std::int64_t y = 0; y < height; ++y) FeatureLine(&features[y * width], width, true, width, y).pass();
    return features;
}

} // namespace colonnade::environment
