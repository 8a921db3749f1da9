/// Clips: vertices that bones and morph targets move over time, as glTF 2.0 defines it.
#pragma once

#include "normals.hpp"

namespace colonnade::mesh {

/// Bones that move a vertex.
constexpr int influences = 4;

enum class Path : std::int32_t { translation, rotation, scale, weights };
enum class Interpolation : std::int32_t { step, linear, cubicSpline };

using Values = std::vector<double>;
using Quaternion = std::array<double, 4>;
using Matrix = std::array<double, 16>;     ///< row by row, as the next
using BoneMatrix = std::array<double, 12>;

/// A vector of a matrix's linear part: axis 0 to 2.
template <class M> Vector column(const M& matrix, std::size_t axis) {
    return {matrix[axis], matrix[4 + axis], matrix[8 + axis]};
}
template <class M> Vector row(const M& matrix, std::size_t axis) {
    return {matrix[4 * axis], matrix[4 * axis + 1], matrix[4 * axis + 2]};
}

/// The columns of what transforms normals as a matrix transforms surfaces: its inverse transpose, times its
/// determinant.
inline std::array<Vector, 3> cofactors(const BoneMatrix& matrix) {
    const Vector x = column(matrix, 0), y = column(matrix, 1), z = column(matrix, 2);
    return {cross(y, z), cross(z, x), cross(x, y)};
}

/// The point of a matrix's linear part and its translation.
inline Vector moved(const BoneMatrix& matrix, const Vector& point) {
    return {dot(row(matrix, 0), point) + matrix[3], dot(row(matrix, 1), point) + matrix[7],
            dot(row(matrix, 2), point) + matrix[11]};
}

inline Matrix product(const Matrix& a, const Matrix& b) {
    Matrix result{};
    for (std::size_t i = 0; i < 16; ++i)
        for (std::size_t k = 0; k < 4; ++k) result[i] += a[i / 4 * 4 + k] * b[4 * k + i % 4];
    return result;
}

/// The matrix of a translation after a rotation, of a unit quaternion, after a scale; `bottom` has its last row.
inline Matrix matrixOf(const Vector& translation, const Quaternion& rotation, const Vector& scale,
                       const Matrix& bottom) {
    const auto [x, y, z, w] = rotation;
    const double rows[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
                               {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
                               {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}};
    Matrix matrix = bottom;
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 0; j < 3; ++j) matrix[4 * i + j] = rows[i][j] * scale[j];
        matrix[4 * i + 3] = translation[i];
    }
    return matrix;
}

/// One property of one node over time.
class Track {
public:
    std::int64_t node = 0;
    Path path = Path::translation;
    Interpolation interpolation = Interpolation::linear;
    Values times;   ///< of the keys, seconds, ascending
    Values values;  ///< of the keys; of a cubic spline each with the tangents before and after

    /// The value at a time, or just before it. Before the first and after the last key it is theirs.
    Values at(double time, bool before) const {
        const auto next = before ? std::lower_bound(times.begin(), times.end(), time)
                                 : std::upper_bound(times.begin(), times.end(), time);
        const std::ptrdiff_t index = next - times.begin() - 1, last = static_cast<std::ptrdiff_t>(times.size()) - 1;
        const std::size_t key = static_cast<std::size_t>(std::max<std::ptrdiff_t>(index, 0));
        if (index < 0 || index == last || interpolation == Interpolation::step) return unitValue(valueAt(key));
        const double span = times[key + 1] - times[key], part = (time - times[key]) / span;
        const Values from = valueAt(key), to = valueAt(key + 1);
        Values value(width());
        if (interpolation == Interpolation::cubicSpline) {
            const double squared = part * part, cubed = part * part * part;
            const Values after = tangentAt(key, 2), into = tangentAt(key + 1, 0);
            for (std::size_t i = 0; i < value.size(); ++i)
                value[i] = (2 * cubed - 3 * squared + 1) * from[i] + (cubed - 2 * squared + part) * (span * after[i]) +
                           (3 * squared - 2 * cubed) * to[i] + (cubed - squared) * (span * into[i]);
            return unitValue(value);
        }
        if (path == Path::rotation) return arc(unitValue(from), unitValue(to), part);
        for (std::size_t i = 0; i < value.size(); ++i) value[i] = from[i] + part * (to[i] - from[i]);
        return value;
    }

private:
    std::size_t parts() const { return interpolation == Interpolation::cubicSpline ? 3 : 1; }
    std::size_t width() const { return values.size() / times.size() / parts(); }
    Values tangentAt(std::size_t key, std::size_t part) const {
        const auto begin = values.begin() + static_cast<std::ptrdiff_t>((key * parts() + part) * width());
        return {begin, begin + static_cast<std::ptrdiff_t>(width())};
    }
    Values valueAt(std::size_t key) const { return tangentAt(key, parts() / 2); }

