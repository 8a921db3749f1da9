// Decoders of the physical-attribute memory, as in the RTL's TwoLevelMap, SlicMap and PlaneMap (docs/attributes.md).
#pragma once
#include "attribute_words.hpp"

namespace colonnade {

/// Linear colour; 4095 is 1.0.
struct Rgb12 {
    int r, g, b;
    /// A word beyond the heap was read.
    bool isIllegal;
};

/// View-space normal (x right, y down, z forward); 11 fraction bits.
struct Normal12 {
    int x, y, z;
    bool isIllegal;
};

/// The planes of a tile.
struct TileInfo {
    /// Log2 of the cell's edge in pixels; for a tile with one plane, of the tile's edge.
    int cellLog2;
    /// Number of planes, 1, 2 or 4; the other ids are 0.
    int count;
    std::array<int, 4> ids;
    /// A word beyond the heap was read.
    bool isIllegal;
};

/// The plane of a pixel's cell.
struct CellPlane {
    int id;
    bool isIllegal;
};

/// Index of a pixel's palette entry or seed.
struct MapEntry {
    int index;
    bool isIllegal;
};

/// A bounding plane with its albedo and normal.
struct BoundingPlaneEntry {
    PlaneWord plane;
    Rgb12 albedo;
    Normal12 normal;
};

/// A map of three 12-bit components per pixel (albedo or normals), two-level or SLIC.
class ComponentMap {
public:
    using Components = std::array<int, 3>;

    explicit ComponentMap(const AttributeSizes& sizes)
        : sizes_(sizes), descriptors_(sizes.hasSlicMaps() ? 0 : sizes.tiles()),
          entries_(sizes.hasSlicMaps() ? sizes.tiles() : sizes.paletteSize),
          heap_(sizes.hasSlicMaps() ? sizes.labelWords : sizes.mapHeapWords) {}

    void loadDescriptors(const AttributeWords& words) {
        for (std::size_t i = 0; i < std::min(words.count(), descriptors_.size()); ++i)
            descriptors_[i] = {
                static_cast<int>(words.field(i, "mode")),
                static_cast<int>(words.field(i, "pointer")),
                {static_cast<int>(words.field(i, "entries[0]")), static_cast<int>(words.field(i, "entries[1]"))}};
    }
    void loadEntries(const AttributeWords& words, const char* axes) {
        for (std::size_t i = 0; i < std::min(words.count(), entries_.size()); ++i)
            entries_[i] = words.components(i, "", axes);
    }
    AttributeHeap& heap() { return heap_; }
    const AttributeHeap& heap() const { return heap_; }

    const Components& components(const MapEntry& entry) const { return entries_[entry.index]; }

    /// The palette entry or the seed of a pixel.
    MapEntry entryAt(int x, int y) const {
        return sizes_.hasSlicMaps() ? MapEntry{seedAt(x, y), false} : paletteEntryAt(x, y);
    }

private:
    struct Descriptor {
        int mode, pointer;
        std::array<int, 2> entries;
    };

    /// The mask's word has the highest address that a pixel reads: if it is legal, all are.
    MapEntry paletteEntryAt(int x, int y) const {
        const Descriptor& tile = descriptors_.at(sizes_.tileOf(x, y));
        const int cell = sizes_.cellOf(x, y, sizes_.tileLog - 1 - (tile.mode & 3));
        const int known = sizes_.paletteSize - 1;
        if (tile.mode == 0) return {tile.entries[(tile.pointer >> cell) & 1] & known, false};
        const bool hasFour = tile.mode >= 4;
        const int mask = tile.pointer + hasFour, bits = hasFour ? 2 : 1;
        const int choice = heap_.select(mask, cell, bits);
        const int entry = choice < 2    ? tile.entries[choice]
                          : choice == 2 ? heap_.low(tile.pointer)
                                        : heap_.high(tile.pointer);
        return {entry & known, !heap_.covers(AttributeHeap::wordOf(mask, cell, bits))};
    }

    /// A label above 8 selects the tile's own seed; neighbours are clamped to the map.
    int seedAt(int x, int y) const {
        const int block = (y >> sizes_.blockLog) * sizes_.blockColumns + (x >> sizes_.blockLog);
        const int label = heap_.select(0, block, 4), neighbour = label > 8 ? 4 : label;
        const int column = std::clamp((x >> sizes_.tileLog) + neighbour % 3 - 1, 0, sizes_.tileColumns - 1);
        const int row = std::clamp((y >> sizes_.tileLog) + neighbour / 3 - 1, 0, sizes_.tileRows - 1);
        return row * sizes_.tileColumns + column;
    }

