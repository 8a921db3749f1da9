/// A surface with normal maps, in pieces: its normals at any point.
#pragma once

#include "pieces.hpp"
#include "relief.hpp"

namespace colonnade::mesh {

class ReliefSurface {
public:
    Pieces pieces;

    /// `normals` have unit length, or 0 for that of the face.
    ReliefSurface(std::vector<Vector> vertices, const std::vector<Face>& faces, std::vector<Corners> normals,
                  const std::vector<NormalMap>& maps, const std::vector<ReliefFace>& relief)
        : pieces(std::move(vertices), faces), maps_(maps), relief_(relief), normals_(std::move(normals)) {
        const std::vector<Vector> flat = faceNormals();
        for (std::size_t i = 0; i < normals_.size(); ++i)
            for (Vector& normal : normals_[i])
                if (normal == Vector{}) normal = flat[i];
        frames_ = framesOf(pieces.vertices, faces, normals_, relief_);
    }

    /// Unit normals of the pieces.
    std::vector<Vector> faceNormals() const {
        const auto [low, high] = pieces.bounds();
        const double size = std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
        std::vector<Vector> normals;
        for (const Piece& piece : pieces.pieces) {
            Corners scaled;
            for (int corner = 0; corner < 3; ++corner)
                for (int axis = 0; axis < 3; ++axis)
                    scaled[corner][axis] = pieces.vertices[piece.face[corner]][axis] / size;
            normals.push_back(unit(cross(difference(scaled[1], scaled[0]), difference(scaled[2], scaled[0]))));
        }
        return normals;
    }

    /// Normals at the corners of a piece without its map.
    Corners smooth(const Piece& piece) const { return weighted(piece.weights, normals_[piece.owner]); }

    bool hasMap(const Piece& piece) const { return relief_[piece.owner].map >= 0; }

    /// Normals of a piece at points, by weights of its corners, at most of unit length. They are means over squares so
    /// wide; without a width as wide as points that fill a triangle are apart.
    std::vector<Vector> normalsAt(const Piece& piece, const std::vector<Vector>& points,
                                  std::optional<double> width = {}) const {
        const ReliefFace& own = relief_[piece.owner];
        const Frames frames = weighted(piece.weights, frames_[piece.owner]);
        Triangle uvs{};
        std::size_t level = 0;
        if (own.map >= 0) {
            uvs = weighted(piece.weights, own.uvs);
            double texels = 0;
            for (int axis = 0; axis < 2; ++axis) {
                const double size = maps_[own.map].size()[axis];
                const auto [least, most] = std::minmax({uvs[0][axis] * size, uvs[1][axis] * size, uvs[2][axis] * size});
                texels = std::max(texels, most - least);
            }
            const double spacing = width ? texels * *width / std::sqrt(pieces.longest(piece))
                                         : texels / std::sqrt(2.0 * static_cast<double>(points.size()));
            int exponent;
            std::frexp(std::max(spacing, 1.0), &exponent);
            level = static_cast<std::size_t>(std::max(exponent - 1, 0));
        }
        std::vector<Vector> normals;
        for (const Vector& point : points) {
            const std::array<double, 9> axes = weighted(point, frames);
            const Vector tilt = own.map < 0 ? Vector{0, 0, 1} : maps_[own.map].normal(weighted(point, uvs), level);
            Vector normal;
            for (int axis = 0; axis < 3; ++axis)
                normal[axis] = tilt[0] * axes[axis] + tilt[1] * axes[3 + axis] + tilt[2] * axes[6 + axis];
            normal = unit(normal);
            for (double& component : normal) component *= length(tilt);
            normals.push_back(normal);
        }
        return normals;
    }

    /// Samples along an edge of a face, of small, larger and the largest meshes.
    static int stepsOf(std::size_t count) {
        for (const int steps : {8, 4})
            if (count * static_cast<std::size_t>(steps * (steps + 1) / 2) <= 1u << 22) return steps;
        return 3;
    }

private:
    const std::vector<NormalMap>& maps_;
    const std::vector<ReliefFace>& relief_;
    std::vector<Corners> normals_;
    std::vector<Frames> frames_;
};

} // namespace colonnade::mesh
