/// A clip in whole numbers, as a target has it: vertices, bones and keys on the object's grid (docs/driver.md).
#pragma once

#include <map>
#include <string>

#include "mesh/clip_keys.hpp"

namespace colonnade::packer {

/// The numbers of a clip file.
struct GridClip {
    std::string error; ///< why the clip does not fit, after its name; empty if it does
    double scale = 0; ///< from the scene of the mesh to vertex units, for all poses
    mesh::Vector offset{}; ///< position of vertex unit (0, 0, 0)
    mesh::Row<std::int32_t> low{}, high{}; ///< bounds of all poses, vertex units
    std::vector<mesh::Face> corners; ///< the clip's vertex at each corner of the mesh's faces
    std::vector<std::array<std::int64_t, 13>>
        vertices; ///< bound position, normal, bones, weights of all bones but the first
    std::vector<std::array<std::int64_t, 8>> changes; ///< vertex, position, normal and target of what morph targets add
    std::vector<std::int64_t> times; ///< of the keys, 2^-16 s
    std::vector<std::vector<std::int64_t>> poses; ///< of the keys: matrices of bones row by row, weights of targets
    std::vector<std::int64_t> rest; ///< the rest pose
    std::size_t bones = 0, targets = 0;
    int linearShift = 0, shift = 0; ///< extra fraction bits of matrices; fraction bits of translations
};

/// The faces of a clean mesh, whose clip moves it.
struct ClipMesh {
    const mesh::Clip& clip;
    const std::vector<mesh::Vector>& vertices;
    const std::vector<mesh::Face>& faces;
    const std::vector<mesh::Corners>& normals;
    const std::vector<mesh::Face>& clipCorners; ///< the vertex of the clip at each corner
};

/// Puts the clip of a mesh on a grid that holds all of its poses.
class GridClipMaker {
public:
    /// `baked` are keys of the mesh's clip.
    GridClipMaker(const ClipMesh& mesh, const mesh::BakedClip& baked, int vertexBits)
        : mesh_(mesh), clip_(mesh.clip), baked_(baked), vertexBits_(vertexBits) {}

    GridClip make() {
        const auto& [keys, box] = baked_;
        GridClip& made = made_;
        for (int axis = 0; axis < 3; ++axis)
            if (!std::isfinite(box.low[axis]) || !std::isfinite(box.high[axis]))
                made.error = "has a pose that is not finite: export it again";
        if (!made.error.empty()) return made;
        fitGrid(box);
        findScales(keys);
        if (!made.error.empty()) return made;
        makeVertices();
        for (const mesh::ClipKey& key : keys) {
            const double time = std::rint(key.time * 65536);
            if (!(time < 4294967296.0)) {
                made.error = "is longer than 18 hours: shorten it";
                return made;
            }
            made.times.push_back(static_cast<std::int64_t>(time));
            made.poses.push_back(words(key.pose));
        }
        made.rest = words(clip_.rest());
        made.bones = clip_.joints.size();
        made.targets = clip_.morphs.weights.size();
        return made;
    }

private:
    /// Fraction bits of weights of bones, of morph targets, of normals.
    static constexpr int weightFraction = 15, targetFraction = 16, normalFraction = 14;
    /// Bits of bound positions, of elements of matrices, of weights of morph targets, without the sign.
    static constexpr int boundBits = 25, matrixBits = 30, targetBits = 24;
    /// Of the shifts.
    static constexpr int minShift = 2, maxShift = 20, maxLinearShift = 32;
    using Whole = mesh::Row<std::int64_t>;

    static std::int64_t whole(double value) { return static_cast<std::int64_t>(std::rint(value)); }

    /// A box in the centre of the cube, with a margin; its low planes are whole numbers.
    void fitGrid(const mesh::Box& box) {
        // Vertices are within this of where floats have them, in vertex units, by the rounding of positions and weights
        const std::int64_t margin = 2 + ((std::int64_t{1} << vertexBits_) >> 14),
                           maximum = (std::int64_t{1} << vertexBits_) - 1;
        GridClip& made = made_;
        made.scale = static_cast<double>(maximum - 2 * margin) / box.edge();
        for (int axis = 0; axis < 3; ++axis) {
            const double start = std::floor(
                (static_cast<double>(maximum) - std::rint((box.high[axis] - box.low[axis]) * made.scale)) / 2);
            made.offset[axis] = box.low[axis] - start / made.scale;
            made.low[axis] =
                static_cast<std::int32_t>(whole((box.low[axis] - made.offset[axis]) * made.scale) - margin);
            made.high[axis] =
                static_cast<std::int32_t>(whole((box.high[axis] - made.offset[axis]) * made.scale) + margin);
        }
    }

