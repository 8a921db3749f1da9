/// PLY files: polygons and triangle strips with normals, colours and textures.
///
/// The format names no properties; those that are read are the ones that MeshLab, Blender, Assimp, trimesh and scanners
/// write. Colours are sRGB, as bytes or from 0 to 1. `comment TextureFile NAME` names a picture, in the forms of
/// MeshLab and Blender: a vertex has its position as `s t`, `u v`, `texture_u texture_v` or `tx ty`, or a face has
/// those of its corners as the list `texcoord`, and the number of its picture as `texnumber`.
#pragma once

#include <cstring>
#include <map>
#include <set>

#include "mesh/files/reader.hpp"

namespace colonnade::mesh {

/// The numbers of a property, row by row; of a list also how many each row has.
struct PlyColumn {
    std::vector<std::int64_t> sizes;
    std::vector<double> values;
};

struct PlyProperty {
    enum Type { i1, u1, i2, u2, i4, u4, f4, f8, none };

    std::string name;
    Type type = none, countType = none; ///< that of the sizes of a list; none: it is no list
    bool isRead = false;
    PlyColumn column;

    bool isList() const { return countType != none; }
    /// The largest value of a colour; nothing for real numbers.
    std::optional<double> white() const {
        return type == f4 || type == f8 ? std::nullopt : std::optional(type == u2 ? 65535.0 : 255.0);
    }

    static Type typeOf(Text name) {
        static constexpr Text names[][2]{{"char", "int8"},     {"uchar", "uint8"},   {"short", "int16"},
                                         {"ushort", "uint16"}, {"int", "int32"},     {"uint", "uint32"},
                                         {"float", "float32"}, {"double", "float64"}};
        for (int type = 0; type < none; ++type)
            if (name == names[type][0] || name == names[type][1]) return static_cast<Type>(type);
        return none;
    }
};

struct PlyElement {
    std::string name;
    std::uint64_t rows;
    std::vector<PlyProperty> properties;

    /// The last property of a name.
    const PlyProperty* find(Text own, bool isList = false) const {
        for (std::size_t i = properties.size(); i-- > 0;)
            if (properties[i].name == own) return properties[i].isList() == isList ? &properties[i] : nullptr;
        return nullptr;
    }
};

class PlyReader : public MeshReader {
public:
    using MeshReader::MeshReader;

    bool begin(Text bytes) override {
        if (!readHeader(bytes) || !(encoding_ == "ascii" ? readAscii() : readBinary())) return false;
        const PlyElement* vertex = find("vertex");
        if (!vertex) return refuseAs("mesh " + where_ + " has no vertices");
        std::vector<Vector> normals;
        if (!stack(vertex, {"x", "y", "z"}, surface.vertices)) return refuse("its vertices lack x, y or z");
        if (stack(vertex, {"nx", "ny", "nz"}, normals)) polygons_.normals = std::move(normals);
        const PlyElement* face = find("face");
        if (face) {
            PlyColumn corners = take("face", "vertex_indices");
            if (corners.sizes.empty()) corners = take("face", "vertex_index");
            polygons_.sizes = std::move(corners.sizes);
            polygons_.corners.reserve(corners.values.size());
            for (const double value : corners.values) addCorner(value);
            readColours(*face, polygons_.colours);
        }
        unroll(take("tristrips", "vertex_indices"));
        if (least_ < 0 || largest_ >= static_cast<std::int64_t>(surface.vertices.size()))
            return refuse("a face names vertex " + std::to_string(least_ < 0 ? least_ : largest_) +
                          ", which does not exist: the file has " + grouped(surface.vertices.size()) +
                          " vertices, numbered from 0");
        const PlyElement* edges = find("edge");
        losses.add(lost::lines, edges ? edges->rows : 0);
        losses.add(lost::alpha, transparent(*vertex));
        losses.add(lost::faceAlpha, face ? transparent(*face) : 0);
        return true;
    }

    bool needPictures() override {
        if (names_.empty()) return true;
        numbers_.assign(polygons_.sizes.size(), 0);
        const PlyElement* face = find("face");
        if (const PlyProperty* own = face ? face->find("texnumber") : nullptr)
            for (std::size_t i = 0; i < std::min(numbers_.size(), own->column.values.size()); ++i) {
                const double value = own->column.values[i];
                numbers_[i] =
                    value >= 0 && value < static_cast<double>(names_.size()) ? static_cast<std::int32_t>(value) : -1;
            }
        for (const std::int32_t number : std::set<std::int32_t>(numbers_.begin(), numbers_.end())) {
            if (number < 0) continue;
            needed_.push_back(number);
            pictures.push_back({names_[static_cast<std::size_t>(number)], false});
        }
        return true;
    }

