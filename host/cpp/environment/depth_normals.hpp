/// Normals of a depth map.
///
/// A plane is linear in inverse depth: w = m · (x, y, 1) at the view ray (x, y, 1), and its normal is -m / |m|. Planes
/// are fitted twice: in windows around each pixel, as large as the noise of the depth map asks for, of which the
/// flattest of nine counts, so that a window does not reach across an edge; and to the whole map, where many windows
/// agree, the largest first. A pixel takes the normal of the large plane that it lies on, else its window's.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "nearest.hpp"

namespace colonnade::environment {

using Vector = std::array<double, 3>;

struct Lens {
    double fx, fy, cx, cy; ///< pixels
};

struct DepthNormals {
    std::vector<Vector> normals; ///< unit, view space, facing the camera
    int planes; ///< large ones
    double onPlanes; ///< share of the pixels that lie on one
};

/// Radius of the windows that measure the noise, and the least and largest radius of windows that give normals, pixels.
constexpr int noiseRadius = 14, minRadius = 2, maxRadius = 11;
/// Share of the windows that is flat; their largest residual is the noise. A residual of rounding alone counts as
/// `leastNoise`.
constexpr double flatShare = 0.3, leastNoise = 1e-4;
/// Slope error of a window that is accepted, radians, and distance over which a sensor's noise is correlated, pixels.
constexpr double slopeError = 0.06, correlation = 2.5;
/// Pixels that vote for large planes, about, a quarter of which are tried as their centres; votes of the smallest
/// plane.
constexpr double voters = 4800;
constexpr int planeLimit = 128, leastVotes = 20;
/// A pixel lies on a plane if its depth differs by this many times the noise, or by this share of the depth, and its
/// window's normal by this angle, as a cosine.
constexpr double deviations = 3.0, leastTolerance = 0.002, agreement = 0.85;

inline double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/// The sum of numbers in the order of numpy: halves down to 128, there in eight lanes.
inline double pairwiseSum(const double* values, std::size_t count) {
    if (count > 128) {
        const std::size_t half = count / 2 - count / 2 % 8;
        return pairwiseSum(values, half) + pairwiseSum(values + half, count - half);
    }
    std::size_t i = 0;
    double sum = 0;
    if (count >= 8) {
        std::array<double, 8> lanes{};
        for (; i + 8 <= count; i += 8)
            for (int lane = 0; lane < 8; ++lane) lanes[lane] += values[i + lane];
        sum = ((lanes[0] + lanes[1]) + (lanes[2] + lanes[3])) + ((lanes[4] + lanes[5]) + (lanes[6] + lanes[7]));
    }
    for (; i < count; ++i) sum += values[i];
    return sum;
}

/// The plane m with m · p = 1 at points, by least squares.
inline Vector fittedPlane(const Vector* points, std::size_t count) {
    std::array<std::array<double, 4>, 3> rows{};
    std::vector<double> products(count);
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
            for (std::size_t k = 0; k < count; ++k) products[k] = points[k][i] * points[k][j];
            rows[i][j] = pairwiseSum(products.data(), count);
        }
        for (std::size_t k = 0; k < count; ++k) rows[i][3] += points[k][i];
    }
    // The second term is of depth in kilometres, whose rounding would make the matrix singular
    const double least = std::max(1e-9 * static_cast<double>(count), 1e-12 * (rows[0][0] + rows[1][1] + rows[2][2]));
    for (int i = 0; i < 3; ++i) rows[i][i] += least;
    for (int k = 0; k < 2; ++k)
        for (int i = k + 1; i < 3; ++i) {
            const double factor = rows[i][k] / rows[k][k];
            for (int j = k; j < 4; ++j) rows[i][j] -= factor * rows[k][j];
        }
    Vector plane{};
    for (int k = 2; k >= 0; --k) {
        double known = 0;
        for (int j = k + 1; j < 3; ++j) known += rows[k][j] * plane[j];
        plane[k] = (rows[k][3] - known) / rows[k][k];
    }
    return plane;
}

class DepthMap {
public:
    /// `depth`: metres along z, filled; `holes`: pixels whose depth was filled from a neighbour.
    DepthMap(const double* depth, const std::uint8_t* holes, const Lens& lens, int width, int height)
        : depth_(depth), holes_(holes), lens_(lens), width_(width), height_(height),
          size_(static_cast<std::size_t>(width) * height), rays_(size_) {
        for (std::size_t i = 0; i < size_; ++i) {
            const std::size_t column = i % width, row = i / width;
            rays_[i] = {(static_cast<double>(column) + 0.5 - lens.cx) / lens.fx,
                        (static_cast<double>(row) + 0.5 - lens.cy) / lens.fy, 1.0};
        }
    }

    /// Root mean square error of the depth on flat surfaces, as a share of the depth.
    double noise() const {
        const Windows windows = windowsOf(noiseRadius);
        std::vector<double> residuals;
        eachCentre(windows.radius, [&](std::size_t i) {
            if (windows.holes[i] == 0) residuals.push_back(std::sqrt(windows.residual[i]) / windows.value[i]);
        });
        if (residuals.empty()) return leastNoise;
        const auto flat =
            residuals.begin() + static_cast<std::ptrdiff_t>(flatShare * static_cast<double>(residuals.size() - 1));
        std::nth_element(residuals.begin(), flat, residuals.end());
        return std::max(*flat, leastNoise);
    }

