/// The triangles of a mesh file, made of its polygons and what these carry.
#pragma once

#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "mesh/files/losses.hpp"
#include "mesh/files/polygons.hpp"
#include "mesh/normals.hpp"
#include "srgb.hpp"

namespace colonnade::mesh {

/// Largest magnitude of a position in a texture: beyond it float32 holds no fractions of a picture.
constexpr double maxUv = 1e6;

/// Triangles of a mesh, at most, as MAX_TRIANGLES of host/colonnade/common/limits.py.
constexpr std::size_t maxTriangles = 1 << 24;

/// Surface kinds of the device.
enum class Kind { diffuse, mirror, glass };

/// A material of a file, as MeshMaterial of host/colonnade/mesh/materials/materials.py.
struct FileMaterial {
    Kind kind = Kind::diffuse;
    Vector albedo{0.8, 0.8, 0.8};
    double ior = 1.5, roughness = 0;
    Vector emission{};
    std::optional<double> alpha; ///< factor of the texture's alpha, of which a half and more is shown
    std::int32_t texture = -1;

    bool operator<(const FileMaterial& other) const {
        const auto values = [](const FileMaterial& one) {
            return std::tie(one.kind, one.albedo, one.ior, one.roughness, one.emission, one.alpha, one.texture);
        };
        return values(*this) < values(other);
    }
};

/// A texture: a picture, or white, whose alpha is that of another one, or its brightness.
struct FileTexture {
    std::int32_t picture, mask; ///< numbers of what the caller has read; mask -1: opaque
    bool isWhite;
};

struct FileSurface {
    std::vector<Vector> vertices;
    std::vector<Face> faces;
    std::vector<Corners> normals;              ///< of any length, 0 where the file has none; empty: none
    std::vector<Corners> colours;              ///< linear, NaN on faces without; empty: none
    std::vector<Triangle> uvs;                 ///< v downwards, 0 on faces without; empty: none
    std::vector<FileMaterial> materials{FileMaterial()};
    std::vector<std::int32_t> faceMaterials;   ///< empty: all faces have the first
    std::vector<FileTexture> textures;
};

/// The polygons of a file: their corners follow each other.
struct Polygons {
    std::vector<std::int64_t> sizes;
    std::vector<std::int32_t> corners;           ///< vertices, each one of the surface's
    std::vector<Vector> normals; ///< of the vertices, of which `cornerNormals` are the corners'; empty: none
    std::vector<std::int32_t> cornerNormals; ///< -1: none; empty: those of the vertices
    std::vector<Vector> vertexColours; ///< linear; empty: none
    std::vector<Vector> colours; ///< of the polygons, before those of vertices, NaN for none; empty: none
    std::vector<std::int32_t> materials; ///< of the polygons; empty: all have the first
    std::vector<Pair> uvs; ///< of the corners; empty: none
};

/// Linear colours of sRGB ones; what is clipped, or no number, is counted. `white`: their largest value; nothing: 255
/// if one of them is above 2, else 1.
inline void makeLinear(std::vector<Vector>& colours, std::optional<double> white, Losses& losses) {
    if (!white) {
        white = 1.0;
        for (const Vector& colour : colours)
            for (const double value : colour)
                if (std::isfinite(value) && value > 2.0) white = 255.0;
    }
    std::size_t dark = 0, clipped = 0;
    Vector last{}, lastLinear{};
    for (Vector& colour : colours) {
        bool isDark = false, isClipped = false;
        for (double& value : colour) {
            if (!std::isfinite(value)) {
                isDark = true;
                value = 0;
            } else isClipped |= value < 0 || value > *white;
            value = std::clamp(value / *white, 0.0, 1.0);
        }
        dark += isDark;
        clipped += isClipped;
        if (colour != last) {
            last = colour;
            for (int channel = 0; channel < 3; ++channel) lastLinear[channel] = linearFromSrgb(colour[channel]);
        }
        colour = lastLinear;
    }
    losses.add(lost::darkColours, dark);
    losses.add(lost::clippedColours, clipped);
}

/// Gives a surface, which has vertices, materials and textures, the triangles of polygons; an error, or none.
inline std::string addPolygons(FileSurface& surface, const Polygons& from, Losses& losses) {
    std::size_t most = 0;
    for (const std::int64_t size : from.sizes) most += static_cast<std::size_t>(std::max<std::int64_t>(size - 2, 0));
    if (most > maxTriangles) return "it has more than " + grouped(maxTriangles) + " triangles: leave some out";
    const bool hasColours = !from.colours.empty() || !from.vertexColours.empty();
    surface.faces.reserve(most);
    if (!from.normals.empty()) surface.normals.reserve(most);
    if (!from.uvs.empty()) surface.uvs.reserve(most);
    if (!from.materials.empty()) surface.faceMaterials.reserve(most);
    if (hasColours) surface.colours.reserve(most);
    PolygonSplitter splitter;
    std::vector<Vector> points;
    std::size_t start = 0, hidden = 0, changed = 0;
    for (std::size_t polygon = 0; polygon < from.sizes.size(); ++polygon) {
        const std::size_t end = start + static_cast<std::size_t>(from.sizes[polygon]);
        points.clear();
        for (std::size_t corner = start; corner < end; ++corner)
            points.push_back(surface.vertices[static_cast<std::size_t>(from.corners[corner])]);
        if (!splitter.split(points)) return splitter.error;
        const std::size_t material = from.materials.empty() ? 0 : static_cast<std::size_t>(from.materials[polygon]);
        const bool isTextured = surface.materials[material].texture >= 0;
        for (const Row<std::size_t>& triangle : splitter.triangles) {
            Face face;
            Corners normals{}, colours;
            Triangle uvs;
            bool isWhite = true;
            for (int k = 0; k < 3; ++k) {
                const std::size_t corner = start + triangle[k];
                const auto vertex = static_cast<std::size_t>(from.corners[corner]);
                face[k] = from.corners[corner];
                if (!from.normals.empty()) {
                    const std::int32_t normal = from.cornerNormals.empty() ? face[k] : from.cornerNormals[corner];
                    if (normal >= 0) normals[k] = from.normals[static_cast<std::size_t>(normal)];
                }
                if (!from.uvs.empty()) uvs[k] = from.uvs[corner];
                if (hasColours) {
                    colours[k] = from.colours.empty() ? from.vertexColours[vertex] : from.colours[polygon];
                    isWhite &= colours[k] == Vector{1, 1, 1};
                    if (isTextured) colours[k].fill(std::numeric_limits<double>::quiet_NaN());
                }
            }
            surface.faces.push_back(face);
            if (!from.normals.empty()) surface.normals.push_back(normals);
            if (!from.uvs.empty()) surface.uvs.push_back(uvs);
            if (hasColours) surface.colours.push_back(colours);
            if (!from.materials.empty()) surface.faceMaterials.push_back(from.materials[polygon]);
            hidden += isTextured;
            changed += isTextured && !isWhite;
        }
        start = end;
    }
    losses.add(lost::shortFaces, splitter.shorts);
    losses.add(lost::crossed, splitter.crossed);
    if (hasColours) losses.add(lost::texturedColours, changed);
    if (hidden == surface.faces.size()) surface.colours.clear();
    return "";
}

} // namespace colonnade::mesh
