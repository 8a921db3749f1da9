/// The nodes of a glTF file: where its meshes are in the scene.
#pragma once

#include "mesh/clip.hpp"
#include "mesh/files/gltf_document.hpp"

namespace colonnade::mesh::gltf {

/// A node with a mesh, and the transforms of the mesh's copies to the scene.
struct Placement {
    std::int32_t node;
    std::vector<Matrix> matrices;
};

class NodeReader {
public:
    explicit NodeReader(GltfDocument& document) : document_(document) {}

    /// All nodes, those outside of the default scene, too; false refuses the file.
    bool readAll(Nodes& to) {
        const std::size_t count = document_.count(GltfDocument::nodes);
        to.parents.assign(count, -1);
        for (std::size_t index = 0; index < count; ++index)
            for (const JsonValue child : childrenOf(index))
                to.parents[static_cast<std::size_t>(child.number())] = static_cast<std::int64_t>(index);
        for (std::size_t index = 0; index < count; ++index)
            if (to.parents[index] < 0) to.order.push_back(static_cast<std::int64_t>(index));
        for (std::size_t i = 0; i < to.order.size(); ++i) // which grows
            for (const JsonValue child : childrenOf(static_cast<std::size_t>(to.order[i])))
                to.order.push_back(static_cast<std::int64_t>(child.number()));
        for (std::size_t index = 0; index < count; ++index) {
            Parts parts;
            Matrix matrix;
            if (!readParts(index, parts) || !readMatrix(index, matrix)) return false;
            to.matrices.push_back(matrix);
            to.translations.push_back(parts.translation);
            to.rotations.push_back(parts.rotation);
            to.scales.push_back(parts.scale);
        }
        return true;
    }

    /// The nodes with a mesh of the default scene. A node has a transform for each copy of its mesh; if it is animated,
    /// one.
    Found read(bool isAnimated, std::vector<Placement>& to, Losses& losses) {
        to.clear();
        std::uint64_t bent = 0;
        Found found = Found::yes;
        const bool isRead = each(
            Matrix(identity),
            [&](std::size_t index, const Matrix& parent, Matrix& matrix) {
                Matrix own;
                if (!readMatrix(index, own)) return false;
                matrix = product(parent, own);
                return isFinite(index, matrix);
            },
            [&](std::size_t index, const Matrix& matrix) {
                std::vector<Matrix> copies;
                found = copiesOf(index, copies);
                if (found != Found::yes) return false;
                if (isAnimated) {
                    bent += copies.size() - 1;
                    copies.assign(1, identity);
                }
                for (Matrix& copy : copies) {
                    copy = product(matrix, copy);
                    if (!isFinite(index, copy)) return false;
                }
                to.push_back({static_cast<std::int32_t>(index), std::move(copies)});
                return true;
            });
        if (found == Found::buffer) return found;
        if (!isRead) return Found::refused;
        const std::size_t scenes = document_.count(GltfDocument::scenes);
        losses.add(furtherScenes, scenes > 1 ? scenes - 1 : 0);
        losses.add(bentCopies, bent);
        return Found::yes;
    }