    DepthNormals normals(double noise, int maxPlanes = planeLimit) {
        tolerance_ = std::max(deviations * noise, leastTolerance);
        const double size = std::sqrt(noise * lens_.fx * std::sqrt(12.0) * correlation / slopeError);
        const int radius = std::clamp(static_cast<int>(std::nearbyint(size / 2)), minRadius, maxRadius);
        std::vector<std::uint8_t> isUnknown = fitWindows(windowsOf(radius));
        const std::vector<Vector> planes = largePlanes(isUnknown, maxPlanes);
        std::vector<Vector> assigned = local_;
        std::vector<double> best(size_, 0.5), on(size_, 1.0);
        const std::vector<double> area = boxSums(on, radius / 2);
        for (const Vector& plane : planes) {
            for (std::size_t i = 0; i < size_; ++i) on[i] = agrees(plane, i);
            const std::vector<double> sums = boxSums(on, radius / 2);
            for (std::size_t i = 0; i < size_; ++i)
                if (sums[i] / area[i] > best[i]) {
                    best[i] = sums[i] / area[i];
                    assigned[i] = plane;
                    isUnknown[i] = false;
                }
        }
        const std::vector<std::int32_t> nearest = nearestKnown(isUnknown.data(), width_, height_);
        DepthNormals result{std::vector<Vector>(size_), static_cast<int>(planes.size()), 0};
        for (std::size_t i = 0; i < size_; ++i) {
            const Vector& plane = assigned[nearest[i] < 0 ? i : nearest[i]];
            Vector normal = facing(plane);
            // A plane seen from behind its own ray, at a hole or an edge, faces the camera
            result.normals[i] = dot(normal, rays_[i]) >= 0 ? facing(rays_[i]) : normal;
            result.onPlanes += best[i] > 0.5;
        }
        result.onPlanes /= static_cast<double>(size_);
        return result;
    }

private:
    using Pixels = std::vector<std::uint32_t>;

    /// Planes fitted to inverse depth in the square window around each pixel, where it lies in the map: value at the
    /// centre, slopes for a pixel, mean squared residual, share of holes.
    struct Windows {
        int radius;
        std::vector<double> value, across, down, residual, holes;
    };

    template <class Use> void eachCentre(int radius, Use use) const {
        for (int y = radius; y < height_ - radius; ++y)
            for (int x = radius; x < width_ - radius; ++x) use(static_cast<std::size_t>(y) * width_ + x);
    }

    static Vector facing(const Vector& plane) {
        const double length = std::sqrt(dot(plane, plane));
        return {-plane[0] / length, -plane[1] / length, -plane[2] / length};
    }

    /// Sums over square windows that are cut at the border.
    std::vector<double> boxSums(std::vector<double> values, int radius) const {
        std::vector<double> sums(std::max(width_, height_) + 1);
        const auto along = [&](int lines, int size, int lineStep, int step) {
            for (int line = 0; line < lines; ++line) {
                double* value = &values[static_cast<std::size_t>(line) * lineStep];
                for (int i = 0; i < size; ++i) sums[i + 1] = sums[i] + value[static_cast<std::size_t>(i) * step];
                for (int i = 0; i < size; ++i)
                    value[static_cast<std::size_t>(i) * step] =
                        sums[std::min(size, i + radius + 1)] - sums[std::max(0, i - radius)];
            }
        };
        along(width_, height_, 1, width_);
        along(height_, width_, width_, 1);
        return values;
    }

    Windows windowsOf(int radius) const {
        radius = std::min(radius, (std::min(width_, height_) - 1) / 2);
        const double count = (2 * radius + 1) * (2 * radius + 1), spread = count * radius * (radius + 1) / 3.0;
        const auto u = [&](std::size_t i) { return static_cast<double>(i % width_) - width_ / 2.0; };
        const auto v = [&](std::size_t i) {
            const std::size_t row = i / width_;
            return static_cast<double>(row) - height_ / 2.0;
        };
        const auto sumsOf = [&](auto valueOf) {
            std::vector<double> values(size_);
            for (std::size_t i = 0; i < size_; ++i) values[i] = valueOf(1.0 / depth_[i], i);
            return boxSums(std::move(values), radius);
        };
        Windows result{radius,
                       sumsOf([](double w, std::size_t) { return w; }),
                       sumsOf([&](double w, std::size_t i) { return w * u(i); }),
                       sumsOf([&](double w, std::size_t i) { return w * v(i); }),
                       sumsOf([](double w, std::size_t) { return w * w; }),
                       sumsOf([&](double, std::size_t i) { return holes_[i] ? 1.0 : 0.0; })};
        eachCentre(radius, [&](std::size_t i) {
            const double total = result.value[i];
            double &value = result.value[i], &across = result.across[i], &down = result.down[i],
                   &residual = result.residual[i];
            value = total / count;
            across = radius ? (across - u(i) * total) / spread : 0;
            down = radius ? (down - v(i) * total) / spread : 0;
            residual =
                std::max(0.0, residual / count - value * value - (across * across + down * down) * spread / count);
            result.holes[i] /= count;
        });
        return result;
    }

