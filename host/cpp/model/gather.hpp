// Gathered rays: their sample points and directions, and the light that they meet (docs/gather.md).
#pragma once
#include "shading.hpp"

namespace colonnade {

/// A sample point of a scattered ray, one byte for each dimension.
struct SamplePoint {
    std::uint8_t u, v;

    SamplePoint operator^(const SamplePoint& other) const {
        return {static_cast<std::uint8_t>(u ^ other.u), static_cast<std::uint8_t>(v ^ other.v)};
    }
};

/// Registers of gathered rays. `bounces`: gathered rays of a path, 0 for none; `points`: the frame's sample point of
/// each of them; `parallax`: the distance of the light cube's surfaces is 2^(parallax - 1) edges of the object's cube,
/// infinite if it is 0.
struct Gather {
    int bounces, parallax;
    std::array<SamplePoint, 4> points;

    /// The point of a rough mirror or of rough glass, for a path that has gathered so many rays.
    const SamplePoint& microfacetPoint(int gathered, bool backSide) const {
        return points[(static_cast<std::size_t>(gathered) ^ (backSide ? 2 : 3)) & 3];
    }
};

/// Low bits of a pixel's coordinates that count.
constexpr int coordinateBits = 10;

/// What each bit of a pixel's Morton code (x in the even bits, low ones first) adds to its point: the third and the
/// fourth dimension of Sobol's sequence (Joe and Kuo 2008).
inline const std::array<SamplePoint, 2 * coordinateBits>& pixelMatrix() {
    static const auto matrix = [] {
        std::array<SamplePoint, 2 * coordinateBits> columns{};
        struct Dimension {
            int degree, coefficients;
            std::array<std::uint64_t, 3> first;
            std::uint8_t SamplePoint::* byte;
        };
        for (const auto& [degree, coefficients, first, byte] :
             {Dimension{2, 1, {1, 3, 0}, &SamplePoint::u}, Dimension{3, 1, {1, 3, 1}, &SamplePoint::v}}) {
            std::vector<std::uint64_t> m(first.begin(), first.begin() + degree);
            for (int k = degree; k < 2 * coordinateBits; ++k) {
                std::uint64_t value = m[k - degree] ^ (m[k - degree] << degree);
                for (int i = 1; i < degree; ++i)
                    value ^= static_cast<std::uint64_t>(coefficients >> (degree - 1 - i) & 1) * (m[k - i] << i);
                m.push_back(value);
            }
            // m / 2^(k + 1) is a fraction: its highest eight bits
            for (int k = 0; k < 2 * coordinateBits; ++k)
                columns[k].*byte = static_cast<std::uint8_t>((m[k] << 8) >> (k + 1));
        }
        return columns;
    }();
    return matrix;
}

inline SamplePoint pixelPoint(std::int64_t x, std::int64_t y) {
    SamplePoint point{0, 0};
    for (int bit = 0; bit < coordinateBits; ++bit) {
        if (x >> bit & 1) point = point ^ pixelMatrix()[2 * bit];
        if (y >> bit & 1) point = point ^ pixelMatrix()[2 * bit + 1];
    }
    return point;
}

/// The point of the unit sphere that a sample point stands for; 8 fraction bits.
inline Vector spherePoint(const SamplePoint& point) {
    const auto rounded = [](double x) { return static_cast<std::int64_t>(std::nearbyint(256 * x)); };
    const std::int64_t z = 255 - 2 * point.u;
    const std::int64_t radius = rounded(std::sqrt(1.0 - static_cast<double>(z * z) / 65536.0));
    const int quarter = point.v >> 6, angle = point.v & 63;
    Vector result{0, 0, z};
    for (int axis = 0; axis < 2; ++axis) {
        const bool isBackwards = ((quarter & 1) != 0) != (axis == 1);
        const int index = isBackwards ? 63 - angle : angle;
        const std::int64_t across =
            (radius * rounded(std::cos((index + 0.5) * 3.14159265358979323846 / 128)) + 128) >> 8;
        const bool isMinus = axis == 0 ? quarter == 1 || quarter == 2 : quarter >= 2;
        result[axis] = isMinus ? -across : across;
    }
    return result;
}

/// The direction in which a smooth mirror would reflect a ray, the axis of a rough one's lobe; its largest component
/// has `shadeBits` bits.
inline WideVector lobeAxis(const WideVector& about, const Vector& dir, const Numbers& n) {
    Vector normal, ray, reflection;
    blockNormalise(about, n.shadeBits, normal);
    for (int a = 0; a < 3; ++a) {
        normal[a] = floorShift(normal[a], n.shadeBits - 12);
        ray[a] = floorShift(dir[a], n.shadeBits - 12);
    }
    const Wide square = dot(normal, normal), against = std::max<Wide>(0, -dot(normal, ray));
    const int drop = bitLength(square) - 12;
    const std::int64_t length = static_cast<std::int64_t>(floorShift(square, drop)),
                       along = static_cast<std::int64_t>(floorShift(against, drop));
    WideVector sum;
    for (int a = 0; a < 3; ++a) sum[a] = length * ray[a] + 2 * along * normal[a];
    blockNormalise(sum, n.shadeBits, reflection);
    return {reflection[0], reflection[1], reflection[2]};
}

/// An axis as scattered rays see it, with 11 bits, half its length, and a sample point's part along it, in units of the
/// length.
struct ScatterAxis {
    Vector axis;
    std::int64_t length, lift;

