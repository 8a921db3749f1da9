#include "kernels.hpp"

#include <algorithm>

// Each loop is compiled for every processor, and once more for those with AVX2; the program takes the better one. The
// values are the same. Sanitizers cannot instrument the choice, and other compilers than GCC for x86-64 do not offer
// it.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && defined(__OPTIMIZE__) && \
    defined(__gnu_linux__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__) && \
    !defined(COLONNADE_LIVE_ONE_PROCESSOR)
#define FOR_PROCESSORS __attribute__((target_clones("avx2", "default")))
#else
#define FOR_PROCESSORS
#endif
#define INLINE static inline __attribute__((always_inline))

namespace colonnade::live {
namespace {

/// Calls a function with the number of cells as a constant.
#define WITH_CELLS(count, call) \
    switch (count) { \
    case 4: call(4); break; \
    case 16: call(16); break; \
    case 64: call(64); break; \
    default: call(256); break; \
    }

template <int n> INLINE void sums(const Cells& cells, std::int32_t sum[3], std::int64_t& squares) {
    squares = 0;
    for (int a = 0; a < 3; ++a) {
        const std::int16_t* x = cells.axis[a];
        std::int32_t total = 0;
        for (int i = 0; i < n; ++i) total += x[i];
        sum[a] = total;
        constexpr int part = n < 64 ? n : 64; // sums of 64 squares are below 2^31
        for (int first = 0; first < n; first += part) {
            std::int32_t square = 0;
            for (int i = 0; i < part; ++i) square += x[first + i] * x[first + i];
            squares += square;
        }
    }
}

template <int n>
INLINE void covariance(const Cells& cells, const Point& about, const std::int16_t* mask, std::int32_t out[6]) {
    alignas(64) std::int16_t u[3][n];
    for (int a = 0; a < 3; ++a) {
        const std::int16_t middle = static_cast<std::int16_t>(about.at[a]);
        for (int i = 0; i < n; ++i)
            u[a][i] = static_cast<std::int16_t>((static_cast<std::int16_t>(cells.axis[a][i] - middle) >> 1) & mask[i]);
    }
    const auto product = [&](int a, int b) __attribute__((always_inline)) {
        std::int32_t sum = 0;
        for (int i = 0; i < n; ++i) sum += u[a][i] * u[b][i];
        return sum;
    };
    out[0] = product(0, 0);
    out[1] = product(1, 1);
    out[2] = product(2, 2);
    out[3] = product(0, 1);
    out[4] = product(0, 2);
    out[5] = product(1, 2);
}

template <int n>
INLINE Cluster split(const Cells& cells, const std::int16_t axis[3], std::int32_t threshold, std::int16_t* mask) {
    const std::int16_t ax = axis[0], ay = axis[1], az = axis[2];
    const std::int16_t *x = cells.axis[0], *y = cells.axis[1], *z = cells.axis[2];
    for (int i = 0; i < n; ++i) mask[i] = static_cast<std::int16_t>(-(ax * x[i] + ay * y[i] + az * z[i] > threshold));
    Cluster cluster{};
    for (int i = 0; i < n; ++i) cluster.count -= mask[i];
    for (int a = 0; a < 3; ++a) {
        std::int32_t sum = 0;
        for (int i = 0; i < n; ++i) sum += static_cast<std::int16_t>(cells.axis[a][i] & mask[i]);
        cluster.sum[a] = sum;
    }
    return cluster;
}

template <int n> INLINE void four(const Cells& cells, const Point c[4], Cluster clusters[4], std::uint8_t* which) {
    const std::int16_t *x = cells.axis[0], *y = cells.axis[1], *z = cells.axis[2];
    alignas(64) std::int16_t choice[n];
    std::int32_t half[4];
    std::int16_t at[4][3];
    for (int k = 0; k < 4; ++k) {
        half[k] = (c[k].at[0] * c[k].at[0] + c[k].at[1] * c[k].at[1] + c[k].at[2] * c[k].at[2]) >> 1;
        for (int a = 0; a < 3; ++a) at[k][a] = static_cast<std::int16_t>(c[k].at[a]);
    }
    for (int i = 0; i < n; ++i) {
        std::int32_t near[4];
        for (int k = 0; k < 4; ++k) near[k] = at[k][0] * x[i] + at[k][1] * y[i] + at[k][2] * z[i] - half[k];
        const std::int32_t first = near[1] > near[0] ? near[1] : near[0], last = near[3] > near[2] ? near[3] : near[2];
        const std::int32_t one = near[1] > near[0], three = 2 + (near[3] > near[2]);
        choice[i] = static_cast<std::int16_t>(last > first ? three : one);
    }
    clusters[0] = Cluster{};
    for (int k = 1; k < 4; ++k) {
        std::int32_t count = 0;
        for (int i = 0; i < n; ++i) count += choice[i] == k;
        clusters[k].count = count;
        for (int a = 0; a < 3; ++a) {
            const std::int16_t* values = cells.axis[a];
            std::int32_t sum = 0;
            for (int i = 0; i < n; ++i) sum += static_cast<std::int16_t>(choice[i] == k ? values[i] : 0);
            clusters[k].sum[a] = sum;
        }
    }
    clusters[0].count = n - clusters[1].count - clusters[2].count - clusters[3].count;
    for (int a = 0; a < 3; ++a) {
        std::int32_t sum = 0;
        for (int i = 0; i < n; ++i) sum += cells.axis[a][i];
        clusters[0].sum[a] = sum - clusters[1].sum[a] - clusters[2].sum[a] - clusters[3].sum[a];
    }
    if (which != nullptr)
        for (int i = 0; i < n; ++i) which[i] = static_cast<std::uint8_t>(choice[i]);
}

template <int n>
INLINE int addition(const std::int32_t* have, const std::int32_t* candidates, int count, std::int64_t& sum) {
    int best = 0;
    std::int32_t least = INT32_MAX; // 256 saturated errors are below 2^25
    for (int k = 0; k < count; ++k) {
        const std::int32_t* other = candidates + k * n;
        std::int32_t total = 0;
        for (int i = 0; i < n; ++i) total += other[i] < have[i] ? other[i] : have[i];
        if (total < least) {
            least = total;
            best = k;
        }
    }
    sum = least;
    return best;
}

} // namespace

FOR_PROCESSORS int nearestEntry(const PaletteTable& palette, const Point& point) {
    const std::int16_t x = static_cast<std::int16_t>(point.at[0]), y = static_cast<std::int16_t>(point.at[1]),
                       z = static_cast<std::int16_t>(point.at[2]);
    alignas(64) std::int32_t keys[maxEntries];
    for (int i = 0; i < maxEntries; ++i) {
        const std::int32_t distance =
            palette.half[i] - (palette.axis[0][i] * x + palette.axis[1][i] * y + palette.axis[2][i] * z);
        keys[i] = (distance >> 3) * maxEntries + i;
    }
    std::int32_t least = INT32_MAX;
    for (int i = 0; i < maxEntries; ++i) least = keys[i] < least ? keys[i] : least;
    return least & (maxEntries - 1);
}

FOR_PROCESSORS void sumCells(const Cells& cells, std::int32_t sum[3], std::int64_t& squares){
#define CALL(n) sums<n>(cells, sum, squares)
    WITH_CELLS(cells.count, CALL)
#undef CALL
}

FOR_PROCESSORS std::int64_t halveCells(const std::int16_t* fine, int edge, std::int16_t* coarse) {
    const int half = edge / 2;
    std::int32_t sixteenths = 0;
    for (int y = 0; y < half; ++y)
        for (int x = 0; x < half; ++x) {
            const std::int16_t* at = fine + 2 * y * edge + 2 * x;
            const std::int32_t a = at[0], b = at[1], c = at[edge], d = at[edge + 1], sum = a + b + c + d;
            coarse[y * half + x] = static_cast<std::int16_t>((sum + 2) >> 2);
            sixteenths += (4 * (a * a + b * b + c * c + d * d) - sum * sum) >> 4;
        }
    return std::int64_t{4} * sixteenths;
}

FOR_PROCESSORS void covariances(const Cells& cells, const Point& about, const std::int16_t* mask, std::int32_t out[6]){
#define CALL(n) covariance<n>(cells, about, mask, out)
    WITH_CELLS(cells.count, CALL)
#undef CALL
}

FOR_PROCESSORS Cluster
    above(const Cells& cells, const std::int16_t axis[3], std::int32_t threshold, std::int16_t* mask) {
    Cluster cluster{};
#define CALL(n) cluster = split<n>(cells, axis, threshold, mask)
    WITH_CELLS(cells.count, CALL)
#undef CALL
    return cluster;
}

FOR_PROCESSORS void nearestOfFour(const Cells& cells, const Point centres[4], Cluster clusters[4], std::uint8_t* which){
#define CALL(n) four<n>(cells, centres, clusters, which)
    WITH_CELLS(cells.count, CALL)
#undef CALL
}

FOR_PROCESSORS void planeErrors(const PlaneLine& line, const std::int32_t* w, const std::int32_t* metres,
                                const std::int32_t* cap, std::int32_t* errors) {
    for (int y = 0; y < 16; ++y) {
        const std::int32_t first = line.value + line.down * y;
        for (int x = 0; x < 16; ++x) {
            const int i = 16 * y + x;
            const std::int32_t difference = ((first + line.across * x) >> 6) - w[i];
            const std::int32_t size = difference < 0 ? -difference : difference;
            errors[i] = ((size < cap[i] ? size : cap[i]) * metres[i]) >> 14;
        }
    }
}

FOR_PROCESSORS void sumSquares(const std::int32_t* fine, int edge, std::int32_t* coarse) {
    const int half = edge / 2;
    for (int y = 0; y < half; ++y)
        for (int x = 0; x < half; ++x) {
            const std::int32_t* at = fine + 2 * y * edge + 2 * x;
            coarse[y * half + x] = at[0] + at[1] + at[edge] + at[edge + 1];
        }
}

FOR_PROCESSORS int bestAddition(const std::int32_t* have, const std::int32_t* candidates, int cells, int count,
                                std::int64_t& sum) {
    int best = 0;
#define CALL(n) best = addition<n>(have, candidates, count, sum)
    WITH_CELLS(cells, CALL)
#undef CALL
    return best;
}

FOR_PROCESSORS std::int64_t lowerErrors(std::int32_t* have, const std::int32_t* other, int cells) {
    std::int32_t total = 0;
    for (int i = 0; i < cells; ++i) {
        have[i] = other[i] < have[i] ? other[i] : have[i];
        total += have[i];
    }
    return total;
}

// A quotient of whole numbers below 2^53, correctly rounded, is never rounded up to the next whole number here: the
// exact one is below it by at least 1 / z, more than half a step of the quotient. So the result equals an integer
// division.
FOR_PROCESSORS void inverseDepth(const std::uint32_t* depth, int count, std::uint32_t unit, std::int32_t* w) {
    const double numerator = static_cast<double>(unit) * 4194304.0;
    for (int i = 0; i < count; ++i)
        w[i] = static_cast<std::int32_t>(numerator / static_cast<double>(static_cast<std::int32_t>(depth[i])));
}

FOR_PROCESSORS void errorScales(const std::uint32_t* depth, const std::uint16_t* lengths, int count, int shift,
                                std::int32_t* metres, std::int32_t* cap) {
    for (int i = 0; i < count; ++i) {
        const std::uint64_t square = (static_cast<std::uint64_t>(depth[i]) * depth[i]) >> 16;
        const std::uint64_t scale = (square * lengths[i]) >> shift;
        metres[i] = static_cast<std::int32_t>(std::min<std::uint64_t>(std::max<std::uint64_t>(scale, 1), 1u << 26));
    }
    for (int i = 0; i < count; ++i) cap[i] = static_cast<std::int32_t>(1073741824.0 / metres[i]);
}

} // namespace colonnade::live
