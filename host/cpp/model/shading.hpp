// Shader: docs/numbers.md, section 5.
#pragma once
#include "traversal.hpp"

namespace colonnade {

using Colour = std::array<std::int64_t, 3>;

/// What the frame registers say of light and materials; fixed point as in docs/numbers.md.
struct Lighting {
    WideVector lightPosition;
    Colour lightColour, ambient, background;
    std::int64_t shadowOffset;
    bool flat, shadows;
    std::vector<Colour> albedo;
};

/// The outcome at a hit: both colours the pixel may have, and the shadow ray that decides.
struct Shading {
    Colour lit, ambient;
    bool needsShadowRay;
    RayRequest shadowRay;
};

/// Scales a vector so that its largest component takes `bits` magnitude bits.
inline Vector blockNormalise(const WideVector& v, int bits) {
    UnsignedWide all = 0;
    for (const Wide component : v) all = std::max(all, magnitude(component));
    const int drop = bitLength(all) - bits;
    return {static_cast<std::int64_t>(floorShift(v[0], drop)), static_cast<std::int64_t>(floorShift(v[1], drop)),
            static_cast<std::int64_t>(floorShift(v[2], drop))};
}

inline Wide dot(const Vector& a, const Vector& b) { return Wide(a[0]) * b[0] + Wide(a[1]) * b[1] + Wide(a[2]) * b[2]; }

/// dot / sqrt(nn * ll), `cosineFraction` fraction bits, at most 1.
inline std::int64_t cosineOf(Wide dotProduct, Wide nn, Wide ll, const Numbers& n) {
    if (dotProduct <= 0) return 0;
    const Normalised u = normalise(nn, n.shadeBits), v = normalise(ll, n.shadeBits);
    const Normalised product = normalise(UnsignedWide(u.mantissa) * v.mantissa, n.radicandBits);
    // nn * ll = mantissa * 2^(exponent - radicandBits)
    const int exponent = u.exponent + v.exponent + product.exponent - 2 * n.shadeBits;
    const bool odd = exponent & 1;
    const std::uint64_t root = squareRoot(odd ? product.mantissa >> 1 : product.mantissa);
    const int rootExponent = (exponent + (odd ? 1 : 0)) / 2;
    // length = root * 2^(rootExponent - radicandBits / 2)
    const Normalised dividend = normalise(dotProduct, n.mantissaBits), divisor = normalise(root, n.mantissaBits);
    const int divisorExponent = divisor.exponent + rootExponent - n.radicandBits / 2;
    const Wide quotient = floorShift<Wide>(divide(dividend.mantissa, divisor.mantissa, n.cosineFraction), divisorExponent - dividend.exponent);
    return static_cast<std::int64_t>(std::min<Wide>(quotient, Wide(1) << n.cosineFraction));
}

inline Shading shade(const Ray& ray, const Hit& hit, const Face& face, const Lighting& lighting, const Numbers& n) {
    // The hit point, and the shadow ray's origin above it
    WideVector permuted, point;
    for (int a = 0; a < 2; ++a) permuted[a] = ray.origin[a] + nearestEven<Wide>(Wide(ray.shear[a]) * hit.t, n.shearFraction);
    permuted[2] = ray.negative[2] ? Wide(ray.origin[2]) - hit.t : Wide(ray.origin[2]) + hit.t;
    for (int a = 0; a < 3; ++a) point[ray.objectAxis(a)] = permuted[a];
    Vector facing = face.geometricNormal;
    if (hit.backSide)
        for (auto& component : facing) component = -component;
    for (int a = 0; a < 3; ++a) point[a] += nearestEven<Wide>(Wide(lighting.shadowOffset) * facing[a], n.normalFraction);

    // The shading normal
    WideVector normal = {facing[0], facing[1], facing[2]};
    if (!lighting.flat) {
        WideVector smooth = {0, 0, 0};
        for (int corner = 0; corner < 3; ++corner)
            for (int a = 0; a < 3; ++a) smooth[a] += Wide(hit.weights[corner]) * face.normals[corner][a];
        if (smooth[0] != 0 || smooth[1] != 0 || smooth[2] != 0)
            for (int a = 0; a < 3; ++a) normal[a] = hit.backSide ? -smooth[a] : smooth[a];
    }

    // Towards the light
    Shading result{};
    WideVector toLight;
    for (int a = 0; a < 3; ++a) toLight[a] = lighting.lightPosition[a] - point[a];
    const Vector shadingNormal = blockNormalise(normal, n.shadeBits), shadingLight = blockNormalise(toLight, n.shadeBits);
    const Wide facingLight = dot(shadingNormal, shadingLight);
    const std::int64_t cosine =
        cosineOf(facingLight, dot(shadingNormal, shadingNormal), dot(shadingLight, shadingLight), n);
    result.needsShadowRay = lighting.shadows && facingLight > 0;
    const int dominant = dominantAxis(toLight);
    result.shadowRay = {point, toLight, static_cast<Wide>(magnitude(toLight[dominant])), 0};

    // Both colours
    const std::int64_t white = (std::int64_t(1) << n.colourBits) - 1;
    const Colour albedo = lighting.albedo[static_cast<std::size_t>(face.material) % lighting.albedo.size()];
    for (int channel = 0; channel < 3; ++channel) {
        const std::int64_t direct = (lighting.lightColour[channel] * cosine) >> n.cosineFraction;
        result.lit[channel] = std::min(white, (albedo[channel] * (lighting.ambient[channel] + direct)) >> n.lightFraction);
        result.ambient[channel] = std::min(white, (albedo[channel] * lighting.ambient[channel]) >> n.lightFraction);
    }
    return result;
}

} // namespace colonnade
