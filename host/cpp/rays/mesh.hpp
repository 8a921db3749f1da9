// The faces of a scene as the application has them: hits in double, and the faces around a face.
#pragma once
#include <atomic>
#include <cmath>
#include <memory>
#include <mutex>
#include <optional>

#include "mesh/topology.hpp"

namespace colonnade::rays {

/// The hit of a ray with the plane of a face: `least` is the smallest of the corners' weights, below 0 outside.
struct PlaneHit {
    double t, u, v, least;
    bool backSide;
};

/// What the hit of a face reads, together for the sake of a processor's cache.
struct FaceRecord {
    std::array<mesh::Vector, 3> corners;
    std::uint32_t mesh, face; ///< of the application
    bool isClear;
};

class Faces {
public:
    Faces() = default;
    /// `each`: the faces in the order of `faces`, but for their corners.
    Faces(std::vector<mesh::Vector> vertices, std::vector<mesh::Face> faces, std::vector<FaceRecord> each)
        : vertices_(std::move(vertices)), faces_(std::move(faces)), records_(std::move(each)) {
        for (std::size_t i = 0; i < faces_.size(); ++i)
            for (int corner = 0; corner < 3; ++corner) records_[i].corners[corner] = vertices_[faces_[i][corner]];
    }

    const std::vector<mesh::Vector>& vertices() const { return vertices_; }
    const std::vector<mesh::Face>& faces() const { return faces_; }
    const FaceRecord& operator[](std::size_t index) const { return records_[index]; }

    double longestEdge(std::size_t index) const {
        const std::array<mesh::Vector, 3>& corners = records_[index].corners;
        double longest = 0;
        for (int i = 0; i < 3; ++i) {
            const mesh::Vector edge = mesh::difference(corners[(i + 1) % 3], corners[i]);
            longest = std::max(longest, std::sqrt(dot(edge, edge)));
        }
        return longest;
    }

    /// The distance of a face's corner from the longest edge.
    double altitude(std::size_t index) const {
        const std::array<mesh::Vector, 3>& corners = records_[index].corners;
        const double longest = longestEdge(index);
        const mesh::Vector area =
            mesh::cross(mesh::difference(corners[1], corners[0]), mesh::difference(corners[2], corners[0]));
        return longest > 0 ? std::sqrt(dot(area, area)) / longest : 0;
    }

    /// Nothing for a ray along the face's plane, or one whose numbers overflow.
    std::optional<PlaneHit> hit(std::size_t index, const double* origin, const double* direction) const {
        const std::array<mesh::Vector, 3>& corners = records_[index].corners;
        const mesh::Vector &corner = corners[0], d{direction[0], direction[1], direction[2]};
        const mesh::Vector e1 = mesh::difference(corners[1], corner), e2 = mesh::difference(corners[2], corner);
        const mesh::Vector s = mesh::difference({origin[0], origin[1], origin[2]}, corner), p = mesh::cross(d, e2),
                           q = mesh::cross(s, e1);
        const double determinant = dot(e1, p);
        if (determinant == 0 || !std::isfinite(determinant)) return std::nullopt;
        const double u = dot(s, p) / determinant, v = dot(d, q) / determinant;
        const PlaneHit hit{dot(e2, q) / determinant, u, v, std::min({u, v, 1 - u - v}), determinant < 0};
        return std::isfinite(hit.t) && std::isfinite(hit.u) && std::isfinite(hit.v) ? std::optional(hit) : std::nullopt;
    }

    /// The faces with a corner at the place of one of this face's, itself among them. `function` is called once or more
    /// for each.
    template <class Function> void around(std::size_t index, const Function& function) const {
        const Neighbours& near = neighbours();
        for (int corner = 0; corner < 3; ++corner) {
            const std::int64_t position = near.positions[faces_[index][corner]];
            for (std::size_t i = near.first[position]; i < near.first[position + 1]; ++i) function(near.at[i]);
        }
    }

private:
    static double dot(const mesh::Vector& a, const mesh::Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

    /// Faces by the places of their corners: place p's are at[first[p]] … at[first[p + 1] - 1].
    struct Neighbours {
        std::vector<std::int64_t> positions; ///< of the vertices
        std::vector<std::size_t> first, at;
        std::mutex finding;
        std::atomic<bool> areFound{false};
    };

    const Neighbours& neighbours() const {
        if (neighbours_->areFound.load(std::memory_order_acquire)) return *neighbours_;
        const std::lock_guard<std::mutex> lock(neighbours_->finding);
        if (!neighbours_->areFound) findNeighbours(*neighbours_);
        neighbours_->areFound.store(true, std::memory_order_release);
        return *neighbours_;
    }

    void findNeighbours(Neighbours& to) const {
        const mesh::MergedRows<double> merged = mesh::mergeRows(vertices_.data(), vertices_.size());
        to.positions = merged.index;
        to.first.assign(merged.rows.size() + 1, 0);
        for (const mesh::Face& face : faces_)
            for (int corner = 0; corner < 3; ++corner) ++to.first[to.positions[face[corner]] + 1];
        for (std::size_t i = 1; i < to.first.size(); ++i) to.first[i] += to.first[i - 1];
        to.at.resize(to.first.back());
        std::vector<std::size_t> next(to.first.begin(), to.first.end() - 1);
        for (std::size_t i = 0; i < faces_.size(); ++i)
            for (int corner = 0; corner < 3; ++corner) to.at[next[to.positions[faces_[i][corner]]]++] = i;
    }

    std::vector<mesh::Vector> vertices_;
    std::vector<mesh::Face> faces_;
    std::vector<FaceRecord> records_;
    std::unique_ptr<Neighbours> neighbours_ = std::make_unique<Neighbours>();
};

} // namespace colonnade::rays
