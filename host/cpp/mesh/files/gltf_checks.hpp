/// Checks the JSON of glTF files before it is used.
#pragma once

#include "mesh/files/json.hpp"

namespace colonnade::mesh::gltf {

/// Extensions whose content is read, and checked; a file may require them.
inline constexpr Text readExtensions[]{"KHR_materials_transmission",
                                       "KHR_materials_ior",
                                       "KHR_materials_emissive_strength",
                                       "KHR_materials_pbrSpecularGlossiness",
                                       "KHR_materials_clearcoat",
                                       "KHR_materials_unlit",
                                       "KHR_draco_mesh_compression",
                                       "KHR_mesh_quantization",
                                       "KHR_lights_punctual",
                                       "KHR_texture_transform",
                                       "KHR_texture_basisu",
                                       "EXT_mesh_gpu_instancing",
                                       "EXT_texture_webp",
                                       "EXT_texture_avif"};
/// Extensions that compress the mesh, and are not supported.
inline constexpr Text compression[]{"EXT_meshopt_compression", "KHR_meshopt_compression"};

template <class Names> bool isOneOf(const Names& names, Text name) {
    return std::find(std::begin(names), std::end(names), name) != std::end(names);
}

/// Finds why a document is refused; each check is true if it passes.
class Checks {
public:
    explicit Checks(JsonValue document) : document_(document) {}

    bool pass() {
        if (!document_.isObject()) return fail("its JSON is not an object");
        const JsonValue version = document_["asset"]["version"];
        const std::string named = version.isText() ? version.text() : version ? std::string(version.raw()) : "";
        // Files of version 1, whose lists are objects, need not name it
        if (startsWith(named, "1") || ((named.empty() || named == "null") && document_["nodes"].isObject())) {
            isVersion1 = true;
            return false;
        }
        for (const Text key : lists) {
            const JsonValue entries = document_[key];
            if (entries && !isListOf(entries, [](JsonValue one) { return one.isObject(); }))
                return fail(std::string(key) + " must be a list of objects");
            where_ = key;
            if (!hasTypes(entries)) return false;
        }
        const JsonValue scene = document_["scene"], extensions = document_["extensions"];
        if ((scene && !scene.isWhole()) || (extensions && !extensions.isObject()))
            return fail("its scene is not a whole number, or its extensions are not an object");
        const JsonValue required = document_["extensionsRequired"];
        if (required && !isListOf(required, [](JsonValue one) { return one.isText(); }))
            return fail("extensionsRequired is not a list of texts");
        return ofEach("accessors", &Checks::hasValidChanges) && ofEach("accessors", &Checks::hasValidCount) &&
               ofEach("materials", &Checks::hasValidFactors) && hasTrees();
    }

    std::string reason;
    bool isVersion1 = false;

private:
    static constexpr Text lists[]{"nodes",  "meshes",   "accessors", "bufferViews", "buffers",    "materials",
                                  "scenes", "textures", "images",    "samplers",    "animations", "skins"};
    // Keys at any depth whose values are whole numbers from 0 on, texts, objects, and lists of these
    static constexpr Text wholes[]{"mesh",       "material",
                                   "bufferView", "buffer",
                                   "source",     "sampler",
                                   "index",      "texCoord",
                                   "byteOffset", "byteLength",
                                   "byteStride", "componentType",
                                   "mode",       "skin",
                                   "wrapS",      "wrapT",
                                   "magFilter",  "minFilter",
                                   "node",       "input",
                                   "output",     "inverseBindMatrices"};
    static constexpr Text texts[]{"uri", "mimeType", "alphaMode"};
    static constexpr Text objects[]{
        "attributes",    "extensions",      "pbrMetallicRoughness",     "sparse",          "values", "baseColorTexture",
        "normalTexture", "emissiveTexture", "metallicRoughnessTexture", "occlusionTexture"};
    static constexpr Text objectLists[]{"primitives", "targets", "channels", "samplers"};
    static constexpr Text wholeLists[]{"nodes", "children", "joints"};

    bool fail(const std::string& why) {
        reason = why;
        return false;
    }
    bool failAt(Text why) { return fail(where_ + " " + std::string(why)); }

    template <class Is> static bool areAll(JsonValue group, const Is& is) {
        return group.each([&](JsonValue, JsonValue value) { return is(value); });
    }
    template <class Is> static bool isListOf(JsonValue value, const Is& is) {
        return value.isList() && areAll(value, is);
    }

