/// Newell's teapot of 1975, tessellated from its control points: 28 published Bézier patches and the later bottom.
///
/// Body, lid and bottom are surfaces of revolution: a profile and Newell's cubic quarter circle (an approximation) give
/// their control points. Handle and spout are mirrored halves. Adjacent patches share their edges bit for bit, so the
/// mesh is closed without a merging tolerance.
#pragma once

#include "cleaning.hpp"

namespace colonnade::mesh {

/// Rows of control points of a bicubic patch, y up, normals outward.
using Patch = std::array<std::array<Vector, 4>, 4>;

/// Profiles of the surfaces of revolution: rim, upper and lower body, knob of the lid, lid, bottom; radius and height,
/// starting at the rim.
inline constexpr double profiles[6][4][2]{
    {{1.4, 2.4}, {1.3375, 2.53125}, {1.4375, 2.53125}, {1.5, 2.4}},
    {{1.5, 2.4}, {1.75, 1.875}, {2.0, 1.35}, {2.0, 0.9}},
    {{2.0, 0.9}, {2.0, 0.45}, {1.5, 0.225}, {1.5, 0.15}},
    {{0.0, 3.15}, {0.8, 3.15}, {0.0, 2.85}, {0.2, 2.7}},
    {{0.2, 2.7}, {0.4, 2.55}, {1.3, 2.55}, {1.3, 2.4}},
    {{1.5, 0.15}, {1.5, 0.075}, {1.425, 0.0}, {0.0, 0.0}},
};

/// Upper and lower handle, lower and upper spout: rows of x, half width and height, from symmetry plane to symmetry
/// plane.
inline constexpr double halves[4][4][4][3]{
    {{{-1.6, 0.0, 2.025}, {-1.6, 0.3, 2.025}, {-1.5, 0.3, 2.25}, {-1.5, 0.0, 2.25}},
     {{-2.3, 0.0, 2.025}, {-2.3, 0.3, 2.025}, {-2.5, 0.3, 2.25}, {-2.5, 0.0, 2.25}},
     {{-2.7, 0.0, 2.025}, {-2.7, 0.3, 2.025}, {-3.0, 0.3, 2.25}, {-3.0, 0.0, 2.25}},
     {{-2.7, 0.0, 1.8}, {-2.7, 0.3, 1.8}, {-3.0, 0.3, 1.8}, {-3.0, 0.0, 1.8}}},
    {{{-2.7, 0.0, 1.8}, {-2.7, 0.3, 1.8}, {-3.0, 0.3, 1.8}, {-3.0, 0.0, 1.8}},
     {{-2.7, 0.0, 1.575}, {-2.7, 0.3, 1.575}, {-3.0, 0.3, 1.35}, {-3.0, 0.0, 1.35}},
     {{-2.5, 0.0, 1.125}, {-2.5, 0.3, 1.125}, {-2.65, 0.3, 0.9375}, {-2.65, 0.0, 0.9375}},
     {{-2.0, 0.0, 0.9}, {-2.0, 0.3, 0.9}, {-1.9, 0.3, 0.6}, {-1.9, 0.0, 0.6}}},
    {{{1.7, 0.0, 1.425}, {1.7, 0.66, 1.425}, {1.7, 0.66, 0.6}, {1.7, 0.0, 0.6}},
     {{2.6, 0.0, 1.425}, {2.6, 0.66, 1.425}, {3.1, 0.66, 0.825}, {3.1, 0.0, 0.825}},
     {{2.3, 0.0, 2.1}, {2.3, 0.25, 2.1}, {2.4, 0.25, 2.025}, {2.4, 0.0, 2.025}},
     {{2.7, 0.0, 2.4}, {2.7, 0.25, 2.4}, {3.3, 0.25, 2.4}, {3.3, 0.0, 2.4}}},
    {{{2.7, 0.0, 2.4}, {2.7, 0.25, 2.4}, {3.3, 0.25, 2.4}, {3.3, 0.0, 2.4}},
     {{2.8, 0.0, 2.475}, {2.8, 0.25, 2.475}, {3.525, 0.25, 2.49375}, {3.525, 0.0, 2.49375}},
     {{2.9, 0.0, 2.475}, {2.9, 0.15, 2.475}, {3.45, 0.15, 2.5125}, {3.45, 0.0, 2.5125}},
     {{2.8, 0.0, 2.4}, {2.8, 0.15, 2.4}, {3.2, 0.15, 2.4}, {3.2, 0.0, 2.4}}},
};

inline std::vector<Patch> teapotPatches() {
    std::vector<Patch> patches;
    for (const auto& profile : profiles) {
        Patch patch;
        for (int row = 0; row < 4; ++row) {
            const double radius = profile[row][0], height = profile[row][1];
            // A quarter circle from +x to +z. The original data rounds 0.448, for radius 0.8, to 0.45
            const double flat = radius * (radius == 0.8 ? 0.5625 : 0.56);
            patch[row] = {{{radius, height, 0}, {radius, height, flat}, {flat, height, radius}, {0, height, radius}}};
        }
        for (int quarter = 0; quarter < 4; ++quarter) {
            patches.push_back(patch);
            for (auto& row : patch)
                for (Vector& point : row) point = {-point[2], point[1], point[0]};
        }
    }
    for (const auto& half : halves) {
        Patch one, other;
        for (int row = 0; row < 4; ++row)
            for (int i = 0; i < 4; ++i) {
                const auto& [x, width, height] = half[row][i];
                one[row][i] = {x, height, width};
                other[row][3 - i] = {x, height, -width};
            }
        patches.push_back(one);
        patches.push_back(other);
    }
    return patches;
}

/// Each patch in level × level cells of two triangles, without the degenerate ones at the poles; vertices are not
/// merged between patches.
inline RawMesh teapot(int level) {
    std::vector<std::array<double, 4>> basis;
    for (int i = 0; i <= level; ++i) {
        const double t = static_cast<double>(i) / level, s = 1 - t;
        basis.push_back({s * s * s, 3 * t * (s * s), 3 * (t * t) * s, t * t * t});
    }
    RawMesh mesh;
    const int side = level + 1;
    for (const Patch& patch : teapotPatches()) {
        const auto first = static_cast<std::int32_t>(mesh.vertices.size());
        for (int u = 0; u < side; ++u) {
            // In a fixed order: on a shared edge all other terms are exactly 0, so adjacent patches agree bit for bit
            std::array<Vector, 4> row{};
            for (int i = 0; i < 4; ++i)
                for (int j = 0; j < 4; ++j)
                    for (int axis = 0; axis < 3; ++axis) row[j][axis] += basis[u][i] * patch[i][j][axis];
            const auto& end = patch[u == 0 ? 0 : 3];
            const bool isPole = (u == 0 || u == level) && end == std::array<Vector, 4>{end[0], end[0], end[0], end[0]};
            for (int v = 0; v < side; ++v) {
                Vector vertex{};
                for (int j = 0; j < 4; ++j)
                    for (int axis = 0; axis < 3; ++axis) vertex[axis] += basis[v][j] * row[j][axis];
                mesh.vertices.push_back(isPole ? Vector{end[0][0] + 0.0, end[0][1] + 0.0, end[0][2] + 0.0} : vertex);
            }
        }
        for (int u = 0; u < level; ++u)
            for (int v = 0; v < level; ++v) {
                const std::int32_t corner = first + u * side + v;
                for (const Face& face :
                     {Face{corner, corner + 1, corner + side + 1}, Face{corner, corner + side + 1, corner + side}}) {
                    const Vector &a = mesh.vertices[face[0]], &b = mesh.vertices[face[1]], &c = mesh.vertices[face[2]];
                    if (a != b && b != c && c != a) mesh.faces.push_back(face);
                }
            }
    }
    return mesh;
}

} // namespace colonnade::mesh
