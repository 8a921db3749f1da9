/// The planes of each tile, and the words of the plane map.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "blocks.hpp"
#include "heap_writer.hpp"
#include "kernels.hpp"
#include "modes.hpp"
#include "regions.hpp"

namespace colonnade::live {

constexpr int planeModes = 7;
constexpr int planeWords[planeModes] = {0, 2, 5, 4, 10, 17, 34};
constexpr int planesOf[planeModes] = {1, 2, 2, 4, 4, 2, 4}, planeCells[planeModes] = {1, 16, 64, 16, 64, 256, 256};

class PlaneTiles {
public:
    PlaneTiles(int columns, int rows, int heapWords)
        : columns_(columns), rows_(rows), heapWords_(heapWords), tiles_(static_cast<std::size_t>(columns) * rows),
          modes_{std::vector<std::int64_t>(tiles_.size() * planeModes), planeWords, planeModes},
          selected_(tiles_.size()), heap_(heapWords) {}

    /// Chooses the planes of all tiles; the table's are the device's.
    void choose(const DepthBlocks& blocks, const std::vector<std::int32_t>& labels, const PlaneTable& table,
                std::int64_t tolerance, std::uint16_t* descriptors, std::uint16_t* heap) {
        const std::vector<std::uint8_t> bySize = table.bySize();
        const std::int64_t least = budget_.price() * 5 / 8;
        for (int tile = 0; tile < static_cast<int>(tiles_.size()); ++tile)
            fit(tile, blocks, labels, table, bySize, tolerance, least);
        budget_.fill(modes_, heap_, heapWords_,
                     [&](int tile, int mode) { return store(tile, mode, descriptors[tile]); });
        std::copy(heap_.words().begin(), heap_.words().end(), heap);
    }

    int columns() const { return columns_; }
    int rows() const { return rows_; }
    /// The planes of a tile in its mode; the plane of each of its pixels.
    int count(int tile) const { return planesOf[selected_[tile]]; }
    std::uint8_t id(int tile, int k) const { return tiles_[tile].ids[planesOf[selected_[tile]] / 2][k]; }
    void owners(int tile, std::uint8_t* ids) const {
        const int mode = selected_[tile], set = planesOf[mode] / 2,
                  edge = mode == 0                ? 1
                         : planeCells[mode] == 16 ? 4
                         : planeCells[mode] == 64 ? 8
                                                  : 16;
        for (int y = 0; y < 16; ++y)
            for (int x = 0; x < 16; ++x)
                ids[16 * y + x] =
                    tiles_[tile].ids[set][mode == 0 ? 0 : which(tile, mode, (y * edge / 16) * edge + x * edge / 16)];
    }

private:
    /// One, two and four planes, by ascending id, and for two and four the member of each cell, from 4×4 cells on.
    struct Tile {
        std::uint8_t ids[3][4];
        std::uint8_t members[2][16 + 64 + 256];
    };
    static constexpr int startOf(int cells) { return cells == 16 ? 0 : cells == 64 ? 16 : 80; }
    int which(int tile, int mode, int cell) const {
        return tiles_[tile].members[planesOf[mode] / 4][startOf(planeCells[mode]) + cell];
    }

