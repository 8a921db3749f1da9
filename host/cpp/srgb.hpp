/// The sRGB transfer function (IEC 61966-2-1) on values from 0 to 1, as host/colonnade/common/srgb.py.
#pragma once

#include <algorithm>

#include "fixed_order.hpp"

namespace colonnade {

inline double linearFromSrgb(double encoded) {
    return encoded <= 0.04045 ? encoded / 12.92 : fixed_order::power((encoded + 0.055) / 1.055, 2.4);
}

inline double srgbFromLinear(double linear) {
    const double value = std::clamp(linear, 0.0, 1.0);
    return value <= 0.0031308 ? 12.92 * value : 1.055 * fixed_order::power(value, 1 / 2.4) - 0.055;
}

} // namespace colonnade
