// Reflection and refraction: docs/numbers.md, section 6.
#pragma once
#include "shading.hpp"

namespace colonnade {

/// The continuation of a path at a mirror or glass. `reflection` is the direction of the Fresnel reflection, which sees
/// only the background. `fresnelWeight` has 12 fraction bits and is 0 without such a reflection.
struct Bounce {
    bool isRefraction;
    RayRequest ray;
    Vector reflection;
    std::int64_t fresnelWeight;
};

/// Reflected and refracted directions for one normal, before the check of the hemisphere.
struct MirrorDirections {
    bool isFacing, isRefraction;
    Vector direction, reflection;
    Wide cosine, nn;
};

/// x^5 for a number with `fraction` fraction bits; each product is rounded down.
inline std::int64_t fifthPower(std::int64_t x, int fraction) {
    const std::int64_t square = (x * x) >> fraction, fourth = (square * square) >> fraction;
    return (fourth * x) >> fraction;
}

inline MirrorDirections mirrorAbout(const WideVector& about, const Surface& surface, const Material& material,
                                    const Numbers& n) {
    MirrorDirections result{};
    Vector normal;
    blockNormalise(about, n.shadeBits, normal);
    const Wide nn = dot(normal, normal), againstNormal = -dot(normal, surface.dir);
    result.isFacing = againstNormal > 0;
    result.cosine = std::max<Wide>(0, againstNormal);
    result.nn = nn;

    // Reflection d · (n·n) − 2 (n·d) · n, both factors to shadeBits
    const int drop = bitLength(nn) - n.shadeBits, keep = n.shadeBits - 4;
    const std::int64_t square = static_cast<std::int64_t>(floorShift(nn, drop)),
                       along = static_cast<std::int64_t>(floorShift(result.cosine, drop));
    for (int a = 0; a < 3; ++a)
        result.reflection[a] = static_cast<std::int64_t>(
            floorShift<Wide>(Wide(square) * surface.dir[a] + 2 * Wide(along) * normal[a], keep));
    result.direction = result.reflection;
    if (material.kind != MaterialKind::glass) return result;

    // Discriminant: squared length of the refracted direction along the normal; negative for total internal reflection
    const std::int64_t eta = material.eta[surface.backSide];
    const std::int64_t etaSquared = (eta * eta) >> n.etaFraction;
    const int small = drop - (n.shadeBits - 1), low = std::max(0, 2 * n.shadeBits + 1 - n.rootBits);
    const Wide dd = dot(surface.dir, surface.dir) >> (n.shadeBits - 1);
    const Wide etaTerm = floorShift<Wide>(Wide(square) * dd, low),
               normalTerm = floorShift<Wide>(floorShift<Wide>(Wide(along) * along, -small), low);
    const Wide discriminant =
        etaTerm - floorShift<Wide>(std::max<Wide>(0, etaTerm - normalTerm) * etaSquared, n.etaFraction);
    if (discriminant < 0) return result;

    // Its root, in the scale of `along`: root² = discriminant · 2^(low − small)
    const Normalised radicand = normalise(UnsignedWide(discriminant), n.radicandBits);
    const int exponent = radicand.exponent - n.radicandBits + low - small;
    const bool odd = exponent & 1;
    const Wide root = floorShift<Wide>(squareRoot(odd ? radicand.mantissa >> 1 : radicand.mantissa),
                                       -((exponent + (odd ? 1 : 0)) / 2));
    const Wide directionScale = floorShift<Wide>(Wide(eta) * square, n.etaFraction),
               normalScale = floorShift<Wide>(Wide(eta) * along, n.etaFraction) - root;
    for (int a = 0; a < 3; ++a)
        result.direction[a] = static_cast<std::int64_t>(
            floorShift<Wide>(directionScale * surface.dir[a] + normalScale * normal[a], keep));
    result.isRefraction = true;
    return result;
}

/// Continues a ray at a mirror or glass. The shading normal is the smooth one, or a microfacet's. The geometric normal
/// replaces it if it faces away from the ray, or if the direction would leave on the wrong side of the surface.
inline Bounce bounce(const Surface& surface, const Material& material, bool flat, std::int64_t offset, const Numbers& n,
                     const WideVector* microfacet = nullptr) {
    const WideVector geometric = {surface.faceForwardNormal[0], surface.faceForwardNormal[1],
                                  surface.faceForwardNormal[2]};
    const bool isGeometric = !microfacet && (flat || isZero(surface.smooth));
    MirrorDirections directions =
        mirrorAbout(microfacet ? *microfacet : shadingNormal(surface, flat), surface, material, n);
    if (!isGeometric) {
        const Wide hemisphereCheck = dot(directions.direction, surface.faceForwardNormal);
        if (!directions.isFacing || (directions.isRefraction ? hemisphereCheck >= 0 : hemisphereCheck <= 0))
            directions = mirrorAbout(geometric, surface, material, n);
    }

    Bounce result{};
    result.isRefraction = directions.isRefraction;
    result.reflection = directions.reflection;
    result.ray = {offSurface(surface.point, surface.faceForwardNormal, directions.isRefraction ? -offset : offset, n),
                  {},
                  n.unlimited()};
    for (int a = 0; a < 3; ++a) result.ray.direction[a] = directions.direction[a];
    if (directions.isRefraction && !surface.backSide) {
        const std::int64_t one = std::int64_t(1) << n.lightFraction;
        const std::int64_t cosine = cosineOf(directions.cosine, directions.nn, dot(surface.dir, surface.dir), n);
        const std::int64_t oneMinusCosine = one - floorShift(cosine, n.cosineFraction - n.lightFraction);
        result.fresnelWeight =
            material.reflectance +
            (((one - material.reflectance) * fifthPower(oneMinusCosine, n.lightFraction)) >> n.lightFraction);
    }
    return result;
}

} // namespace colonnade
