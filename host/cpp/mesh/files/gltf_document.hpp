/// The document of a glTF file: its container, its JSON, its buffers, and the arrays of its accessors.
///
/// What needs a buffer of another file says so, `Found::buffer`; it is asked again after `give`.
#pragma once

#include <cstring>
#include <map>

#include "mesh/files/gltf_checks.hpp"

namespace colonnade::mesh::gltf {

/// Whether something is found, refused, or needs the buffer `GltfDocument::buffer` first.
enum class Found { yes, refused, buffer };

/// A type of components: the number of glTF, bytes, and the largest integer, 0 of floats.
struct Component {
    int number, size;
    bool isSigned;
    double most;
};

/// Elements of a buffer view.
struct Elements {
    const unsigned char* first = nullptr; ///< null: zeros
    std::size_t stride = 0, count = 0;
    const Component* component = nullptr;

    double at(std::size_t row, int column) const {
        if (!first) return 0;
        const unsigned char* from = first + row * stride + static_cast<std::size_t>(column * component->size);
        std::uint32_t bits = 0;
        for (int i = component->size; i-- > 0;) bits = bits << 8 | from[i];
        if (component->most == 0) {
            float value;
            std::memcpy(&value, &bits, sizeof value);
            return static_cast<double>(value);
        }
        const std::int64_t range = std::int64_t{1} << 8 * component->size;
        return static_cast<double>(bits - (component->isSigned && bits >= range / 2 ? range : 0));
    }
};

/// What a decoder gives for an accessor: rows of numbers.
struct Decoded {
    const double* values;
    std::size_t count;
    int width;
    bool isWhole;
};

/// The elements of an accessor.
struct Array {
    Elements own, indices, changes;
    const double* decoded = nullptr; ///< the elements in place of `own`
    std::size_t count = 0;
    int width = 0;
    bool isScaled = false;        ///< integers stand for -1 or 0 to 1
    bool isDecodedScaled = false; ///< those of the decoder, too
    bool isWhole = false;         ///< integers, and not scaled

    template <class Value> void copy(Value* to) const {
        const auto scaled = [](double value, const Component& component, bool isScaled) {
            return isScaled && component.most > 0 ? std::max(value / component.most, -1.0) : value;
        };
        const auto row = [&](std::size_t at, const auto& value) {
            for (int column = 0; column < width; ++column)
                to[at * static_cast<std::size_t>(width) + static_cast<std::size_t>(column)] =
                    static_cast<Value>(value(column));
        };
        for (std::size_t i = 0; i < count; ++i)
            row(i, [&](int column) {
                return decoded ? scaled(decoded[i * static_cast<std::size_t>(width) + static_cast<std::size_t>(column)],
                                        *own.component, isDecodedScaled)
                               : scaled(own.at(i, column), *own.component, isScaled);
            });
        for (std::size_t i = 0; i < changes.count; ++i)
            row(static_cast<std::size_t>(indices.at(i, 0)),
                [&](int column) { return scaled(changes.at(i, column), *changes.component, isScaled); });
    }
};

class GltfDocument {
public:
    /// `where`: the file, and `kind` what it is, in messages.
    explicit GltfDocument(std::string where, std::string kind = "mesh")
        : where_(std::move(where)), kind_(std::move(kind)) {}

    /// Reads a file, text or binary, whose bytes stay.
    bool begin(Text bytes) {
        Text text = bytes;
        if (startsWith(bytes, "glTF") && !takeChunks(bytes, text)) return false;
        if (const std::string error = json_.read(text); !error.empty())
            return refuseAs(where_ + " cannot be read as a mesh: its glTF document" + error);
        Checks checks(json_.root());
        if (!checks.pass())
            return refuseAs("mesh " + where_ + ": " +
                            (checks.isVersion1 ? version1 : checks.reason + ": export it again"));
        for (const List list : {accessors, bufferViews, buffers, images, nodes, meshes, scenes})
            json_.root()[names[list]].each(
                [&](JsonValue, JsonValue entry) { return lists_[list].push_back(entry), true; });
        return true;
    }
    enum List { accessors, bufferViews, buffers, images, nodes, meshes, scenes };
    /// The entries of a list.
    std::size_t count(List list) const { return lists_[list].size(); }
    JsonValue at(List list, std::size_t index) const { return lists_[list][index]; }
    /// The number of an entry of a list; none, and a refusal, if it does not exist.
    std::optional<std::size_t> entry(List list, JsonValue index) {
        if (index.isWhole() && index.number() < static_cast<double>(lists_[list].size()))
            return static_cast<std::size_t>(index.number());
        refuse(std::string(names[list]) + "[" + (index ? std::string(index.raw()) : "None") +
               "] is used, but does not exist: export it again");
        return {};
    }
    std::optional<std::size_t> defaultScene() {
        const JsonValue scene = json_.root()["scene"];
        return scene || count(scenes) == 0 ? entry(scenes, scene) : std::optional<std::size_t>(0);
    }
    bool refuse(const std::string& reason) { return refuseAs(kind_ + " " + where_ + ": " + reason); }
    /// The JSON.
    Text text() const { return json_.text; }

