// Background: which point of the room does a ray meet? docs/background.md.
#pragma once
#include "map_geometry.hpp"

namespace colonnade {

class Background : private MapGeometry {
public:
    /// Steps of a march at most: then the ray meets the shell.
    static constexpr int maxSteps = 128;

    Background(const Numbers& numbers, const AttributeImage& image) : MapGeometry(numbers, image.sizes()), n_(numbers), image_(image) {}

    /// The point of the room that a ray from `origin` (grid steps) along `direction` (components of shadeBits bits and a sign) meets.
    EnvironmentPoint meet(const WideVector& origin, const Vector& direction, const EnvironmentView& view) const {
        const MapRay ray = project(origin, direction, view);
        EnvironmentPoint point{};
        if (ray.isInFront && !march(ray, view, point)) meetBoundingPlanes(ray, view, point);
        return point;
    }

    /// The point that the map's own camera sees in pixel (x, y) of the frame; `direction` is that of the pixel's ray, as for `meet`.
    EnvironmentPoint seen(std::int64_t x, std::int64_t y, const Vector& direction, const EnvironmentView& view) const {
        EnvironmentPoint point{};
        Vector place{};
        const std::array<std::int64_t, 2> pixel = {x, y};
        for (int a = 0; a < 2; ++a) place[a] = ((2 * pixel[a] + 1) * view.step[a]) >> stepGuard;
        point.x = static_cast<int>(clamp<std::int64_t>(place[0] >> (f_ - mapLog), 0, sizes_.width - 1));
        point.y = static_cast<int>(clamp<std::int64_t>(place[1] >> (f_ - mapLog), 0, sizes_.height - 1));
        MapRay ray{};
        const std::array<int, 2> size = {sizes_.width, sizes_.height};
        for (int a = 0; a < 2; ++a) {
            // Beyond the map its place from the middle is kept modulo what a register holds
            const std::int64_t middle = std::int64_t(size[a]) << (f_ - mapLog - 1);
            ray.position[a] = middle + static_cast<std::int64_t>(wrapped(place[a] - middle, f_ + placeGuard));
        }
        const CellPlane cell = image_.cellAt(point.x, point.y);
        point.isIllegal = cell.isIllegal;
        const Depth depth = depthOf(ray, image_.planeOf(cell.id), 0);
        const std::int64_t w = std::min(maximum(), -inW(depth.value, depth));
        const Wide dir = times(view.matrix[2], {direction[0], direction[1], direction[2]});
        if (w <= 0 || dir <= 0) {
            EnvironmentPoint nothing{};
            nothing.isIllegal = cell.isIllegal;
            return nothing;
        }
        point.kind = EnvironmentPoint::Kind::map;
        const Normalised fall = normalise(UnsignedWide(dir), f_), speed = normalise(UnsignedWide(w) * fall.mantissa, f_);
        point.travel = reciprocal(speed.mantissa);
        point.travelExponent = 1 + f_ - speed.exponent - fall.exponent + view.exponent;
        return point;
    }

    /// Albedo and normal of a point.
    EnvironmentTexel texelOf(const EnvironmentPoint& point, const EnvironmentView& view) const {
        const bool isBoundingPlane = point.kind == EnvironmentPoint::Kind::boundingPlane;
        const Rgb12 albedo = isBoundingPlane ? image_.boundingPlane(point.entry).albedo : image_.albedoAt(point.x, point.y);
        const Normal12 normal = isBoundingPlane ? image_.boundingPlane(point.entry).normal : image_.normalAt(point.x, point.y);
        EnvironmentTexel texel{{albedo.r, albedo.g, albedo.b}, {}, albedo.isIllegal || normal.isIllegal};
        const std::int64_t one = std::int64_t(1) << n_.normalFraction;
        for (int a = 0; a < 3; ++a) {
            const std::int64_t turned = view.rotation[a][0] * normal.x + view.rotation[a][1] * normal.y + view.rotation[a][2] * normal.z;
            texel.normal[a] = clamp<std::int64_t>(nearestEven(turned, rotationFraction), -one, one - 1);
        }
        return texel;
    }

