// Between an application's rays and hits, in float32, and the device's integers (docs/numbers.md, section 9).
#pragma once
#include <cstring>
#include <limits>

#include "colonnade_rays.h"
#include "model/traversal.hpp"

namespace colonnade::rays {

/// value = mantissa · 2^(exponent − 24): the mantissa has 24 bits with the top one set, or is 0.
struct Float {
    std::int32_t mantissa;
    int exponent;
    bool isFinite, isNan;

    /// Subnormal numbers are 0.
    explicit Float(float value) {
        std::uint32_t bits;
        std::memcpy(&bits, &value, sizeof bits);
        const int biased = bits >> 23 & 0xff;
        const auto fraction = static_cast<std::int32_t>(bits & 0x7fffff);
        isFinite = biased != 0xff;
        isNan = !isFinite && fraction != 0;
        mantissa = biased == 0 ? 0 : fraction | 0x800000;
        if (bits >> 31) mantissa = -mantissa;
        exponent = biased - 126;
    }
};

/// The float nearest to numerator · 2^exponent / denominator, ties to even; below the least normal number it is 0. The
/// operands are not negative and have at most 64 bits, the denominator is not 0.
inline float nearestFloat(std::uint64_t numerator, std::uint64_t denominator, int exponent) {
    if (numerator == 0) return 0;
    // A quotient of 26 or 27 digits, and a bit for the rest
    const int shift = 26 + bitLength(denominator) - bitLength(numerator);
    std::int64_t digits;
    if (shift >= 0 && bitLength(numerator) + shift <= 64) {
        const std::uint64_t dividend = numerator << shift;
        digits = static_cast<std::int64_t>(dividend / denominator << 1 | (dividend % denominator != 0));
    } else {
        const UnsignedWide dividend = shift >= 0 ? UnsignedWide(numerator) << shift : numerator,
                           divisor = shift >= 0 ? denominator : UnsignedWide(denominator) << -shift;
        digits = static_cast<std::int64_t>(dividend / divisor << 1 | (dividend % divisor != 0));
    }
    const int drop = bitLength(digits) - 24;
    const double nearest = std::ldexp(static_cast<double>(nearestEven(digits, drop)), drop - 1 - shift + exponent);
    if (nearest < std::numeric_limits<float>::min()) return 0;
    return nearest > std::numeric_limits<float>::max() ? std::numeric_limits<float>::infinity()
                                                       : static_cast<float>(nearest);
}

/// Where a scene lies among the rays: registers of the device.
struct Placement {
    static constexpr int scaleBits = 24, fractionBits = 3;

    /// Vertex units in the application's unit: mantissa · 2^(exponent − 24), the mantissa's top bit set.
    std::uint32_t mantissa;
    int exponent;
    /// The application's position of (0, 0, 0), in steps of 2^(−g − exponent − 3).
    Vector base;
};

/// A ray in the device's integers.
struct ConvertedRay {
    enum class Kind { legal, refused, outOfRange };

    Kind kind;
    RayRequest request;
    /// A step of t: 2^exponent / product of the application's.
    std::uint64_t product;
    int exponent;
};

class RayConverter {
public:
    RayConverter(const Numbers& numbers, int directionBits, const Placement& placement)
        : n_(numbers), directionBits_(directionBits), placement_(placement) {}

    /// `isLocal`: the origin is relative to the position (0, 0, 0) of the device.
    ConvertedRay convert(const colonnade_rays_record& ray, bool isLocal) const {
        ConvertedRay result{};
        convert(ray, isLocal, result);
        return result;
    }

