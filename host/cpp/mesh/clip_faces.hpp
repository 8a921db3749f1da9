/// Parts of the faces that a clip moves: their corners follow what moves the corners of the faces.
#pragma once

#include <cstring>

#include "clip.hpp"

namespace colonnade::mesh {

/// Gives a clip vertices at points of faces: each point one, also where several faces have it.
class ClipPoints {
public:
    /// For at most so many parts of faces.
    ClipPoints(Clip& clip, std::size_t parts) : clip_(clip), first_(clip.positions.size()) {
        std::size_t size = 16;
        while (size < 6 * parts) size *= 2;
        slots_.assign(size, -1);
    }

    /// The vertices at the corners of a part of a face, by the weights of the face's corners at each.
    Face part(const Face& face, const Corners& weights) {
        Face corners;
        for (int corner = 0; corner < 3; ++corner) corners[corner] = at(face, weights[corner]);
        return corners;
    }

private:
    struct Share {
        std::int64_t of; ///< a bone
        double value;
    };
    /// Corners of a face, descending, and their weights; -1 for those that are not used.
    struct Point {
        Face corners{-1, -1, -1};
        Vector weights{};
    };

    std::int32_t at(const Face& face, const Vector& weights) {
        Point point;
        for (int corner = 0; corner < 3; ++corner) {
            if (weights[corner] == 1) return face[corner];
            if (weights[corner] == 0) continue;
            int i = corner;
            for (; i > 0 && point.corners[i - 1] < face[corner]; --i) {
                point.corners[i] = point.corners[i - 1];
                point.weights[i] = point.weights[i - 1];
            }
            point.corners[i] = face[corner];
            point.weights[i] = weights[corner];
        }
        std::uint64_t hash = 0;
        for (int corner = 0; corner < 3; ++corner) {
            std::uint64_t bits;
            std::memcpy(&bits, &point.weights[corner], sizeof bits);
            hash = (hash ^ bits ^ static_cast<std::uint32_t>(point.corners[corner])) * 0x9e3779b97f4a7c15;
            hash ^= hash >> 29;
        }
        for (std::size_t slot = hash & (slots_.size() - 1);; slot = (slot + 1) & (slots_.size() - 1)) {
            std::int32_t& vertex = slots_[slot];
            if (vertex < 0) {
                vertex = static_cast<std::int32_t>(clip_.positions.size());
                points_.push_back(point);
                add(point);
                return vertex;
            }
            const Point& known = points_[static_cast<std::size_t>(vertex) - first_];
            if (known.corners == point.corners && known.weights == point.weights) return vertex;
        }
    }

    /// Adds the mean of corners. Of their joints the four with the largest share move it.
    void add(const Point& point) {
        Morphs& morphs = clip_.morphs;
        const auto vertex = static_cast<std::int64_t>(clip_.positions.size());
        const std::size_t firstChange = morphs.targets.size();
        Vector position{};
        std::array<Share, 3 * influences> shares;
        std::size_t count = 0;
        for (int corner = 0; corner < 3 && point.corners[corner] >= 0; ++corner) {
            const auto of = static_cast<std::size_t>(point.corners[corner]);
            const double weight = point.weights[corner];
            for (int axis = 0; axis < 3; ++axis) position[axis] += weight * clip_.positions[of][axis];
            for (int influence = 0; influence < influences; ++influence) {
                if (!(clip_.shares[of][influence] > 0)) continue;
                const std::int64_t bone = clip_.bones[of][influence];
                std::size_t i = 0;
                while (i < count && shares[i].of != bone) ++i;
                if (i == count) shares[count++] = {bone, 0};
                shares[i].value += weight * clip_.shares[of][influence];
            }
            const auto found = std::lower_bound(morphs.vertices.begin(), morphs.vertices.end(), point.corners[corner]) -
                               morphs.vertices.begin();
            for (auto change = static_cast<std::size_t>(found);
                 change < firstChange && morphs.vertices[change] == point.corners[corner]; ++change) {
                std::size_t i = firstChange;
                while (i < morphs.targets.size() && morphs.targets[i] != morphs.targets[change]) ++i;
                if (i == morphs.targets.size()) {
                    morphs.targets.push_back(morphs.targets[change]);
                    morphs.vertices.push_back(vertex);
                    morphs.positions.emplace_back();
                    morphs.normals.emplace_back();
                }
                for (int axis = 0; axis < 3; ++axis) {
                    morphs.positions[i][axis] += weight * morphs.positions[change][axis];
                    morphs.normals[i][axis] += weight * morphs.normals[change][axis];
                }
            }
        }
        std::array<Share, influences> kept{};
        double total = 0;
        for (Share& own : kept) {
            // Of equal shares that of the first bone
            Share* largest = &shares[0];
            for (std::size_t i = 1; i < count; ++i)
                if (shares[i].value > largest->value ||
                    (shares[i].value == largest->value && shares[i].of < largest->of))
                    largest = &shares[i];
            own = {largest->value > 0 ? largest->of : kept[0].of, largest->value};
            largest->value = 0;
            total += own.value;
        }
        std::array<std::int64_t, influences> bones;
        std::array<double, influences> own;
        for (int i = 0; i < influences; ++i) {
            bones[i] = kept[i].of;
            own[i] = kept[i].value / total;
        }
        clip_.positions.push_back(position);
        clip_.bones.push_back(bones);
        clip_.shares.push_back(own);
    }

    Clip& clip_;
    const std::size_t first_;
    std::vector<std::int32_t> slots_; ///< the vertices of points by their hash, -1 for none
    std::vector<Point> points_;
};

} // namespace colonnade::mesh