    static double product(const Values& a, const Values& b) {
        return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
    }

    Values unitValue(Values value) const {
        if (path != Path::rotation) return value;
        const double length = std::sqrt(product(value, value));
        if (!(length > 0)) return {0, 0, 0, 1};
        for (double& each : value) each /= length;
        return value;
    }

    /// Between two rotations, on the shorter arc of the unit sphere.
    static Values arc(const Values& first, Values last, double part) {
        double cosine = product(first, last);
        if (cosine < 0) {
            for (double& each : last) each = -each;
            cosine = -cosine;
        }
        Values value(4);
        if (cosine > 1 - 1e-9) { // a chord stands for the arc
            for (int i = 0; i < 4; ++i) value[i] = first[i] + part * (last[i] - first[i]);
            const double length = std::sqrt(product(value, value));
            for (double& each : value) each /= length;
            return value;
        }
        const double angle = fixed_order::arccos(cosine), sine = fixed_order::cosine(angle, 1);
        const double before = fixed_order::cosine(angle * (1 - part), 1) / sine,
                     after = fixed_order::cosine(angle * part, 1) / sine;
        for (int i = 0; i < 4; ++i) value[i] = before * first[i] + after * last[i];
        return value;
    }
};

/// A forest of coordinate systems.
struct Nodes {
    std::vector<std::int64_t> parents;  ///< −1 of a root
    std::vector<std::int64_t> order;    ///< each after its parent
    std::vector<Matrix> matrices;       ///< to the parents, at rest; their parts are the next
    std::vector<Vector> translations;
    std::vector<Quaternion> rotations;
    std::vector<Vector> scales;
};

/// A clip at a time: from where vertices are bound to the scene, by bone, and the weights of morph targets.
struct ClipPose {
    std::vector<BoneMatrix> matrices;
    Values weights;

    bool operator!=(const ClipPose& other) const { return matrices != other.matrices || weights != other.weights; }
};

/// Shapes that are added to the vertices, each by its weight.
struct Morphs {
    std::vector<std::int64_t> nodes, slots; ///< of each target, its node and its number among the node's weights
    Values weights; ///< at rest
    std::vector<std::int64_t> targets, vertices; ///< of each change, by ascending vertex
    std::vector<Vector> positions, normals; ///< what is added
};

struct Clip {
    double duration = 0;
    Nodes nodes;
    std::vector<Track> tracks;
    std::vector<std::int64_t> joints; ///< the node of each bone
    std::vector<Matrix> inverses; ///< from where vertices are bound to their bone
    std::vector<Vector> positions; ///< of vertices, where they are bound
    std::vector<std::array<std::int64_t, influences>> bones;
    std::vector<std::array<double, influences>> shares; ///< of sum 1, the largest first
    Morphs morphs;

    ClipPose rest() const { return poseOf(nodes.matrices, morphs.weights); }

    /// The pose at a time, seconds, or just before it, if it jumps there.
    ClipPose pose(double time, bool before = false) const {
        Values weights = morphs.weights;
        for (const Track& track : tracks) {
            if (track.path != Path::weights) continue;
            const Values found = track.at(time, before);
            for (std::size_t target = 0; target < weights.size(); ++target)
                if (morphs.nodes[target] == track.node)
                    weights[target] = found[static_cast<std::size_t>(morphs.slots[target])];
        }
        return poseOf(matricesAt(time, before), weights);
    }

    /// The vertices where they are bound, with morph targets of these weights.
    std::vector<Vector> bound(const Values& weights) const {
        std::vector<Vector> found = positions, sums(morphs.targets.empty() ? 0 : positions.size());
        for (std::size_t change = 0; change < morphs.targets.size(); ++change)
            for (int axis = 0; axis < 3; ++axis)
                sums[static_cast<std::size_t>(morphs.vertices[change])][axis] +=
                    morphs.positions[change][axis] * weights[static_cast<std::size_t>(morphs.targets[change])];
        for (std::size_t vertex = 0; vertex < sums.size(); ++vertex)
            for (int axis = 0; axis < 3; ++axis) found[vertex][axis] += sums[vertex][axis];
        return found;
    }