    /// Writes all of a legal ray, and the kind of others.
    void convert(const colonnade_rays_record& ray, bool isLocal, ConvertedRay& result) const {
        result.kind = ConvertedRay::Kind::refused;
        const Float near(ray.tnear), far(ray.tfar);
        if (near.isNan || far.isNan || !(ray.tnear <= ray.tfar) || far.mantissa < 0) return;
        std::array<int, 3> exponents;
        int largest = std::numeric_limits<int>::min(), dominant = 0;
        for (int a = 0; a < 3; ++a) {
            const Float direction(ray.direction[a]);
            if (!direction.isFinite || !Float(ray.origin[a]).isFinite) return;
            result.request.direction[a] = direction.mantissa;
            exponents[a] = direction.exponent;
            if (direction.mantissa != 0) largest = std::max(largest, direction.exponent);
        }
        if (largest == std::numeric_limits<int>::min()) return;
        for (int a = 0; a < 3; ++a) {
            // At most directionBits, 64
            const auto mantissa = static_cast<std::int64_t>(result.request.direction[a]);
            if (mantissa != 0 && exponents[a] == largest)
                dominant = std::max(dominant, static_cast<int>(magnitude(mantissa)));
            result.request.direction[a] =
                nearestEven(mantissa, std::min(largest - exponents[a] - (directionBits_ - 2 - 24), 62));
        }
        setStep(result, dominant, largest);
        result.request.tMin = near.mantissa > 0 ? std::min<Wide>(steps(near, result, true), n_.unlimited()) : 0;
        result.request.tMax = std::min<Wide>(steps(far, result, false) + 1, n_.unlimited());
        result.kind = ConvertedRay::Kind::legal;
        for (int a = 0; a < 3; ++a)
            if (!toGrid(ray.origin[a], isLocal ? 0 : placement_.base[a], result.request.origin[a]))
                result.kind = ConvertedRay::Kind::outOfRange;
    }

    /// Sets a step of t, from the direction's largest component.
    void setStep(ConvertedRay& ray, int mantissa, int exponent) const {
        ray.product = static_cast<std::uint64_t>(mantissa) * placement_.mantissa;
        ray.exponent = 48 - exponent - placement_.exponent - n_.gridFraction;
    }

    /// The id of a hit, with its bits.
    static std::uint32_t idOf(const Hit& hit) {
        return static_cast<std::uint32_t>(hit.id) | (hit.backSide ? COLONNADE_RAYS_BACK_SIDE : 0) |
               (hit.isClear ? COLONNADE_RAYS_NON_OPAQUE : 0);
    }

    /// A hit in the application's numbers.
    colonnade_rays_response hitOf(const ConvertedRay& converted, const Ray& ray, const Hit& hit) const {
        const auto steps = static_cast<std::uint64_t>(floorShift<Wide>(ray.tEntry, -n_.gridFraction) + hit.t);
        const auto sum = static_cast<std::uint64_t>(hit.weights[0] + hit.weights[1] + hit.weights[2]);
        return {nearestFloat(steps, converted.product, converted.exponent), idOf(hit),
                nearestFloat(static_cast<std::uint64_t>(hit.weights[1]), sum, 0),
                nearestFloat(static_cast<std::uint64_t>(hit.weights[2]), sum, 0)};
    }

private:
    /// A parameter of the ray in grid steps, rounded down or up, saturated as for a ray without a limit.
    Wide steps(const Float& t, const ConvertedRay& ray, bool isUp) const {
        if (!t.isFinite) return n_.unlimited();
        if (t.mantissa == 0) return 0;
        const Wide product = Wide(t.mantissa) * ray.product;
        const int left = t.exponent - 24 - ray.exponent;
        if (bitLength(magnitude(product)) + left > n_.sceneBits + 1) return n_.unlimited();
        return isUp ? -floorShift<Wide>(-product, -left) : floorShift<Wide>(product, -left);
    }

    /// A coordinate in grid steps; false if it is 16 box edges or more away.
    bool toGrid(float coordinate, std::int64_t base, Wide& position) const {
        const Float value(coordinate);
        const int left = value.exponent - 24 + n_.gridFraction + placement_.exponent + Placement::fractionBits;
        if (value.mantissa != 0 && left > 62 - 24) return false;
        constexpr int shift = Placement::scaleBits + Placement::fractionBits;
        const std::int64_t fixed = nearestEven<std::int64_t>(value.mantissa, std::min(-left, 62));
        const Wide distance = Wide(fixed) - base;
        if (magnitude(distance) >> (62 - Placement::scaleBits) == 0)
            position = nearestEven(static_cast<std::int64_t>(distance) * placement_.mantissa, shift);
        else position = nearestEven(distance * placement_.mantissa, shift);
        return magnitude(position) >> (n_.gridBits + 1) == 0;
    }

    Numbers n_;
    int directionBits_;
    Placement placement_;
};

} // namespace colonnade::rays
