// Words and sizes of the physical-attribute memory, read by the manifest's layouts (docs/attributes.md).
#pragma once
#include <algorithm>
#include <stdexcept>
#include <string>
#include <vector>

#include "formats.hpp"

namespace colonnade {

/// w' = (a·(u − W/2) + b·(v − H/2))/1024 + c; each coefficient is its field · 2^(e − 22).
struct PlaneWord {
    std::int64_t a, b, c;
    int e;
};

/// The manifest's `attributes.sizes`.
struct AttributeSizes {
    int width, height, tileLog, tileColumns, tileRows, planes, boundingPlanes;
    /// Of two-level maps; 0 for SLIC maps.
    int paletteSize = 0;
    /// Of SLIC maps: log2 of a block's edge, blocks in a row, words with labels; 0 for two-level maps.
    int blockLog = 0, blockColumns = 0, labelWords = 0;
    /// Depth of the heaps, words.
    int mapHeapWords = 0, planeHeapWords;

    explicit AttributeSizes(const std::map<std::string, std::int64_t>& values) {
        const auto take = [&](const char* key) { return static_cast<int>(lookUp(values, key)); };
        width = take("width");
        height = take("height");
        tileLog = take("tileLog");
        tileColumns = take("tileColumns");
        tileRows = take("tileRows");
        planes = take("planes");
        boundingPlanes = take("boundingPlanes");
        planeHeapWords = take("planeHeapWords");
        if (values.count("paletteSize")) {
            paletteSize = take("paletteSize");
            mapHeapWords = take("mapHeapWords");
        } else {
            blockLog = take("blockLog");
            blockColumns = take("blockColumns");
            labelWords = take("labelWords");
        }
    }

    /// Sizes of the texture memory, by the manifest's `texture.sizes`: an atlas without planes.
    static AttributeSizes ofTexture(std::map<std::string, std::int64_t> values) {
        for (const char* key : {"planes", "boundingPlanes", "planeHeapWords"}) values[key] = 0;
        return AttributeSizes(values);
    }

    bool hasSlicMaps() const { return labelWords > 0; }
    int tiles() const { return tileColumns * tileRows; }
    bool covers(int x, int y) const { return x >= 0 && y >= 0 && x < width && y < height; }
    int tileOf(int x, int y) const { return (y >> tileLog) * tileColumns + (x >> tileLog); }

    /// Row-major index of a pixel's cell in its tile, for cells of 2^cellLog pixels.
    int cellOf(int x, int y, int cellLog) const {
        const int inTile = (1 << tileLog) - 1;
        return (((y & inTile) >> cellLog) << (tileLog - cellLog)) + ((x & inTile) >> cellLog);
    }
};

/// A heap of 16-bit words. Reads beyond its end are illegal and give 0; loads beyond its end are dropped.
class AttributeHeap {
public:
    static constexpr int wordBytes = 2;

    explicit AttributeHeap(int depth) : words_(depth) {}

    void load(const std::uint8_t* words, std::size_t count, std::size_t stride) {
        if (stride < wordBytes) throw std::invalid_argument("heap words must have 16 bits");
        for (std::size_t i = 0; i < std::min(count, words_.size()); ++i)
            words_[i] = static_cast<std::uint16_t>(words[i * stride] | words[i * stride + 1] << 8);
    }
    bool covers(int address) const { return static_cast<std::size_t>(address) < words_.size(); }
    int word(int address) const { return covers(address) ? words_[address] : 0; }
    int low(int address) const { return word(address) & 255; }
    int high(int address) const { return word(address) >> 8; }

    /// Element `index` of a mask at `address` with elements of `bits` (1, 2 or 4) bits.
    int select(int address, int index, int bits) const {
        return (word(wordOf(address, index, bits)) >> (index * bits % 16)) & ((1 << bits) - 1);
    }

    /// Address of the word with that element.
    static int wordOf(int address, int index, int bits) { return address + index * bits / 16; }

private:
    std::vector<std::uint16_t> words_;
};

/// Reads fields of words of `stride` bytes, low byte first, by their layout.
class AttributeWords {
public:
    AttributeWords(const Layout& layout, const std::uint8_t* words, std::size_t count, std::size_t stride)
        : layout_(layout), words_(words), count_(count), stride_(stride) {
        for (const auto& [name, field] : layout)
            if (field.offset + field.width > static_cast<int>(8 * stride))
                throw std::invalid_argument("words are too short for their field " + name);
    }
    std::size_t count() const { return count_; }
    std::int64_t field(std::size_t index, const std::string& name) const {
        return layout_.at(name).read(words_ + index * stride_);
    }
    std::array<int, 3> components(std::size_t index, const std::string& prefix, const char* axes) const {
        std::array<int, 3> values;
        for (int i = 0; i < 3; ++i) values[i] = static_cast<int>(field(index, prefix + axes[i]));
        return values;
    }
    PlaneWord plane(std::size_t index, const std::string& prefix) const {
        return {field(index, prefix + "a"), field(index, prefix + "b"), field(index, prefix + "c"),
                static_cast<int>(field(index, prefix + "exponent"))};
    }

private:
    const Layout& layout_;
    const std::uint8_t* words_;
    std::size_t count_, stride_;
};

} // namespace colonnade
