// The environment march: finds where a ray hits the environment (docs/background.md).
#pragma once
#include "ray_clip.hpp"
#include "tile_march.hpp"

namespace colonnade {

class EnvironmentMarch : private TileMarch {
public:
    EnvironmentMarch(const Numbers& numbers, const AttributeImage& image) : TileMarch(numbers, image), n_(numbers) {}

    /// The point hit by a ray from `origin` (grid steps) along `direction` (components of shadeBits bits and a sign).
    EnvironmentPoint findHit(const WideVector& origin, const Vector& direction, const EnvironmentView& view) const {
        const MapRay ray = project(origin, direction, view);
        EnvironmentPoint point{};
        if (ray.isInFront && !marchTiles(ray, view, point)) hitBoundingPlanes(ray, view, point);
        return point;
    }

    /// The point of the maps that a ray from any camera sees; a miss where they show nothing.
    EnvironmentPoint cameraView(const WideVector& origin, const Vector& direction, const EnvironmentView& view) const {
        MapRay ray = projected(origin, direction, view, RayClip::leastExponent(view));
        EnvironmentPoint point{};
        point.work.isFromCamera = true;
        const std::optional<Way> clipped = RayClip(f_, sizes_).clip(ray, view, point.work);
        if (!clipped) return point;
        for (int a = 0; a < 3; ++a)
            ray.from[a] += static_cast<std::int64_t>(inMap(Wide(clipped->mantissa) * ray.dir[a], -clipped->exponent));
        placeInMap(ray, view);
        if (!ray.isInFront || !marchTiles(ray, view, point)) return point;
        const int start = clipped->mantissa == 0 ? RayClip::none : clipped->exponent + ray.fromShift - ray.dirShift;
        const int longer = std::max(start, point.travelExponent) + 1;
        point.travel =
            floorShift(clipped->mantissa, longer - start) + floorShift(point.travel, longer - point.travelExponent);
        point.travelExponent = longer;
        return point;
    }

    /// The point visible to the maps' camera in pixel (x, y) of the frame; `direction` is the pixel's ray's, as in
    /// `findHit`.
    EnvironmentPoint directView(std::int64_t x, std::int64_t y, const Vector& direction,
                                const EnvironmentView& view) const {
        EnvironmentPoint point{};
        Vector position{};
        const std::array<std::int64_t, 2> pixel = {x, y};
        for (int a = 0; a < 2; ++a) position[a] = ((2 * pixel[a] + 1) * view.step[a]) >> stepGuard;
        point.x = static_cast<int>(clamp<std::int64_t>(position[0] >> (f_ - mapLog), 0, sizes_.width - 1));
        point.y = static_cast<int>(clamp<std::int64_t>(position[1] >> (f_ - mapLog), 0, sizes_.height - 1));
        MapRay ray{};
        const std::array<int, 2> size = {sizes_.width, sizes_.height};
        for (int a = 0; a < 2; ++a) {
            // Beyond the map, the offset from its centre wraps as in the RTL's register
            const std::int64_t middle = std::int64_t(size[a]) << (f_ - mapLog - 1);
            ray.position[a] = middle + static_cast<std::int64_t>(wrapped(position[a] - middle, f_ + positionGuard));
        }
        const TileInfo tile = image_.tileAt(point.x, point.y);
        const CellPlane cell = image_.cellAt(tile, point.x, point.y);
        point.isIllegal = cell.isIllegal;
        point.work.cells = tile.count > 1;
        const PlaneDistance depth = planeDistance(ray, image_.planeOf(cell.id), 0);
        const std::int64_t w = std::min(maximum(), -toW(depth.value, depth));
        const Wide dir = times(view.matrix[2], {direction[0], direction[1], direction[2]});
        if (w <= 0 || dir <= 0) {
            EnvironmentPoint miss{};
            miss.isIllegal = cell.isIllegal;
            return miss;
        }
        point.kind = HitKind::map;
        const Normalised fall = normalise(UnsignedWide(dir), f_), rate = normalise(UnsignedWide(w) * fall.mantissa, f_);
        point.travel = reciprocal(rate.mantissa);
        point.travelExponent = 1 + f_ - rate.exponent - fall.exponent + view.exponent;
        return point;
    }

    /// Albedo and normal of a point, the normal rotated to object space.
    EnvironmentTexel texelOf(const EnvironmentPoint& point, const EnvironmentView& view) const {
        const bool isBoundingPlane = point.kind == HitKind::boundingPlane;
        const Rgb12 albedo =
            isBoundingPlane ? image_.boundingPlane(point.entry).albedo : image_.albedoAt(point.x, point.y);
        const Normal12 normal =
            isBoundingPlane ? image_.boundingPlane(point.entry).normal : image_.normalAt(point.x, point.y);
        EnvironmentTexel texel{{albedo.r, albedo.g, albedo.b}, {}, albedo.isIllegal || normal.isIllegal};
        const std::int64_t one = std::int64_t(1) << n_.normalFraction;
        for (int a = 0; a < 3; ++a) {
            const std::int64_t rotated =
                view.rotation[a][0] * normal.x + view.rotation[a][1] * normal.y + view.rotation[a][2] * normal.z;
            texel.normal[a] = clamp<std::int64_t>(nearestEven(rotated, rotationFraction), -one, one - 1);
        }
        return texel;
    }

