// The faces of a scene as the application has them: hits in double, and the faces around a face.
#pragma once
#include <optional>

#include "mesh/topology.hpp"

namespace colonnade::rays {

/// The hit of a ray with the plane of a face: `least` is the smallest of the corners' weights, below 0 outside.
struct PlaneHit {
    double t, u, v, least;
    bool backSide;
};

class Faces {
public:
    Faces() = default;
    Faces(std::vector<mesh::Vector> vertices, std::vector<mesh::Face> faces) : vertices_(std::move(vertices)), faces_(std::move(faces)) {}

    const std::vector<mesh::Vector>& vertices() const { return vertices_; }
    const std::vector<mesh::Face>& faces() const { return faces_; }

    /// Nothing for a ray along the face's plane.
    std::optional<PlaneHit> hit(std::size_t index, const double* origin, const double* direction) const {
        const mesh::Face& face = faces_[index];
        const mesh::Vector &corner = vertices_[face[0]], d{direction[0], direction[1], direction[2]};
        const mesh::Vector e1 = mesh::difference(vertices_[face[1]], corner), e2 = mesh::difference(vertices_[face[2]], corner);
        const mesh::Vector s = mesh::difference({origin[0], origin[1], origin[2]}, corner), p = mesh::cross(d, e2), q = mesh::cross(s, e1);
        const double determinant = dot(e1, p);
        if (determinant == 0) return std::nullopt;
        const double u = dot(s, p) / determinant, v = dot(d, q) / determinant;
        return PlaneHit{dot(e2, q) / determinant, u, v, std::min({u, v, 1 - u - v}), determinant < 0};
    }

    /// The faces with a corner at the place of one of this face's, itself among them. `function` is called once or more for each.
    template <class Function> void around(std::size_t index, const Function& function) {
        if (first_.empty()) findNeighbours();
        for (int corner = 0; corner < 3; ++corner) {
            const std::int64_t position = positions_[faces_[index][corner]];
            for (std::size_t i = first_[position]; i < first_[position + 1]; ++i) function(at_[i]);
        }
    }

private:
    static double dot(const mesh::Vector& a, const mesh::Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

    void findNeighbours() {
        const mesh::MergedRows<double> merged = mesh::mergeRows(vertices_.data(), vertices_.size());
        positions_ = merged.index;
        first_.assign(merged.rows.size() + 1, 0);
        for (const mesh::Face& face : faces_)
            for (int corner = 0; corner < 3; ++corner) ++first_[positions_[face[corner]] + 1];
        for (std::size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
        at_.resize(first_.back());
        std::vector<std::size_t> next(first_.begin(), first_.end() - 1);
        for (std::size_t i = 0; i < faces_.size(); ++i)
            for (int corner = 0; corner < 3; ++corner) at_[next[positions_[faces_[i][corner]]]++] = i;
    }

    std::vector<mesh::Vector> vertices_;
    std::vector<mesh::Face> faces_;
    std::vector<std::int64_t> positions_;
    std::vector<std::size_t> first_, at_;
};

} // namespace colonnade::rays