    bool finish(const std::vector<std::int32_t>& read) override {
        std::vector<std::string> known{
            "x", "y", "z", "nx", "ny", "nz", "vertex_indices", "vertex_index", "confidence", "intensity", "quality"};
        if (!names_.empty()) addTextures(read, known);
        noteUnread(known);
        readColours(*find("vertex"), polygons_.vertexColours);
        return addTo(polygons_);
    }

private:
    /// Properties that a note names, at most.
    static constexpr std::size_t maxNamed = 8;

    bool refuseShort(const PlyElement& element) {
        return refuseTruncated("its header states " + grouped(element.rows) + " rows of " + element.name +
                               ", the file ends before");
    }

    const PlyElement* find(Text name) const {
        for (std::size_t i = elements_.size(); i-- > 0;)
            if (elements_[i].name == name) return &elements_[i];
        return nullptr;
    }

    /// The numbers of a list, which has none left; none without the list.
    PlyColumn take(Text elementName, Text name) {
        const PlyElement* element = find(elementName);
        const PlyProperty* own = element ? element->find(name, true) : nullptr;
        if (!own) return {};
        PlyElement& from = elements_[static_cast<std::size_t>(element - elements_.data())];
        return std::move(from.properties[static_cast<std::size_t>(own - element->properties.data())].column);
    }

    bool readHeader(Text bytes) {
        Lines lines(bytes);
        bool hasEnd = false;
        Text line;
        if (startsWith(bytes, "ply"))
            while (!hasEnd && lines.next(line)) {
                const std::vector<Text> words = wordsOf(line);
                if (words.empty()) continue;
                hasEnd = words[0] == "end_header" && line[0] == 'e' && words.size() == 1 &&
                         (!lines.rest().empty() || isEnd(bytes.back()));
                if (words[0] == "format" && words.size() > 1) encoding_ = words[1];
                else if (words[0] == "comment" && words.size() > 2 && words[1] == "TextureFile") {
                    names_.emplace_back(trimmed(line.substr(static_cast<std::size_t>(words[2].data() - line.data()))));
                } else if (words[0] == "element") {
                    const std::optional<std::int64_t> rows =
                        words.size() == 3 && words[2].size() <= 18 && isDigit(words[2][0]) ? wholeOf(words[2])
                                                                                           : std::nullopt;
                    if (!rows)
                        return refuse("the number of an element of its header is not valid: " + std::string(line));
                    elements_.push_back({std::string(words[1]), static_cast<std::uint64_t>(*rows), {}});
                } else if (words[0] == "property" && !addProperty(words))
                    return refuse("a property of its header is not valid: " + std::string(line));
            }
        if (!hasEnd) return refuseFormat("its PLY header has no end");
        if (encoding_ != "ascii" && encoding_ != "binary_little_endian" && encoding_ != "binary_big_endian")
            return refuseFormat("its PLY format is " + (encoding_.empty() ? "missing" : encoding_));
        body_ = lines.rest();
        // Of other properties the values are passed over
        static constexpr Text read[]{"x",        "y",        "z", "nx", "ny", "nz", "vertex_indices", "vertex_index",
                                     "texcoord", "texnumber"};
        for (PlyElement& element : elements_)
            for (PlyProperty& property : element.properties) {
                property.isRead = std::find(std::begin(read), std::end(read), property.name) != std::end(read);
                for (const auto& names : colourNames)
                    for (const char* name : names) property.isRead |= property.name == name;
                for (const auto& names : uvNames)
                    for (const char* name : names) property.isRead |= property.name == name;
            }
        return true;
    }

    bool addProperty(const std::vector<Text>& words) {
        const bool isList = words.size() == 5 && words[1] == "list";
        if (elements_.empty() || words.size() != (isList ? 5 : 3)) return false;
        PlyProperty added;
        added.name = words.back();
        added.type = PlyProperty::typeOf(words[words.size() - 2]);
        if (isList) added.countType = PlyProperty::typeOf(words[2]);
        if (added.type == PlyProperty::none || (isList && !added.isList())) return false;
        elements_.back().properties.push_back(std::move(added));
        return true;
    }

