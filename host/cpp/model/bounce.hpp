// Reflection and refraction: docs/numbers.md, section 6.
#pragma once
#include "shading.hpp"

namespace colonnade {

/// What a mirror or glass makes of a ray. `reflection`: the direction of Schlick's part, which meets the background only; its `share` has
/// 12 fraction bits and is 0 where there is none.
struct Bounce {
    bool isRefraction;
    RayRequest ray;
    Vector reflection;
    std::int64_t share;
};

/// Directions about one normal, before it is known whether they leave the surface on the right side.
struct Mirrored {
    bool isFacing, isRefraction;
    Vector direction, reflection;
    Wide cosine, nn;
};

/// x^5 of a number with `fraction` fraction bits, floored at each product.
inline std::int64_t fifthPower(std::int64_t x, int fraction) {
    const std::int64_t square = (x * x) >> fraction, fourth = (square * square) >> fraction;
    return (fourth * x) >> fraction;
}

inline Mirrored mirrorAbout(const WideVector& about, const Surface& surface, const Material& material, const Numbers& n) {
    Mirrored result{};
    Vector normal;
    blockNormalise(about, n.shadeBits, normal);
    const Wide nn = dot(normal, normal), against = -dot(normal, surface.dir);
    result.isFacing = against > 0;
    result.cosine = std::max<Wide>(0, against);
    result.nn = nn;

    // d · (n·n) − 2 (n·d) · n, both factors to shadeBits
    const int drop = bitLength(nn) - n.shadeBits, keep = n.shadeBits - 4;
    const std::int64_t square = static_cast<std::int64_t>(floorShift(nn, drop)), along = static_cast<std::int64_t>(floorShift(result.cosine, drop));
    for (int a = 0; a < 3; ++a)
        result.reflection[a] = static_cast<std::int64_t>(floorShift<Wide>(Wide(square) * surface.dir[a] + 2 * Wide(along) * normal[a], keep));
    result.direction = result.reflection;
    if (material.kind != MaterialKind::glass) return result;

    // The squared length of the refracted ray's part along the normal: negative is total reflection
    const std::int64_t eta = material.eta[surface.backSide];
    const std::int64_t etaSquared = (eta * eta) >> n.etaFraction;
    const int small = drop - (n.shadeBits - 1), low = std::max(0, 2 * n.shadeBits + 1 - n.rootBits);
    const Wide dd = dot(surface.dir, surface.dir) >> (n.shadeBits - 1);
    const Wide whole = floorShift<Wide>(Wide(square) * dd, low), upright = floorShift<Wide>(floorShift<Wide>(Wide(along) * along, -small), low);
    const Wide rest = whole - floorShift<Wide>(std::max<Wide>(0, whole - upright) * etaSquared, n.etaFraction);
    if (rest < 0) return result;

    // Its root, in the scale of `along`: root² = rest · 2^(low − small)
    const Normalised radicand = normalise(UnsignedWide(rest), n.radicandBits);
    const int exponent = radicand.exponent - n.radicandBits + low - small;
    const bool odd = exponent & 1;
    const Wide root = floorShift<Wide>(squareRoot(odd ? radicand.mantissa >> 1 : radicand.mantissa), -((exponent + (odd ? 1 : 0)) / 2));
    const Wide scale = floorShift<Wide>(Wide(eta) * square, n.etaFraction), deeper = floorShift<Wide>(Wide(eta) * along, n.etaFraction) - root;
    for (int a = 0; a < 3; ++a)
        result.direction[a] = static_cast<std::int64_t>(floorShift<Wide>(scale * surface.dir[a] + deeper * normal[a], keep));
    result.isRefraction = true;
    return result;
}

/// Where a ray goes on from a mirror or from glass. The shading normal is the smooth one unless that turns away from the ray, or would send the
/// ray to the wrong side of the surface: then the geometric one.
inline Bounce bounce(const Surface& surface, const Material& material, bool flat, std::int64_t offset, const Numbers& n) {
    const WideVector geometric = {surface.faceForwardNormal[0], surface.faceForwardNormal[1], surface.faceForwardNormal[2]};
    const bool isSmooth = !flat && !isZero(surface.smooth);
    Mirrored mirrored = mirrorAbout(shadingNormal(surface, flat), surface, material, n);
    if (isSmooth) {
        const Wide side = dot(mirrored.direction, surface.faceForwardNormal);
        if (!mirrored.isFacing || (mirrored.isRefraction ? side >= 0 : side <= 0)) mirrored = mirrorAbout(geometric, surface, material, n);
    }

    Bounce result{};
    result.isRefraction = mirrored.isRefraction;
    result.reflection = mirrored.reflection;
    result.ray = {offSurface(surface.point, surface.faceForwardNormal, mirrored.isRefraction ? -offset : offset, n), {}, n.unlimited(), ~std::uint64_t(0)};
    for (int a = 0; a < 3; ++a) result.ray.direction[a] = mirrored.direction[a];
    if (mirrored.isRefraction && !surface.backSide) {
        const std::int64_t one = std::int64_t(1) << n.lightFraction;
        const std::int64_t cosine = cosineOf(mirrored.cosine, mirrored.nn, dot(surface.dir, surface.dir), n);
        const std::int64_t away = one - floorShift(cosine, n.cosineFraction - n.lightFraction);
        result.share = material.reflectance + (((one - material.reflectance) * fifthPower(away, n.lightFraction)) >> n.lightFraction);
    }
    return result;
}

} // namespace colonnade
