/// Encodes a two-level map, of colours or normals, from frame to frame.
#pragma once

#include <cstdint>
#include <cstring>
#include <utility>
#include <vector>

#include "clusters.hpp"
#include "heap_writer.hpp"
#include "modes.hpp"
#include "palette.hpp"
#include "tile_sums.hpp"

namespace colonnade::live {

/// Sizes of a two-level map. Its pixels are whole tiles.
struct VectorSizes {
    int columns, rows, tileSize, paletteSize, heapWords;
    int tiles() const { return columns * rows; }
};

constexpr int vectorModes = 8;
constexpr int vectorWords[vectorModes] = {0, 1, 4, 16, 2, 3, 9, 33};

template <class Fields> class VectorMap {
public:
    explicit VectorMap(const VectorSizes& sizes)
        : sizes_(sizes), palette_(sizes.paletteSize), tiles_(sizes.tiles()),
          entries_(static_cast<std::size_t>(sizes.tiles()) * vectorModes),
          modes_{std::vector<std::int64_t>(static_cast<std::size_t>(sizes.tiles()) * vectorModes), vectorWords,
                 vectorModes},
          selected_(sizes.tiles()), heap_(sizes.heapWords) {
        std::fill(std::begin(all_), std::end(all_), std::int16_t{-1});
    }

    /// Encodes a frame: three bytes a pixel. The first one fits a palette; later ones start with the frame before's.
    void encode(const std::uint8_t* codes, std::uint32_t* descriptors, std::uint64_t* palette, std::uint16_t* heap) {
        const std::size_t stride = static_cast<std::size_t>(3) * sizes_.columns * sizes_.tileSize;
        for (int tile = 0; tile < sizes_.tiles(); ++tile) {
            const std::size_t row = tile / sizes_.columns, column = tile % sizes_.columns;
            tiles_[tile].read(codes + row * sizes_.tileSize * stride + 3 * column * sizes_.tileSize, stride,
                              sizes_.tileSize, Fields::space());
        }
        if (!isWarm_) palette_.fit(tiles_);
        else if (Fields::stepsFirst) palette_.step(tiles_);
        palette_.store(fields_, palette);
        const std::int64_t least = isWarm_ ? budget_.price() * 5 / 8 : 0;
        for (int tile = 0; tile < sizes_.tiles(); ++tile) fit(tile, least);
        budget_.fill(modes_, heap_, sizes_.heapWords,
                     [&](int tile, int mode) { return store(tile, mode, descriptors[tile]); });
        std::memcpy(heap, heap_.words().data(), heap_.words().size() * sizeof(std::uint16_t));
        updatePalette();
        isWarm_ = true;
    }

    /// Rotates the palette of normals with the camera.
    void rotate(const std::int32_t rotation[9]) { palette_.rotate(rotation); }

private:
    struct Entries {
        std::uint8_t at[4];
    };

    Entries& entries(int tile, int mode) { return entries_[static_cast<std::size_t>(tile) * vectorModes + mode]; }

    /// Finds entries and cost of each mode that may gain more than `least` a word.
    void fit(int tile, std::int64_t least) {
        const TileSums& sums = tiles_[tile];
        std::int64_t* costs = modes_.of(tile);
        std::fill(costs, costs + vectorModes, impossible);
        std::int64_t cheapest = impossible;
        int words = 0;
        // Whether finer cells or more entries than `cheapest` has may pay for a mode: even a perfect fit leaves what is
        // within the cells
        const auto mayPay = [&](int mode, int level) {
            return cheapest == impossible ||
                   cheapest - sums.cost(sums.within(level)) > least * std::max(1, vectorWords[mode] - words);
        };
        const auto take = [&](int mode, std::int64_t cost) {
            costs[mode] = cost;
            if (cost < cheapest) {
                cheapest = cost;
                words = vectorWords[mode];
            }
        };
        for (int level = 0; level <= sums.finest(); ++level) {
            if (!mayPay(level, level)) continue;
            const Cells cells = sums.cells(level);
            Point centres[4];
            const bool differ = halve(cells, sums.sum(level).data(), all_, level == 0 ? 1 : 2, halves_, centres);
            take(level, fitTwo(tile, level, centres));
            if (!differ || !mayPay(4 + level, level)) continue;
            if (level == 0) {
                for (int k = 0; k < 4; ++k) centres[k] = sums.point(0, k);
            } else {
                quarter(cells, halves_, std::array<Point, 2>{centres[0], centres[1]}.data(), 2, centres);
            }
            take(4 + level, fitFour(tile, level, centres));
        }
    }

    std::int64_t costOf(const TileSums& sums, int level, std::int64_t explainedBy) const {
        return sums.cost((std::max<std::int64_t>(sums.squares(level) - explainedBy, 0)) * sums.pixelsOf(level) +
                         sums.within(level));
    }

    /// The two entries near the centres, once more near the means of their cells; the cost.
    std::int64_t fitTwo(int tile, int level, const Point centres[2]) {
        const TileSums& sums = tiles_[tile];
        Entries& best = entries(tile, level);
        std::int64_t cost = impossible;
        Point means[2] = {centres[0], centres[1]};
        // The masks of the split remain in halves_ for the split into four
        for (int round = 0; round < 2; ++round) {
            Entries tried{};
            for (int k = 0; k < 2; ++k) tried.at[k] = static_cast<std::uint8_t>(palette_.nearest(means[k]));
            if (round > 0 && tried.at[0] == best.at[0] && tried.at[1] == best.at[1]) break;
            const Point &a = palette_[tried.at[0]], &b = palette_[tried.at[1]];
            taken_.assign(sums.cells(level), sums.sum(level).data(), a, b);
            const std::int64_t triedCost =
                costOf(sums, level, explained(taken_.clusters[0], a) + explained(taken_.clusters[1], b));
            if (triedCost >= cost) break;
            cost = triedCost;
            best = tried;
            for (int k = 0; k < 2; ++k) means[k] = meanOf(taken_.clusters[k], means[k]);
        }
        return cost;
    }

    std::int64_t fitFour(int tile, int level, const Point centres[4]) {
        const TileSums& sums = tiles_[tile];
        Entries& best = entries(tile, 4 + level);
        std::int64_t cost = impossible;
        Point means[4] = {centres[0], centres[1], centres[2], centres[3]};
        for (int round = 0; round < 2; ++round) {
            Entries tried{};
            Point points[4];
            for (int k = 0; k < 4; ++k) {
                tried.at[k] = static_cast<std::uint8_t>(palette_.nearest(means[k]));
                points[k] = palette_[tried.at[k]];
            }
            if (round > 0 && std::memcmp(tried.at, best.at, 4) == 0) break;
            Cluster clusters[4];
            nearestOfFour(sums.cells(level), points, clusters, nullptr);
            std::int64_t sum = 0;
            for (int k = 0; k < 4; ++k) sum += explained(clusters[k], points[k]);
            const std::int64_t triedCost = costOf(sums, level, sum);
            if (triedCost >= cost) break;
            cost = triedCost;
            best = tried;
            for (int k = 0; k < 4; ++k) means[k] = meanOf(clusters[k], means[k]);
        }
        return cost;
    }

    /// Writes a tile's words and its descriptor; false if the words do not fit.
    bool store(int tile, int mode, std::uint32_t& descriptor) {
        selected_[tile] = static_cast<std::uint8_t>(mode);
        const TileSums& sums = tiles_[tile];
        const int level = mode & 3, cells = cellsOf(level);
        Entries own = entries(tile, mode);
        std::uint16_t words[33] = {};
        if (mode < 4) {
            const Point &a = palette_[own.at[0]], &b = palette_[own.at[1]];
            taken_.assign(sums.cells(level), sums.sum(level).data(), a, b);
            // The first cell takes entry 0, so that equal patterns are equal words
            const std::int16_t flip = taken_.mask[0];
            Pattern pattern{};
            for (int i = 0; i < cells; ++i)
                pattern.bits[i >> 6] |= static_cast<std::uint64_t>((taken_.mask[i] ^ flip) & 1) << (i & 63);
            const bool isSwapped = mode > 0 && share(sums, level, a, b, pattern);
            if ((flip != 0) != isSwapped) std::swap(own.at[0], own.at[1]);
            for (int i = 0; i < std::max(1, cells / 16); ++i)
                words[i] = static_cast<std::uint16_t>(pattern.bits[i >> 2] >> (16 * i & 48));
        } else {
            std::uint8_t rank[4], order[4] = {0, 1, 2, 3}, which[maxCells];
            std::stable_sort(order, order + 4, [&](int a, int b) { return own.at[a] < own.at[b]; });
            const Entries before = own;
            for (int k = 0; k < 4; ++k) {
                own.at[k] = before.at[order[k]];
                rank[order[k]] = static_cast<std::uint8_t>(k);
            }
            Point points[4];
            for (int k = 0; k < 4; ++k) points[k] = palette_[before.at[k]];
            Cluster clusters[4];
            nearestOfFour(sums.cells(level), points, clusters, which);
            words[0] = static_cast<std::uint16_t>(own.at[2] | own.at[3] << 8);
            for (int i = 0; i < cells; ++i)
                words[1 + (i >> 3)] |= static_cast<std::uint16_t>(rank[which[i]] << (2 * i & 15));
        }
        const int pointer = mode == 0 ? words[0] : heap_.put(words, vectorWords[mode]);
        if (pointer < 0) return false;
        descriptor = static_cast<std::uint32_t>(mode) | static_cast<std::uint32_t>(pointer) << 3 |
                     static_cast<std::uint32_t>(own.at[0]) << 16 | static_cast<std::uint32_t>(own.at[1]) << 24;
        return true;
    }

    /// Replaces a pattern by a stored one, or by its complement, if that costs less than its words. True for a
    /// complement.
    bool share(const TileSums& sums, int level, const Point& a, const Point& b, Pattern& pattern) {
        const int cells = cellsOf(level), words = vectorWords[level];
        const std::int64_t most = budget_.price() * words;
        std::int32_t losses[maxCells]; // of a cell that takes the other entry, 1/256 squared code
        const std::int32_t lengths = static_cast<std::int32_t>(product(b, b) - product(a, a));
        const Point way{{b.at[0] - a.at[0], b.at[1] - a.at[1], b.at[2] - a.at[2]}};
        for (int i = 0; i < cells; ++i)
            losses[i] = std::abs(lengths - 2 * static_cast<std::int32_t>(product(sums.point(level, i), way)));
        Pattern best = pattern;
        bool isComplement = false;
        std::int64_t least = (most << costShift) / sums.weight() / sums.pixelsOf(level);
        for (const Pattern& stored : heap_.patterns(words)) {
            for (const bool complement : {false, true}) {
                std::int64_t loss = 0;
                for (int part = 0; 64 * part < cells && loss < least; ++part) {
                    const std::uint64_t all = cells < 64 ? (std::uint64_t{1} << cells) - 1 : ~std::uint64_t{0};
                    for (std::uint64_t other = (pattern.bits[part] ^ stored.bits[part] ^ (complement ? all : 0));
                         other != 0 && loss < least; other &= other - 1)
                        loss += losses[64 * part + __builtin_ctzll(other)];
                }
                if (loss >= least) continue;
                least = loss;
                best = stored;
                isComplement = complement;
            }
        }
        pattern = best;
        return isComplement;
    }

    void updatePalette() {
        std::vector<EntrySums> sums(sizes_.paletteSize);
        std::vector<Misfit> misfits(sizes_.tiles());
        for (int tile = 0; tile < sizes_.tiles(); ++tile) {
            const TileSums& own = tiles_[tile];
            const int mode = selected_[tile], level = mode & 3, count = mode < 4 ? 2 : 4;
            const Entries members = entries(tile, mode);
            Cluster clusters[4];
            Point points[4];
            for (int k = 0; k < count; ++k) points[k] = palette_[members.at[k]];
            if (count == 2) {
                taken_.assign(own.cells(level), own.sum(level).data(), points[0], points[1]);
                clusters[0] = taken_.clusters[0];
                clusters[1] = taken_.clusters[1];
            } else {
                nearestOfFour(own.cells(level), points, clusters, nullptr);
            }
            const std::int64_t weight = static_cast<std::int64_t>(own.weight()) * own.pixelsOf(level);
            for (int k = 0; k < count; ++k) {
                if (clusters[k].count == 0) continue;
                sums[members.at[k]].add(weight, clusters[k]);
                const Point mean = meanOf(clusters[k], points[k]);
                Point way;
                for (int a = 0; a < 3; ++a) way.at[a] = mean.at[a] - points[k].at[a];
                const std::int64_t error = own.cost(product(way, way) * clusters[k].count * own.pixelsOf(level));
                if (error > misfits[tile].error) misfits[tile] = {error, mean};
            }
        }
        palette_.update(sums, misfits);
    }

    VectorSizes sizes_;
    Fields fields_;
    Palette palette_;
    std::vector<TileSums> tiles_;
    std::vector<Entries> entries_;
    ModeCosts modes_;
    std::vector<std::uint8_t> selected_;
    HeapWriter heap_;
    Budget budget_;
    Halves halves_, taken_;
    std::int16_t all_[maxCells];
    bool isWarm_ = false;
};

} // namespace colonnade::live
