// Rays and planes in map space, where both are linear (docs/background.md).
#pragma once
#include "attributes.hpp"
#include "environment_view.hpp"

namespace colonnade {

/// Geometry in map space for maps of given sizes; positions have shadeBits fraction bits.
class MapGeometry {
public:
    /// Log2 of the unit of u and v, pixels.
    static constexpr int mapLog = 10;

protected:
    /// Signed distance in w between a ray and a plane: value + slope · s, in units of 2^(exponent − 22); positive in
    /// front of the plane.
    struct PlaneDistance {
        int id;
        std::int64_t value, slope;
        int exponent;
    };

    static constexpr int planeFraction = 22;
    MapGeometry(const Numbers& numbers, const AttributeSizes& sizes)
        : f_(numbers.shadeBits), sceneBits_(numbers.sceneBits), sizes_(sizes) {}

    /// The largest position, and the largest distance along a ray.
    std::int64_t maximum() const { return (std::int64_t(1) << (f_ + 3)) - 1; }

    /// Dot product modulo 2^128, which only the widest formats exceed.
    static Wide times(const Vector& row, const WideVector& v) {
        UnsignedWide sum = 0;
        for (int i = 0; i < 3; ++i) sum += UnsignedWide(Wide(row[i])) * UnsignedWide(v[i]);
        return Wide(sum);
    }

    /// Projects a ray. If its origin is behind the camera, only `from` and `dir` are valid.
    MapRay project(const WideVector& origin, const Vector& direction, const EnvironmentView& view) const {
        MapRay ray = projected(origin, direction, view, 0);
        placeInMap(ray, view);
        return ray;
    }

    /// Matrix products; `least` is the least exponent of the origin's block.
    MapRay projected(const WideVector& origin, const Vector& direction, const EnvironmentView& view, int least) const {
        MapRay ray{};
        WideVector from, dir;
        for (int i = 0; i < 3; ++i) {
            const Wide offset = shiftLeft<Wide>(view.offset[i], std::min(view.offsetShift, sceneBits_));
            from[i] = Wide(UnsignedWide(times(view.matrix[i], origin)) + UnsignedWide(offset));
            dir[i] = times(view.matrix[i], {direction[0], direction[1], direction[2]});
        }
        ray.fromShift = blockScale(from, f_, ray.from, least);
        ray.dirShift = blockScale(dir, f_, ray.dir);
        return ray;
    }

    /// Completes a ray from its projection: its position and direction in the map.
    void placeInMap(MapRay& ray, const EnvironmentView& view) const {
        ray.isInFront = ray.from[2] > 0;
        if (!ray.isInFront) return;

        // 1 / p2 = inverse · 2^(1 - f - length)
        const Normalised depth = normalise(UnsignedWide(ray.from[2]), f_);
        const auto inverse = reciprocal(depth.mantissa);
        for (int i = 0; i < 2; ++i) ray.position[i] = inMap(Wide(ray.from[i]) * inverse, depth.exponent - 1);
        ray.position[2] = inMap(inverse, depth.exponent - 1 + ray.fromShift - view.exponent);

        WideVector way;
        for (int i = 0; i < 2; ++i) way[i] = shiftLeft<Wide>(ray.dir[i], f_) - Wide(ray.position[i]) * ray.dir[2];
        way[2] = -Wide(ray.position[2]) * ray.dir[2];
        ray.directionShift = blockScale(way, f_, ray.direction);
    }

    /// value / 2^drop, saturated to the range of map positions. |value| must be below 2^64.
    std::int64_t inMap(Wide value, int drop) const {
        const Wide nearest = value < 0 ? -maximum() - 1 : maximum();
        return static_cast<std::int64_t>(
            drop < -32 && value != 0 ? nearest : clamp<Wide>(floorShift<Wide>(value, drop), -maximum() - 1, maximum()));
    }

    /// 2^(2f - 1) / mantissa for a normalised mantissa of f bits; the result has f + 1 bits.
    std::int64_t reciprocal(std::uint64_t mantissa) const {
        return static_cast<std::int64_t>(divide(std::uint64_t(1) << (f_ - 1), mantissa, f_));
    }

    /// A component of the ray's position at s.
    std::int64_t positionAt(const MapRay& ray, int axis, std::int64_t s) const {
        return ray.position[axis] + (ray.direction[axis] * s >> f_);
    }

    PlaneDistance planeDistance(const MapRay& ray, const PlaneWord& plane, int id) const {
        const std::int64_t du = ray.position[0] - (std::int64_t(sizes_.width) << (f_ - mapLog - 1)),
                           dv = ray.position[1] - (std::int64_t(sizes_.height) << (f_ - mapLog - 1));
        const int up = planeFraction - f_ - plane.e;
        return {id, floorShift<std::int64_t>(ray.position[2], -up) - ((plane.a * du + plane.b * dv) >> f_) - plane.c,
                floorShift<std::int64_t>(ray.direction[2], -up) -
                    ((plane.a * ray.direction[0] + plane.b * ray.direction[1]) >> f_),
                plane.e};
    }

    /// Distance of the ray from a plane at s.
    std::int64_t distanceAt(const PlaneDistance& depth, std::int64_t s) const {
        return depth.value + (depth.slope * s >> f_);
    }

    /// Converts a distance to w's units.
    std::int64_t toW(std::int64_t value, const PlaneDistance& depth) const {
        return floorShift<std::int64_t>(value, planeFraction - f_ - depth.exponent);
    }

    int f_, sceneBits_;
    const AttributeSizes& sizes_;
};

} // namespace colonnade