    /// Rows may go over several lines. Where the words are not those of the header, each line is a row, of which the
    /// values beyond those of the header are left out.
    bool readAscii() {
        const std::vector<PlyElement> header = elements_;
        std::size_t used = 0, ofLines = 0;
        const bool isRead = readWords(false, used);
        const std::size_t count = countWords(body_);
        if (isRead && used == count) return true;
        const std::string refused = refusal;
        std::vector<PlyElement> found = std::move(elements_);
        elements_ = header;
        if (readWords(true, ofLines)) used = ofLines;
        else if (isRead) elements_ = std::move(found);
        else return refuseAs(refused);
        refusal.clear();
        losses.add(lost::surplus, count - used);
        return true;
    }

    static std::size_t countWords(Text text) {
        std::size_t count = 0;
        bool isIn = false;
        for (const char one : text) {
            count += !isIn && !isSpace(one);
            isIn = !isSpace(one);
        }
        return count;
    }

    /// Reads the words of all elements, of which `used` is the number; with `byLines` those of a row from a line of its
    /// own.
    bool readWords(bool byLines, std::size_t& used) {
        Lines lines(body_);
        const char *at = body_.data(), *end = at + body_.size();
        const auto next = [&] {
            while (at != end && isSpace(*at)) ++at;
            const char* first = at;
            while (at != end && !isSpace(*at)) ++at;
            used += at != first;
            return Text(first, static_cast<std::size_t>(at - first));
        };
        for (PlyElement& element : elements_) {
            if (element.properties.empty() && !byLines) continue;
            for (std::uint64_t row = 0; row < element.rows; ++row) {
                if (byLines) {
                    Text line;
                    do {
                        if (!lines.next(line)) return refuseShort(element);
                        line = trimmed(line);
                    } while (line.empty());
                    at = line.data();
                    end = at + line.size();
                }
                for (PlyProperty& property : element.properties) {
                    std::int64_t size = 1;
                    if (property.isList()) {
                        const Text word = next();
                        if (word.empty()) return refuseShort(element);
                        const std::optional<std::int64_t> given = isDigit(word[0]) ? wholeOf(word) : std::nullopt;
                        if (!given)
                            return refuse(
                                "a list of " + element.name + " begins with " + std::string(word.substr(0, 40)) +
                                ", not with its number of values: rows may have more values than the header states");
                        size = *given;
                        if (size > end - at) return refuseShort(element);
                        if (property.isRead) property.column.sizes.push_back(size);
                    }
                    for (std::int64_t i = 0; i < size; ++i) {
                        const Text word = next();
                        if (word.empty()) return refuseShort(element);
                        const std::optional<double> number = numberOf(word);
                        if (!number) return refuseValue(noNumber(word));
                        if (property.isRead) property.column.values.push_back(*number);
                    }
                }
            }
        }
        return true;
    }

    template <class T> static double numberAt(const char* at, bool isBig) {
        T value;
        char bytes[sizeof value];
        std::memcpy(bytes, at, sizeof bytes);
        if (isBig) std::reverse(bytes, bytes + sizeof bytes);
        std::memcpy(&value, bytes, sizeof bytes);
        return static_cast<double>(value);
    }
    static double numberAt(PlyProperty::Type type, const char* at, bool isBig) {
        switch (type) {
        case PlyProperty::i1: return static_cast<double>(static_cast<signed char>(*at));
        case PlyProperty::u1: return static_cast<double>(static_cast<unsigned char>(*at));
        case PlyProperty::i2: return numberAt<std::int16_t>(at, isBig);
        case PlyProperty::u2: return numberAt<std::uint16_t>(at, isBig);
        case PlyProperty::i4: return numberAt<std::int32_t>(at, isBig);
        case PlyProperty::u4: return numberAt<std::uint32_t>(at, isBig);
        case PlyProperty::f4: return numberAt<float>(at, isBig);
        default: return numberAt<double>(at, isBig);
        }
    }

