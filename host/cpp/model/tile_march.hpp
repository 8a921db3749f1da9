// The march of a ray through the tiles and cells of the plane map (docs/background.md).
#pragma once
#include "map_geometry.hpp"

namespace colonnade {

/// Tests a ray in map space against the planes of each tile that it crosses.
class TileMarch : protected MapGeometry {
public:
    /// Largest number of march steps; after that the ray hits the bounding planes.
    static constexpr int maxSteps = 512;

    /// Decodes the tiles: an image that is loaded again needs another march.
    TileMarch(const Numbers& numbers, const AttributeImage& image)
        : MapGeometry(numbers, image.sizes()), image_(image) {
        for (int y = 0; y < sizes_.tileRows; ++y)
            for (int x = 0; x < sizes_.tileColumns; ++x)
                tiles_.push_back(image.tileAt(x << sizes_.tileLog, y << sizes_.tileLog));
    }

    /// Marches a ray that starts in front of the camera; true if it hits a plane, and then completes `point`.
    bool marchTiles(const MapRay& ray, const EnvironmentView& view, EnvironmentPoint& point) const {
        const int toPixel = f_ - mapLog;
        std::array<int, 2> pixel = {static_cast<int>(ray.position[0] >> toPixel),
                                    static_cast<int>(ray.position[1] >> toPixel)};
        if (!sizes_.covers(pixel[0], pixel[1])) return false;
        std::array<AxisSteps, 2> axes = {axisSteps(ray, 0, pixel[0]), axisSteps(ray, 1, pixel[1])};
        std::array<int, 2> tile = {pixel[0] >> sizes_.tileLog, pixel[1] >> sizes_.tileLog};
        MarchState state{};
        std::int64_t tEnter = 0;
        while (true) {
            const std::int64_t tExit = std::min({axes[0].next, axes[1].next, maxGuardedS()});
            const std::int64_t s0 = tEnter >> guardBits, s1 = tExit >> guardBits;
            const TileInfo& info = tiles_[tile[1] * sizes_.tileColumns + tile[0]];
            point.isIllegal = point.isIllegal || info.isIllegal;
            std::array<PlaneDistance, 4> depths;
            for (int i = 0; i < info.count; ++i)
                depths[i] = planeDistance(ray, image_.planeOf(info.ids[i]), info.ids[i]);

            // If the ray is in front of all planes of a tile, one step passes the whole tile
            int nearest = 0;
            std::int64_t nearestW = 0;
            bool isInFrontOfAll = !state.isBehind;
            ++(info.count == 1 ? point.work.flatTiles : point.work.tiles);
            if (info.count == 1) point.work.lookUp(info.ids[0]);
            for (int i = 0; i < info.count && info.count > 1; ++i) {
                const std::int64_t atExit = distanceAt(depths[i], s1), w = toW(atExit, depths[i]);
                if (isInFrontOfAll) {
                    ++point.work.planes;
                    point.work.lookUp(info.ids[i]);
                }
                isInFrontOfAll = isInFrontOfAll && atExit >= 0 && distanceAt(depths[i], s0) >= 0;
                if (i == 0 || w < nearestW) {
                    nearest = i;
                    nearestW = w;
                }
            }
            if (info.count == 1 || isInFrontOfAll) {
                ++point.steps;
                point.work.behind += state.isBehind;
                if (testPlane(ray, depths[nearest], s0, s1, {tile, sizes_.tileLog, info.count == 1 ? s0 : s1}, state))
                    return reportHit(ray, view, state, point);
            } else if (marchCells(ray, info, depths, tile, axes, tEnter, tExit, state, point)) {
                return reportHit(ray, view, state, point);
            }
            if (point.steps >= maxSteps || tExit >= maxGuardedS() || positionAt(ray, 2, s1) <= 0 ||
                positionAt(ray, 2, s1) >= maximum())
                return false;
            tEnter = tExit;
            const int axis = axes[0].next <= axes[1].next ? 0 : 1;
            tile[axis] += axes[axis].isNegative ? -1 : 1;
            axes[axis].next = std::min(maxGuardedS(), axes[axis].next + axes[axis].tile);
            if (tile[axis] < 0 || tile[axis] >= (axis == 0 ? sizes_.tileColumns : sizes_.tileRows)) return false;
        }
    }

protected:
    const AttributeImage& image_;

private:
    std::vector<TileInfo> tiles_;

