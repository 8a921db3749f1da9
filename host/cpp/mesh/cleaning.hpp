/// Cleaning: vertices are merged by position; degenerate faces, equal faces and unused
/// vertices go, and closed parts are reversed that point inward.
#pragma once

#include <string>

#include "files/losses.hpp"
#include "winding.hpp"

namespace colonnade::mesh {

/// A file's triangles.
struct RawMesh {
    std::vector<Vector> vertices;
    std::vector<Face> faces;
    std::vector<Corners> normals;  ///< of any length, 0 for none; empty: the file has none
};

struct CleanMesh {
    std::string error; ///< why the mesh cannot be cleaned, beginning with "the mesh"; empty if it can
    std::vector<Vector> vertices;
    std::vector<Face> faces;
    std::vector<std::int64_t> sources; ///< of each face, its index in the raw mesh
    Winding winding; ///< reversed faces have the corners of their source backwards
    CornerNormals normals;
};

/// Why a mesh cannot be cleaned, before its faces are looked at.
inline std::string whyUnclean(const RawMesh& raw) {
    if (raw.faces.empty()) return "the mesh has no faces";
    std::vector<bool> isUsed(raw.vertices.size());
    for (const Face& face : raw.faces)
        for (const std::int32_t vertex : face) {
            if (vertex < 0 || static_cast<std::size_t>(vertex) >= raw.vertices.size())
                return "the mesh has a face that names a vertex that does not exist";
            isUsed[vertex] = true;
        }
    double largest = 0.0;
    for (std::size_t i = 0; i < raw.vertices.size(); ++i)
        for (const double component : raw.vertices[i]) {
            if (isUsed[i] && !std::isfinite(component))
                return "the mesh: vertex " + std::to_string(i) + " is not a finite number: repair the file";
            if (isUsed[i]) largest = std::max(largest, std::fabs(component));
        }
    return largest > 1e100 ? "the mesh has coordinates beyond 1e100: scale it down" : "";
}

/// `sourceFaces`: the number of faces of the file, for messages.
inline CleanMesh clean(const RawMesh& raw, double leastCosine, std::size_t sourceFaces) {
    CleanMesh result{whyUnclean(raw), {}, {}, {}, {}, {}};
    if (!result.error.empty()) return result;
    std::vector<bool> isUsed(raw.vertices.size());
    for (const Face& face : raw.faces)
        for (const std::int32_t vertex : face) isUsed[vertex] = true;
    std::vector<Vector> used;
    std::vector<std::int64_t> number(raw.vertices.size());
    for (std::size_t i = 0; i < raw.vertices.size(); ++i)
        if (isUsed[i]) {
            number[i] = static_cast<std::int64_t>(used.size());
            used.push_back({raw.vertices[i][0] + 0.0, raw.vertices[i][1] + 0.0, raw.vertices[i][2] + 0.0});
        }
    const MergedRows<double> merged = mergeRows(used.data(), used.size());
    Vector low = merged.rows[0], high = merged.rows[0];
    for (const Vector& vertex : merged.rows)
        for (int axis = 0; axis < 3; ++axis) {
            low[axis] = std::min(low[axis], vertex[axis]);
            high[axis] = std::max(high[axis], vertex[axis]);
        }
    const double edge = std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
    std::vector<Vector> scaled = merged.rows;
    for (Vector& vertex : scaled)
        for (int axis = 0; axis < 3; ++axis) vertex[axis] = (vertex[axis] - low[axis]) / edge;
    std::vector<Row<std::int64_t>> corners(raw.faces.size());
    for (std::size_t i = 0; i < corners.size(); ++i)
        for (int corner = 0; corner < 3; ++corner) corners[i][corner] = merged.index[number[raw.faces[i][corner]]];
    if (edge > 0) result.sources = dropFaces(scaled, corners);
    if (result.sources.empty())
        result.error = "the mesh has only degenerate triangles (" + grouped(sourceFaces) + ", all without area)";
    else if (edge < 1e-100) result.error = "the mesh is smaller than 1e-100: scale it up";
    if (!result.error.empty()) return result;

    std::vector<std::int32_t> renumbered(merged.rows.size(), -1);
    for (const std::int64_t source : result.sources)
        for (const std::int64_t vertex : corners[source]) renumbered[vertex] = 0;
    for (std::size_t i = 0; i < renumbered.size(); ++i)
        if (renumbered[i] == 0) {
            renumbered[i] = static_cast<std::int32_t>(result.vertices.size());
            result.vertices.push_back(merged.rows[i]);
        }
    std::vector<Corners> authored;
    bool hasNormals = false;
    for (const std::int64_t source : result.sources) {
        result.faces.push_back(
            {renumbered[corners[source][0]], renumbered[corners[source][1]], renumbered[corners[source][2]]});
        if (!raw.normals.empty()) authored.push_back(raw.normals[source]);
        hasNormals = hasNormals || (!raw.normals.empty() && raw.normals[source] != Corners{});
    }
    result.winding = findWinding(result.vertices, result.faces);
    for (std::size_t i = 0; i < result.faces.size(); ++i)
        if (result.winding.reversed[i]) {
            std::reverse(result.faces[i].begin(), result.faces[i].end());
            if (hasNormals) std::reverse(authored[i].begin(), authored[i].end());
        }
    if (hasNormals) result.normals = cornerNormals(result.vertices, result.faces, std::move(authored), leastCosine);
    else result.normals.normals = creaseNormals(result.vertices, result.faces, leastCosine);
    return result;
}

} // namespace colonnade::mesh
