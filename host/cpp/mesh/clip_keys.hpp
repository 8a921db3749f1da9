/// The keys of a clip: poses between which matrices are interpolated linearly.
#pragma once

#include <set>
#include <utility>

#include "clip.hpp"

namespace colonnade::mesh {

/// Share of the longest edge of the object at rest by which interpolated keys may miss the clip.
constexpr double clipTolerance = 1.0 / 1024;

struct Box {
    Vector low, high;

    void widen(const std::vector<Vector>& points) {
        for (const Vector& point : points)
            for (int axis = 0; axis < 3; ++axis) {
                low[axis] = std::min(low[axis], point[axis]);
                high[axis] = std::max(high[axis], point[axis]);
            }
    }
    static Box of(const std::vector<Vector>& points) {
        Box box{points[0], points[0]};
        box.widen(points);
        return box;
    }
    double edge() const { return std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]}); }
};

/// A pose at a time, seconds. Of two of equal time the first is just before a jump.
struct ClipKey {
    double time;
    ClipPose pose;
};

/// A box of the clip's vertices at rest, in all poses of the keys and between them.
inline Box boxOf(const Clip& clip, const std::vector<ClipKey>& keys) {
    const ClipPose rest = clip.rest();
    Box box = Box::of(clip.vertices(rest.matrices, rest.weights));
    for (std::size_t key = 0; key < keys.size(); ++key) {
        const ClipPose& pose = keys[key].pose;
        box.widen(clip.vertices(pose.matrices, pose.weights));
        if (key + 1 == keys.size() || pose.weights == keys[key + 1].pose.weights) continue;
        // With these a vertex is on a parabola, within its control points
        const ClipPose& next = keys[key + 1].pose;
        std::vector<Vector> crossed = clip.vertices(pose.matrices, next.weights);
        const std::vector<Vector> other = clip.vertices(next.matrices, pose.weights);
        for (std::size_t vertex = 0; vertex < crossed.size(); ++vertex)
            for (int axis = 0; axis < 3; ++axis)
                crossed[vertex][axis] = (crossed[vertex][axis] + other[vertex][axis]) / 2;
        box.widen(crossed);
    }
    return box;
}

/// Chooses keys with which no vertex is further than a tolerance from where the clip has it, at the keys of the file.
class KeyChooser {
public:
    KeyChooser(const Clip& clip, double tolerance)
        : clip_(clip), tolerance_(tolerance), targets_(clip.morphs.weights.size()) {
        const Morphs& morphs = clip.morphs;
        std::vector<Vector> span(clip.positions.size());
        for (std::size_t change = 0; change < morphs.targets.size(); ++change)
            for (int axis = 0; axis < 3; ++axis) {
                const double added = std::fabs(morphs.positions[change][axis]);
                double& target = targets_[static_cast<std::size_t>(morphs.targets[change])];
                span[static_cast<std::size_t>(morphs.vertices[change])][axis] += added;
                target = std::max(target, added);
            }
        boxes_.resize(clip.joints.size(), {{HUGE_VAL, HUGE_VAL, HUGE_VAL}, {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL}});
        for (std::size_t vertex = 0; vertex < clip.positions.size(); ++vertex)
            for (const std::int64_t bone : clip.bones[vertex])
                for (int axis = 0; axis < 3; ++axis) {
                    Box& box = boxes_[static_cast<std::size_t>(bone)];
                    box.low[axis] = std::min(box.low[axis], clip.positions[vertex][axis] - span[vertex][axis]);
                    box.high[axis] = std::max(box.high[axis], clip.positions[vertex][axis] + span[vertex][axis]);
                }
    }

    std::vector<ClipKey> make() const {
        std::set<double> times{0, clip_.duration};
        for (const Track& track : clip_.tracks) times.insert(track.times.begin(), track.times.end());
        std::vector<ClipKey> found, piece{{0, clip_.pose(0)}};
        for (auto time = std::next(times.begin()); time != times.end(); ++time) {
            const ClipKey before{*time, clip_.pose(*time, true)};
            const ClipPose pose = clip_.pose(*time);
            addBetween(ClipKey(piece.back()), before, bisections, piece);
            if (before.pose != pose) {
                addThinned(piece, found);
                piece = {{*time, pose}};
            }
        }
        addThinned(piece, found);
        return found;
    }

private:
    /// Bisections of the time between two keys of the file.
    static constexpr int bisections = 8;