    /// Refuses a file that requires an extension that is not read.
    bool checkExtensions() {
        const JsonValue required = json_.root()["extensionsRequired"];
        return required.each([&](JsonValue, JsonValue one) {
            const std::string name = one.text();
            if (isOneOf(compression, name)) return refuseCompressed(name);
            return isOneOf(readExtensions, name) ||
                   refuse("it requires the glTF extension " + name + ", which is not supported: export it without");
        });
    }

    /// The elements of an accessor that exists, or those of its decoder with the changes that it states.
    Found array(std::size_t index, Array& to, const Decoded* decoded = nullptr) {
        const JsonValue accessor = lists_[accessors][index], sparse = accessor["sparse"];
        const std::string name = "accessor " + std::to_string(index);
        const Component* component = componentOf(accessor);
        to = {};
        const JsonValue type = accessor["type"];
        for (const auto& [own, width] : widths)
            if (type.isText(own)) to.width = width;
        if (!component || to.width == 0) return isFound(refuse(name + " has an unknown type"));
        if (decoded && decoded->width != to.width)
            return isFound(refuse(name + " has " + std::to_string(to.width) + " components, its compressed data " +
                                  std::to_string(decoded->width)));
        to.count = decoded ? decoded->count : static_cast<std::size_t>(accessor["count"].number());
        to.isScaled = isTrue(accessor["normalized"]);
        to.own.component = component;
        to.isWhole = component->most > 0 && !to.isScaled;
        if (decoded) {
            to.decoded = decoded->values;
            // Draco's decoder normalises signed integers itself
            const auto isSmall = [](double value) { return std::fabs(value) <= 1; };
            to.isDecodedScaled =
                to.isScaled && component->most > 0 &&
                (decoded->isWhole ||
                 !std::all_of(to.decoded, to.decoded + to.count * static_cast<std::size_t>(to.width), isSmall));
            to.isWhole = decoded->isWhole && !to.isDecodedScaled;
        } else if (const JsonValue view = accessor["bufferView"]) {
            const std::optional<std::size_t> number = entry(bufferViews, view);
            if (!number) return Found::refused;
            const Found found =
                elements(*number, accessor, *component, static_cast<double>(to.count), to.width, to.own);
            if (found != Found::yes) return found;
        } else if (!sparse)
            return isFound(refuse(name + " has no data, as of a compressed mesh: export it without compression"));
        return sparse ? changes(sparse, to) : Found::yes;
    }

    /// The bytes of a buffer view that exists, as of a picture.
    Found viewBytes(std::size_t index, std::string& to) {
        const double size = lists_[bufferViews][index].wholeOf("byteLength");
        if (size < 1) return isFound(refuse("bufferViews[" + std::to_string(index) + "] is empty: export it again"));
        Elements bytes;
        const Found found = elements(index, {}, components[1], size, 1, bytes);
        if (found != Found::yes) return found;
        to.resize(bytes.count);
        for (std::size_t i = 0; i < bytes.count; ++i) to[i] = static_cast<char>(bytes.first[i * bytes.stride]);
        return Found::yes;
    }

    /// The bytes of an image that exists, or the file that has them.
    Found image(std::size_t index, std::string& bytes, std::optional<std::string>& file) {
        const JsonValue own = lists_[images][index], view = own["bufferView"], uri = own["uri"];
        const std::string name = "image " + std::to_string(index);
        if (view) {
            const std::optional<std::size_t> number = entry(bufferViews, view);
            return number ? viewBytes(*number, bytes) : Found::refused;
        }
        if (!uri) return isFound(refuse(name + " has no picture: export it again"));
        return isFound(content(uri.text(), name, bytes, file));
    }

