/// The palette of a map: its entries as points and as words, its first fit, and its step from frame to frame.
#pragma once

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <vector>

#include "clusters.hpp"
#include "kernels.hpp"
#include "srgb.hpp"
#include "tile_sums.hpp"

namespace colonnade::live {

/// Bits of a field of a palette's word.
constexpr int fieldBits = 12, fieldMask = (1 << fieldBits) - 1;

/// The storage of colours: linear fields of points in sRGB.
class ColourFields {
public:
    ColourFields() : fields_(highest + 1), points_(1 << fieldBits) {
        for (int i = 0; i <= highest; ++i) {
            const double linear = linearFromSrgb(i / static_cast<double>(highest));
            fields_[i] = static_cast<std::uint16_t>(std::min<double>(fieldMask, linear * fieldMask + 0.5));
        }
        for (int i = 0; i <= fieldMask; ++i) {
            const double encoded = srgbFromLinear(i / static_cast<double>(fieldMask));
            points_[i] = static_cast<std::uint16_t>(std::min<double>(highest, encoded * highest + 0.5));
        }
    }
    static constexpr int highest = 255 * 16;
    /// Whether the palette of the frame before takes a step before it encodes a frame.
    static constexpr bool stepsFirst = false;
    std::uint64_t word(Point& point) const {
        std::uint64_t word = 0;
        for (int a = 0; a < 3; ++a) {
            const int field = fields_[std::clamp<std::int32_t>(point.at[a], 0, highest)];
            word |= static_cast<std::uint64_t>(field) << fieldBits * a;
            point.at[a] = points_[field];
        }
        return word;
    }
    static constexpr PointSpace space() { return {{16, 16, 16}, {0, 0, 0}}; }

private:
    std::vector<std::uint16_t> fields_, points_;
};

/// The storage of normals: unit vectors in view space, y down and z forward; the codes have y up and z towards the
/// viewer.
class NormalFields {
public:
    /// New surfaces come into view with normals of their own, and walls fill their tiles with one.
    static constexpr bool stepsFirst = true;
    static constexpr int length = 2040, one = (1 << (fieldBits - 1)) - 1;
    std::uint64_t word(Point& point) const {
        std::int64_t square = product(point, point);
        if (square == 0) {
            point = {{0, 0, -length}};
            square = product(point, point);
        }
        const std::int64_t scaled = squareRoot(square << 20);
        std::uint64_t word = 0;
        for (int a = 0; a < 3; ++a) {
            const std::int32_t field = divideRounded(static_cast<std::int64_t>(point.at[a]) * one * 1024, scaled);
            word |= static_cast<std::uint64_t>(field & fieldMask) << fieldBits * a;
            point.at[a] = divideRounded(static_cast<std::int64_t>(field) * length, one);
        }
        return word;
    }
    static constexpr PointSpace space() { return {{16, -16, -16}, {-length, length, length}}; }
};

/// Sums of what an entry stands for, weighted, and the worst cluster of each tile.
struct EntrySums {
    std::int64_t weight = 0, sum[3] = {0, 0, 0};
    void add(std::int64_t by, const Cluster& cluster) {
        weight += by * cluster.count;
        for (int a = 0; a < 3; ++a) sum[a] += by * cluster.sum[a];
    }
    void add(const EntrySums& other) {
        weight += other.weight;
        for (int a = 0; a < 3; ++a) sum[a] += other.sum[a];
    }
};
struct Misfit {
    std::int64_t error = 0;
    Point mean{};
};

class Palette {
public:
    explicit Palette(int size) : size_(size), entries_(size) {}

    const Point& operator[](int entry) const { return entries_[entry]; }
    int nearest(const Point& point) const { return nearestEntry(table_, point); }

    /// Rounds the entries to their words.
    template <class Fields> void store(const Fields& fields, std::uint64_t* words) {
        for (int i = 0; i < size_; ++i) words[i] = fields.word(entries_[i]);
        for (int i = 0; i < maxEntries; ++i) {
            const Point entry = i < size_ ? entries_[i] : Point{{0, 0, 0}};
            for (int a = 0; a < 3; ++a) table_.axis[a][i] = static_cast<std::int16_t>(entry.at[a]);
            table_.half[i] = i < size_ ? static_cast<std::int32_t>(product(entry, entry) >> 1) : 60'000'000;
        }
    }