    /// How far the chord from one key to another is from a pose between them, at most.
    double error(const ClipKey& first, const ClipKey& key, const ClipKey& last) const {
        const double span = last.time - first.time, part = (key.time - first.time) / (span > 0 ? span : 1);
        const auto apart = [part](double a, double b, double own) { return a + part * (b - a) - own; };
        double most = 0, scale = 0, shapes = 0;
        for (std::size_t bone = 0; bone < boxes_.size(); ++bone) {
            BoneMatrix change;
            const BoneMatrix& own = key.pose.matrices[bone];
            for (std::size_t i = 0; i < change.size(); ++i)
                change[i] = apart(first.pose.matrices[bone][i], last.pose.matrices[bone][i], own[i]);
            for (int octant = 0; octant < 8; ++octant) {
                const Box& box = boxes_[bone];
                const Vector corner{(octant & 4 ? box.high : box.low)[0], (octant & 2 ? box.high : box.low)[1],
                                    (octant & 1 ? box.high : box.low)[2]};
                for (const double component : moved(change, corner)) most = std::max(most, std::fabs(component));
            }
            for (std::size_t axis = 0; axis < 3; ++axis)
                scale = std::max(
                    scale, std::fabs(own[4 * axis]) + std::fabs(own[4 * axis + 1]) + std::fabs(own[4 * axis + 2]));
        }
        for (std::size_t target = 0; target < targets_.size(); ++target)
            shapes +=
                std::fabs(apart(first.pose.weights[target], last.pose.weights[target], key.pose.weights[target])) *
                targets_[target];
        return most + scale * shapes;
    }

    /// Adds the poses after the first up to the last, so dense that their chords are good.
    void addBetween(const ClipKey& first, const ClipKey& last, int depth, std::vector<ClipKey>& keys) const {
        const double middle = (first.time + last.time) / 2;
        const ClipKey key{middle, clip_.pose(middle)};
        if (error(first, key, last) <= tolerance_ / 4 || depth == 0) return keys.push_back(last);
        addBetween(first, key, depth - 1, keys);
        addBetween(key, last, depth - 1, keys);
    }

    /// Adds the keys without those that are near enough to a chord of others (Ramer, Douglas and Peucker).
    void addThinned(const std::vector<ClipKey>& keys, std::vector<ClipKey>& found) const {
        std::set<std::size_t> kept{0, keys.size() - 1};
        std::vector<std::pair<std::size_t, std::size_t>> pending{{0, keys.size() - 1}};
        while (!pending.empty()) {
            const auto [first, last] = pending.back();
            pending.pop_back();
            double largest = 3 * tolerance_ / 4;
            std::size_t worst = first;
            for (std::size_t key = first + 1; key < last; ++key)
                if (const double own = error(keys[first], keys[key], keys[last]); own > largest) {
                    largest = own;
                    worst = key;
                }
            if (worst == first) continue;
            kept.insert(worst);
            pending.push_back({first, worst});
            pending.push_back({worst, last});
        }
        for (const std::size_t key : kept) found.push_back(keys[key]);
    }

    const Clip& clip_;
    const double tolerance_;
    Values targets_;          ///< what a target adds to a vertex, at most
    std::vector<Box> boxes_;  ///< of the vertices of each bone
};

/// The keys of a clip within `clipTolerance`, and the box of all of its poses.
struct BakedClip {
    std::vector<ClipKey> keys;
    Box box;

    static BakedClip of(const Clip& clip) {
        const ClipPose rest = clip.rest();
        BakedClip baked{
            KeyChooser(clip, clipTolerance * Box::of(clip.vertices(rest.matrices, rest.weights)).edge()).make(), {}};
        baked.box = boxOf(clip, baked.keys);
        return baked;
    }
};

} // namespace colonnade::mesh