    /// Gives each pixel the plane of its flattest window; returns the pixels whose window holds too little depth.
    std::vector<std::uint8_t> fitWindows(const Windows& windows) {
        const int radius = windows.radius;
        local_.resize(size_);
        std::vector<std::uint8_t> isUnknown(size_);
        for (std::size_t i = 0; i < size_; ++i) {
            const int x = static_cast<int>(i % width_), y = static_cast<int>(i / width_);
            double least = std::numeric_limits<double>::infinity();
            std::size_t centre = i;
            for (const int dv : {0, -radius, radius})
                for (const int du : {0, -radius, radius}) {
                    const int row = std::clamp(y + dv, radius, height_ - 1 - radius);
                    const std::size_t other =
                        static_cast<std::size_t>(row) * width_ + std::clamp(x + du, radius, width_ - 1 - radius);
                    // A window around the pixel is preferred: it has the same noise and no preferred side
                    const double cost =
                        windows.residual[other] * (du == 0 && dv == 0 ? 1.0 : 1.5) + windows.holes[other];
                    if (cost < least) {
                        least = cost;
                        centre = other;
                    }
                }
            const double a = windows.across[centre] * lens_.fx, b = windows.down[centre] * lens_.fy;
            local_[i] = {a, b, windows.value[centre] - a * rays_[centre][0] - b * rays_[centre][1]};
            isUnknown[i] = !(windows.holes[centre] < 0.5);
        }
        return isUnknown;
    }

    /// Planes that many windows agree with, the largest first.
    std::vector<Vector> largePlanes(const std::vector<std::uint8_t>& isUnknown, int maxPlanes) const {
        const int step = std::max(1, static_cast<int>(std::nearbyint(std::sqrt(static_cast<double>(size_) / voters))));
        const auto grid = [&](int start, int stride) {
            Pixels pixels;
            for (int y = start; y < height_; y += stride)
                for (int x = start; x < width_; x += stride)
                    if (const std::size_t i = static_cast<std::size_t>(y) * width_ + x; !isUnknown[i])
                        pixels.push_back(static_cast<std::uint32_t>(i));
            return pixels;
        };
        const Pixels trials = grid(step, 2 * step);
        Pixels free = grid(step / 2, step);
        std::vector<Vector> planes;
        const auto supporters = [&](const Vector& plane) {
            Pixels found;
            for (const std::uint32_t pixel : free)
                if (agrees(plane, pixel)) found.push_back(pixel);
            return found;
        };
        std::vector<Pixels> votes(trials.size());
        for (std::size_t i = 0; i < trials.size(); ++i) votes[i] = supporters(local_[trials[i]]);
        std::vector<bool> isTaken(size_);
        while (static_cast<int>(planes.size()) < maxPlanes && !votes.empty()) {
            const auto largest = std::max_element(votes.begin(), votes.end(), [](const auto& one, const auto& other) {
                return one.size() < other.size();
            });
            Pixels found = *largest;
            if (found.size() < leastVotes) break;
            for (const std::uint32_t pixel : found) isTaken[pixel] = true;
            Vector plane{};
            for (int round = 0; round < 3 && found.size() >= leastVotes; ++round) {
                plane = fitted(found);
                found = supporters(plane);
            }
            for (const std::uint32_t pixel : found) isTaken[pixel] = true;
            if (found.size() >= leastVotes) planes.push_back(plane);
            const auto leave = [&](Pixels& pixels) {
                pixels.erase(
                    std::remove_if(pixels.begin(), pixels.end(), [&](std::uint32_t pixel) { return isTaken[pixel]; }),
                    pixels.end());
            };
            leave(free);
            for (Pixels& own : votes) leave(own);
        }
        return planes;
    }

    /// The plane with the least squared relative error of depth.
    Vector fitted(const Pixels& pixels) const {
        std::vector<Vector> points;
        for (const std::uint32_t pixel : pixels)
            points.push_back(
                {rays_[pixel][0] * depth_[pixel], rays_[pixel][1] * depth_[pixel], rays_[pixel][2] * depth_[pixel]});
        return fittedPlane(points.data(), points.size());
    }

    /// Whether a pixel lies on a plane: by its depth, and by the normal of its window.
    bool agrees(const Vector& plane, std::size_t pixel) const {
        if (!(std::fabs(dot(rays_[pixel], plane) * depth_[pixel] - 1.0) < tolerance_)) return false;
        const Vector& own = local_[pixel];
        return dot(own, plane) > agreement * std::sqrt(dot(own, own) * dot(plane, plane));
    }

    const double* depth_;
    const std::uint8_t* holes_;
    Lens lens_;
    int width_, height_;
    std::size_t size_;
    std::vector<Vector> rays_;
    std::vector<Vector> local_; ///< planes of the windows
    double tolerance_ = 0;
};

} // namespace colonnade::environment
