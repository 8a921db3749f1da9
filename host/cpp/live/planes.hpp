/// Planes of the picture's inverse depth, in whole numbers.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace colonnade::live {

/// Fraction bits of w, and of a plane's coefficients.
constexpr int wBits = 22, planeBits = 34;
/// Least and largest depth, steps of 2^-16 m: 1 mm and 4 km.
constexpr std::uint32_t leastDepth = 1 << 6, largestDepth = 1u << 28;
/// Metres in the encoder's errors: steps of 2^-17 m.
constexpr int errorBits = 17;

/// w = a · X + b · Y + c with 34 fraction bits. X and Y are twice the distance from the picture's centre in pixels: odd
/// at the centres of pixels, even at their corners.
struct Plane {
    std::int64_t a = 0, b = 0, c = 0;

    std::int64_t at(std::int64_t x, std::int64_t y) const { return a * x + b * y + c; }

    static std::int64_t whole(double value) {
        return static_cast<std::int64_t>(std::floor(std::clamp(value, -4e12, 4e12) + 0.5));
    }
};

/// The word of a plane (docs/background.md); `plane` becomes the plane of this word.
inline std::uint64_t planeWord(Plane& plane) {
    // A and B are slopes per 1024 pixels = 2048 half pixels, so their fields are a >> (1 + e); C's is c >> (12 + e)
    std::int64_t* const values[3] = {&plane.a, &plane.b, &plane.c};
    const int shifts[3] = {planeBits - 22 - 11, planeBits - 22 - 11, planeBits - 22};
    const auto field = [&](int i, int e) {
        return (*values[i] + (std::int64_t{1} << (shifts[i] + e - 1))) >> (shifts[i] + e);
    };
    constexpr std::int64_t half = 1 << 19;
    int exponent = 0;
    for (; exponent < 15; ++exponent) {
        bool fits = true;
        for (int i = 0; i < 3; ++i) fits = fits && field(i, exponent) >= -half && field(i, exponent) < half;
        if (fits) break;
    }
    std::uint64_t word = static_cast<std::uint64_t>(exponent) << 60;
    for (int i = 0; i < 3; ++i) {
        const std::int64_t value = std::clamp<std::int64_t>(field(i, exponent), -half, half - 1);
        word |= (static_cast<std::uint64_t>(value) & 0xfffff) << 20 * i;
        *values[i] = value * (std::int64_t{1} << (shifts[i] + exponent));
    }
    return word;
}

/// Sums of pixels on a plane: exact, in any order.
struct PlaneSums {
    std::int64_t n = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0, w = 0, xw = 0, yw = 0;
    std::int32_t blocks = 0;

    void add(const PlaneSums& o) {
        n += o.n;
        x += o.x;
        y += o.y;
        xx += o.xx;
        xy += o.xy;
        yy += o.yy;
        w += o.w;
        xw += o.xw;
        yw += o.yw;
        blocks += o.blocks;
    }

    /// The plane of least squares; false if the pixels lie on a line. Additions, products and quotients of doubles in
    /// this order, none of them fused, so the plane is the same on every processor.
    bool solve(Plane& plane) const {
        const double count = static_cast<double>(n), meanX = static_cast<double>(x) / count,
                     meanY = static_cast<double>(y) / count, meanW = static_cast<double>(w) / count;
        const double varianceX = static_cast<double>(xx) / count - meanX * meanX,
                     varianceY = static_cast<double>(yy) / count - meanY * meanY;
        const double mixed = static_cast<double>(xy) / count - meanX * meanY;
        const double alongX = static_cast<double>(xw) / count - meanX * meanW,
                     alongY = static_cast<double>(yw) / count - meanY * meanW;
        const double determinant = varianceX * varianceY - mixed * mixed;
        if (!(determinant > 1.0)) return false;
        const double a = (alongX * varianceY - alongY * mixed) / determinant,
                     b = (alongY * varianceX - alongX * mixed) / determinant;
        const double c = (meanW - a * meanX) - b * meanY;
        constexpr double scale = 1 << (planeBits - wBits);
        plane = {Plane::whole(a * scale), Plane::whole(b * scale), Plane::whole(c * scale)};
        return true;
    }
};

/// A pinhole camera and its pose: view space to world, three rows of four.
struct Camera {
    double fx, fy, cx, cy;
    double toWorld[12];
};

/// Vectors q with q · P = 1 for the points P of planes, in view space (1/m).
struct DualVector {
    double q[3];
};

inline DualVector dualOf(const Plane& plane, const Camera& camera, int width, int height, double unit) {
    const double scale = 1.0 / (std::int64_t{1} << planeBits) / unit;
    const double a = static_cast<double>(plane.a) * scale * 2, b = static_cast<double>(plane.b) * scale * 2; // a pixel
    const double middle = static_cast<double>(plane.c) * scale + a * (camera.cx - width / 2.0);
    return {{a * camera.fx, b * camera.fy, middle + b * (camera.cy - height / 2.0)}};
}

inline Plane planeOf(const DualVector& dual, const Camera& camera, int width, int height, double unit) {
    const double a = dual.q[0] / camera.fx, b = dual.q[1] / camera.fy;
    const double middle = dual.q[2] + a * (width / 2.0 - camera.cx);
    const double scale = (std::int64_t{1} << planeBits) * unit;
    return {Plane::whole(a / 2 * scale), Plane::whole(b / 2 * scale),
            Plane::whole((middle + b * (height / 2.0 - camera.cy)) * scale)};
}

/// How the view of one camera becomes another's: P' = rotation · (P - move).
struct Motion {
    double rotation[9], move[3];

    static Motion between(const Camera& from, const Camera& to) {
        Motion motion;
        const auto product = [](const double* m, int column, const double* n, int otherColumn) {
            double sum = m[column] * n[otherColumn];
            sum = sum + m[4 + column] * n[4 + otherColumn];
            return sum + m[8 + column] * n[8 + otherColumn];
        };
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) motion.rotation[3 * i + j] = product(to.toWorld, i, from.toWorld, j);
        double way[12] = {};
        for (int row = 0; row < 3; ++row) way[4 * row] = to.toWorld[4 * row + 3] - from.toWorld[4 * row + 3];
        for (int i = 0; i < 3; ++i) motion.move[i] = product(from.toWorld, i, way, 0);
        return motion;
    }

    /// A plane in the other camera's view; false if the camera is on the plane.
    bool apply(DualVector& dual) const {
        double along = dual.q[0] * move[0];
        along = along + dual.q[1] * move[1];
        along = along + dual.q[2] * move[2];
        const double rest = 1 - along;
        if (!(std::fabs(rest) > 1e-3)) return false;
        double rotated[3];
        for (int i = 0; i < 3; ++i) {
            double sum = rotation[3 * i] * dual.q[0];
            sum = sum + rotation[3 * i + 1] * dual.q[1];
            sum = sum + rotation[3 * i + 2] * dual.q[2];
            rotated[i] = sum / rest;
        }
        for (int i = 0; i < 3; ++i) dual.q[i] = rotated[i];
        return true;
    }
};

} // namespace colonnade::live