    /// Whether values at any depth have the types of glTF; `where_` names the value.
    bool hasTypes(JsonValue value) {
        std::size_t number = 0;
        if (value.isObject())
            return value.each([&](JsonValue key, JsonValue entry) { return hasType(key.text(), entry); });
        return !value.isList() || value.each([&](JsonValue, JsonValue entry) {
            return entered("[" + std::to_string(number++) + "]", [&] { return hasTypes(entry); });
        });
    }
    /// Whether a check passes of a part of the value.
    template <class Check> bool entered(const std::string& part, const Check& check) {
        const std::size_t length = where_.size();
        where_ += part;
        if (!check()) return false;
        where_.resize(length);
        return true;
    }
    bool hasType(const std::string& key, JsonValue entry) {
        const auto isWhole = [](JsonValue one) { return one.isWhole(); };
        const auto isObject = [](JsonValue one) { return one.isObject(); };
        return entered("." + key, [&] {
            if (isOneOf(wholes, key) && !entry.isWhole()) return failAt("is not a whole number from 0 on");
            if (isOneOf(texts, key) && !entry.isText()) return failAt("is not text");
            if (isOneOf(objects, key) && !entry.isObject()) return failAt("is not an object");
            const bool isExtensions = key == "extensions";
            if (isExtensions && !areAll(entry, isObject)) return failAt("has a value that is not an object");
            if (isOneOf(objectLists, key) && !isListOf(entry, isObject)) return failAt("is not a list of objects");
            if (isOneOf(wholeLists, key) && !isListOf(entry, isWhole)) return failAt("is not a list of whole numbers");
            if (key == "attributes" && !areAll(entry, isWhole)) return failAt("has a value that is not a whole number");
            if (!isExtensions) return key == "extras" || hasTypes(entry);
            for (const Text name : readExtensions)
                if (const JsonValue own = entry[name]; own && !hasType(std::string(name), own)) return false;
            return true;
        });
    }

    /// Whether a check passes for all entries of a list.
    bool ofEach(Text list, bool (Checks::*check)(JsonValue, const std::string&)) {
        const JsonValue entries = document_[list];
        const std::string noun(list.substr(0, list.size() - 1));
        std::size_t number = 0;
        return !entries || areAll(entries, [&](JsonValue one) {
            return (this->*check)(one, noun + " " + std::to_string(number++));
        });
    }
    bool hasValidChanges(JsonValue accessor, const std::string& name) {
        const JsonValue sparse = accessor["sparse"], indices = sparse["indices"], values = sparse["values"];
        const JsonValue type = accessor["type"];
        if ((sparse && !(indices.isObject() && values.isObject())) || (type && !type.isText()))
            return fail(name + " has an invalid type, or lacks indices or values");
        if (!sparse) return true;
        if (!sparse["count"].isWhole() || !indices["bufferView"] || !values["bufferView"])
            return fail(name + " lacks a part of its changes");
        const double kind = indices.wholeOf("componentType");
        return kind == 5121 || kind == 5123 || kind == 5125 || fail(name + " has indices of an unknown type");
    }
    bool hasValidCount(JsonValue accessor, const std::string& name) {
        constexpr double most = 100'000'000;
        const JsonValue count = accessor["count"];
        return (count.isWhole() && count.number() > 0 && count.number() <= most) ||
               fail(name + " has an invalid count");
    }
    /// Whether all used factors are non-negative numbers.
    bool hasValidFactors(JsonValue material, const std::string& name) {
        const auto isValid = [](JsonValue one) { return !one || (one.isNumber() && one.number() >= 0); };
        const JsonValue surface = material["pbrMetallicRoughness"], extensions = material["extensions"];
        const auto areValid = [&](JsonValue factors) { return !factors || isListOf(factors, isValid); };
        return (isValid(surface["metallicFactor"]) && areValid(surface["baseColorFactor"]) &&
                areValid(material["emissiveFactor"]) &&
                isValid(extensions["KHR_materials_transmission"]["transmissionFactor"]) &&
                isValid(extensions["KHR_materials_ior"]["ior"])) ||
               fail(name + " has a factor that is negative or not a number");
    }
    /// Whether no node has two parents or is in a cycle.
    bool hasTrees() {
        std::vector<JsonValue> nodes;
        document_["nodes"].each([&](JsonValue, JsonValue node) { return nodes.push_back(node), true; });
        constexpr std::size_t none = ~std::size_t{0};
        std::vector<std::size_t> parents(nodes.size(), none);
        for (std::size_t number = 0; number < nodes.size(); ++number) {
            const JsonValue children = nodes[number]["children"];
            const bool isValid = !children || areAll(children, [&](JsonValue child) {
                if (child.number() >= static_cast<double>(nodes.size()))
                    return fail("node " + std::to_string(number) + " has a child that does not exist");
                const auto index = static_cast<std::size_t>(child.number());
                if (parents[index] != none) return fail("node " + std::to_string(index) + " has two parents");
                parents[index] = number;
                return true;
            });
            if (!isValid) return false;
        }
        enum : char { unknown, passed, rooted };
        std::vector<char> states(nodes.size(), unknown);
        std::vector<std::size_t> path;
        for (std::size_t number = 0; number < nodes.size(); ++number) {
            std::size_t ancestor = number;
            path.clear();
            while (parents[ancestor] != none && states[ancestor] == unknown) {
                path.push_back(ancestor);
                states[ancestor] = passed;
                ancestor = parents[ancestor];
            }
            if (states[ancestor] == passed) return fail("node " + std::to_string(ancestor) + " is its own ancestor");
            for (const std::size_t each : path) states[each] = rooted;
        }
        return true;
    }

    JsonValue document_;
    std::string where_; ///< the value that is checked
};

} // namespace colonnade::mesh::gltf
