// The start of a camera's ray in the frustum of the maps (docs/march.md, "Any camera").
#pragma once
#include <optional>

#include "map_geometry.hpp"

namespace colonnade {

/// A length: mantissa · 2^exponent directions.
struct Way {
    std::int64_t mantissa;
    int exponent;
};

/// Clips a projected ray to the maps' frustum: its near plane, where w is 1, and planes through the camera a quarter
/// of a pixel within the maps' edges.
class RayClip {
public:
    /// Stands for the exponent of no way.
    static constexpr int none = -1024;

    RayClip(int f, const AttributeSizes& sizes) : f_(f), sizes_(sizes) {}

    /// The least exponent of a block that also holds the depth of the near plane.
    static int leastExponent(const EnvironmentView& view) { return clamp(view.exponent + 1, 0, 255); }

    /// The way from the origin, in ray.dir, to the last plane that the ray enters through; 0 · 2^none if the origin is
    /// inside, nothing if the ray stays outside a plane. `work` counts the planes that the origin is outside of.
    std::optional<Way> clip(const MapRay& ray, const EnvironmentView& view, MarchWork& work) const {
        const std::int64_t near = floorShift(std::int64_t(1) << f_, ray.fromShift + f_ - view.exponent);
        Way best{0, none};
        for (int i = 0; i < 5; ++i) {
            const int axis = i == 0 ? 2 : (i - 1) / 2, size = axis == 0 ? sizes_.width : sizes_.height;
            const bool isHigh = i == 2 || i == 4;
            const std::int64_t limit = i == 0   ? 0
                                       : isHigh ? (std::int64_t(size) << insetLog) - 1
                                                : 1,
                               from = ray.from[axis] - (i == 0 ? near : 0);
            const std::int64_t outside = distance(from, ray.from[2] * limit, isHigh);
            if (outside <= 0) continue;
            ++work.outside;
            const std::int64_t rate = -distance(ray.dir[axis], ray.dir[2] * limit, isHigh);
            if (rate <= 0) return std::nullopt;
            const Normalised way = normalise(magnitude(outside), f_), speed = normalise(magnitude(rate), f_);
            const Normalised quotient = normalise(divide(way.mantissa, speed.mantissa, f_), f_ + 1);
            const int exponent = way.exponent - speed.exponent + quotient.exponent - 2 * f_ - 1;
            const auto mantissa = static_cast<std::int64_t>(quotient.mantissa);
            if (exponent > best.exponent || (exponent == best.exponent && mantissa > best.mantissa))
                best = {mantissa, exponent};
        }
        return best;
    }

private:
    /// Log2 of the planes within a pixel.
    static constexpr int insetLog = 2;

    /// How far a position is outside a plane, in 2^-12 of its units.
    static std::int64_t distance(std::int64_t position, std::int64_t limit, bool isHigh) {
        const std::int64_t inside = limit - position * (std::int64_t(1) << (MapGeometry::mapLog + insetLog));
        return isHigh ? -inside : inside;
    }

    int f_;
    const AttributeSizes& sizes_;
};

} // namespace colonnade
