// Surfaces and lights (docs/numbers.md, section 5).
#pragma once
#include <cmath>

#include "traversal.hpp"

namespace colonnade {

using Colour = std::array<std::int64_t, 3>;

/// How a surface continues a path.
enum class MaterialKind : std::uint8_t { diffuse = 0, mirror = 1, glass = 2, roughMetal = 3 };

/// How wide and how bright a rough surface spreads its reflections (docs/gather.md): `alpha` has 8 fraction bits at
/// rough metal, 10 at mirrors and glass, where 0 spreads nothing; `slope` has 6, `peak` is a logarithm.
struct Lobe {
    std::int64_t alpha, slope, peak;
};

/// A material. `eta` is the relative index of refraction on the front and the back side; `reflectance` is at normal
/// incidence, 12 fraction bits.
struct Material {
    Colour albedo;
    /// The albedo comes from the corners of the face.
    bool hasCornerColours;
    /// The albedo comes from the texture, at the position that the corners give.
    bool hasTexture;
    /// Added to the light that a diffuse surface reflects.
    Colour emission;
    MaterialKind kind;
    std::array<std::int64_t, 2> eta;
    std::int64_t reflectance;
    Lobe lobe;
};

/// A point light. With `reachMantissa` = 0 its intensity is constant. Otherwise it has its colour where the squared
/// distance is reachMantissa · 2^reachExponent, in grid steps.
struct Light {
    WideVector position;
    Colour colour;
    std::int64_t reachMantissa;
    int reachExponent;
};

/// Registers of lights, materials and shading, in the fixed-point formats of docs/numbers.md.
struct Lighting {
    std::vector<Light> lights;
    Colour ambient, background;
    std::int64_t offset, shadowTransmittance;
    /// Whether transmissive triangles transmit light; otherwise they are opaque.
    bool hasTransmittance;
    bool flat, shadows;
    int bounces;
    std::vector<Material> materials;

    /// The material of a face: the index modulo the next power of two, or entry 0 beyond the table.
    const Material& materialOf(const Face& face) const {
        const std::size_t index =
            static_cast<std::size_t>(face.material) & ((std::size_t(1) << bitLength(materials.size() - 1)) - 1);
        return materials[index < materials.size() ? index : 0];
    }
};

/// The surface at a hit. `faceForwardNormal` and `smooth` face the ray's origin. `dir` is the ray's direction, with a
/// dominant component of ±2^(shadeBits − 1).
struct Surface {
    WideVector point;
    Vector faceForwardNormal;
    WideVector smooth;
    Vector dir;
    bool backSide;
};

/// The light that an unoccluded light source gives to a surface, and the shadow ray that tests for occlusion.
struct Illumination {
    Colour direct;
    bool needsShadowRay;
    RayRequest shadowRay;
};

/// Scales a vector so that its largest component has `bits` magnitude bits; returns the right shift.
inline int blockNormalise(const WideVector& v, int bits, Vector& scaled) {
    UnsignedWide all = 0;
    for (const Wide component : v) all |= magnitude(component);
    const int shift = bitLength(all) - bits;
    for (int a = 0; a < 3; ++a) scaled[a] = shiftToFit(v[a], shift, all);
    return shift;
}

inline Wide dot(const Vector& a, const Vector& b) { return Wide(a[0]) * b[0] + Wide(a[1]) * b[1] + Wide(a[2]) * b[2]; }

/// dot / sqrt(nn * ll) with `cosineFraction` fraction bits, at most 1.
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
    const Wide quotient = floorShift<Wide>(divide(dividend.mantissa, divisor.mantissa, n.cosineFraction),
                                           divisorExponent - dividend.exponent);
    return static_cast<std::int64_t>(std::min<Wide>(quotient, Wide(1) << n.cosineFraction));
}

inline Surface surfaceOf(const Ray& ray, const Hit& hit, const Face& face, const Numbers& n) {
    Surface surface{};
    surface.backSide = hit.backSide;
    WideVector permuted;
    for (int a = 0; a < 2; ++a)
        permuted[a] = ray.origin[a] + nearestEven<Wide>(Wide(ray.shear[a]) * hit.t, n.shearFraction);
    permuted[2] = ray.negative[2] ? Wide(ray.origin[2]) - hit.t : Wide(ray.origin[2]) + hit.t;
    const int slopeDrop = n.shearFraction - (n.shadeBits - 1);
    const std::int64_t one = std::int64_t(1) << (n.shadeBits - 1);
    for (int a = 0; a < 3; ++a) {
        const int axis = ray.objectAxis(a);
        surface.point[axis] = permuted[a];
        surface.dir[axis] = a < 2 ? floorShift(ray.shear[a], slopeDrop) : ray.negative[2] ? -one : one;
        surface.faceForwardNormal[axis] = hit.backSide ? -face.geometricNormal[axis] : face.geometricNormal[axis];
        for (int corner = 0; corner < 3; ++corner)
            surface.smooth[axis] += Wide(hit.weights[corner]) * face.normals[corner][axis];
        if (hit.backSide) surface.smooth[axis] = -surface.smooth[axis];
    }
    return surface;
}