    void fit(int number, const DepthBlocks& blocks, const std::vector<std::int32_t>& labels, const PlaneTable& table,
             const std::vector<std::uint8_t>& bySize, std::int64_t tolerance, std::int64_t least) {
        const int column = number % columns_, row = number / columns_, across = blocks.blockColumns();
        Tile& tile = tiles_[number];
        std::int64_t* costs = modes_.of(number);
        std::fill(costs, costs + planeModes, impossible);
        int votes[maxPlanes] = {}, count = 0;
        std::uint8_t candidates[maxPlanes];
        const auto vote = [&](int id, int by) {
            if (id < 0) return;
            if (votes[id] == 0) candidates[count++] = static_cast<std::uint8_t>(id);
            votes[id] += by;
        };
        const int first = 4 * row * across + 4 * column, label = labels[first];
        bool isFlat = label >= 0;
        for (int j = 0; j < 4; ++j)
            for (int i = 0; i < 4; ++i) {
                const int block = first + j * across + i;
                vote(labels[block], 4);
                isFlat = isFlat && labels[block] == label && blocks[block].residual <= tolerance;
            }
        if (isFlat) {
            tile.ids[0][0] = static_cast<std::uint8_t>(label);
            std::int64_t cost = 0;
            for (int j = 0; j < 4; ++j)
                for (int i = 0; i < 4; ++i) cost += blocks.error(first + j * across + i, table.planes[label]) * 8;
            costs[0] = cost;
            return;
        }
        for (int j = -3; j < 7; ++j)
            for (int i = -3; i < 7; ++i) {
                const int y = 4 * row + j, x = 4 * column + i;
                if ((i >= 0 && i < 4 && j >= 0 && j < 4) || x < 0 || y < 0 || x >= across || y >= blocks.blockRows())
                    continue;
                vote(labels[y * across + x], i >= -1 && i <= 4 && j >= -1 && j <= 4 ? 2 : 1);
            }
        for (std::size_t i = 0; count == 0 && i < bySize.size() && i < maxCandidates; ++i)
            vote(bySize[i], 1), count = static_cast<int>(i) + 1;
        if (count == 0) { // no plane at all
            tile.ids[0][0] = 0;
            costs[0] = 0;
            return;
        }
        std::stable_sort(candidates, candidates + count, [&](int a, int b) { return votes[a] > votes[b]; });
        count = std::min(count, maxCandidates);
        alignas(64) std::int32_t w[256], metres[256], cap[256], half[64];
        blocks.tile(column, row, w, metres, cap);
        const std::int64_t left = 32 * column + 1 - blocks.width(), top = 32 * row + 1 - blocks.height();
        int single = 0;
        std::int64_t leastSum = impossible;
        for (int k = 0; k < count; ++k) {
            const Plane& plane = table.planes[candidates[k]];
            const auto limited = [](std::int64_t value, std::int64_t limit) {
                return static_cast<std::int32_t>(std::clamp(value, -limit, limit));
            };
            const PlaneLine line{limited(plane.at(left, top) >> 6, 1 << 30), limited(plane.a >> 5, 1 << 24),
                                 limited(plane.b >> 5, 1 << 24)};
            planeErrors(line, w, metres, cap, &fine_[256 * k]);
            sumSquares(&fine_[256 * k], 16, &middle_[64 * k]);
            sumSquares(&middle_[64 * k], 8, &coarse_[16 * k]);
            std::int64_t sum = 0;
            for (int i = 0; i < 16; ++i) sum += coarse_[16 * k + i];
            if (sum < leastSum) {
                leastSum = sum;
                single = k;
            }
        }
        costs[0] = leastSum;
        tile.ids[0][0] = candidates[single];
        if (leastSum <= least * planeWords[1] || count == 1) return;
        int members[4] = {};
        std::int64_t reached = 0;
        int selected = 0;
        const auto withoutSlot = [&](int slot) {
            std::fill(half, half + 64, 1 << 24);
            for (int k = 0; k < selected; ++k)
                if (k != slot) lowerErrors(half, &middle_[64 * members[k]], 64);
        };
        for (int set = 1; set <= 2; ++set) {
            const int size = 2 * set;
            for (; selected < size; ++selected) {
                withoutSlot(-1);
                members[selected] = bestAddition(half, middle_, 64, count, reached);
            }
            for (int slot = 0; slot < size; ++slot) {
                withoutSlot(slot);
                members[slot] = bestAddition(half, middle_, 64, count, reached);
            }
            int sorted[4];
            std::copy(members, members + size, sorted);
            std::stable_sort(sorted, sorted + size, [&](int a, int b) { return candidates[a] < candidates[b]; });
            for (int k = 0; k < size; ++k) tile.ids[set][k] = candidates[sorted[k]];
            const auto assign = [&](const std::int32_t* errors, int cells) {
                std::int64_t sum = 0;
                std::uint8_t* own = tile.members[set - 1] + startOf(cells);
                for (int i = 0; i < cells; ++i) {
                    std::int32_t lowest = errors[cells * sorted[0] + i];
                    std::uint8_t member = 0;
                    for (int k = 1; k < size; ++k)
                        if (errors[cells * sorted[k] + i] < lowest) {
                            lowest = errors[cells * sorted[k] + i];
                            member = static_cast<std::uint8_t>(k);
                        }
                    own[i] = member;
                    sum += lowest;
                }
                return sum;
            };
            costs[set == 1 ? 1 : 3] = assign(coarse_, 16);
            const std::int64_t cost = costs[set == 1 ? 2 : 4] = assign(middle_, 64);
            if (cost > least * (planeWords[set == 1 ? 5 : 6] - planeWords[set == 1 ? 2 : 4]))
                costs[set == 1 ? 5 : 6] = assign(fine_, 256);
            if (cost <= least * (planeWords[3] - planeWords[1])) break;
        }
    }

    bool store(int tile, int mode, std::uint16_t& descriptor) {
        const Tile& own = tiles_[tile];
        selected_[tile] = static_cast<std::uint8_t>(mode);
        if (mode == 0) {
            descriptor = static_cast<std::uint16_t>(own.ids[0][0] << 3);
            return true;
        }
        const int set = planesOf[mode] / 2, cells = planeCells[mode];
        std::uint16_t words[34] = {};
        words[0] = static_cast<std::uint16_t>(own.ids[set][0] | own.ids[set][1] << 8);
        if (set == 2) words[1] = static_cast<std::uint16_t>(own.ids[set][2] | own.ids[set][3] << 8);
        for (int i = 0; i < cells; ++i)
            words[set + (i * set >> 4)] |= static_cast<std::uint16_t>(which(tile, mode, i) << (i * set & 15));
        const int pointer = heap_.put(words, planeWords[mode]);
        if (pointer < 0) return false;
        descriptor = static_cast<std::uint16_t>(mode | pointer << 3);
        return true;
    }

    int columns_, rows_, heapWords_;
    std::vector<Tile> tiles_;
    ModeCosts modes_;
    std::vector<std::uint8_t> selected_;
    HeapWriter heap_;
    Budget budget_;
    alignas(64) std::int32_t fine_[256 * maxCandidates], middle_[64 * maxCandidates], coarse_[16 * maxCandidates];
};

} // namespace colonnade::live