    /// Guard bits of accumulated distances along the ray.
    static constexpr int guardBits = 8;
    /// Log2 of the fraction of w by which a ray may be behind a plane and still count as on it.
    static constexpr int surfaceToleranceLog = 8;

    /// The pixel of a ray at s in a square of the map, a tile or a cell: its place in squares of 2^log pixels.
    struct SquarePoint {
        std::array<int, 2> square;
        int log;
        std::int64_t s;
    };

    /// State of a march. `isBehind`: the ray is behind the visible surfaces.
    struct MarchState {
        bool isBehind;
        /// The last plane that the ray was in front of, if any, and the start of that step.
        bool hasPlane;
        PlaneDistance plane;
        SquarePoint first;
        /// Position of the hit along the ray.
        std::int64_t hitS;
    };

    /// Tests the ray from s0 to s1 against a plane, whose first pixel is `first`; true if it hits this plane, or the
    /// last plane in front.
    bool testPlane(const MapRay& ray, const PlaneDistance& depth, std::int64_t s0, std::int64_t s1,
                   const SquarePoint& first, MarchState& state) const {
        const std::int64_t atEntry = distanceAt(depth, s0), atExit = distanceAt(depth, s1);
        if (!state.isBehind && (atEntry < 0 || atExit < 0)) {
            // A plane entered slightly behind it is a hit too: an edge between planes, or a start on the surface
            const bool isNear = -toW(atEntry, depth) < positionAt(ray, 2, s0) >> surfaceToleranceLog,
                       isSame = state.hasPlane && state.plane.id == depth.id;
            if (atEntry >= 0 || isNear || isSame) {
                state.hitS = atEntry < 0 ? s0 : crossing(depth, s0, s1);
                return true;
            }
            state.isBehind = true;
        }
        if (state.isBehind) {
            if (state.hasPlane && distanceAt(state.plane, s1) < 0) {
                state.hitS = crossing(state.plane, s0, s1);
                return true;
            }
            if (atExit < 0) return false;
            state.isBehind = false;
        }
        state.hasPlane = true;
        state.plane = depth;
        state.first = first;
        return false;
    }

    /// The s at which a distance becomes negative.
    std::int64_t crossing(const PlaneDistance& depth, std::int64_t s0, std::int64_t s1) const {
        if (depth.slope >= 0 || depth.value <= 0) return s0;
        const Normalised above = normalise(magnitude(depth.value), f_), fall = normalise(magnitude(depth.slope), f_);
        const Wide s = floorShift<Wide>(divide(above.mantissa, fall.mantissa, f_), -(above.exponent - fall.exponent));
        return static_cast<std::int64_t>(clamp<Wide>(s, s0, s1));
    }

    /// Tile boundaries that a ray crosses on one axis of the map.
    struct AxisSteps {
        bool moves, isNegative;
        std::int64_t next, tile; // the next boundary and the spacing of boundaries along the ray, with guard bits
    };

    AxisSteps axisSteps(const MapRay& ray, int axis, int pixel) const {
        AxisSteps result{ray.direction[axis] != 0, ray.direction[axis] < 0, maxGuardedS(), maxGuardedS()};
        if (!result.moves) return result;
        const Normalised rate = normalise(magnitude(ray.direction[axis]), f_);
        const std::int64_t inverse = reciprocal(rate.mantissa),
                           low = (std::int64_t(pixel) >> sizes_.tileLog << sizes_.tileLog) << (f_ - mapLog);
        const std::int64_t width = std::int64_t(1) << (f_ - mapLog + sizes_.tileLog);
        const std::int64_t way = result.isNegative ? ray.position[axis] - low : low + width - ray.position[axis];
        const auto guardedS = [&](std::int64_t length) {
            return std::min(maxGuardedS(), floorShift((length * inverse) << guardBits, rate.exponent - 1));
        };
        result.next = guardedS(way);
        result.tile = guardedS(width);
        return result;
    }

    std::int64_t maxGuardedS() const { return (maximum() << guardBits) | ((std::int64_t(1) << guardBits) - 1); }