    /// The buffer that is needed, and the name of its file.
    std::size_t buffer = 0;
    std::optional<std::string> bufferFile;
    /// Gives that buffer, whose bytes stay, or refuses the file that lacks it.
    bool give(std::optional<Text> bytes) {
        if (!bytes)
            return refuse("its buffer " + lists_[buffers][buffer]["uri"].text() +
                          " is missing: copy it beside the mesh");
        buffers_[buffer] = *bytes;
        return true;
    }

    std::string refusal;

private:
    static constexpr const char* version1 = "it is glTF of version 1: export it as glTF 2.0";
    static constexpr Component components[]{{5120, 1, true, 127},           {5121, 1, false, 255},
                                            {5122, 2, true, 32767},         {5123, 2, false, 65535},
                                            {5125, 4, false, 4294967295.0}, {5126, 4, false, 0}};
    static constexpr Text names[]{"accessors", "bufferViews", "buffers", "images", "nodes", "meshes", "scenes"};
    static constexpr struct {
        Text type;
        int width;
    } widths[]{{"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT4", 16}};

    bool refuseAs(const std::string& line) {
        refusal = oneLine(line);
        return false;
    }
    bool refuseCompressed(Text name) {
        return refuse("its meshes are compressed (" + std::string(name) + "): export it without compression");
    }
    static Found isFound(bool isIt) { return isIt ? Found::yes : Found::refused; }

    /// Takes the JSON of a binary file, and the chunk after it.
    bool takeChunks(Text bytes, Text& text) {
        const auto word = [&](std::size_t at) {
            std::uint32_t value = 0;
            for (std::size_t i = 4; i-- > 0;) value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
            return value;
        };
        const std::string start = where_ + " cannot be read as a mesh: ";
        if (bytes.size() >= 12 && word(4) == 1) return refuseAs(start + version1);
        Text kinds[2], chunks[2];
        std::size_t count = 0;
        for (std::size_t at = 12; at + 8 <= bytes.size() && count < 2; ++count) {
            const std::size_t length = word(at), left = bytes.size() - at - 8;
            if (length > left)
                return refuseAs("mesh " + where_ + " is truncated: a part of " + grouped(length) + " bytes begins, " +
                                grouped(left) + " follow");
            kinds[count] = bytes.substr(at + 4, 4);
            chunks[count] = bytes.substr(at + 8, length);
            at += 8 + length;
        }
        if (kinds[0] != "JSON") return refuseAs(start + "it is not a binary glTF file of version 2");
        text = chunks[0];
        if (kinds[1] == Text("BIN\0", 4)) binary_ = chunks[1];
        return true;
    }

    static const Component* componentOf(JsonValue of) {
        const double number = of.wholeOf("componentType");
        for (const Component& one : components)
            if (one.number == number) return &one;
        return nullptr;
    }
    /// Whether a value is neither empty nor 0.
    static bool isTrue(JsonValue value) {
        if (value.isNumber()) return value.number() != 0;
        if (value.isText()) return !value.raw().empty();
        if (value.isObject() || value.isList()) return !value.each([](JsonValue, JsonValue) { return false; });
        return value.type() == 't';
    }