    bool readBinary() {
        static constexpr std::size_t bytes[]{1, 1, 2, 2, 4, 4, 4, 8};
        const bool isBig = encoding_ == "binary_big_endian";
        const char *at = body_.data(), *end = at + body_.size();
        for (PlyElement& element : elements_) {
            if (element.properties.empty()) continue;
            for (std::uint64_t row = 0; row < element.rows; ++row)
                for (PlyProperty& property : element.properties) {
                    const auto left = [&] { return static_cast<std::size_t>(end - at); };
                    std::size_t size = 1;
                    if (property.isList()) {
                        if (left() < bytes[property.countType]) return refuseShort(element);
                        const double given = numberAt(property.countType, at, isBig);
                        at += bytes[property.countType];
                        if (!(given >= 0) || given > static_cast<double>(left())) return refuseShort(element);
                        size = static_cast<std::size_t>(given);
                        if (property.isRead) property.column.sizes.push_back(static_cast<std::int64_t>(size));
                    }
                    if (left() / bytes[property.type] < size) return refuseShort(element);
                    std::vector<double>& values = property.column.values;
                    if (property.isRead && values.capacity() - values.size() < size)
                        values.reserve(std::max(2 * values.capacity(), values.size() + size));
                    if (!property.isRead) at += size * bytes[property.type];
                    else
                        for (std::size_t i = 0; i < size; ++i, at += bytes[property.type])
                            values.push_back(numberAt(property.type, at, isBig));
                }
        }
        return true;
    }

    /// Three properties side by side; false if one is missing.
    static bool stack(const PlyElement* element, const std::array<const char*, 3>& names, std::vector<Vector>& to) {
        std::array<const PlyProperty*, 3> found;
        for (std::size_t i = 0; i < 3; ++i) found[i] = element->find(names[i]);
        if (std::find(found.begin(), found.end(), nullptr) != found.end()) return false;
        to.resize(found[0]->column.values.size());
        for (std::size_t row = 0; row < to.size(); ++row)
            for (std::size_t i = 0; i < 3; ++i) to[row][i] = found[i]->column.values[row];
        return true;
    }

    /// Adds a corner; an index that is no whole number of 53 bits is -1.
    void addCorner(double value) {
        const std::int64_t index = std::fabs(value) < 9007199254740992.0 ? static_cast<std::int64_t>(value) : -1;
        least_ = std::min(least_, index);
        largest_ = std::max(largest_, index);
        polygons_.corners.push_back(static_cast<std::int32_t>(std::clamp<std::int64_t>(index, -1, INT32_MAX)));
    }

    /// Adds the triangles of strips, which end at -1.
    void unroll(const PlyColumn& strips) {
        if (strips.sizes.empty()) return;
        polygons_.colours.clear();
        const double* at = strips.values.data();
        polygons_.sizes.reserve(polygons_.sizes.size() + strips.values.size());
        polygons_.corners.reserve(polygons_.corners.size() + 3 * strips.values.size());
        for (const std::int64_t size : strips.sizes) {
            std::size_t length = 0;
            for (std::int64_t i = 0; i < size; ++i, ++at) {
                length = *at == -1 ? 0 : length + 1;
                if (length < 3) continue;
                const bool isOdd = length % 2 != 0;
                for (const double corner : {at[isOdd ? -2 : -1], at[isOdd ? -1 : -2], at[0]}) addCorner(corner);
                polygons_.sizes.push_back(3);
            }
        }
    }

    /// The properties of a colour; none without one.
    static const char* const* colourOf(const PlyElement& element) {
        for (const auto& names : colourNames)
            if (element.find(names[0]) && element.find(names[1]) && element.find(names[2])) return names;
        return nullptr;
    }

    void readColours(const PlyElement& element, std::vector<Vector>& to) {
        const char* const* names = colourOf(element);
        if (!names || element.rows == 0) return;
        stack(&element, {names[0], names[1], names[2]}, to);
        makeLinear(to, element.find(names[0])->white(), losses);
    }

    /// Rows of an element with an alpha below that of an opaque one.
    static std::size_t transparent(const PlyElement& element) {
        const char* const* names = colourOf(element);
        const PlyProperty* alpha = names ? element.find(names[3]) : nullptr;
        if (!alpha) return 0;
        const double white = alpha->white().value_or(1.0);
        return static_cast<std::size_t>(std::count_if(alpha->column.values.begin(), alpha->column.values.end(),
                                                      [&](double value) { return value < white; }));
    }

