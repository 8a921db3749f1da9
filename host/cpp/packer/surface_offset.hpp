/// The distance from a surface at which shadow rays and bounces start (docs/numbers.md, "Off the surface").
#pragma once

#include <cmath>

namespace colonnade::packer {

/// The number formats that it depends on.
struct OffsetFormat {
    int gridFraction, weightBits, mantissaBits, distanceDigits;
};

/// Bound of the error of a hit's t, grid steps. `largestTriangle`: greatest extent of a triangle along an axis, vertex
/// units.
inline double distanceError(const OffsetFormat& n, int largestTriangle) {
    const double weights = 4 / (std::ldexp(1, n.weightBits) - 6),
                 quotient = std::ldexp(1, 1 - n.mantissaBits) + std::ldexp(1, 1 - n.distanceDigits);
    return 1 + std::ldexp(largestTriangle, n.gridFraction) * (weights + quotient);
}

/// The least `shading.offset` with which no ray hits the plane that it leaves, grid steps.
inline long surfaceOffset(const OffsetFormat& n, int largestTriangle) {
    // The geometric normal is at least this long along the exact one, see unitLength
    const double normalLength = 0.99, root = std::sqrt(3.0);
    const double vertices = root / 2 * (std::ldexp(1, n.gridFraction) + (n.gridFraction < 0 ? 1 : 0));
    const double hit = root * distanceError(n, largestTriangle) + std::sqrt(2.0), offset = root / 2;
    return static_cast<long>(std::ceil((2 * vertices + 2 * hit + offset) / normalLength));
}

} // namespace colonnade::packer