    /// The triangles of the default scene, with all copies, by the counts of accessors; nothing of a file that is not
    /// valid.
    std::optional<double> triangles() {
        double count = 0;
        const bool isRead = each(
            false, [](std::size_t, bool, bool&) { return true; },
            [&](std::size_t index, bool) {
                const auto mesh = document_.entry(GltfDocument::meshes, nodeAt(index)["mesh"]);
                const std::optional<double> copies = copyCount(index);
                if (!mesh || !copies) return false;
                const std::optional<double> own = trianglesOf(*mesh);
                count += own.value_or(0) * *copies;
                return own.has_value();
            });
        return isRead ? std::optional(count) : std::nullopt;
    }

private:
    struct Parts {
        Vector translation{0, 0, 0};
        Quaternion rotation{0, 0, 0, 1};
        Vector scale{1, 1, 1};
    };
    static constexpr Matrix identity{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    static constexpr Text instancing = "EXT_mesh_gpu_instancing";
    static constexpr Loss furtherScenes{"further scene is not shown", "further scenes are not shown",
                                        "only the default scene is rendered"};
    static constexpr Loss bentCopies{"copy of an animated mesh is not shown",
                                     "copies of an animated mesh are not shown", "a node has one: give each a node"};
    /// Nodes with a mesh, with the copies of each, at most.
    static constexpr double maxCopies = 1 << 16;

    JsonValue nodeAt(std::size_t index) const { return document_.at(GltfDocument::nodes, index); }
    static std::vector<JsonValue> valuesOf(JsonValue list) {
        std::vector<JsonValue> found;
        if (list.isList()) list.each([&](JsonValue, JsonValue value) { return found.push_back(value), true; });
        return found;
    }
    std::vector<JsonValue> childrenOf(std::size_t index) const { return valuesOf(nodeAt(index)["children"]); }
    bool refuseNode(std::size_t index, const char* reason) {
        return document_.refuse("the transform of node " + std::to_string(index) + " is not " + reason +
                                ": export it again");
    }

    /// Visits the nodes of the default scene, each after its parent, of which it gets a value: `enter` gives its own,
    /// and is false to end, as is `use` of those with a mesh.
    template <class Value, class Enter, class Use> bool each(const Value& root, const Enter& enter, const Use& use) {
        std::vector<std::pair<std::size_t, Value>> pending;
        std::vector<JsonValue> roots;
        if (document_.count(GltfDocument::scenes) > 0) {
            const std::optional<std::size_t> scene = document_.defaultScene();
            if (!scene) return false;
            roots = valuesOf(document_.at(GltfDocument::scenes, *scene)["nodes"]);
            std::reverse(roots.begin(), roots.end());
        } else {
            std::vector<bool> isChild(document_.count(GltfDocument::nodes));
            for (std::size_t index = 0; index < isChild.size(); ++index)
                for (const JsonValue child : childrenOf(index))
                    isChild[static_cast<std::size_t>(child.number())] = true;
            for (std::size_t index = isChild.size(); index-- > 0;)
                if (!isChild[index]) pending.emplace_back(index, root);
        }
        double copies = 0;
        for (;;) {
            if (pending.empty()) {
                // A root that does not exist is refused in its turn
                if (roots.empty()) return true;
                const std::optional<std::size_t> index = document_.entry(GltfDocument::nodes, roots.back());
                if (!index) return false;
                roots.pop_back();
                pending.emplace_back(*index, root);
            }
            const auto [index, parent] = pending.back();
            pending.pop_back();
            Value own = root;
            if (!enter(index, parent, own)) return false;
            std::vector<JsonValue> children = childrenOf(index);
            for (std::size_t i = children.size(); i-- > 0;)
                pending.emplace_back(static_cast<std::size_t>(children[i].number()), own);
            if (!nodeAt(index)["mesh"]) continue;
            const std::optional<double> count = copyCount(index);
            if (!count) return false;
            copies += *count;
            if (copies > maxCopies)
                return document_.refuse("it has more than 65,536 copies of meshes: leave some out, or join them");
            if (!use(index, own)) return false;
        }
    }

    /// The number of copies of a node's mesh that the first of their attributes states.
    std::optional<double> copyCount(std::size_t index) {
        const JsonValue extension = nodeAt(index)["extensions"][instancing];
        if (!extension) return 1;
        JsonValue first;
        extension["attributes"].each([&](JsonValue key, JsonValue accessor) {
            if (!first && widthOf(key) > 0) first = accessor;
            return !first;
        });
        if (!first) return 0;
        const std::optional<std::size_t> accessor = document_.entry(GltfDocument::accessors, first);
        if (!accessor) return {};
        return document_.at(GltfDocument::accessors, *accessor)["count"].number();
    }
    /// The components of an attribute of copies; 0 of others.
    static int widthOf(JsonValue key) {
        return key.isText("TRANSLATION") || key.isText("SCALE") ? 3 : key.isText("ROTATION") ? 4 : 0;
    }
    /// The transforms of copies to their node.
    Found copiesOf(std::size_t index, std::vector<Matrix>& to) {
        to.assign(1, identity);
        const JsonValue extension = nodeAt(index)["extensions"][instancing];
        if (!extension) return Found::yes;
        std::vector<double> values[3];
        std::size_t count = 0;
        bool isValid = true;
        Found found = Found::yes;
        extension["attributes"].each([&](JsonValue key, JsonValue accessor) {
            const int width = widthOf(key);
            if (width == 0) return true;
            Array array;
            const std::optional<std::size_t> number = document_.entry(GltfDocument::accessors, accessor);
            found = number ? document_.array(*number, array) : Found::refused;
            if (found != Found::yes) return false;
            isValid &= array.width == width && (count == 0 || array.count == count);
            count = array.count;
            std::vector<double>& own = values[key.isText("TRANSLATION") ? 0 : width == 4 ? 1 : 2];
            own.resize(count * static_cast<std::size_t>(array.width));
            array.copy(own.data());
            return true;
        });
        if (found != Found::yes) return found;
        if (count == 0 || !isValid) {
            document_.refuse("the copies of node " + std::to_string(index) + " (" + std::string(instancing) +
                             ") are not valid: export it again");
            return Found::refused;
        }
        to.clear();
        for (std::size_t copy = 0; copy < count; ++copy) {
            Parts parts;
            const auto take = [&](const std::vector<double>& from, auto& part) {
                if (!from.empty())
                    std::copy_n(from.begin() + static_cast<std::ptrdiff_t>(part.size() * copy), part.size(),
                                part.begin());
            };
            take(values[0], parts.translation);
            take(values[1], parts.rotation);
            take(values[2], parts.scale);
            double squares = 0;
            for (const double value : parts.rotation) squares += value * value;
            if (const double length = std::sqrt(squares); length > 0)
                for (double& value : parts.rotation) value /= length;
            to.push_back(matrixOf(parts.translation, parts.rotation, parts.scale, identity));
        }
        return Found::yes;
    }

    std::optional<double> trianglesOf(std::size_t mesh) {
        double count = 0;
        for (const JsonValue primitive : valuesOf(document_.at(GltfDocument::meshes, mesh)["primitives"])) {
            const double mode = primitive.wholeOf("mode", 4);
            if (mode < 4 || mode > 6) continue;
            const JsonValue indices = primitive["indices"];
            const std::optional<std::size_t> accessor =
                document_.entry(GltfDocument::accessors, indices ? indices : primitive["attributes"]["POSITION"]);
            if (!accessor) return {};
            const double corners = document_.at(GltfDocument::accessors, *accessor)["count"].number();
            count += mode == 4 ? std::floor(corners / 3) : std::max(0.0, corners - 2);
        }
        return count;
    }

    bool isFinite(std::size_t index, const Matrix& matrix) {
        // A magnitude that no scene has
        constexpr double most = 1e100;
        for (const double value : matrix)
            if (!(std::fabs(value) < most)) return refuseNode(index, "finite, or too large");
        return true;
    }
    /// Numbers of a node, which has those that stand for them.
    template <class Numbers> bool readNumbers(std::size_t index, Text key, Numbers& to) {
        const JsonValue list = nodeAt(index)[key];
        if (!list) return true;
        std::size_t count = 0;
        const bool isValid = list.isList() && list.each([&](JsonValue, JsonValue value) {
            if (count == to.size() || !value.isNumber()) return false;
            to[count++] = value.number();
            return true;
        });
        return (isValid && count == to.size()) || refuseNode(index, "valid");
    }
    bool readParts(std::size_t index, Parts& to) {
        if (!readNumbers(index, "rotation", to.rotation) || !readNumbers(index, "translation", to.translation) ||
            !readNumbers(index, "scale", to.scale))
            return false;
        if (const double length = lengthOf(to.rotation); length > 0)
            for (double& value : to.rotation) value /= length;
        return true;
    }
    /// A node's transform to its parent.
    bool readMatrix(std::size_t index, Matrix& to) {
        if (nodeAt(index)["matrix"]) {
            Matrix columns;
            if (!readNumbers(index, "matrix", columns)) return false;
            for (std::size_t i = 0; i < 16; ++i) to[i] = columns[4 * (i % 4) + i / 4];
            return true;
        }
        Parts parts;
        if (!readParts(index, parts)) return false;
        to = matrixOf(parts.translation, parts.rotation, parts.scale, identity);
        return true;
    }
    /// The length of a quaternion, rounded about once.
    static double lengthOf(const Quaternion& of) {
        double most = 0, high = 0, low = 0;
        for (const double value : of) most = std::max(most, std::fabs(value));
        if (most == 0) return 0;
        int exponent;
        std::frexp(most, &exponent);
        // Adds a square, which is exact in two parts, as is the sum
        const auto add = [&](double value, double sign) {
            const double wide = 134217729.0 * value, upper = wide - (wide - value), lower = value - upper;
            const double square = value * value, rest = (upper * upper - square + 2 * upper * lower) + lower * lower;
            const double sum = high + sign * square, back = sum - high;
            low += (high - (sum - back)) + (sign * square - back) + sign * rest;
            high = sum;
        };
        for (const double value : of) add(std::ldexp(value, -exponent), 1);
        const double root = std::sqrt(high);
        add(root, -1);
        return std::ldexp(root + (high + low) / (2 * root), exponent);
    }

    GltfDocument& document_;
};

} // namespace colonnade::mesh::gltf