    /// Where a ray has met the room, grid steps; at most half as far as a scene reaches, so that there is room for an offset and for the way to a light.
    WideVector reached(const WideVector& origin, const Vector& direction, const EnvironmentPoint& point) const {
        WideVector result;
        const Wide maximum = largest(n_.sceneBits);
        for (int a = 0; a < 3; ++a) {
            const Wide step = Wide(point.travel) * direction[a];
            const Wide way = point.travelExponent > f_ ? (step < 0 ? -maximum - 1 : step > 0 ? maximum : 0) : floorShift<Wide>(step, -point.travelExponent);
            result[a] = clamp<Wide>(origin[a] + clamp<Wide>(way, -maximum - 1, maximum), -(maximum / 2) - 1, maximum / 2);
        }
        return result;
    }

private:
    static constexpr int stepGuard = 12, rotationFraction = 14;
    /// Bits of a place from the map's middle beyond its fraction.
    static constexpr int placeGuard = 5;
    /// More bits of a distance along the ray while it is summed up.
    static constexpr int guardBits = 8;
    /// A ray that is less than this share of w behind a surface is on it, log2.
    static constexpr int nearLog = 5;

    /// A march so far. The ray is in front of what the camera sees, or behind it.
    struct March {
        bool isBehind;
        /// The last plane that the ray was in front of, if there was one, and its last pixel.
        bool hasPlane;
        Depth plane;
        int x, y;
        /// Where the ray has met something.
        std::int64_t hit;
    };

    /// The ray goes from s0 to s1 above a plane, over pixel (x, y) first; true if it meets it, or the last plane that it was in front of.
    bool pass(const MapRay& ray, const Depth& depth, std::int64_t s0, std::int64_t s1, int x, int y, March& march) const {
        const std::int64_t enters = at(depth, s0), leaves = at(depth, s1);
        if (!march.isBehind && (enters < 0 || leaves < 0)) {
            // Hardly behind when it comes above the plane: that is an edge, or a start on the surface
            const bool isNear = -inW(enters, depth) < along(ray, 2, s0) >> nearLog, isSame = march.hasPlane && march.plane.id == depth.id;
            if (enters >= 0 || isNear || isSame) {
                march.hit = enters < 0 ? s0 : crossing(depth, s0, s1);
                march.x = x;
                march.y = y;
                return true;
            }
            march.isBehind = true;
        }
        if (march.isBehind) {
            if (march.hasPlane && at(march.plane, s1) < 0) {
                march.hit = crossing(march.plane, s0, s1);
                return true;
            }
            if (leaves < 0) return false;
            march.isBehind = false;
        }
        march.hasPlane = true;
        march.plane = depth;
        march.x = x;
        march.y = y;
        return false;
    }

    /// Where a depth becomes negative.
    std::int64_t crossing(const Depth& depth, std::int64_t s0, std::int64_t s1) const {
        if (depth.slope >= 0 || depth.value <= 0) return s0;
        const Normalised above = normalise(magnitude(depth.value), f_), fall = normalise(magnitude(depth.slope), f_);
        const Wide s = floorShift<Wide>(divide(above.mantissa, fall.mantissa, f_), -(above.exponent - fall.exponent));
        return static_cast<std::int64_t>(clamp<Wide>(s, s0, s1));
    }

    /// Boundaries that a ray crosses on one axis of the map.
    struct Axis {
        bool moves, isNegative;
        std::int64_t next, tile; // the next tile's boundary and how far apart they are, along the ray, with guard bits
    };

    Axis axisOf(const MapRay& ray, int axis, int pixel) const {
        Axis result{ray.direction[axis] != 0, ray.direction[axis] < 0, farthest(), farthest()};
        if (!result.moves) return result;
        const Normalised speed = normalise(magnitude(ray.direction[axis]), f_);
        const std::int64_t inverse = reciprocal(speed.mantissa), low = (std::int64_t(pixel) >> sizes_.tileLog << sizes_.tileLog) << (f_ - mapLog);
        const std::int64_t width = std::int64_t(1) << (f_ - mapLog + sizes_.tileLog);
        const std::int64_t way = result.isNegative ? ray.position[axis] - low : low + width - ray.position[axis];
        const auto far = [&](std::int64_t length) { return static_cast<std::int64_t>(std::min<Wide>(farthest(), floorShift<Wide>(Wide(length) * inverse << guardBits, speed.exponent - 1))); };
        result.next = far(way);
        result.tile = far(width);
        return result;
    }

    std::int64_t farthest() const { return (maximum() << guardBits) | ((std::int64_t(1) << guardBits) - 1); }

