/// OBJ files: polygons with normals, vertex colours, materials and texture coordinates.
#pragma once

#include <set>

#include "mesh/files/mtl.hpp"
#include "mesh/files/reader.hpp"

namespace colonnade::mesh {

class ObjReader : public MeshReader {
public:
    using MeshReader::MeshReader;

    bool begin(Text bytes) override {
        std::string buffer;
        Lines lines(textOf(bytes, buffer), true);
        names_[""] = 0;
        std::size_t points = 0, strokes = 0, curves = 0;
        std::set<std::string> groups;
        for (Text line; lines.next(line);) {
            Words words(line);
            const Text keyword = words.next();
            if (keyword == "v") readVertex(words);
            else if (keyword == "f") readFace(words);
            else if (keyword == "vn") readRow(words, normals_, badNormal_);
            else if (keyword == "vt") readRow(words, uvs_, badUv_);
            else if (keyword == "usemtl") {
                material_ = static_cast<std::int32_t>(
                    names_.emplace(joined(wordsOf(words.rest())), names_.size()).first->second);
            } else if (keyword == "mtllib") addLibrary(words.rest());
            else if (keyword == "s") {
                const std::string group(words.next());
                if (group != "off" && group != "0" && group[0] != '#') groups.insert(group);
            } else if (keyword == "p") ++points;
            else if (keyword == "l") ++strokes;
            else if (keyword == "curv" || keyword == "curv2" || keyword == "surf") ++curves;
        }
        if (!finishVertices() || !finishCorners()) return false;
        losses.add(lost::points, points);
        losses.add(lost::lines, strokes);
        losses.add(lost::curves, curves);
        if (groups.size() > 1 && polygons_.normals.empty()) losses.add(lost::groups, groups.size());
        return true;
    }

    bool giveMaterials(Text bytes, const std::string& where) override {
        const std::string refused = addMaterials(bytes, where, defined_);
        return refused.empty() || refuse(refused);
    }

    bool needPictures() override {
        uses_.resize(names_.size());
        std::set<std::size_t> used(polygons_.materials.begin(), polygons_.materials.end());
        std::vector<std::string> names(names_.size());
        for (const auto& [name, number] : names_) names[number] = name;
        for (const std::size_t number : used) {
            const auto found = defined_.find(names[number]);
            Use& use = uses_[number];
            if (found == defined_.end()) {
                if (!names[number].empty() && (!defined_.empty() || !lacksMaterials)) use.isUnknown = true;
                continue;
            }
            use.entries = &found->second;
            const std::optional<TextureMap> colour = use.entries->map("map_kd", losses),
                                            alpha = use.entries->map("map_d", losses);
            if (!colour && !alpha) continue;
            use.map = colour ? colour : alpha; // one position of a corner serves both
            use.isColoured = colour.has_value();
            const auto [entry, isNew] = textures_.emplace(std::make_pair(colour, alpha), textures_.size());
            use.texture = static_cast<std::int32_t>(entry->second);
            if (!isNew) continue;
            needed_.emplace_back(colour ? addPicture(*colour) : -1, alpha ? addPicture(*alpha) : -1);
        }
        return true;
    }

    bool finish(const std::vector<std::int32_t>& pictures) override {
        surface.materials.resize(names_.size());
        std::vector<std::int32_t> numbers; // of the textures that are needed, in the surface
        for (const auto& [colour, alpha] : needed_) {
            const auto read = [&](std::int32_t picture) {
                return picture < 0 ? -1 : pictures[static_cast<std::size_t>(picture)];
            };
            const std::int32_t base = read(colour), mask = read(alpha);
            numbers.push_back(base < 0 && mask < 0 ? -1 : static_cast<std::int32_t>(surface.textures.size()));
            if (numbers.back() >= 0) surface.textures.push_back({base < 0 ? mask : base, mask, base < 0});
        }
        for (std::size_t number = 0; number < uses_.size(); ++number) {
            const Use& use = uses_[number];
            losses.add(lost::unknownMaterials, use.isUnknown);
            if (!use.entries) continue;
            FileMaterial& material = surface.materials[number] = use.entries->material();
            use.entries->count(losses);
            if (!use.map) continue;
            material.texture = numbers[static_cast<std::size_t>(use.texture)];
            if (material.texture < 0) material.alpha.reset();
            else if (use.isColoured && material.albedo == Vector{}) material.albedo = {1, 1, 1};
        }
        if (!surface.textures.empty() && !placeTextures()) return false;
        // Of equal materials the first
        std::map<FileMaterial, std::int32_t> firsts;
        std::vector<std::int32_t> first;
        for (const FileMaterial& material : surface.materials)
            first.push_back(firsts.emplace(material, static_cast<std::int32_t>(first.size())).first->second);
        for (std::int32_t& material : polygons_.materials) material = first[static_cast<std::size_t>(material)];
        return addTo(polygons_);
    }

private:
    struct Use {
        const MtlEntries* entries = nullptr;
        bool isUnknown = false, isColoured = false;
        std::optional<TextureMap> map;
        std::int32_t texture = -1;
    };
    /// The first word that is none of so many numbers of a row, and its column.
    struct Bad {
        std::string word;
        std::size_t column = SIZE_MAX;
    };