    /// Finds scales with which all numbers fit.
    void findScales(const std::vector<mesh::ClipKey>& keys) {
        const mesh::Morphs& morphs = clip_.morphs;
        const mesh::Box box = mesh::Box::of(clip_.positions);
        for (int axis = 0; axis < 3; ++axis) centre_[axis] = (box.low[axis] + box.high[axis]) / 2;
        mesh::Values largest(morphs.weights.size()), weights = largest;
        for (std::size_t change = 0; change < morphs.targets.size(); ++change)
            for (const double component : morphs.positions[change]) {
                double& target = largest[static_cast<std::size_t>(morphs.targets[change])];
                target = std::max(target, std::fabs(component));
            }
        double linear = 0, offset = 0, reach = 0;
        const auto include = [&](const mesh::ClipPose& pose) {
            for (std::size_t target = 0; target < weights.size(); ++target)
                weights[target] = std::max(weights[target], std::fabs(pose.weights[target]));
        };
        for (const mesh::ClipKey& key : keys) include(key.pose);
        const mesh::ClipPose rest = clip_.rest();
        include(rest);
        for (std::size_t target = 0; target < weights.size(); ++target) {
            if (!(weights[target] < 1 << (targetBits - targetFraction)))
                made_.error = "has a weight beyond 255: export it again";
            reach += largest[target] * (1 + weights[target]);
        }
        if (!made_.error.empty()) return;
        int exponent;
        std::frexp(std::max(box.edge() / 2 + reach, 1e-30), &exponent);
        step_ = std::ldexp(1, exponent - boundBits);
        const auto measure = [&](const mesh::ClipPose& pose) {
            for (const mesh::BoneMatrix& bone : pose.matrices) {
                const mesh::BoneMatrix parts = partsOf(bone);
                for (std::size_t i = 0; i < parts.size(); ++i)
                    (i % 4 == 3 ? offset : linear) = std::max(i % 4 == 3 ? offset : linear, std::fabs(parts[i]));
            }
        };
        for (const mesh::ClipKey& key : keys) measure(key.pose);
        measure(rest);
        const int linearBits = fractionOf(linear);
        made_.shift = std::min({fractionOf(offset), linearBits, maxShift});
        made_.linearShift = std::min(linearBits - made_.shift, maxLinearShift);
        if (made_.shift < minShift) made_.error = "moves a bone too far: export it again";
    }

    /// The fraction bits with which a number has `matrixBits` bits.
    static int fractionOf(double largest) {
        int exponent;
        std::frexp(std::max(largest, std::ldexp(1, -60)), &exponent);
        return matrixBits - 1 - exponent;
    }

    /// A bone's matrix from bound positions to vertex units.
    mesh::BoneMatrix partsOf(const mesh::BoneMatrix& bone) const {
        mesh::BoneMatrix parts;
        for (std::size_t axis = 0; axis < 3; ++axis) {
            for (std::size_t i = 0; i < 3; ++i) parts[4 * axis + i] = bone[4 * axis + i] * (step_ * made_.scale);
            parts[4 * axis + 3] =
                (mesh::dot(mesh::row(bone, axis), centre_) + bone[4 * axis + 3] - made_.offset[axis]) * made_.scale;
        }
        return parts;
    }

    std::vector<std::int64_t> words(const mesh::ClipPose& pose) const {
        std::vector<std::int64_t> found;
        for (const mesh::BoneMatrix& bone : pose.matrices) {
            const mesh::BoneMatrix parts = partsOf(bone);
            for (std::size_t i = 0; i < parts.size(); ++i)
                found.push_back(whole(std::ldexp(parts[i], made_.shift + (i % 4 == 3 ? 0 : made_.linearShift))));
        }
        for (const double weight : pose.weights) found.push_back(whole(std::ldexp(weight, targetFraction)));
        return found;
    }

    Whole bound(const mesh::Vector& position) const {
        return {whole(position[0] / step_), whole(position[1] / step_), whole(position[2] / step_)};
    }

    static Whole direction(const mesh::Vector& vector) {
        const double limit = (1 << (normalFraction + 1)) - 1;
        Whole found;
        for (int axis = 0; axis < 3; ++axis)
            found[axis] = static_cast<std::int64_t>(
                std::clamp(std::rint(std::ldexp(vector[axis], normalFraction)), -limit, limit));
        return found;
    }

