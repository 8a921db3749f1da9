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
    const Triangles split = triangulate(from.sizes, [&](std::int64_t corner) -> const Vector& {
        return surface.vertices[static_cast<std::size_t>(from.corners[static_cast<std::size_t>(corner)])];
    });
    if (!split.error.empty()) return split.error;
    losses.add(lost::shortFaces, split.shorts);
    losses.add(lost::crossed, split.crossed);
    const std::size_t count = split.corners.size();
    surface.faces.resize(count);
    if (!from.normals.empty()) surface.normals.resize(count);
    if (!from.uvs.empty()) surface.uvs.resize(count);
    if (!from.materials.empty()) surface.faceMaterials.resize(count);
    const bool hasColours = !from.colours.empty() || !from.vertexColours.empty();
    if (hasColours) surface.colours.resize(count);
    std::size_t hidden = 0, changed = 0;
    for (std::size_t i = 0; i < count; ++i) {
        const auto polygon = static_cast<std::size_t>(split.polygons[i]);
        const std::size_t material = from.materials.empty() ? 0 : static_cast<std::size_t>(from.materials[polygon]);
        const bool isTextured = surface.materials[material].texture >= 0;
        bool isWhite = true;
        for (int k = 0; k < 3; ++k) {
            const auto corner = static_cast<std::size_t>(split.corners[i][k]);
            const auto vertex = static_cast<std::size_t>(from.corners[corner]);
            surface.faces[i][k] = from.corners[corner];
            if (!from.normals.empty()) {
                const std::int32_t normal =
                    from.cornerNormals.empty() ? from.corners[corner] : from.cornerNormals[corner];
                if (normal >= 0) surface.normals[i][k] = from.normals[static_cast<std::size_t>(normal)];
            }
            if (!from.uvs.empty()) surface.uvs[i][k] = from.uvs[corner];
            if (hasColours) {
                Vector& colour = surface.colours[i][k];
                colour = from.colours.empty() ? from.vertexColours[vertex] : from.colours[polygon];
                isWhite &= colour == Vector{1, 1, 1};
                if (isTextured) colour.fill(std::numeric_limits<double>::quiet_NaN());
            }
        }
        if (!from.materials.empty()) surface.faceMaterials[i] = from.materials[polygon];
        hidden += isTextured;
        changed += isTextured && !isWhite;
    }
    if (hasColours) losses.add(lost::texturedColours, changed);
    if (hidden == count) surface.colours.clear();
    return "";
}

} // namespace colonnade::mesh
