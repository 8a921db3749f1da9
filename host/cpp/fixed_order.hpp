/// Arithmetic with equal bits on every processor: IEEE additions, multiplications, divisions and square roots alone, in
/// a fixed order, never contracted into fused operations (CMakeLists.txt). Libraries of linear algebra and of
/// elementary functions choose their order, and so their rounding, by the processor.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace colonnade::fixed_order {

/// Product of matrices: out [rows, columns] = a [rows, inner] · b [inner, columns], all row-major, or a transposed.
/// Each element is summed by ascending inner index. Elements of a block are summed side by side, which does not change
/// any sum.
template <class T> inline __attribute__((always_inline)) void product(const T* a, const T* b, T* out, std::size_t rows,
                                                                      std::size_t inner, std::size_t columns,
                                                                      bool isTransposed) {
    constexpr std::size_t lanes = 32 / sizeof(T), down = 4, across = 2 * lanes;
    typedef T Lanes __attribute__((vector_size(32)));
    const auto load = [](const T* from) __attribute__((always_inline)) {
        Lanes values;
        std::memcpy(&values, from, sizeof values);
        return values;
    };
    const std::size_t wholeColumns = columns - columns % across, rowStep = isTransposed ? 1 : inner,
                      step = isTransposed ? rows : 1;
    for (std::size_t row = 0; row < rows; row += down) {
        // A block beyond the last row sums that one again
        const std::size_t height = std::min(down, rows - row);
        const T* left[down];
        for (std::size_t i = 0; i < down; ++i) left[i] = a + (row + std::min(i, height - 1)) * rowStep;
        for (std::size_t column = 0; column < wholeColumns; column += across) {
            Lanes sums[down][2] = {};
            for (std::size_t k = 0; k < inner; ++k) {
                const Lanes first = load(b + k * columns + column), second = load(b + k * columns + column + lanes);
                for (std::size_t i = 0; i < down; ++i) {
                    const T factor = left[i][k * step];
                    sums[i][0] += factor * first;
                    sums[i][1] += factor * second;
                }
            }
            for (std::size_t i = 0; i < height; ++i)
                std::memcpy(out + (row + i) * columns + column, sums[i], sizeof sums[i]);
        }
        for (std::size_t column = wholeColumns; column < columns; ++column) {
            T sums[down] = {};
            for (std::size_t k = 0; k < inner; ++k)
                for (std::size_t i = 0; i < down; ++i) sums[i] += left[i][k * step] * b[k * columns + column];
            for (std::size_t i = 0; i < height; ++i) out[(row + i) * columns + column] = sums[i];
        }
    }
}

/// Whether x is positive, finite, and has a whole mantissa.
inline bool isNormal(double x) { return x >= 2.2250738585072014e-308 && x <= 1.7976931348623157e308; }

/// Natural logarithms of normal numbers, side by side; relative error below 2^-50.
template <std::size_t count> inline __attribute__((always_inline)) void logs(const double* x, double* out) {
    double exponent[count], s[count], square[count], series[count];
    for (std::size_t i = 0; i < count; ++i) {
        std::uint64_t bits;
        std::memcpy(&bits, x + i, sizeof bits);
        int twos = static_cast<int>(bits >> 52) - 1022;
        bits = (bits & 0xfffffffffffffu) | (std::uint64_t{1022} << 52);
        double mantissa;
        std::memcpy(&mantissa, &bits, sizeof mantissa);
        if (mantissa < 0.70710678118654752) {
            mantissa *= 2;
            twos -= 1;
        }
        // log m = 2 artanh s
        exponent[i] = twos;
        s[i] = (mantissa - 1) / (mantissa + 1);
        square[i] = s[i] * s[i];
        series[i] = 0;
    }
    for (int power = 23; power >= 1; power -= 2)
        for (std::size_t i = 0; i < count; ++i) series[i] = series[i] * square[i] + 1.0 / power;
    for (std::size_t i = 0; i < count; ++i) out[i] = exponent[i] * 0.69314718055994531 + 2 * s[i] * series[i];
}

/// Exponentials, side by side, as a number near 1 and an exponent of 2; relative error below 2^-48 for |x| < 64.
template <std::size_t count>
inline __attribute__((always_inline)) void exps(const double* x, double* near, double* twos) {
    double rest[count];
    for (std::size_t i = 0; i < count; ++i) {
        twos[i] = std::floor(x[i] * 1.4426950408889634 + 0.5);
        // ln 2 in two parts, so that the product with a small integer is exact
        rest[i] = (x[i] - twos[i] * 0.693147180369123816490) - twos[i] * 1.90821492927058770002e-10;
        near[i] = 1;
    }
    for (int term = 15; term >= 1; --term)
        for (std::size_t i = 0; i < count; ++i) near[i] = near[i] * rest[i] / term + 1;
}