    /// The normals of all corners where their vertices are bound.
    std::vector<mesh::Corners> boundNormals() const {
        const mesh::Morphs& morphs = clip_.morphs;
        const mesh::ClipPose rest = clip_.rest();
        const std::vector<mesh::BoneMatrix> blended = clip_.blended(rest.matrices);
        std::vector<mesh::Vector> added(clip_.positions.size());
        for (std::size_t change = 0; change < morphs.targets.size(); ++change)
            for (int axis = 0; axis < 3; ++axis)
                added[static_cast<std::size_t>(morphs.vertices[change])][axis] +=
                    morphs.normals[change][axis] * rest.weights[static_cast<std::size_t>(morphs.targets[change])];
        std::vector<mesh::Corners> found = mesh_.normals;
        for (std::size_t face = 0; face < found.size(); ++face) {
            const auto vertex = [&](int corner) {
                return mesh_.vertices[static_cast<std::size_t>(mesh_.faces[face][corner])];
            };
            const mesh::Vector across =
                mesh::unit(mesh::cross(mesh::difference(vertex(1), vertex(0)), mesh::difference(vertex(2), vertex(0))));
            for (int corner = 0; corner < 3; ++corner) {
                const auto source = static_cast<std::size_t>(mesh_.clipCorners[face][corner]);
                const mesh::BoneMatrix& matrix = blended[source];
                mesh::Vector& normal = found[face][corner];
                if (normal == mesh::Vector{}) normal = across;
                const double determinant = mesh::dot(mesh::column(matrix, 0), mesh::cofactors(matrix)[0]);
                if (determinant != 0) {
                    const double side = determinant > 0 ? 1 : -1;
                    normal = {mesh::dot(mesh::column(matrix, 0), normal) * side,
                              mesh::dot(mesh::column(matrix, 1), normal) * side,
                              mesh::dot(mesh::column(matrix, 2), normal) * side};
                }
                normal = mesh::difference(mesh::unit(normal), added[source]);
            }
        }
        return found;
    }

    /// Vertices and changes: corners that always move together have one vertex.
    void makeVertices() {
        const mesh::Morphs& morphs = clip_.morphs;
        using Change = std::array<std::int64_t, 7>;
        std::vector<Change> changes;
        for (std::size_t change = 0; change < morphs.targets.size(); ++change) {
            const Whole position = bound(morphs.positions[change]), normal = direction(morphs.normals[change]);
            changes.push_back(
                {position[0], position[1], position[2], normal[0], normal[1], normal[2], morphs.targets[change]});
        }
        const auto firstOf = [&](std::int64_t vertex) {
            return std::lower_bound(morphs.vertices.begin(), morphs.vertices.end(), vertex) - morphs.vertices.begin();
        };
        const auto ofVertex = [&](std::int64_t vertex) {
            return std::vector<Change>(changes.begin() + firstOf(vertex), changes.begin() + firstOf(vertex + 1));
        };
        std::map<std::vector<Change>, std::int64_t> shapes;
        using Own = std::array<std::int64_t, 14>; // of a vertex, and of its changes
        std::vector<Own> own(clip_.positions.size());
        for (std::size_t vertex = 0; vertex < own.size(); ++vertex) {
            const Whole position = bound(mesh::difference(clip_.positions[vertex], centre_));
            std::copy(position.begin(), position.end(), own[vertex].begin());
            std::copy(clip_.bones[vertex].begin(), clip_.bones[vertex].end(), own[vertex].begin() + 6);
            for (int i = 1; i < mesh::influences; ++i)
                own[vertex][9 + i] = whole(std::ldexp(clip_.shares[vertex][i], weightFraction));
            own[vertex][13] =
                shapes.emplace(ofVertex(static_cast<std::int64_t>(vertex)), static_cast<std::int64_t>(shapes.size()))
                    .first->second;
        }
        const std::vector<mesh::Corners> normals = boundNormals();
        std::vector<Own> rows;
        for (std::size_t corner = 0; corner < 3 * mesh_.clipCorners.size(); ++corner) {
            rows.push_back(own[static_cast<std::size_t>(mesh_.clipCorners[corner / 3][corner % 3])]);
            const Whole normal = direction(normals[corner / 3][corner % 3]);
            std::copy(normal.begin(), normal.end(), rows.back().begin() + 3);
        }
        made_.corners.resize(mesh_.clipCorners.size());
        std::int64_t last = -1;
        for (const std::int64_t corner : mesh::sortedIndices(
                 rows.size(), [&](std::int64_t one, std::int64_t other) { return rows[one] < rows[other]; })) {
            if (last < 0 || rows[last] != rows[corner]) {
                std::array<std::int64_t, 13> vertex;
                std::copy(rows[corner].begin(), rows[corner].end() - 1, vertex.begin());
                made_.vertices.push_back(vertex);
                for (const Change& change : ofVertex(mesh_.clipCorners[corner / 3][corner % 3])) {
                    std::array<std::int64_t, 8> changed{static_cast<std::int64_t>(made_.vertices.size()) - 1};
                    std::copy(change.begin(), change.end(), changed.begin() + 1);
                    made_.changes.push_back(changed);
                }
            }
            last = corner;
            made_.corners[corner / 3][corner % 3] = static_cast<std::int32_t>(made_.vertices.size()) - 1;
        }
    }

    const ClipMesh& mesh_;
    const mesh::Clip& clip_;
    const mesh::BakedClip& baked_;
    const int vertexBits_;
    GridClip made_;
    mesh::Vector centre_{};
    double step_ = 0; ///< of bound positions
};

} // namespace colonnade::packer