/// The colours at the corners of a face, interpolated at a hit: a quotient of sums, rounded to nearest. White if all
/// weights are 0.
inline Colour cornerColour(const Hit& hit, const Face& face, const Numbers& n) {
    const std::int64_t total = hit.weights[0] + hit.weights[1] + hit.weights[2];
    Colour colour;
    for (int channel = 0; channel < 3; ++channel) {
        std::int64_t sum = total / 2;
        for (int corner = 0; corner < 3; ++corner) sum += hit.weights[corner] * face.colours[corner][channel];
        colour[channel] = total == 0 ? (std::int64_t(1) << n.colourBits) - 1 : sum / total;
    }
    return colour;
}

/// Moves a position off the surface, along the normal for a positive offset.
inline WideVector offSurface(const WideVector& point, const Vector& faceForwardNormal, std::int64_t offset,
                             const Numbers& n) {
    WideVector moved;
    for (int a = 0; a < 3; ++a)
        moved[a] = point[a] + nearestEven<Wide>(Wide(offset) * faceForwardNormal[a], n.normalFraction);
    return moved;
}

inline bool isZero(const WideVector& v) { return v[0] == 0 && v[1] == 0 && v[2] == 0; }

/// The normal for lighting and bounces: the smooth one unless it is zero or `flat` is set.
inline WideVector shadingNormal(const Surface& surface, bool flat) {
    return flat || isZero(surface.smooth)
               ? WideVector{surface.faceForwardNormal[0], surface.faceForwardNormal[1], surface.faceForwardNormal[2]}
               : surface.smooth;
}

/// How brightly a rough metal shows a light at an angle to its axis, as a multiple of `cosineFraction` fraction bits.
inline std::int64_t lobeShare(std::int64_t cosine, const Lobe& lobe, const Numbers& n) {
    static const auto logarithms = [] {
        std::array<std::int64_t, 128> table;
        for (std::size_t i = 0; i < table.size(); ++i)
            table[i] = std::lrint(128 * std::log2(1 + (static_cast<double>(i) + 0.5) / 128));
        return table;
    }();
    static const auto powers = [] {
        std::array<std::int64_t, 128> table;
        for (std::size_t i = 0; i < table.size(); ++i)
            table[i] = std::lrint(256 * std::exp2(static_cast<double>(i) / 128));
        return table;
    }();
    const int fraction = n.cosineFraction, slopeFraction = 6;
    const std::int64_t one = std::int64_t(1) << fraction;
    const Normalised length =
        normalise(static_cast<UnsignedWide>((one << slopeFraction) + lobe.slope * (one - cosine)), 8);
    const std::int64_t octaves = length.exponent - (fraction + slopeFraction + 1);
    const std::int64_t logarithm = lobe.peak - 2 * 128 - 2 * (128 * octaves + logarithms[length.mantissa & 127]);
    const int exponent = static_cast<int>(floorShift(logarithm, 7));
    const std::int64_t most = (one << 6) - 1;
    return exponent > 5 ? most : floorShift(powers[static_cast<std::size_t>(logarithm & 127)], 8 - fraction - exponent);
}

/// Illumination by one light at `origin` (off the surface), for a normal of any length; at a rough metal for the axis
/// of its lobe.
inline Illumination illuminate(const WideVector& origin, const WideVector& normal, const Light& light, bool shadows,
                               const Numbers& n, const Lobe* lobe = nullptr) {
    WideVector toLight;
    for (int a = 0; a < 3; ++a) toLight[a] = light.position[a] - origin[a];
    Vector shadingNormal, shadingLight;
    blockNormalise(normal, n.shadeBits, shadingNormal);
    const int shift = blockNormalise(toLight, n.shadeBits, shadingLight);
    const Wide facingLight = dot(shadingNormal, shadingLight), ll = dot(shadingLight, shadingLight);
    std::int64_t cosine = cosineOf(facingLight, dot(shadingNormal, shadingNormal), ll, n);
    if (lobe) cosine = facingLight > 0 ? lobeShare(cosine, *lobe, n) : 0;
    if (light.reachMantissa != 0 && cosine != 0) {
        const Normalised square = normalise(ll, n.shadeBits), divisor = normalise(square.mantissa, n.mantissaBits);
        const int exponent = n.mantissaBits + light.reachExponent - square.exponent - 2 * shift;
        const std::int64_t maximum = std::int64_t(4) << n.lightFraction;
        const Wide quotient =
            divide(static_cast<std::uint64_t>(light.reachMantissa), divisor.mantissa, n.cosineFraction);
        const std::int64_t falloff =
            exponent > 3 ? maximum
                         : static_cast<std::int64_t>(std::min<Wide>(
                               maximum, floorShift<Wide>(quotient, n.cosineFraction - n.lightFraction - exponent)));
        cosine = (cosine * falloff) >> n.lightFraction;
    }
    // The brightest that the product of a cosine and a falloff may be
    cosine = std::min(cosine, (std::int64_t(16) << n.cosineFraction) - 1);
    Illumination result{};
    const std::int64_t maxLight = (std::int64_t(1) << n.lightBits) - 1;
    for (int channel = 0; channel < 3; ++channel)
        result.direct[channel] = std::min(maxLight, (light.colour[channel] * cosine) >> n.cosineFraction);
    result.needsShadowRay = shadows && facingLight > 0;
    const int dominant = dominantAxis(toLight);
    result.shadowRay = {origin, toLight, static_cast<Wide>(magnitude(toLight[dominant]))};
    return result;
}

/// Reflected light of one channel.
inline std::int64_t reflected(std::int64_t albedo, std::int64_t incoming, const Numbers& n) {
    return std::min((std::int64_t(1) << n.colourBits) - 1, (albedo * incoming) >> n.lightFraction);
}

} // namespace colonnade