    ScatterAxis(const WideVector& about, const Vector& sphere, const Numbers& n) {
        Vector scaled;
        blockNormalise(about, n.shadeBits, scaled);
        for (int a = 0; a < 3; ++a) axis[a] = floorShift(scaled[a], n.shadeBits - 11);
        length = static_cast<std::int64_t>(
            squareRoot(static_cast<std::uint64_t>(floorShift(dot(scaled, scaled), 2 * n.shadeBits + 2 - 22))));
        lift = static_cast<std::int64_t>(floorShift(dot(sphere, axis) + 256, 9));
    }

    /// The vector across the axis and a sample point, times the length and a width with 7 fraction bits.
    Vector across(const Vector& sphere, std::int64_t alpha) const {
        Vector result;
        for (int a = 0; a < 3; ++a) {
            const int b = (a + 1) % 3, c = (a + 2) % 3;
            result[a] = floorShift(alpha * length + 64, 7) * floorShift(sphere[b] * axis[c] - sphere[c] * axis[b], 8);
        }
        return result;
    }
};

/// The sum of two vectors without its low 11 bits. If it is not on the side of a third one it is negated, or else the
/// difference replaces it. It is never zero.
inline Vector onSide(const Vector& along, const Vector& across, const Vector& side, bool isNegated) {
    Vector direction;
    Wide sum = 0;
    for (int a = 0; a < 3; ++a) {
        direction[a] = floorShift(along[a] + across[a], 11);
        sum += floorShift(direction[a], 2) * side[a];
    }
    if (sum < 0)
        for (int a = 0; a < 3; ++a) direction[a] = isNegated ? -direction[a] : floorShift(along[a] - across[a], 11);
    direction[2] |= 1;
    return direction;
}

/// The direction of the ray that gathers light at a surface, about an axis of any length: n + |n| · s at a diffuse one,
/// about its normal; for a rough metal a ray of its lobe. One that points below the surface is negated, or lies on the
/// other side of the lobe's axis. It is never zero.
inline Vector gatherDirection(const WideVector& about, const Vector& faceForwardNormal, const SamplePoint& point,
                              const Lobe* lobe, const Numbers& n) {
    const Vector sphere = spherePoint(point);
    const ScatterAxis frame(about, sphere, n);
    Vector along, across, side;
    const std::int64_t lowered =
        lobe ? floorShift(
                   lobe->alpha * floorShift(lobe->alpha * std::max<std::int64_t>(0, frame.length + frame.lift), 8), 8)
             : 0;
    if (lobe) across = frame.across(sphere, lobe->alpha);
    for (int a = 0; a < 3; ++a) {
        along[a] = lobe ? (frame.length - frame.lift - lowered) * frame.axis[a] : frame.axis[a] << 10;
        if (!lobe) across[a] = frame.length * sphere[a] << 3;
        side[a] = floorShift(faceForwardNormal[a], 4);
    }
    return onSide(along, across, side, !lobe);
}

/// The normal of a microfacet of a rough mirror or of rough glass, of any length. One that faces away from a ray in the
/// direction `dir` lies on the other side of the normal. `alpha` has 10 fraction bits.
inline WideVector microfacetNormal(const WideVector& normal, const Vector& dir, const SamplePoint& point,
                                   std::int64_t alpha, const Numbers& n) {
    const Vector sphere = spherePoint(point);
    const ScatterAxis frame(normal, sphere, n);
    Vector along, across = frame.across(sphere, alpha), side;
    for (int a = 0; a < 3; ++a) {
        along[a] = (frame.length - frame.lift + 1) * frame.axis[a];
        across[a] = floorShift(across[a], 3);
        side[a] = ~floorShift(dir[a], n.shadeBits - 8);
    }
    const Vector found = onSide(along, across, side, false);
    return {found[0], found[1], found[2]};
}

/// The light cube: linear radiance by direction, 12 fraction bits, and where lights are; faces of 16 × 16 texels. The
/// fields of a word are its mantissas of 7 bits, blue lowest, their exponent of 4 bits and whether there is a light.
class LightCube {
public:
    static constexpr int faceLog = 4, texels = 6 << (2 * faceLog);
    static constexpr std::size_t wordBytes = 4;