    /// Moves each entry to the mean of what it stands for, and unused ones to the worst clusters.
    void update(const std::vector<EntrySums>& sums, std::vector<Misfit>& misfits) {
        std::vector<int> unused;
        for (int i = 0; i < size_; ++i) {
            if (sums[i].weight == 0) unused.push_back(i);
            else entries_[i] = mean(sums[i]);
        }
        std::stable_sort(misfits.begin(), misfits.end(),
                         [](const Misfit& a, const Misfit& b) { return a.error > b.error; });
        for (std::size_t i = 0; i < unused.size() && i < misfits.size() && misfits[i].error > 0; ++i)
            entries_[unused[i]] = misfits[i].mean;
    }

    /// Rotates all entries, which are directions, by a rotation in steps of 2^-14.
    void rotate(const std::int32_t rotation[9]) {
        for (Point& entry : entries_) {
            Point rotated;
            for (int a = 0; a < 3; ++a)
                rotated.at[a] = divideRounded(
                    product(Point{{rotation[3 * a], rotation[3 * a + 1], rotation[3 * a + 2]}}, entry), 1 << 14);
            for (int a = 0; a < 3; ++a)
                entry.at[a] = std::clamp(rotated.at[a], -NormalFields::length, NormalFields::length);
        }
    }

    /// Fits the entries to the cells of a level of all tiles: seeds as far as possible from each other, then Lloyd's
    /// steps.
    void fit(const std::vector<TileSums>& tiles) {
        const std::vector<Bin> bins = histogram(tiles);
        std::vector<std::int64_t> distance(bins.size(), INT32_MAX);
        EntrySums all;
        for (const Bin& bin : bins) all.add(bin.sums);
        Point seed = mean(all);
        for (int i = 0; i < size_; ++i) {
            entries_[i] = seed;
            std::int64_t most = -1;
            Point farthest = seed;
            for (std::size_t b = 0; b < bins.size(); ++b) {
                const Point difference{{bins[b].mean.at[0] - seed.at[0], bins[b].mean.at[1] - seed.at[1],
                                        bins[b].mean.at[2] - seed.at[2]}};
                distance[b] = std::min(distance[b], product(difference, difference));
                const std::int64_t weighted = distance[b] * (bins[b].sums.weight >> 8);
                if (weighted > most) {
                    most = weighted;
                    farthest = bins[b].mean;
                }
            }
            seed = farthest;
        }
        for (int round = 0; round < 4; ++round) step(bins);
    }

    /// One of Lloyd's steps on the cells of all tiles.
    void step(const std::vector<TileSums>& tiles) { step(histogram(tiles)); }

private:
    struct Unrounded {
        std::uint64_t word(Point&) const { return 0; }
    };
    struct Bin {
        std::uint32_t key;
        EntrySums sums;
        Point mean;
    };

    void step(const std::vector<Bin>& bins) {
        std::vector<std::uint64_t> ignored(size_);
        store(Unrounded{}, ignored.data());
        std::vector<EntrySums> sums(size_);
        for (const Bin& bin : bins) sums[nearest(bin.mean)].add(bin.sums);
        for (int i = 0; i < size_; ++i)
            if (sums[i].weight > 0) entries_[i] = mean(sums[i]);
    }

    static Point mean(const EntrySums& sums) {
        Point point;
        for (int a = 0; a < 3; ++a) point.at[a] = divideRounded(sums.sum[a], std::max<std::int64_t>(1, sums.weight));
        return point;
    }

    /// Bins of 4 codes on each axis that hold cells.
    static std::vector<Bin> histogram(const std::vector<TileSums>& tiles) {
        std::vector<Bin> bins;
        std::vector<std::int32_t> slots(1 << 16, -1);
        for (const TileSums& tile : tiles) {
            const int level = std::min(2, tile.finest());
            for (int i = 0; i < cellsOf(level); ++i) {
                const Point point = tile.point(level, i);
                std::uint32_t key = 0;
                for (int a = 0; a < 3; ++a) key = key << 8 | static_cast<std::uint32_t>((point.at[a] + 4096) >> 6);
                std::uint32_t slot = (key * 2654435761u) >> 16;
                while (slots[slot] >= 0 && bins[slots[slot]].key != key) slot = (slot + 1) & 0xffff;
                if (slots[slot] < 0) {
                    if (bins.size() == 1 << 15) continue;
                    slots[slot] = static_cast<std::int32_t>(bins.size());
                    bins.push_back({key, {}, {}});
                }
                EntrySums& sums = bins[slots[slot]].sums;
                sums.weight += tile.weight();
                for (int a = 0; a < 3; ++a) sums.sum[a] += static_cast<std::int64_t>(tile.weight()) * point.at[a];
            }
        }
        for (Bin& bin : bins) bin.mean = mean(bin.sums);
        return bins;
    }

    int size_;
    std::vector<Point> entries_;
    PaletteTable table_;
};

} // namespace colonnade::live