    bool march(const MapRay& ray, const EnvironmentView& view, EnvironmentPoint& point) const {
        const int toPixel = f_ - mapLog;
        std::array<int, 2> pixel = {static_cast<int>(ray.position[0] >> toPixel), static_cast<int>(ray.position[1] >> toPixel)};
        if (!sizes_.covers(pixel[0], pixel[1])) return false;
        std::array<Axis, 2> axes = {axisOf(ray, 0, pixel[0]), axisOf(ray, 1, pixel[1])};
        std::array<int, 2> tile = {pixel[0] >> sizes_.tileLog, pixel[1] >> sizes_.tileLog};
        March state{};
        std::int64_t begin = 0;
        while (true) {
            const std::int64_t end = std::min({axes[0].next, axes[1].next, farthest()});
            const std::int64_t s0 = begin >> guardBits, s1 = end >> guardBits;
            const TileInfo info = image_.tileAt(tile[0] << sizes_.tileLog, tile[1] << sizes_.tileLog);
            point.isIllegal = point.isIllegal || info.isIllegal;
            std::array<Depth, 4> depths;
            for (int i = 0; i < info.count; ++i) depths[i] = depthOf(ray, image_.planeOf(info.ids[i]), info.ids[i]);

            // A tile of several planes is passed at once if the ray is in front of all of them
            int least = 0;
            bool isClear = !state.isBehind;
            for (int i = 0; i < info.count; ++i) {
                isClear = isClear && at(depths[i], s0) >= 0 && at(depths[i], s1) >= 0;
                if (inW(at(depths[i], s1), depths[i]) < inW(at(depths[least], s1), depths[least])) least = i;
            }
            if (info.count == 1 || isClear) {
                const auto [x, y] = pixelAt(ray, tile, info.count == 1 ? s0 : s1);
                ++point.steps;
                if (pass(ray, depths[least], s0, s1, x, y, state)) return hit(ray, view, state, point);
            } else if (throughCells(ray, info, depths, tile, axes, begin, end, state, point)) {
                return hit(ray, view, state, point);
            }
            if (point.steps >= maxSteps || end >= farthest() || along(ray, 2, s1) <= 0 || along(ray, 2, s1) >= maximum()) return false;
            begin = end;
            const int axis = axes[0].next <= axes[1].next ? 0 : 1;
            tile[axis] += axes[axis].isNegative ? -1 : 1;
            axes[axis].next = std::min(farthest(), axes[axis].next + axes[axis].tile);
            if (tile[axis] < 0 || tile[axis] >= (axis == 0 ? sizes_.tileColumns : sizes_.tileRows)) return false;
        }
    }

    /// The pixel at s, within a tile and the map.
    std::array<int, 2> pixelAt(const MapRay& ray, const std::array<int, 2>& tile, std::int64_t s) const {
        std::array<int, 2> pixel;
        const std::array<int, 2> size = {sizes_.width, sizes_.height};
        for (int a = 0; a < 2; ++a) {
            const int low = tile[a] << sizes_.tileLog, high = std::min(size[a], low + (1 << sizes_.tileLog)) - 1;
            pixel[a] = static_cast<int>(clamp<std::int64_t>(along(ray, a, s) >> (f_ - mapLog), low, high));
        }
        return pixel;
    }

    bool throughCells(const MapRay& ray, const TileInfo& info, const std::array<Depth, 4>& depths, const std::array<int, 2>& tile, const std::array<Axis, 2>& axes,
                      std::int64_t begin, std::int64_t end, March& state, EnvironmentPoint& point) const {
        const int cellLog = info.cellLog2, perTile = 1 << (sizes_.tileLog - cellLog);
        const auto start = pixelAt(ray, tile, begin >> guardBits);
        std::array<int, 2> cell;
        std::array<std::int64_t, 2> next, width;
        for (int a = 0; a < 2; ++a) {
            cell[a] = (start[a] & ((1 << sizes_.tileLog) - 1)) >> cellLog;
            width[a] = axes[a].tile >> (sizes_.tileLog - cellLog);
            const int left = axes[a].isNegative ? cell[a] : perTile - 1 - cell[a];
            next[a] = axes[a].moves ? std::max(begin, axes[a].next - left * width[a]) : farthest();
        }
        while (true) {
            const std::int64_t stop = std::min({next[0], next[1], end});
            const std::array<int, 2> size = {sizes_.width, sizes_.height};
            std::array<int, 2> corner;
            for (int a = 0; a < 2; ++a) corner[a] = std::min(size[a] - 1, (tile[a] << sizes_.tileLog) + (cell[a] << cellLog));
            const CellPlane plane = image_.cellAt(corner[0], corner[1]);
            point.isIllegal = point.isIllegal || plane.isIllegal;
            int which = 0;
            while (which < 3 && info.ids[which] != plane.id) ++which;
            const auto [x, y] = pixelIn(ray, corner, cellLog, begin >> guardBits);
            ++point.steps;
            if (pass(ray, depths[which], begin >> guardBits, stop >> guardBits, x, y, state)) return true;
            if (stop >= end || point.steps >= maxSteps) return false;
            begin = stop;
            const int axis = next[0] <= next[1] ? 0 : 1;
            cell[axis] += axes[axis].isNegative ? -1 : 1;
            next[axis] += width[axis];
            if (cell[axis] < 0 || cell[axis] >= perTile) return false;
        }
    }