    /// Elements of a buffer view; `at` has their offset.
    Found elements(std::size_t index, JsonValue at, const Component& component, double count, int width, Elements& to) {
        const JsonValue view = lists_[bufferViews][index];
        Text bytes;
        const Found found = bufferBytes(view["buffer"], bytes);
        if (found != Found::yes) return found;
        // Wide values are exact below 2^53, and large beyond
        const double element = component.size * width, offset = view.wholeOf("byteOffset");
        const double start = offset + at.wholeOf("byteOffset"), given = view.wholeOf("byteStride");
        const double stride = given > 0 ? given : element;
        const double end = start + (count - 1) * stride + element;
        const double size = std::min(static_cast<double>(bytes.size()), offset + view.wholeOf("byteLength"));
        if (stride < element || end > size)
            return isFound(refuse("bufferViews[" + std::to_string(index) + "] is too short for " +
                                  grouped(static_cast<std::uint64_t>(count)) + " elements: the file may be truncated"));
        to.count = static_cast<std::size_t>(count);
        to.component = &component;
        to.stride = count > 1 ? static_cast<std::size_t>(stride) : 0;
        to.first = count > 0 ? reinterpret_cast<const unsigned char*>(bytes.data()) + static_cast<std::size_t>(start)
                             : nullptr;
        return Found::yes;
    }
    Found changes(JsonValue sparse, Array& to) {
        const JsonValue indices = sparse["indices"], values = sparse["values"];
        const auto view = [&](JsonValue of, const Component& component, int width, Elements& elementsOf) {
            const std::optional<std::size_t> number = entry(bufferViews, of["bufferView"]);
            return number ? elements(*number, of, component, sparse["count"].number(), width, elementsOf)
                          : Found::refused;
        };
        if (const Found found = view(indices, *componentOf(indices), 1, to.indices); found != Found::yes) return found;
        double last = -1;
        for (std::size_t i = 0; i < to.indices.count; ++i) last = std::max(last, to.indices.at(i, 0));
        if (last >= static_cast<double>(to.count))
            return isFound(refuse("a sparse accessor changes element " +
                                  std::to_string(static_cast<std::uint64_t>(last)) + " of " + grouped(to.count)));
        return view(values, *to.own.component, to.width, to.changes);
    }

    Found bufferBytes(JsonValue index, Text& to) {
        const std::optional<std::size_t> found = entry(buffers, index);
        if (!found) return Found::refused;
        const std::size_t number = *found;
        if (const auto known = buffers_.find(number); known != buffers_.end()) {
            to = known->second;
            return Found::yes;
        }
        const JsonValue own = lists_[buffers][number], uri = own["uri"];
        const std::string name = "buffer " + std::to_string(number);
        if (!uri) {
            for (const Text one : compression)
                if (own["extensions"][one]) return isFound(refuseCompressed(one));
            if (number != 0 || !binary_) return isFound(refuse(name + " has no data"));
            buffers_[number] = *binary_;
        } else {
            std::string& bytes = embedded_[number];
            if (!content(uri.text(), name, bytes, bufferFile)) return Found::refused;
            if (bufferFile) {
                buffer = number;
                return Found::buffer;
            }
            buffers_[number] = bytes;
        }
        to = buffers_[number];
        return Found::yes;
    }

    /// The bytes that a URI embeds, or the file that it names; `what` has them, in messages.
    bool content(const std::string& uri, const std::string& what, std::string& bytes,
                 std::optional<std::string>& file) {
        file.reset();
        if (!startsWith(uri, "data:")) {
            file.emplace();
            for (std::size_t i = 0; i < uri.size(); ++i) {
                const bool isCode = uri[i] == '%' && i + 2 < uri.size() && Json::digitOf(uri[i + 1]) >= 0 &&
                                    Json::digitOf(uri[i + 2]) >= 0;
                *file +=
                    isCode ? static_cast<char>(16 * Json::digitOf(uri[i + 1]) + Json::digitOf(uri[i + 2])) : uri[i];
                i += isCode ? 2 : 0;
            }
            return true;
        }
        const std::size_t comma = uri.find(',');
        const Text code = comma == std::string::npos ? Text() : Text(uri).substr(comma + 1);
        if (code.size() % 4 != 0) return refuse("the data of " + what + " are not base64");
        const std::size_t end = code.size() - std::min<std::size_t>(2, code.size() - code.find_last_not_of('=') - 1);
        static constexpr Text digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
        int values[256];
        std::fill(std::begin(values), std::end(values), -1);
        for (std::size_t i = 0; i < digits.size(); ++i)
            values[static_cast<unsigned char>(digits[i])] = static_cast<int>(i);
        bytes.clear();
        bytes.reserve(code.size() / 4 * 3);
        std::uint32_t bits = 0;
        for (std::size_t i = 0; i < end; ++i) {
            const int value = values[static_cast<unsigned char>(code[i])];
            if (value < 0) return refuse("the data of " + what + " are not base64");
            bits = bits << 6 | static_cast<std::uint32_t>(value);
            if (i % 4 != 0) bytes += static_cast<char>(bits >> (6 - 2 * (i % 4)) & 0xff);
        }
        return true;
    }

    const std::string where_, kind_;
    Json json_;
    std::optional<Text> binary_;
    std::vector<JsonValue> lists_[7];
    std::map<std::size_t, Text> buffers_;
    std::map<std::size_t, std::string> embedded_;
};

} // namespace colonnade::mesh::gltf