    /// Position of a hit, grid steps, clamped to half the scene's range, so that an offset and a vector to a light fit.
    WideVector hitPosition(const WideVector& origin, const Vector& direction, const EnvironmentPoint& point) const {
        WideVector result;
        const Wide maximum = largest(n_.sceneBits);
        const WideVector way = wayTo(direction, point);
        for (int a = 0; a < 3; ++a) result[a] = clamp<Wide>(origin[a] + way[a], -(maximum / 2) - 1, maximum / 2);
        return result;
    }

    /// Whether a point of the map hides a hit of the object on the same ray, `distance` grid steps away along the
    /// dominant axis. A point that is in contact with the hit, or with the start of a bounced ray, hides nothing;
    /// neither does one that the camera does not see.
    bool hides(const EnvironmentPoint& point, const Vector& direction, Wide distance, bool isDirectView,
               const EnvironmentView& view) const {
        if (point.kind != HitKind::map || point.isHidden) return false;
        Wide travelled = 0;
        for (const Wide way : wayTo(direction, point)) travelled = std::max(travelled, way < 0 ? ~way : way);
        return travelled + view.occlusionTolerance < distance && (isDirectView || travelled > view.occlusionTolerance);
    }

private:
    static constexpr int stepGuard = 12, rotationFraction = 14;
    /// Integer bits of a position relative to the map's centre.
    static constexpr int positionGuard = 5;

    /// Hits the nearest bounding plane that is in front of the ray's origin and that the ray approaches.
    void hitBoundingPlanes(const MapRay& ray, const EnvironmentView& view, EnvironmentPoint& point) const {
        std::uint64_t bestQuotient = 0;
        int bestExponent = 0;
        for (int i = 0; i < std::min(view.boundingPlanes, sizes_.boundingPlanes); ++i) {
            const PlaneWord& plane = image_.boundingPlane(i).plane;
            const std::int64_t distance = planeDistance(ray, plane, i).value;
            const std::int64_t centreU = std::int64_t(sizes_.width) << (f_ - mapLog - 1),
                               centreV = std::int64_t(sizes_.height) << (f_ - mapLog - 1);
            const auto fromCentre = [&](int axis, std::int64_t centre) {
                return ray.dir[axis] - static_cast<std::int64_t>(floorShift<Wide>(Wide(centre) * ray.dir[2], f_));
            };
            const Wide dir = Wide(plane.a) * fromCentre(0, centreU) + Wide(plane.b) * fromCentre(1, centreV) +
                             Wide(plane.c) * ray.dir[2];
            ++point.work.boundingPlanes;
            if (distance <= 0 || dir <= 0) continue;
            ++point.work.approached;
            const Normalised rate = normalise(magnitude(dir), f_), way = normalise(magnitude(distance), f_);
            const std::uint64_t quotient = divide(rate.mantissa, way.mantissa, f_);
            const int exponent = rate.exponent - way.exponent;
            const Normalised normalised = normalise(quotient, f_ + 1);
            const int length = exponent + normalised.exponent;
            if (bestQuotient == 0 || length > bestExponent ||
                (length == bestExponent && normalised.mantissa > bestQuotient)) {
                bestQuotient = normalised.mantissa;
                bestExponent = length;
                point.entry = i;
                point.kind = HitKind::boundingPlane;
            }
        }
        if (point.kind == HitKind::miss) return;
        // travel = distance / dir · p2
        const Normalised depth = normalise(magnitude(ray.from[2]), f_);
        const Normalised rate = normalise(bestQuotient, f_);
        point.travel = static_cast<std::int64_t>(divide(depth.mantissa, rate.mantissa, f_));
        point.travelExponent = depth.exponent - (bestExponent - f_) - f_ + ray.fromShift - ray.dirShift;
    }

    /// The vector from a ray's origin to a hit, grid steps; each component is clamped to the scene's range.
    WideVector wayTo(const Vector& direction, const EnvironmentPoint& point) const {
        const Wide maximum = largest(n_.sceneBits);
        WideVector way;
        for (int a = 0; a < 3; ++a) {
            const Wide step = Wide(point.travel) * direction[a];
            const Wide whole = point.travelExponent > f_ ? (step < 0   ? -maximum - 1
                                                            : step > 0 ? maximum
                                                                       : 0)
                                                         : floorShift<Wide>(step, -point.travelExponent);
            way[a] = clamp<Wide>(whole, -maximum - 1, maximum);
        }
        return way;
    }

    const Numbers& n_;
};

} // namespace colonnade
