/// What each mode of a tile costs, and the price of a word at which the selected modes fill the heap.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "heap_writer.hpp"

namespace colonnade::live {

constexpr std::int64_t impossible = std::numeric_limits<std::int64_t>::max() / 4;

/// Costs of the modes of each tile; modes[t * count + m], `impossible` if a tile does not have the mode.
struct ModeCosts {
    std::vector<std::int64_t> costs;
    const int* words;
    int count;

    int tiles() const { return static_cast<int>(costs.size()) / count; }
    const std::int64_t* of(int tile) const { return &costs[static_cast<std::size_t>(tile) * count]; }
    std::int64_t* of(int tile) { return &costs[static_cast<std::size_t>(tile) * count]; }
    /// The cheapest mode of at most so many words.
    int best(int tile, std::int64_t price, int most) const {
        const std::int64_t* cost = of(tile);
        int mode = 0;
        std::int64_t least = impossible;
        for (int m = 0; m < count; ++m)
            if (words[m] <= most && cost[m] < impossible && cost[m] + price * words[m] < least) {
                least = cost[m] + price * words[m];
                mode = m;
            }
        return mode;
    }
    std::int64_t wordsAt(std::int64_t price) const {
        std::int64_t sum = 0;
        for (int tile = 0; tile < tiles(); ++tile) sum += words[best(tile, price, INT32_MAX)];
        return sum;
    }
    /// The lowest price, up to 1/256, at which the tiles demand at most so many words.
    std::int64_t priceFor(std::int64_t most, std::int64_t start) const {
        std::int64_t low = 0, high = std::max<std::int64_t>(start, 1);
        while (wordsAt(high) > most) {
            low = high;
            high *= 2;
        }
        if (low == 0)
            for (std::int64_t lower = high / 2; lower > 0 && wordsAt(lower) <= most; lower /= 2) high = lower;
        if (low == 0) low = high / 2;
        while (high - low > std::max<std::int64_t>(1, high / 256)) {
            const std::int64_t middle = low + (high - low) / 2;
            (wordsAt(middle) <= most ? high : low) = middle;
        }
        return high;
    }
};

/// The price of a word, and the share of the demanded words that are stored; kept from frame to frame.
class Budget {
public:
    std::int64_t price() const { return price_; }

    /// Fills a heap: `store(tile, mode)` writes a tile in a mode, and tells whether its words fit. Mode 0 always fits.
    template <class Store> void fill(const ModeCosts& modes, HeapWriter& heap, int size, Store store) {
        for (int attempt = 0; attempt < 3; ++attempt) {
            // Words are demanded so that 99.5 % of the heap are stored, if the same share of them is
            price_ = modes.priceFor(size * std::int64_t{1019} / 1024 * demand_ / stored_, price_);
            heap.clear();
            std::int64_t demand = 0, demandUntilFull = 0, stored = 0;
            bool isFull = false;
            for (int tile = 0; tile < modes.tiles(); ++tile) {
                const int mode = modes.best(tile, price_, INT32_MAX);
                demand += modes.words[mode];
                if (store(tile, mode)) continue;
                if (!isFull) {
                    isFull = true;
                    demandUntilFull = demand;
                    stored = heap.used() + modes.words[mode];
                }
                store(tile, modes.best(tile, price_, size - heap.used()));
            }
            if (!isFull) {
                demandUntilFull = demand;
                stored = heap.used();
            }
            demand_ = std::max<std::int64_t>(demandUntilFull, 1);
            stored_ = std::max<std::int64_t>(stored, 1);
            const bool hasSpace = stored < size * std::int64_t{1008} / 1024 && price_ > 1;
            if (!isFull && !hasSpace) return;
        }
    }

private:
    std::int64_t price_ = 0, demand_ = 1, stored_ = 1;
};

} // namespace colonnade::live