    /// The matrix of each vertex, by those of bones.
    std::vector<BoneMatrix> blended(const std::vector<BoneMatrix>& matrices) const {
        std::vector<BoneMatrix> result(positions.size());
        for (std::size_t vertex = 0; vertex < result.size(); ++vertex)
            for (int influence = 0; influence < influences; ++influence) {
                const double share = shares[vertex][influence];
                if (influence > 0 && share == 0) continue;
                const BoneMatrix& bone = matrices[static_cast<std::size_t>(bones[vertex][influence])];
                for (std::size_t i = 0; i < bone.size(); ++i)
                    result[vertex][i] = influence > 0 ? result[vertex][i] + share * bone[i] : share * bone[i];
            }
        return result;
    }

    /// The vertices in the scene.
    std::vector<Vector> vertices(const std::vector<BoneMatrix>& matrices, const Values& weights) const {
        const std::vector<BoneMatrix> own = blended(matrices);
        std::vector<Vector> found = bound(weights);
        for (std::size_t vertex = 0; vertex < found.size(); ++vertex) found[vertex] = moved(own[vertex], found[vertex]);
        return found;
    }

private:
    /// The transforms of nodes to their parents.
    std::vector<Matrix> matricesAt(double time, bool before) const {
        Nodes moving = nodes;
        for (const Track& track : tracks) {
            if (track.path == Path::weights) continue;
            const Values found = track.at(time, before);
            const auto node = static_cast<std::size_t>(track.node);
            double* const to = track.path == Path::rotation
                                   ? moving.rotations[node].data()
                                   : (track.path == Path::scale ? moving.scales : moving.translations)[node].data();
            std::copy(found.begin(), found.end(), to);
        }
        for (const Track& track : tracks) {
            const auto node = static_cast<std::size_t>(track.node);
            if (track.path != Path::weights)
                moving.matrices[node] = matrixOf(moving.translations[node], moving.rotations[node], moving.scales[node],
                                                 nodes.matrices[node]);
        }
        return moving.matrices;
    }

    ClipPose poseOf(std::vector<Matrix> matrices, const Values& weights) const {
        for (const std::int64_t node : nodes.order)
            if (const std::int64_t parent = nodes.parents[static_cast<std::size_t>(node)]; parent >= 0)
                matrices[static_cast<std::size_t>(node)] =
                    product(matrices[static_cast<std::size_t>(parent)], matrices[static_cast<std::size_t>(node)]);
        ClipPose pose{std::vector<BoneMatrix>(joints.size()), weights};
        for (std::size_t bone = 0; bone < joints.size(); ++bone) {
            const Matrix found = product(matrices[static_cast<std::size_t>(joints[bone])], inverses[bone]);
            std::copy(found.begin(), found.begin() + 12, pose.matrices[bone].begin());
        }
        return pose;
    }
};

/// The surface of a clip's vertices in its rest pose.
struct RestSurface {
    bool isFinite = true;
    std::vector<Vector> vertices;
    std::vector<bool> isMirrored; ///< of each face, whose corners go backwards
};

/// `normals`, at the corners of faces where these are bound, of any length, follow them; empty: there are none.
inline RestSurface restSurface(const Clip& clip, const std::vector<Face>& faces, std::vector<Corners>& normals) {
    const ClipPose pose = clip.rest();
    const std::vector<BoneMatrix> blended = clip.blended(pose.matrices);
    RestSurface result{true, clip.vertices(pose.matrices, pose.weights), std::vector<bool>(faces.size())};
    for (const Vector& vertex : result.vertices)
        for (const double component : vertex) result.isFinite = result.isFinite && std::isfinite(component);
    for (std::size_t face = 0; face < faces.size(); ++face)
        for (int corner = 0; corner < 3; ++corner) {
            const BoneMatrix& matrix = blended[static_cast<std::size_t>(faces[face][corner])];
            const std::array<Vector, 3> columns = cofactors(matrix);
            const bool isMirrored = dot(column(matrix, 0), columns[0]) < 0;
            if (corner == 0) result.isMirrored[face] = isMirrored;
            if (normals.empty()) continue;
            const Vector normal = unit(normals[face][corner]);
            Vector rotated;
            for (int axis = 0; axis < 3; ++axis)
                rotated[axis] =
                    dot({columns[0][axis], columns[1][axis], columns[2][axis]}, normal) * (isMirrored ? -1.0 : 1.0);
            normals[face][corner] = unit(rotated);
        }
    return result;
}

} // namespace colonnade::mesh