    std::int32_t addPicture(const TextureMap& map) {
        pictures.push_back({map.name, map.isClamped});
        return static_cast<std::int32_t>(pictures.size()) - 1;
    }

    void readVertex(Words& words) {
        double row[7];
        std::size_t count = 0;
        for (Text word = words.next(); count < 7 && !word.empty() && word[0] != '#'; word = words.next(), ++count) {
            const std::optional<double> number = numberOf(word);
            if (!number && count < badVertex_.column) badVertex_ = {std::string(word), count};
            row[count] = number.value_or(0);
        }
        columns_ = std::min(columns_, count);
        coloured_ += count >= 6;
        std::fill(row + count, row + 7, 0.0);
        surface.vertices.push_back({row[0], row[1], row[2]});
        if (columns_ >= 6) {
            polygons_.vertexColours.push_back({row[3], row[4], row[5]});
            transparent_ += row[6] < 1.0;
        }
    }

    /// Reads the numbers of a row; of texture coordinates v is 0 unless given.
    template <class Values> void readRow(Words& words, std::vector<Values>& rows, Bad& bad) {
        Values row{};
        std::size_t count = 0;
        for (Text word = words.next(); count < row.size() && !word.empty() && word[0] != '#';
             word = words.next(), ++count) {
            const std::optional<double> number = numberOf(word);
            if (!number && bad.word.empty()) bad.word = word;
            row[count] = number.value_or(0);
        }
        if (count < (row.size() == 2 ? 1 : 3)) bad.column = 0;
        rows.push_back(row);
    }

    void readFace(Words& words) {
        std::int64_t size = 0;
        for (Text word = words.next(); !word.empty() && word[0] != '#'; word = words.next(), ++size) {
            std::array<Text, 3> parts;
            for (int part = 0; part < 3; ++part) {
                const std::size_t slash = std::min(word.find('/'), word.size());
                parts[static_cast<std::size_t>(part)] = word.substr(0, slash);
                word.remove_prefix(std::min(word.size(), slash + 1));
            }
            const std::optional<std::int64_t> vertex = wholeOf(parts[0]);
            std::optional<std::int64_t> uv, normal;
            if (!parts[1].empty()) uv = wholeOf(parts[1]);
            if (!parts[2].empty()) normal = wholeOf(parts[2]);
            if (!vertex || (!uv && !parts[1].empty()) || (!normal && !parts[2].empty())) {
                hasOddIndex_ = true;
                continue;
            }
            vertexIndices_.add(*vertex);
            if (normal) normalIndices_.add(*normal);
            namedNormals_ += normal.has_value();
            polygons_.corners.push_back(positionOf(*vertex, surface.vertices.size()));
            isBefore_ |= *vertex < 0 && polygons_.corners.back() < 0;
            polygons_.cornerNormals.push_back(normal ? positionOf(*normal, normals_.size()) : -1);
            cornerUvs_.push_back(uv ? positionOf(*uv, uvs_.size()) : -1);
        }
        polygons_.sizes.push_back(size);
        polygons_.materials.push_back(material_);
    }

    /// The position of an index of which negative ones count back from the last one so far; -1 for none.
    static std::int32_t positionOf(std::int64_t index, std::size_t count) {
        const std::int64_t found = index < 0 ? static_cast<std::int64_t>(count) + index : index - 1;
        return static_cast<std::int32_t>(std::clamp<std::int64_t>(found, -1, INT32_MAX));
    }

    bool finishVertices() {
        if (!surface.vertices.empty() && (columns_ < 3 || badVertex_.column < 3))
            return refuseRow(badVertex_.column < 3 ? badVertex_.word : "");
        if (badNormal_.column == 0 || !badNormal_.word.empty())
            return refuseRow(badNormal_.column == 0 ? "" : badNormal_.word);
        if (columns_ < 6 || surface.vertices.empty()) {
            losses.add(lost::someColours, surface.vertices.empty() ? 0 : coloured_);
            polygons_.vertexColours.clear();
            return true;
        }
        if (badVertex_.column < std::min<std::size_t>(columns_, 7)) return refuseRow(badVertex_.word);
        losses.add(lost::alpha, columns_ > 6 ? transparent_ : 0);
        makeLinear(polygons_.vertexColours, {}, losses);
        return true;
    }

    bool refuseRow(const std::string& word) {
        return refuseValue(word.empty() ? "a vertex or normal has fewer than 3 numbers" : noNumber(word));
    }

