/// Splits polygons into triangles. Concave ones are split by ear clipping, so that no triangle leaves its polygon.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "fixed_order.hpp"
#include "mesh/files/losses.hpp"
#include "mesh/texture.hpp"
#include "mesh/topology.hpp"

namespace colonnade::mesh {

/// Corners of a concave polygon, at most.
constexpr std::size_t maxPolygon = 2000;
/// An angle at a corner that is no more than the rounding of its coordinates, radians.
constexpr double straight = 1e-9;
/// Tests for ears of a polygon, at most, for each of its corners.
constexpr std::size_t earTests = 20;

/// Splits one polygon after the other; each keeps its winding.
class PolygonSplitter {
public:
    std::vector<Row<std::size_t>> triangles; ///< of the last polygon: numbers of its corners
    std::size_t shorts = 0;                  ///< polygons of fewer than three corners, which have no triangle
    std::size_t crossed = 0;                 ///< polygons whose outline crosses itself; their triangles may overlap
    std::size_t tests = 0;                   ///< for ears
    std::string error;                       ///< why the last one cannot be split; empty if it can

    /// False if a polygon has too many corners.
    bool split(const std::vector<Vector>& points) {
        triangles.clear();
        const std::size_t size = points.size();
        if (size < 3) return ++shorts;
        std::size_t first = 0;
        bool isBent = false, crosses = false;
        if (size > 3) first = findBends(points, isBent, crosses);
        if (size > 4 && (isBent || crosses)) {
            if (!clipEars(points, crosses)) return false;
        } else
            for (std::size_t k = 1; k + 1 < size; ++k) emit(first, (first + k) % size, (first + k + 1) % size);
        crossed += crosses;
        return true;
    }

private:
    enum : std::int64_t { ear = -1, unknown = -2, notConvex = -3 };

    void emit(std::size_t a, std::size_t b, std::size_t c) { triangles.push_back({a, b, c}); }

    /// Whether a polygon has a corner that is not convex, and whether it crosses itself: the angles of all others sum
    /// to a circle. Returns the corner from which it is a fan: of a quadrilateral that is not convex the one of the
    /// least angle.
    static std::size_t findBends(const std::vector<Vector>& points, bool& isBent, bool& crosses) {
        const std::size_t size = points.size();
        Vector normal{};
        for (std::size_t i = 0; i < size; ++i) {
            for (const double value : points[i])
                if (!std::isfinite(value)) return 0;
            const Vector across =
                cross(difference(points[i], points[0]), difference(points[(i + 1) % size], points[0]));
            for (int axis = 0; axis < 3; ++axis) normal[axis] += across[axis];
        }
        const double norm = length(normal), divisor = norm > 0 ? norm : 1;
        for (double& value : normal) value /= divisor;
        double total = 0, least = HUGE_VAL;
        std::size_t first = 0;
        for (std::size_t i = 0; i < size; ++i) {
            const Vector before = difference(points[i], points[(i + size - 1) % size]),
                         after = difference(points[(i + 1) % size], points[i]);
            const double angle = fixed_order::arctan2(dot(cross(before, after), normal), dot(before, after));
            total += angle;
            isBent |= angle <= straight;
            if (angle < least) {
                least = angle;
                first = i;
            }
        }
        crosses = std::fabs(total - 2 * 3.14159265358979324) > 1;
        return size == 4 && isBent ? first : 0;
    }

    /// Twice the signed area of a triangle.
    static double area(const Pair& a, const Pair& b, const Pair& c) {
        return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    }

    /// Puts the corners into the polygon's plane, counter-clockwise; exact for integers of up to 25 bits.
    void flatten(const std::vector<Vector>& points) {
        const std::size_t size = points.size();
        double largest = 0;
        std::vector<Vector> relative;
        for (const Vector& point : points) {
            relative.push_back(difference(point, points[0]));
            for (const double value : relative.back()) largest = std::max(largest, std::fabs(value));
        }
        int exponent;
        std::frexp(largest, &exponent);
        for (Vector& point : relative)
            for (double& value : point) value = std::ldexp(value, -exponent);
        Vector normal{};
        for (std::size_t i = 0; i < size; ++i) {
            const Vector across = cross(relative[i], relative[(i + 1) % size]);
            for (int axis = 0; axis < 3; ++axis) normal[axis] += across[axis];
        }
        int axis = 0;
        for (int other = 1; other < 3; ++other)
            if (std::fabs(normal[other]) > std::fabs(normal[axis])) axis = other;
        flat_.clear();
        for (const Vector& point : relative)
            flat_.push_back(
                {normal[axis] >= 0 ? point[(axis + 1) % 3] : -point[(axis + 1) % 3], point[(axis + 2) % 3]});
    }

