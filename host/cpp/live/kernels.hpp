/// Inner loops of the live encoder, for the compiler to vectorise. All arithmetic is on integers, without overflow, so
/// a loop gives the same values in any order and with any vectors. kernels.cpp compiles each loop for several
/// processors.
#pragma once

#include <cstdint>

namespace colonnade::live {

/// Most cells of a tile; entries of a palette; planes that a tile may choose from.
constexpr int maxCells = 256, maxEntries = 256, maxCandidates = 10;

/// Points of cells, 8.4 fixed point: coordinates of one axis in a row.
struct Cells {
    const std::int16_t* axis[3];
    int count;
};

struct Point {
    std::int32_t at[3];
};

/// Number and sum of the points of a cluster.
struct Cluster {
    std::int32_t count, sum[3];
};

/// A palette as the search reads it: coordinates, and half of the squared length. Entries beyond the palette are far
/// away.
struct PaletteTable {
    alignas(64) std::int16_t axis[3][maxEntries];
    alignas(64) std::int32_t half[maxEntries];
};

/// The nearest entry to a point. Distances are compared in steps of 1/16 squared code; the lower entry of two wins.
int nearestEntry(const PaletteTable& palette, const Point& point);

/// Sum of the points, and sum of their squared lengths.
void sumCells(const Cells& cells, std::int32_t sum[3], std::int64_t& squares);

/// Means of 2×2 cells of a square of `edge` by `edge` cells, and the sum of squared distances from them, to 1/64
/// squared code a mean. The means of pixels are exact down to 4×4 pixels.
std::int64_t halveCells(const std::int16_t* fine, int edge, std::int16_t* coarse);

/// Covariances xx, yy, zz, xy, xz, yz of the points about a point, in half codes (1/8): sums over cells whose mask is
/// -1.
void covariances(const Cells& cells, const Point& about, const std::int16_t* mask, std::int32_t out[6]);

/// The cluster of the points whose product with `axis` is above `threshold`; their mask is -1, the others' 0.
Cluster above(const Cells& cells, const std::int16_t axis[3], std::int32_t threshold, std::int16_t* mask);

/// The clusters of the points that are nearest to each of four centres, and the number of the centre for each point.
void nearestOfFour(const Cells& cells, const Point centres[4], Cluster clusters[4], std::uint8_t* which);

/// Errors of the 16×16 pixels of a tile on a plane, saturated: steps of 2^-17 m along the view ray.
/// value: of the plane at the first pixel, and its steps across and down, 2^-28.
struct PlaneLine {
    std::int32_t value, across, down;
};
void planeErrors(const PlaneLine& line, const std::int32_t* w, const std::int32_t* metres, const std::int32_t* cap,
                 std::int32_t* errors);

/// Sums of 2×2 errors of a square of `edge` by `edge` cells.
void sumSquares(const std::int32_t* fine, int edge, std::int32_t* coarse);

/// The candidate that lowers the sum of errors most if each cell takes it or what it has; `sum` is that sum.
int bestAddition(const std::int32_t* have, const std::int32_t* candidates, int cells, int count, std::int64_t& sum);

/// The lower error of each cell, into `have`; their sum.
std::int64_t lowerErrors(std::int32_t* have, const std::int32_t* other, int cells);

/// 1/z of a row of pixels: 2^22 · unit / z, rounded down; z and the unit in steps of 2^-16 m.
void inverseDepth(const std::uint32_t* depth, int count, std::uint32_t unit, std::int32_t* w);

/// Errors of one pixel a unit of w, 2^-9 m, and the difference of w that costs half a metre.
void errorScales(const std::uint32_t* depth, const std::uint16_t* lengths, int count, int shift, std::int32_t* metres,
                 std::int32_t* cap);

} // namespace colonnade::live