/// Natural logarithm of a positive number; relative error below 2^-50 for normal ones.
inline double log(double x) {
    if (!(x > 0)) return -HUGE_VAL;
    if (!isNormal(x)) return x < 1 ? log(x * 18014398509481984.0) - 54 * 0.69314718055994531 : HUGE_VAL;
    double result;
    logs<1>(&x, &result);
    return result;
}

/// Exponential; relative error below 2^-48 for |x| < 64.
inline double exp(double x) {
    if (!(x > -745)) return 0;
    if (x > 709) return HUGE_VAL;
    double near, twos;
    exps<1>(&x, &near, &twos);
    return std::ldexp(near, static_cast<int>(twos));
}

/// x to the power y for x >= 0; relative error below 2^-45 for results from 2^-64 to 2^64.
inline double power(double x, double y) { return x > 0 ? exp(y * log(x)) : (y == 0 ? 1 : 0); }

/// `power` of each number, with the same bits: a block's side by side.
inline __attribute__((always_inline)) void power(const double* x, double y, double* out, std::size_t count) {
    constexpr std::size_t block = 16;
    std::size_t done = 0;
    for (; done + block <= count; done += block) {
        double product[block], near[block], twos[block];
        bool isPlain = true;
        for (std::size_t i = 0; i < block; ++i) isPlain &= isNormal(x[done + i]);
        if (isPlain) {
            logs<block>(x + done, product);
            for (std::size_t i = 0; i < block; ++i) {
                product[i] *= y;
                isPlain &= product[i] > -700 && product[i] < 700; // no result leaves the normal numbers
            }
        }
        if (isPlain) exps<block>(product, near, twos);
        for (std::size_t i = 0; i < block; ++i) {
            const std::uint64_t bits =
                isPlain ? static_cast<std::uint64_t>(static_cast<std::int64_t>(twos[i]) + 1023) << 52 : 0;
            double scale;
            std::memcpy(&scale, &bits, sizeof scale);
            out[done + i] = isPlain ? near[i] * scale : power(x[done + i], y);
        }
    }
    for (; done < count; ++done) out[done] = power(x[done], y);
}

/// Angle of the vector (x, y), -pi to pi; error below 2^-50.
inline double arctan2(double y, double x) {
    const double pi = 3.14159265358979324, acrossX = std::fabs(x), acrossY = std::fabs(y),
                 longer = std::max(acrossX, acrossY);
    if (!(longer > 0)) return 0;
    double tangent = std::min(acrossX, acrossY) / longer;
    // Halve the angle twice: tan(a/2) = t / (1 + sqrt(1 + t²))
    for (int halving = 0; halving < 2; ++halving) tangent /= 1 + std::sqrt(1 + tangent * tangent);
    const double square = tangent * tangent;
    double series = 0;
    for (int term = 25; term >= 1; term -= 2) series = 1.0 / term - square * series;
    double angle = 4 * tangent * series;
    if (acrossY > acrossX) angle = pi / 2 - angle;
    if (x < 0) angle = pi - angle;
    return y < 0 ? -angle : angle;
}

/// Arc cosine of -1 to 1.
inline double arccos(double x) { return 2 * arctan2(std::sqrt(1 - x), std::sqrt(1 + x)); }

/// Cosine of the angle x - quarters · pi/2; error below 2^-50 for |x| < 2^20.
inline double cosine(double x, int quarters) {
    const double turns = std::floor(x * 0.63661977236758134 + 0.5);
    const double rest = (x - turns * 1.57079632673412561417) - turns * 6.07710050650619224932e-11;
    const int quarter = static_cast<int>(static_cast<long long>(turns) - quarters) & 3;
    const double square = rest * rest;
    double even = 0, odd = 0;
    for (int term = 18; term >= 2; term -= 2) {
        even = (1 - even) * square / (term * (term - 1));
        odd = (1 - odd) * square / (term * (term + 1));
    }
    const double cosRest = 1 - even, sinRest = rest * (1 - odd);
    const double values[4] = {cosRest, -sinRest, -cosRest, sinRest};
    return values[quarter];
}

} // namespace colonnade::fixed_order