    bool finishCorners() {
        if (hasOddIndex_) return refuse("a vertex index of a face is not an integer");
        if (normals_.empty()) {
            losses.add(lost::missing, namedNormals_);
            normalIndices_ = {};
        }
        if (!vertexIndices_.check(*this, "vertex", "vertices", surface.vertices.size()) ||
            !normalIndices_.check(*this, "normal", "normals", normals_.size()))
            return false;
        if (isBefore_) return refuse("a relative index of a face names a vertex before the first");
        for (std::int32_t& uv : cornerUvs_)
            if (static_cast<std::size_t>(uv) >= uvs_.size()) uv = -1; // shows no texture, as none does
        polygons_.normals = std::move(normals_);
        std::int32_t odd = INT32_MAX;
        for (const std::int32_t corner : polygons_.corners)
            for (const double value : surface.vertices[static_cast<std::size_t>(corner)])
                if (!std::isfinite(value)) odd = std::min(odd, corner);
        return odd == INT32_MAX ||
               refuse("vertex " + std::to_string(odd + 1) + " is not a finite number: repair the file");
    }

    /// Gives corners their positions. A polygon with a corner without one, or with one beyond `maxUv`, shows no
    /// texture.
    bool placeTextures() {
        if (badUv_.column == 0 || !badUv_.word.empty()) return refuseRow(badUv_.column == 0 ? "" : badUv_.word);
        const auto count = static_cast<std::int32_t>(surface.materials.size());
        for (std::int32_t number = 0; number < count; ++number) {
            surface.materials.push_back(surface.materials[static_cast<std::size_t>(number)]);
            surface.materials.back().texture = -1;
        }
        std::size_t lacking = 0, corner = 0;
        for (std::size_t polygon = 0; polygon < polygons_.sizes.size(); ++polygon) {
            std::int32_t& material = polygons_.materials[polygon];
            const std::optional<TextureMap>& map = uses_[static_cast<std::size_t>(material)].map;
            const TextureMap transform =
                map && surface.materials[static_cast<std::size_t>(material)].texture >= 0 ? *map : TextureMap();
            bool lacks = false;
            for (std::int64_t i = 0; i < polygons_.sizes[polygon]; ++i, ++corner) {
                const std::int32_t own = cornerUvs_[corner];
                const Pair at = own < 0 ? Pair{} : uvs_[static_cast<std::size_t>(own)];
                const Pair uv{at[0] * transform.scale[0] + transform.offset[0],
                              1 - (at[1] * transform.scale[1] + transform.offset[1])};
                const bool isKnown = own >= 0 && std::fabs(uv[0]) <= maxUv && std::fabs(uv[1]) <= maxUv;
                polygons_.uvs.push_back(isKnown ? uv : Pair{});
                lacks |= !isKnown;
            }
            if (!lacks) continue;
            lacking += surface.materials[static_cast<std::size_t>(material)].texture >= 0;
            material += count;
        }
        losses.add(lost::noUvs, lacking);
        return true;
    }

    /// The least and the largest of indices.
    struct Indices {
        std::int64_t least = 1, largest = 1;
        bool isEmpty = true, hasZero = false;

        void add(std::int64_t index) {
            least = isEmpty ? index : std::min(least, index);
            largest = isEmpty ? index : std::max(largest, index);
            isEmpty = false;
            hasZero |= index == 0;
        }
        bool check(MeshReader& reader, const std::string& one, const std::string& several, std::size_t count) const {
            if (isEmpty) return true;
            if (hasZero) return reader.refuse("a face names " + one + " 0; OBJ files number " + several + " from 1");
            for (const std::int64_t worst : {least, largest})
                if (std::abs(worst) > static_cast<std::int64_t>(count))
                    return reader.refuse("a face names " + one + " " + std::to_string(worst) + ", but the file has " +
                                         grouped(count) + " " + several);
            return true;
        }
    };

    Polygons polygons_;
    std::vector<Vector> normals_;
    std::vector<Pair> uvs_;
    std::vector<std::int32_t> cornerUvs_;
    std::map<std::string, std::size_t> names_; ///< of materials, numbered in their order
    std::int32_t material_ = 0;
    std::size_t columns_ = SIZE_MAX, coloured_ = 0, transparent_ = 0, namedNormals_ = 0;
    Bad badVertex_, badNormal_, badUv_;
    Indices vertexIndices_, normalIndices_;
    bool hasOddIndex_ = false, isBefore_ = false;
    MtlMaterials defined_;
    std::vector<Use> uses_;
    std::map<std::pair<std::optional<TextureMap>, std::optional<TextureMap>>, std::size_t> textures_;
    std::vector<std::pair<std::int32_t, std::int32_t>>
        needed_; ///< of each texture the pictures of its colours and its alpha
};

} // namespace colonnade::mesh