    AttributeSizes sizes_;
    std::vector<Descriptor> descriptors_; // of a two-level map
    std::vector<Components> entries_;     // of the palette, or the seeds
    AttributeHeap heap_;                  // of masks and entries, or of labels
};

/// The texture memory: one atlas as a two-level map (docs/textures.md).
class TextureImage {
public:
    /// @param sizes the manifest's `texture.sizes`
    /// @param layouts its `texture.layouts`
    TextureImage(const std::map<std::string, std::int64_t>& sizes, const std::map<std::string, Layout>& layouts)
        : layouts_(layouts), fractionBits_(static_cast<int>(lookUp(sizes, "fractionBits"))),
          atlas_(AttributeSizes::ofTexture(sizes)) {}

    /// Loads a memory as `AttributeImage::load`.
    void load(const std::string& memory, const std::uint8_t* words, std::size_t count, std::size_t stride) {
        if (memory == "texture.descriptors")
            atlas_.loadDescriptors(AttributeWords(layouts_.at("mapDescriptor"), words, count, stride));
        else if (memory == "texture.palette")
            atlas_.loadEntries(AttributeWords(layouts_.at("albedo"), words, count, stride), "rgb");
        else if (memory == "texture.heap") atlas_.heap().load(words, count, stride);
        else throw std::invalid_argument("there is no texture memory '" + memory + "'");
    }

    /// The texel at a position, which has fraction bits and lies in the atlas.
    Rgb12 texelAt(std::int64_t u, std::int64_t v) const {
        const MapEntry entry =
            atlas_.entryAt(static_cast<int>(u >> fractionBits_), static_cast<int>(v >> fractionBits_));
        const auto [r, g, b] = atlas_.components(entry);
        return {r, g, b, entry.isIllegal};
    }

private:
    std::map<std::string, Layout> layouts_;
    int fractionBits_;
    ComponentMap atlas_;
};

/// The map from pixels to plane ids.
class PlaneIds {
public:
    explicit PlaneIds(const AttributeSizes& sizes)
        : sizes_(sizes), descriptors_(sizes.tiles()), heap_(sizes.planeHeapWords) {}

    void loadDescriptors(const AttributeWords& words) {
        for (std::size_t i = 0; i < std::min(words.count(), descriptors_.size()); ++i)
            descriptors_[i] = {static_cast<int>(words.field(i, "mode")), static_cast<int>(words.field(i, "pointer"))};
    }
    AttributeHeap& heap() { return heap_; }
    const AttributeHeap& heap() const { return heap_; }

    TileInfo tileAt(int x, int y) const {
        const Descriptor& tile = descriptors_.at(sizes_.tileOf(x, y));
        const int count = tile.count(), known = sizes_.planes - 1;
        if (count == 1) return {sizes_.tileLog, 1, {tile.pointer & known, 0, 0, 0}, false};
        TileInfo info{cellLog(tile), count, {}, !heap_.covers(tile.pointer + count / 2 - 1)};
        for (int i = 0; i < count; ++i)
            info.ids[i] = (i % 2 ? heap_.high(tile.pointer + i / 2) : heap_.low(tile.pointer + i / 2)) & known;
        return info;
    }

    /// `info`: the planes of the pixel's tile.
    CellPlane planeAt(const TileInfo& info, int x, int y) const {
        if (info.count == 1) return {info.ids[0], false};
        const int bits = info.count / 2, mask = descriptors_[sizes_.tileOf(x, y)].pointer + bits,
                  cell = sizes_.cellOf(x, y, info.cellLog2);
        return {info.ids[heap_.select(mask, cell, bits)], !heap_.covers(AttributeHeap::wordOf(mask, cell, bits))};
    }

private:
    struct Descriptor {
        int mode, pointer;

        /// Number of ids of a tile; 1 for an illegal mode.
        int count() const { return mode == 0 || mode == 7 ? 1 : mode < 3 || mode == 5 ? 2 : 4; }
    };

