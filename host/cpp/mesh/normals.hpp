/// Corner normals: the normals of a face at its three corners, from the file or smoothed up to a crease angle.
#pragma once

#include "fixed_order.hpp"
#include "topology.hpp"

namespace colonnade::mesh {

/// Edges of more faces than this link each face with so many of the following ones.
constexpr std::size_t maxFan = 8;

using Corners = std::array<Vector, 3>;

/// Sets that are joined one by one.
class DisjointSets {
public:
    explicit DisjointSets(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0); }

    std::size_t find(std::size_t element) {
        while (parent_[element] != element) element = parent_[element] = parent_[parent_[element]];
        return element;
    }
    void join(std::size_t one, std::size_t other) { parent_[find(one)] = find(other); }

private:
    std::vector<std::size_t> parent_;
};

/// Positions of the corners of faces, in units of the mesh's size.
inline std::vector<Corners> scaledCorners(const std::vector<Vector>& vertices, const std::vector<Face>& faces) {
    Vector low = vertices[0], high = vertices[0];
    for (const Vector& vertex : vertices)
        for (int axis = 0; axis < 3; ++axis) {
            low[axis] = std::min(low[axis], vertex[axis]);
            high[axis] = std::max(high[axis], vertex[axis]);
        }
    const double size = std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
    std::vector<Corners> corners(faces.size());
    for (std::size_t i = 0; i < faces.size(); ++i)
        for (int corner = 0; corner < 3; ++corner)
            for (int axis = 0; axis < 3; ++axis) corners[i][corner][axis] = vertices[faces[i][corner]][axis] / size;
    return corners;
}

/// Joins the corners, numbered 3 · face + corner, that have one normal: those at the ends of a smooth edge.
inline DisjointSets smoothGroups(const std::vector<Face>& faces, const std::vector<Vector>& normals,
                                 double leastCosine) {
    const std::size_t count = 3 * faces.size();
    const auto vertexOf = [&](std::size_t corner) { return faces[corner / 3][corner % 3]; };
    const auto next = [](std::size_t corner) { return corner % 3 == 2 ? corner - 2 : corner + 1; };
    std::vector<std::array<std::int32_t, 2>> edges(count);
    for (std::size_t corner = 0; corner < count; ++corner) {
        const auto [low, high] = std::minmax({vertexOf(corner), vertexOf(next(corner))});
        edges[corner] = {low, high};
    }
    const std::vector<std::int64_t> order =
        sortedIndices(count, [&](std::int64_t one, std::int64_t other) { return edges[one] < edges[other]; });
    DisjointSets groups(count);
    for (std::size_t i = 0; i < count; ++i)
        for (std::size_t j = i + 1; j < std::min(count, i + 1 + maxFan) && edges[order[j]] == edges[order[i]]; ++j) {
            const std::size_t one = order[i], other = order[j];
            if (!(dot(normals[one / 3], normals[other / 3]) >= leastCosine)) continue;
            const bool isAgainst =
                vertexOf(one) != vertexOf(other); // the faces run along their edge in opposite directions
            groups.join(one, isAgainst ? next(other) : other);
            groups.join(next(one), isAgainst ? other : next(other));
        }
    return groups;
}

/// Corner normals smoothed up to a crease angle: the sum of the face normals, weighted by their angle, over the faces
/// around a vertex that are connected over edges with at least this cosine between their normals; 0 where they cancel.
inline std::vector<Corners> creaseNormals(const std::vector<Vector>& vertices, const std::vector<Face>& faces,
                                          double leastCosine) {
    const std::vector<Corners> corners = scaledCorners(vertices, faces);
    std::vector<Vector> normals(faces.size());
    std::vector<Vector> weighted(3 * faces.size());
    for (std::size_t i = 0; i < faces.size(); ++i) {
        Corners sides;
        for (int corner = 0; corner < 3; ++corner)
            sides[corner] = difference(corners[i][(corner + 1) % 3], corners[i][corner]);
        normals[i] = unit(cross(sides[0], {-sides[2][0], -sides[2][1], -sides[2][2]}));
        for (Vector& side : sides) side = unit(side);
        for (int corner = 0; corner < 3; ++corner) {
            const double cosine = -dot(sides[corner], sides[(corner + 2) % 3]),
                         angle = fixed_order::arccos(std::clamp(cosine, -1.0, 1.0));
            for (int axis = 0; axis < 3; ++axis) weighted[3 * i + corner][axis] = angle * normals[i][axis];
        }
    }
    DisjointSets groups = smoothGroups(faces, normals, leastCosine);
    std::vector<Vector> sums(weighted.size(), Vector{});
    for (std::size_t corner = 0; corner < weighted.size(); ++corner)
        for (int axis = 0; axis < 3; ++axis) sums[groups.find(corner)][axis] += weighted[corner][axis];
    std::vector<Corners> result(faces.size());
    for (std::size_t corner = 0; corner < weighted.size(); ++corner) {
        const Vector& sum = sums[groups.find(corner)];
        result[corner / 3][corner % 3] = length(sum) < 1e-9 ? Vector{} : unit(sum);
    }
    return result;
}

/// Corner normals, and what was done with those of the file.
struct CornerNormals {
    std::vector<Corners> normals;
    std::int64_t flipped = 0, replaced = 0, missing = 0;
};

/// The file's normals, `authored`, of any length; where it has none, or one that points to the back of its face, the
/// smooth ones. Those of a face whose normals all point to its back are negated.
inline CornerNormals cornerNormals(const std::vector<Vector>& vertices, const std::vector<Face>& faces,
                                   std::vector<Corners> authored, double leastCosine) {
    CornerNormals result;
    const std::vector<Corners> corners = scaledCorners(vertices, faces);
    std::vector<std::array<bool, 3>> isAuthored(faces.size());
    bool isWhole = true;
    for (std::size_t i = 0; i < faces.size(); ++i) {
        const Vector normal =
            unit(cross(difference(corners[i][1], corners[i][0]), difference(corners[i][2], corners[i][0])));
        std::array<bool, 3> isGiven;
        std::array<double, 3> heights;
        for (int corner = 0; corner < 3; ++corner) {
            Vector& own = authored[i][corner];
            isGiven[corner] = std::isfinite(own[0]) && std::isfinite(own[1]) && std::isfinite(own[2]) &&
                              (own[0] != 0 || own[1] != 0 || own[2] != 0);
            own = isGiven[corner] ? unit(own) : Vector{};
            heights[corner] = dot(own, normal);
        }
        const auto isBack = [&](int corner) { return isGiven[corner] && heights[corner] < 0; };
        const bool isFlipped = isBack(0) && isBack(1) && isBack(2);
        result.flipped += isFlipped;
        for (int corner = 0; corner < 3; ++corner) {
            if (isFlipped)
                for (double& component : authored[i][corner]) component = -component;
            isAuthored[i][corner] = isGiven[corner] && (isFlipped || !isBack(corner));
            result.replaced += isGiven[corner] && !isAuthored[i][corner];
            result.missing += !isGiven[corner];
            isWhole = isWhole && isAuthored[i][corner];
        }
    }
    result.normals = std::move(authored);
    if (isWhole) return result;
    const std::vector<Corners> smooth = creaseNormals(vertices, faces, leastCosine);
    for (std::size_t i = 0; i < faces.size(); ++i)
        for (int corner = 0; corner < 3; ++corner)
            if (!isAuthored[i][corner]) result.normals[i][corner] = smooth[i][corner];
    return result;
}

} // namespace colonnade::mesh