    /// Loads texels from address 0; words of `wordBytes` bytes, low byte first.
    void load(const std::uint8_t* words, std::size_t count) {
        for (std::size_t i = 0; i < std::min(count, texels_.size()); ++i, words += wordBytes) {
            const std::uint32_t word =
                words[0] | words[1] << 8 | words[2] << 16 | static_cast<std::uint32_t>(words[3]) << 24;
            for (std::size_t channel = 0; channel < 3; ++channel)
                texels_[i][channel] = (word >> (14 - 7 * channel) & 127) << (word >> 21 & 15) & most;
            isLight_[i] = word >> 25 & 1;
        }
    }

    /// What a ray meets that leaves the object, from an origin in grid steps; the lights are seen by paths that have
    /// gathered nothing.
    Colour light(const WideVector& origin, const WideVector& direction, int parallax, bool seesLights,
                 const Numbers& n) const {
        const std::size_t address = addressOf(fromMiddle(origin, direction, parallax, n));
        return seesLights && isLight_[address] ? Colour{most, most, most} : texels_[address];
    }

private:
    static constexpr std::int64_t most = 0xffff;

    /// The direction, seen from the middle of the object's cube, of the point that a ray meets.
    static Vector fromMiddle(const WideVector& origin, const WideVector& direction, int parallax, const Numbers& n) {
        Vector scaled;
        blockNormalise(direction, 8, scaled);
        std::int64_t major = 0;
        for (int a = 0; a < 3; ++a) major = std::max(major, (scaled[a] < 0 ? ~scaled[a] : scaled[a]) >> 5);
        for (int a = 0; a < 3; ++a) {
            const auto offset = static_cast<std::int64_t>(
                floorShift<Wide>(origin[a] - (Wide(1) << (n.gridBits - 4)), n.gridBits - 9 + parallax));
            scaled[a] = floorShift(
                2 * scaled[a] + 1 + (parallax == 0 ? 0 : (2 * std::clamp<std::int64_t>(offset, -32, 31) + 1) * major),
                2);
        }
        return scaled;
    }

    static std::size_t addressOf(const Vector& scaled) {
        std::array<std::int64_t, 3> size;
        for (int a = 0; a < 3; ++a) size[a] = scaled[a] < 0 ? -scaled[a] : scaled[a];
        const int axis = size[0] >= size[1] && size[0] >= size[2] ? 0 : size[1] >= size[2] ? 1 : 2;
        std::size_t address = static_cast<std::size_t>(2 * axis + (scaled[axis] < 0));
        for (int next = 1; next < 3; ++next) {
            std::int64_t left = scaled[(axis + next) % 3] + size[axis];
            for (int digit = 0; digit < faceLog; ++digit) {
                const bool fits = left >= size[axis];
                address = 2 * address + fits;
                left = 2 * (fits ? left - size[axis] : left);
            }
        }
        return address;
    }

    std::array<Colour, texels> texels_{};
    std::array<bool, texels> isLight_{};
};

} // namespace colonnade
