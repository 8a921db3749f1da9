/// Parts of the faces that a clip moves: their corners follow what moves the corners of the faces.
#pragma once

#include <map>
#include <utility>

#include "clip.hpp"
#include "relief.hpp"

namespace colonnade::mesh {

/// Gives a clip vertices at points of faces: each point one, also where several faces have it.
class ClipPoints {
public:
    explicit ClipPoints(Clip& clip) : clip_(clip) {}

    /// The vertices at the corners of a part of a face, by the weights of the face's corners at each.
    Face part(const Face& face, const Corners& weights) {
        Face corners;
        for (int corner = 0; corner < 3; ++corner) corners[corner] = at(face, weights[corner]);
        return corners;
    }

private:
    /// Corners of a face, ascending, and their weights; unused ones come first.
    using Point = std::array<std::pair<std::int32_t, double>, 3>;

    std::int32_t at(const Face& face, const Vector& weights) {
        Point point;
        for (int corner = 0; corner < 3; ++corner) {
            if (weights[corner] == 1) return face[corner];
            point[corner] = weights[corner] == 0 ? std::pair(-1, 0.0) : std::pair(face[corner], weights[corner]);
        }
        std::sort(point.begin(), point.end());
        const auto [found, isNew] = numbers_.try_emplace(point, static_cast<std::int32_t>(clip_.positions.size()));
        if (isNew) add(point);
        return found->second;
    }

    /// Adds the mean of corners. Of their joints the four with the largest share move it.
    void add(const Point& point) {
        Morphs& morphs = clip_.morphs;
        Vector position{};
        std::map<std::int64_t, double> shares;
        std::map<std::int64_t, std::array<Vector, 2>> changes;
        for (const auto& [corner, weight] : point) {
            if (corner < 0) continue;
            const auto vertex = static_cast<std::size_t>(corner);
            for (int axis = 0; axis < 3; ++axis) position[axis] += weight * clip_.positions[vertex][axis];
            for (int influence = 0; influence < influences; ++influence)
                if (const double share = clip_.shares[vertex][influence]; share > 0) shares[clip_.bones[vertex][influence]] += weight * share;
            const auto first = std::lower_bound(morphs.vertices.begin(), morphs.vertices.end(), corner) - morphs.vertices.begin();
            for (auto change = static_cast<std::size_t>(first); change < morphs.vertices.size() && morphs.vertices[change] == corner; ++change) {
                std::array<Vector, 2>& added = changes[morphs.targets[change]];
                for (int axis = 0; axis < 3; ++axis) {
                    added[0][axis] += weight * morphs.positions[change][axis];
                    added[1][axis] += weight * morphs.normals[change][axis];
                }
            }
        }
        std::vector<std::pair<double, std::int64_t>> order; // the largest share first
        for (const auto& [bone, share] : shares) order.push_back({-share, bone});
        std::sort(order.begin(), order.end());
        order.resize(std::min<std::size_t>(order.size(), influences));
        double total = 0;
        for (const auto& [share, bone] : order) total -= share;
        std::array<std::int64_t, influences> bones;
        std::array<double, influences> own{};
        bones.fill(order[0].second);
        for (std::size_t i = 0; i < order.size(); ++i) {
            bones[i] = order[i].second;
            own[i] = -order[i].first / total;
        }
        for (const auto& [target, added] : changes) {
            morphs.targets.push_back(target);
            morphs.vertices.push_back(static_cast<std::int64_t>(clip_.positions.size()));
            morphs.positions.push_back(added[0]);
            morphs.normals.push_back(added[1]);
        }
        clip_.positions.push_back(position);
        clip_.bones.push_back(bones);
        clip_.shares.push_back(own);
    }

    Clip& clip_;
    std::map<Point, std::int32_t> numbers_;
};

} // namespace colonnade::mesh