    /// `ear` if a corner is convex, and its triangle holds no other corner, not even on the cut. Else `notConvex`, or
    /// the corner in the triangle that is farthest from the cut: it is concave in a simple polygon, so that it remains
    /// for long.
    std::int64_t obstacleOf(std::size_t at) {
        ++tests;
        const Pair &a = flat_[before_[at]], &b = flat_[at], &c = flat_[after_[at]];
        const double low = std::sqrt((b[0] - a[0]) * (b[0] - a[0]) + (b[1] - a[1]) * (b[1] - a[1]));
        const double high = std::sqrt((c[0] - b[0]) * (c[0] - b[0]) + (c[1] - b[1]) * (c[1] - b[1]));
        if (area(a, b, c) <= straight * (low * high)) return notConvex;
        std::int64_t found = ear;
        double deepest = 0;
        for (std::size_t i = 0; i < flat_.size(); ++i) {
            const Pair& point = flat_[i];
            const double depth = area(c, a, point);
            if (!remains_[i] || !(depth >= 0) || !(area(a, b, point) >= 0) || !(area(b, c, point) >= 0)) continue;
            if (point == a || point == b || point == c || (found != ear && depth <= deepest)) continue;
            found = static_cast<std::int64_t>(i);
            deepest = depth;
        }
        return found;
    }

    /// Whether what remains has more area than rounding leaves.
    bool hasArea() const {
        const Pair* first = nullptr;
        Pair last{};
        double sum = 0, largest = 0;
        for (std::size_t i = 0; i < flat_.size(); ++i) {
            if (!remains_[i]) continue;
            if (!first) first = &flat_[i];
            const Pair relative{flat_[i][0] - (*first)[0], flat_[i][1] - (*first)[1]};
            sum += last[0] * relative[1] - last[1] * relative[0];
            largest = std::max({largest, std::fabs(relative[0]), std::fabs(relative[1])});
            last = relative;
        }
        return std::fabs(sum) > straight * (largest * largest);
    }

    /// Cuts off ears: convex corners whose triangle contains no other corner, until a triangle remains. A corner is
    /// tested again only when a neighbour or the corner in its way has gone, so a simple polygon takes some tests for
    /// each corner. An outline that crosses itself may have no ear, then any corner is cut off; after too many tests
    /// the rest becomes a fan.
    bool clipEars(const std::vector<Vector>& points, bool& crosses) {
        const std::size_t size = points.size();
        if (size > maxPolygon) {
            error = "a concave polygon has " + grouped(size) + " corners: split it, " + grouped(maxPolygon) +
                    " are supported";
            return false;
        }
        flatten(points);
        before_.resize(size);
        after_.resize(size);
        for (std::size_t i = 0; i < size; ++i) {
            before_[i] = (i + size - 1) % size;
            after_[i] = (i + 1) % size;
        }
        std::vector<std::int64_t> obstacles(size, unknown);
        remains_.assign(size, 1);
        const std::size_t most = tests + earTests * size;
        std::size_t at = 0, count = size, made = 0;
        for (; count > 3; --count) {
            std::size_t tries = 0;
            for (; tries < count; ++tries) {
                std::int64_t& obstacle = obstacles[at];
                if (obstacle == unknown || (obstacle >= 0 && !remains_[static_cast<std::size_t>(obstacle)]))
                    obstacle = obstacleOf(at);
                if (obstacle == ear) break;
                at = after_[at];
            }
            if (tries == count) crosses = crosses || hasArea();
            if (tests > most) {
                crosses = true;
                break;
            }
            const std::size_t low = before_[at], high = after_[at];
            emit(low, at, high);
            ++made;
            remains_[at] = 0;
            after_[low] = high;
            before_[high] = low;
            obstacles[low] = obstacles[high] = unknown;
            at = after_[high]; // not the next one, which makes slivers around one corner
        }
        std::size_t first = 0;
        while (!remains_[first]) ++first;
        for (at = after_[first]; made < size - 2; at = after_[at], ++made) emit(first, at, after_[at]);
        return true;
    }

    std::vector<Pair> flat_;
    std::vector<std::size_t> before_, after_;
    std::vector<char> remains_;
};

} // namespace colonnade::mesh