    /// The pixel at s, within a cell and the map.
    std::array<int, 2> pixelIn(const MapRay& ray, const std::array<int, 2>& corner, int cellLog, std::int64_t s) const {
        std::array<int, 2> pixel;
        const std::array<int, 2> size = {sizes_.width, sizes_.height};
        for (int a = 0; a < 2; ++a)
            pixel[a] = static_cast<int>(clamp<std::int64_t>(along(ray, a, s) >> (f_ - mapLog), corner[a], std::min(size[a], corner[a] + (1 << cellLog)) - 1));
        return pixel;
    }

    /// Reports what a march has met.
    bool hit(const MapRay& ray, const EnvironmentView& view, const March& state, EnvironmentPoint& point) const {
        point.kind = EnvironmentPoint::Kind::map;
        point.isHidden = state.isBehind;
        // A plane met behind another one has its own last pixel's colour
        point.x = state.x;
        point.y = state.y;
        if (!state.isBehind) {
            point.x = pixelOf(ray, 0, state.hit, sizes_.width);
            point.y = pixelOf(ray, 1, state.hit, sizes_.height);
        }
        const std::int64_t w = std::max<std::int64_t>(1, along(ray, 2, state.hit));
        const Normalised way = normalise(magnitude(state.hit), f_), depth = normalise(magnitude(w), f_);
        point.travel = static_cast<std::int64_t>(divide(way.mantissa, depth.mantissa, f_));
        point.travelExponent = way.exponent - depth.exponent - f_ + view.exponent - ray.directionShift - ray.dirShift;
        return true;
    }

    int pixelOf(const MapRay& ray, int axis, std::int64_t s, int size) const {
        return static_cast<int>(clamp<std::int64_t>(along(ray, axis, s) >> (f_ - mapLog), 0, size - 1));
    }

    /// The nearest of the shell's planes: it lies in front of the ray's origin, and the ray goes towards it.
    void meetBoundingPlanes(const MapRay& ray, const EnvironmentView& view, EnvironmentPoint& point) const {
        std::uint64_t bestQuotient = 0;
        int bestExponent = 0;
        for (int i = 0; i < std::min(view.boundingPlanes, sizes_.boundingPlanes); ++i) {
            const PlaneWord& plane = image_.boundingPlane(i).plane;
            const std::int64_t front = depthOf(ray, plane, i).value;
            const std::int64_t centreU = std::int64_t(sizes_.width) << (f_ - mapLog - 1), centreV = std::int64_t(sizes_.height) << (f_ - mapLog - 1);
            const auto off = [&](int axis, std::int64_t centre) { return ray.dir[axis] - static_cast<std::int64_t>(floorShift<Wide>(Wide(centre) * ray.dir[2], f_)); };
            const Wide dir = Wide(plane.a) * off(0, centreU) + Wide(plane.b) * off(1, centreV) + Wide(plane.c) * ray.dir[2];
            if (front <= 0 || dir <= 0) continue;
            const Normalised speed = normalise(magnitude(dir), f_), way = normalise(magnitude(front), f_);
            const std::uint64_t quotient = divide(speed.mantissa, way.mantissa, f_);
            const int exponent = speed.exponent - way.exponent;
            const Normalised now = normalise(quotient, f_ + 1);
            const int length = exponent + now.exponent;
            if (bestQuotient == 0 || length > bestExponent || (length == bestExponent && now.mantissa > bestQuotient)) {
                bestQuotient = now.mantissa;
                bestExponent = length;
                point.entry = i;
                point.kind = EnvironmentPoint::Kind::boundingPlane;
            }
        }
        if (point.kind == EnvironmentPoint::Kind::nothing) return;
        // travel = front / towards · p2
        const Normalised depth = normalise(magnitude(ray.from[2]), f_);
        const Normalised rate = normalise(bestQuotient, f_);
        point.travel = static_cast<std::int64_t>(divide(depth.mantissa, rate.mantissa, f_));
        point.travelExponent = depth.exponent - (bestExponent - f_) - f_ + ray.fromShift - ray.dirShift;
    }

    const Numbers& n_;
    const AttributeImage& image_;
};

} // namespace colonnade
