/// Two or four clusters of a tile's cells, without iterations to convergence: the cells are split by the sign of their
/// projection on a column of the covariance matrix, each half once more, and the means move once or twice.
#pragma once

#include <algorithm>
#include <cstdint>

#include "kernels.hpp"

namespace colonnade::live {

inline std::int32_t divideRounded(std::int64_t value, std::int64_t by) {
    return static_cast<std::int32_t>((value + (value >= 0 ? by / 2 : -(by / 2))) / by);
}

inline std::int32_t squareRoot(std::int64_t value) {
    std::int64_t root = 0;
    for (std::int64_t bit = std::int64_t{1} << 30; bit > 0; bit >>= 1)
        if ((root + bit) * (root + bit) <= value) root += bit;
    return static_cast<std::int32_t>(root);
}

inline std::int64_t product(const Point& a, const Point& b) {
    return static_cast<std::int64_t>(a.at[0]) * b.at[0] + static_cast<std::int64_t>(a.at[1]) * b.at[1] +
           static_cast<std::int64_t>(a.at[2]) * b.at[2];
}

inline Point meanOf(const Cluster& cluster, const Point& otherwise) {
    if (cluster.count == 0) return otherwise;
    return {{divideRounded(cluster.sum[0], cluster.count), divideRounded(cluster.sum[1], cluster.count),
             divideRounded(cluster.sum[2], cluster.count)}};
}

/// By how much the sum of the points' squared lengths exceeds their squared distances from a centre.
inline std::int64_t explained(const Cluster& cluster, const Point& centre) {
    std::int64_t along = 0;
    for (int a = 0; a < 3; ++a) along += static_cast<std::int64_t>(centre.at[a]) * cluster.sum[a];
    return 2 * along - cluster.count * product(centre, centre);
}

/// Two clusters of all cells.
struct Halves {
    Cluster clusters[2];
    alignas(64) std::int16_t mask[maxCells];

    /// Each cell goes to the nearer of two centres.
    void assign(const Cells& cells, const std::int32_t* total, const Point& a, const Point& b) {
        const std::int16_t axis[3] = {static_cast<std::int16_t>(b.at[0] - a.at[0]),
                                      static_cast<std::int16_t>(b.at[1] - a.at[1]),
                                      static_cast<std::int16_t>(b.at[2] - a.at[2])};
        split(cells, total, axis, static_cast<std::int32_t>((product(b, b) - product(a, a)) >> 1));
    }
    void split(const Cells& cells, const std::int32_t* total, const std::int16_t* axis, std::int32_t threshold) {
        clusters[1] = above(cells, axis, threshold, mask);
        clusters[0].count = cells.count - clusters[1].count;
        for (int a = 0; a < 3; ++a) clusters[0].sum[a] = total[a] - clusters[1].sum[a];
    }
};

/// The column of the covariance matrix with the largest variance; its length is the standard deviation, 1/8 codes,
/// on a line of points.
struct Spread {
    std::int32_t column[3];
    std::int32_t variance;
};

inline Spread spreadOf(const std::int32_t c[6]) {
    if (c[0] >= c[1] && c[0] >= c[2]) return {{c[0], c[3], c[4]}, c[0]};
    if (c[1] >= c[2]) return {{c[3], c[1], c[5]}, c[1]};
    return {{c[4], c[5], c[2]}, c[2]};
}

/// Splits the cells at their mean, and moves the means `rounds` times. False if they are all equal.
inline bool halve(const Cells& cells, const std::int32_t* total, const std::int16_t* all, int rounds, Halves& halves,
                  Point centres[2]) {
    const Point mean{{divideRounded(total[0], cells.count), divideRounded(total[1], cells.count),
                      divideRounded(total[2], cells.count)}};
    std::int32_t matrix[6];
    covariances(cells, mean, all, matrix);
    const Spread spread = spreadOf(matrix);
    std::int32_t longest =
        std::max({std::abs(spread.column[0]), std::abs(spread.column[1]), std::abs(spread.column[2])});
    centres[0] = centres[1] = mean;
    if (longest == 0) return false;
    int shift = 0;
    for (; longest > 8191; longest >>= 1) ++shift;
    std::int16_t axis[3];
    std::int64_t along = 0;
    for (int a = 0; a < 3; ++a) {
        axis[a] = static_cast<std::int16_t>(spread.column[a] / (1 << shift));
        along += static_cast<std::int64_t>(axis[a]) * total[a];
    }
    const std::int64_t threshold = along >= 0 ? along / cells.count : -((-along + cells.count - 1) / cells.count);
    halves.split(cells, total, axis, static_cast<std::int32_t>(threshold));
    for (int round = 0;; ++round) {
        if (halves.clusters[0].count == 0 || halves.clusters[1].count == 0) {
            centres[0] = centres[1] = mean;
            return false;
        }
        for (int k = 0; k < 2; ++k) centres[k] = meanOf(halves.clusters[k], mean);
        if (round == rounds) return true;
        halves.assign(cells, total, centres[0], centres[1]);
    }
}

/// Four centres from two: each half is split about its mean by a standard deviation, and the means move `rounds` times.
inline void quarter(const Cells& cells, const Halves& halves, const Point twoCentres[2], int rounds, Point centres[4]) {
    alignas(64) std::int16_t mask[maxCells];
    for (int k = 0; k < 2; ++k) {
        for (int i = 0; i < cells.count; ++i) mask[i] = static_cast<std::int16_t>(k ? halves.mask[i] : ~halves.mask[i]);
        const Point mean = meanOf(halves.clusters[k], twoCentres[k]);
        std::int32_t matrix[6];
        covariances(cells, mean, mask, matrix);
        const Spread spread = spreadOf(matrix);
        // column / sqrt(variance · cells) is the deviation in half codes
        const std::int32_t length =
            std::max(1, squareRoot(static_cast<std::int64_t>(spread.variance) * std::max(1, halves.clusters[k].count)));
        for (int a = 0; a < 3; ++a) {
            const std::int32_t step =
                static_cast<std::int32_t>(static_cast<std::int64_t>(spread.column[a]) * 2 / length);
            centres[2 * k].at[a] = mean.at[a] - step;
            centres[2 * k + 1].at[a] = mean.at[a] + step;
        }
    }
    for (int round = 0; round < rounds; ++round) {
        Cluster clusters[4];
        nearestOfFour(cells, centres, clusters, nullptr);
        for (int k = 0; k < 4; ++k) centres[k] = meanOf(clusters[k], centres[k]);
    }
}

} // namespace colonnade::live