    int cellLog(const Descriptor& tile) const { return sizes_.tileLog - (tile.mode > 4 ? 4 : tile.mode % 2 ? 2 : 3); }

    AttributeSizes sizes_;
    std::vector<Descriptor> descriptors_;
    AttributeHeap heap_;
};

/// All maps of an environment. Callers must not pass pixels outside the maps.
class AttributeImage {
public:
    /// @param layouts the manifest's `attributes.layouts`
    AttributeImage(const AttributeSizes& sizes, const std::map<std::string, Layout>& layouts)
        : sizes_(sizes), layouts_(layouts), albedo_(sizes), normals_(sizes), ids_(sizes), planes_(sizes.planes),
          boundingPlanes_(sizes.boundingPlanes) {}

    /// Loads a memory, by its name in the manifest, from address 0 with words of `stride` bytes, low byte first. Words
    /// beyond its depth are dropped.
    void load(const std::string& memory, const std::uint8_t* words, std::size_t count, std::size_t stride) {
        const auto by = [&](const char* layout) { return AttributeWords(layouts_.at(layout), words, count, stride); };
        const std::string entries = sizes_.hasSlicMaps() ? ".seeds" : ".palette",
                          heap = sizes_.hasSlicMaps() ? ".labels" : ".heap";
        if (memory == "albedo.descriptors" && !sizes_.hasSlicMaps()) albedo_.loadDescriptors(by("mapDescriptor"));
        else if (memory == "normals.descriptors" && !sizes_.hasSlicMaps())
            normals_.loadDescriptors(by("mapDescriptor"));
        else if (memory == "albedo" + entries) albedo_.loadEntries(by("albedo"), "rgb");
        else if (memory == "normals" + entries) normals_.loadEntries(by("normal"), "xyz");
        else if (memory == "albedo" + heap) albedo_.heap().load(words, count, stride);
        else if (memory == "normals" + heap) normals_.heap().load(words, count, stride);
        else if (memory == "planes.descriptors") ids_.loadDescriptors(by("planeDescriptor"));
        else if (memory == "planes.heap") ids_.heap().load(words, count, stride);
        else if (memory == "planes.planes") loadPlanes(by("plane"));
        else if (memory == "planes.bounding") loadBoundingPlanes(by("boundingPlaneEntry"));
        else throw std::invalid_argument("there is no attribute memory '" + memory + "'");
    }

    const AttributeSizes& sizes() const { return sizes_; }

    Rgb12 albedoAt(int x, int y) const {
        const MapEntry entry = albedo_.entryAt(x, y);
        const auto [r, g, b] = albedo_.components(entry);
        return {r, g, b, entry.isIllegal};
    }
    Normal12 normalAt(int x, int y) const {
        const MapEntry entry = normals_.entryAt(x, y);
        const auto [nx, ny, nz] = normals_.components(entry);
        return {nx, ny, nz, entry.isIllegal};
    }
    TileInfo tileAt(int x, int y) const { return ids_.tileAt(x, y); }
    CellPlane cellAt(int x, int y) const { return cellAt(tileAt(x, y), x, y); }
    /// `info`: `tileAt` of the pixel.
    CellPlane cellAt(const TileInfo& info, int x, int y) const { return ids_.planeAt(info, x, y); }
    const PlaneWord& planeOf(int id) const { return planes_.at(id); }
    const BoundingPlaneEntry& boundingPlane(int index) const { return boundingPlanes_.at(index); }

private:
    void loadPlanes(const AttributeWords& words) {
        for (std::size_t i = 0; i < std::min(words.count(), planes_.size()); ++i) planes_[i] = words.plane(i, "");
    }
    void loadBoundingPlanes(const AttributeWords& words) {
        for (std::size_t i = 0; i < std::min(words.count(), boundingPlanes_.size()); ++i) {
            const auto [r, g, b] = words.components(i, "albedo.", "rgb");
            const auto [x, y, z] = words.components(i, "normal.", "xyz");
            boundingPlanes_[i] = {words.plane(i, "plane."), {r, g, b, false}, {x, y, z, false}};
        }
    }

    AttributeSizes sizes_;
    std::map<std::string, Layout> layouts_;
    ComponentMap albedo_, normals_;
    PlaneIds ids_;
    std::vector<PlaneWord> planes_;
    std::vector<BoundingPlaneEntry> boundingPlanes_;
};

} // namespace colonnade