    /// Gives polygons the textures that are read, and their positions; `known` gets the properties that it reads.
    void addTextures(const std::vector<std::int32_t>& read, std::vector<std::string>& known) {
        std::vector<std::int32_t> materials(names_.size());
        for (std::size_t i = 0; i < needed_.size(); ++i) {
            if (read[i] < 0) continue;
            FileMaterial textured;
            textured.albedo = {1, 1, 1};
            textured.texture = static_cast<std::int32_t>(surface.textures.size());
            surface.textures.push_back({read[i], -1, false});
            materials[static_cast<std::size_t>(needed_[i])] = static_cast<std::int32_t>(surface.materials.size());
            surface.materials.push_back(textured);
        }
        const double none = std::numeric_limits<double>::quiet_NaN();
        std::vector<Pair>& uvs = polygons_.uvs;
        uvs.assign(polygons_.corners.size(), {none, none});
        for (const auto& names : uvNames) {
            const PlyProperty *u = find("vertex")->find(names[0]), *v = find("vertex")->find(names[1]);
            if (!u || !v) continue;
            for (std::size_t i = 0; i < uvs.size(); ++i) {
                const auto vertex = static_cast<std::size_t>(polygons_.corners[i]);
                uvs[i] = {u->column.values[vertex], v->column.values[vertex]};
            }
            known.insert(known.end(), std::begin(names), std::end(names));
            break;
        }
        known.insert(known.end(), {"texcoord", "texnumber"});
        const PlyElement* face = find("face");
        const PlyProperty* own = face ? face->find("texcoord", true) : nullptr;
        if (own && own->column.sizes.size() > polygons_.sizes.size()) own = nullptr;
        const double* given = own ? own->column.values.data() : nullptr;
        polygons_.materials.resize(polygons_.sizes.size());
        std::size_t corner = 0, lacking = 0;
        for (std::size_t polygon = 0; polygon < polygons_.sizes.size(); ++polygon) {
            const std::int64_t size = polygons_.sizes[polygon],
                               coordinates = own && polygon < own->column.sizes.size() ? own->column.sizes[polygon] : 0;
            bool lacks = false;
            for (std::int64_t i = 0; i < size; ++i, ++corner) {
                if (coordinates == 2 * size)
                    uvs[corner] = {given[2 * i], given[2 * i + 1]}; // a list that does not fit is none
                const bool isKnown = std::fabs(uvs[corner][0]) <= maxUv && std::fabs(uvs[corner][1]) <= maxUv;
                uvs[corner] = isKnown ? Pair{uvs[corner][0], 1 - uvs[corner][1]} : Pair{};
                lacks |= !isKnown;
            }
            given += coordinates;
            const std::int32_t number = numbers_[polygon],
                               material = number < 0 ? 0 : materials[static_cast<std::size_t>(number)];
            lacking += lacks && material > 0;
            polygons_.materials[polygon] = lacks ? 0 : material;
        }
        losses.add(lost::noUvs, lacking);
    }

    void noteUnread(const std::vector<std::string>& known) {
        std::vector<std::string> unread;
        std::map<std::string, std::size_t> last; // of the elements of a name
        for (std::size_t i = 0; i < elements_.size(); ++i) last[elements_[i].name] = i;
        std::size_t count = 0;
        for (std::size_t i = 0; i < elements_.size(); ++i) {
            const PlyElement& element = elements_[i];
            if (element.rows == 0 || element.name == "edge" || i != last[element.name]) continue;
            const char* const* colours = colourOf(element);
            for (const PlyProperty& property : element.properties) {
                const bool isColour = colours && std::find(colours, colours + 4, property.name) != colours + 4;
                if (isColour || std::find(known.begin(), known.end(), property.name) != known.end()) continue;
                if (++count <= maxNamed) unread.push_back(element.name + "." + property.name);
            }
        }
        static constexpr Loss loss{"property is not read", "properties are not read", ""};
        if (!polygons_.sizes.empty())
            losses.add(loss, count, "", joined(unread, ", ") + (count > maxNamed ? " \u2026" : ""));
    }

    static constexpr const char* colourNames[][4]{{"red", "green", "blue", "alpha"},
                                                  {"r", "g", "b", "a"},
                                                  {"diffuse_red", "diffuse_green", "diffuse_blue", "diffuse_alpha"},
                                                  {"color_0", "color_1", "color_2", "color_3"}};
    static constexpr const char* uvNames[][2]{{"s", "t"}, {"u", "v"}, {"texture_u", "texture_v"}, {"tx", "ty"}};

    std::string encoding_;
    std::vector<std::string> names_; ///< of pictures
    std::vector<PlyElement> elements_;
    Text body_;
    Polygons polygons_;
    std::vector<std::int32_t> numbers_; ///< of the polygons' pictures, -1 for none
    std::vector<std::int32_t> needed_; ///< numbers of the pictures that are needed
    std::int64_t least_ = 0, largest_ = -1; ///< of the vertices that corners name
};

} // namespace colonnade::mesh