    /// The pixel of a point, clamped to its square and the map.
    std::array<int, 2> pixelOf(const MapRay& ray, const SquarePoint& point) const {
        std::array<int, 2> pixel;
        const std::array<int, 2> size = {sizes_.width, sizes_.height};
        for (int a = 0; a < 2; ++a) {
            const int low = std::min(size[a] - 1, point.square[a] << point.log),
                      high = std::min(size[a], low + (1 << point.log)) - 1;
            pixel[a] = static_cast<int>(clamp<std::int64_t>(positionAt(ray, a, point.s) >> (f_ - mapLog), low, high));
        }
        return pixel;
    }

    bool marchCells(const MapRay& ray, const TileInfo& info, const std::array<PlaneDistance, 4>& depths,
                    const std::array<int, 2>& tile, const std::array<AxisSteps, 2>& axes, std::int64_t tEnter,
                    std::int64_t tExit, MarchState& state, EnvironmentPoint& point) const {
        ++point.work.cellTiles;
        const int cellLog = info.cellLog2, perTile = 1 << (sizes_.tileLog - cellLog);
        const auto start = pixelOf(ray, {tile, sizes_.tileLog, tEnter >> guardBits});
        std::array<int, 2> cell;
        std::array<std::int64_t, 2> next, width;
        for (int a = 0; a < 2; ++a) {
            cell[a] = (start[a] & ((1 << sizes_.tileLog) - 1)) >> cellLog;
            width[a] = axes[a].tile >> (sizes_.tileLog - cellLog);
            const int left = axes[a].isNegative ? cell[a] : perTile - 1 - cell[a];
            next[a] = axes[a].moves ? std::max(tEnter, axes[a].next - left * width[a]) : maxGuardedS();
        }
        while (true) {
            const std::int64_t cellExit = std::min({next[0], next[1], tExit});
            const std::array<int, 2> size = {sizes_.width, sizes_.height};
            std::array<int, 2> corner, square;
            for (int a = 0; a < 2; ++a) {
                square[a] = (tile[a] << (sizes_.tileLog - cellLog)) + cell[a];
                corner[a] = std::min(size[a] - 1, square[a] << cellLog);
            }
            const CellPlane plane = image_.cellAt(info, corner[0], corner[1]);
            point.isIllegal = point.isIllegal || plane.isIllegal;
            int slot = 0;
            while (slot < 3 && info.ids[slot] != plane.id) ++slot;
            ++point.steps;
            ++point.work.cells;
            point.work.behind += state.isBehind;
            point.work.lookUp(plane.id);
            if (testPlane(ray, depths[slot], tEnter >> guardBits, cellExit >> guardBits,
                          {square, cellLog, tEnter >> guardBits}, state))
                return true;
            if (cellExit >= tExit || point.steps >= maxSteps) return false;
            tEnter = cellExit;
            const int axis = next[0] <= next[1] ? 0 : 1;
            cell[axis] += axes[axis].isNegative ? -1 : 1;
            next[axis] += width[axis];
            if (cell[axis] < 0 || cell[axis] >= perTile) return false;
        }
    }

    /// Completes the point of a hit.
    bool reportHit(const MapRay& ray, const EnvironmentView& view, const MarchState& state,
                   EnvironmentPoint& point) const {
        point.kind = HitKind::map;
        point.isHidden = state.isBehind;
        // A hidden hit takes the last visible pixel of its plane
        const std::array<int, 2> pixel = state.isBehind
                                             ? pixelOf(ray, state.first)
                                             : std::array<int, 2>{pixelOf(ray, 0, state.hitS, sizes_.width),
                                                                  pixelOf(ray, 1, state.hitS, sizes_.height)};
        point.x = pixel[0];
        point.y = pixel[1];
        const std::int64_t w = std::max<std::int64_t>(1, positionAt(ray, 2, state.hitS));
        const Normalised way = normalise(magnitude(state.hitS), f_), depth = normalise(magnitude(w), f_);
        point.travel = static_cast<std::int64_t>(divide(way.mantissa, depth.mantissa, f_));
        point.travelExponent = way.exponent - depth.exponent - f_ + view.exponent - ray.directionShift - ray.dirShift;
        return true;
    }

    int pixelOf(const MapRay& ray, int axis, std::int64_t s, int size) const {
        return static_cast<int>(clamp<std::int64_t>(positionAt(ray, axis, s) >> (f_ - mapLog), 0, size - 1));
    }
};

} // namespace colonnade
