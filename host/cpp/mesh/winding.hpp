/// Winding of closed parts: counter-clockwise seen from outside.
#pragma once

#include "normals.hpp"

namespace colonnade::mesh {

/// Parts of a mesh for which it is tested whether they lie in another part.
constexpr std::size_t maxNested = 2000;

/// What a repair has to reverse.
struct Winding {
    std::vector<std::uint8_t> reversed;  ///< faces to reverse
    std::int64_t mixed = 0;              ///< closed parts whose faces disagreed
    std::int64_t inverted = 0;           ///< closed parts whose faces agreed, but pointed inward
    std::vector<std::uint8_t> isOpen;    ///< faces of open parts
};

class WindingFinder {
public:
    WindingFinder(const std::vector<Vector>& vertices, const std::vector<Face>& faces)
        : vertices_(vertices), faces_(faces), partOf_(faces.size()), sideOf_(2 * faces.size()) {}

    Winding find() {
        const std::size_t count = faces_.size();
        const std::vector<Run> runs = edgeRuns();
        DisjointSets parts(count), sides(2 * count);
        for (const Run& run : runs) {
            // Of an edge of more than two faces, no pair connects a part
            if (run.size() != 2) continue;
            const std::size_t one = run[0] / 3, other = run[1] / 3;
            const bool agrees = startOf(run[0]) != startOf(run[1]);
            parts.join(one, other);
            // Each face twice, as it is and reversed; faces that agree share a side, others share opposite ones
            sides.join(one, agrees ? other : other + count);
            sides.join(one + count, agrees ? other + count : other);
        }
        number(parts);
        for (std::size_t i = 0; i < 2 * count; ++i) sideOf_[i] = sides.find(i);

        std::vector<std::uint8_t> isClosed = closedParts(runs), isRepairable = isClosed, isMixed(first_.size()),
                                  isInward(first_.size());
        for (std::size_t i = 0; i < count; ++i)
            if (sideOf_[i] == sideOf_[i + count]) isRepairable[partOf_[i]] = false;
        Winding result;
        result.reversed.resize(count);
        for (std::size_t i = 0; i < count; ++i) {
            // Of both sides of a part, that of its first face counts as it is
            result.reversed[i] = isRepairable[partOf_[i]] && sideOf_[i] != sideOf_[first_[partOf_[i]]];
            if (result.reversed[i]) isMixed[partOf_[i]] = true;
        }
        const std::vector<double> volumes = partVolumes(result.reversed);
        for (std::size_t part = 0; part < first_.size(); ++part) {
            isInward[part] =
                isRepairable[part] && volumes[part] < 0 && (isMixed[part] || !isCavity(part, isRepairable));
            result.mixed += isMixed[part];
            result.inverted += isInward[part] && !isMixed[part];
        }
        result.isOpen.resize(count);
        for (std::size_t i = 0; i < count; ++i) {
            result.reversed[i] ^= isInward[partOf_[i]];
            result.isOpen[i] = !isClosed[partOf_[i]];
        }
        return result;
    }

private:
    /// The corners, numbered 3 · face + corner, from which an edge starts.
    using Run = std::vector<std::size_t>;

    std::int32_t startOf(std::size_t corner) const { return faces_[corner / 3][corner % 3]; }

    std::vector<Run> edgeRuns() const {
        const auto edgeOf = [&](std::size_t corner) {
            const auto [low, high] = std::minmax({startOf(corner), faces_[corner / 3][(corner % 3 + 1) % 3]});
            return std::array{low, high};
        };
        std::vector<Run> runs;
        std::array<std::int32_t, 2> edge{-1, -1};
        for (const std::int64_t corner : sortedIndices(3 * faces_.size(), [&](std::int64_t one, std::int64_t other) {
                 return edgeOf(one) < edgeOf(other);
             })) {
            if (edgeOf(corner) != edge) runs.emplace_back();
            edge = edgeOf(corner);
            runs.back().push_back(corner);
        }
        return runs;
    }

    /// Numbers the parts in the order of their first faces.
    void number(DisjointSets& parts) {
        std::vector<std::int64_t> known(faces_.size(), -1);
        for (std::size_t i = 0; i < faces_.size(); ++i) {
            std::int64_t& part = known[parts.find(i)];
            if (part < 0) {
                part = static_cast<std::int64_t>(first_.size());
                first_.push_back(i);
            }
            partOf_[i] = static_cast<std::size_t>(part);
        }
    }

    /// Whether each part has two of its faces at each of its edges.
    std::vector<std::uint8_t> closedParts(const std::vector<Run>& runs) const {
        std::vector<std::uint8_t> isClosed(first_.size(), true);
        for (const Run& run : runs)
            for (const std::size_t corner : run) {
                const std::size_t part = partOf_[corner / 3];
                if (std::count_if(run.begin(), run.end(),
                                  [&](std::size_t other) { return partOf_[other / 3] == part; }) != 2)
                    isClosed[part] = false;
            }
        return isClosed;
    }

    /// Signed volume of each part, times 6, relative to its own centre.
    std::vector<double> partVolumes(const std::vector<std::uint8_t>& reversed) const {
        const std::vector<Corners> corners = scaledCorners(vertices_, faces_);
        std::vector<Vector> centres(first_.size(), Vector{});
        std::vector<double> sizes(first_.size()), volumes(first_.size());
        for (std::size_t i = 0; i < corners.size(); ++i) {
            ++sizes[partOf_[i]];
            for (int axis = 0; axis < 3; ++axis) centres[partOf_[i]][axis] += corners[i][0][axis];
        }
        for (std::size_t part = 0; part < centres.size(); ++part)
            for (double& component : centres[part]) component /= sizes[part];
        for (std::size_t i = 0; i < corners.size(); ++i) {
            const Vector& centre = centres[partOf_[i]];
            const double volume = dot(difference(corners[i][0], centre),
                                      cross(difference(corners[i][1], centre), difference(corners[i][2], centre)));
            volumes[partOf_[i]] += reversed[i] ? -volume : volume;
        }
        return volumes;
    }

    /// The faces and the boxes of all parts, for `isCavity`.
    void findBoxes() {
        if (!facesOf_.empty()) return;
        facesOf_.resize(first_.size());
        low_.assign(first_.size(), Vector{HUGE_VAL, HUGE_VAL, HUGE_VAL});
        high_.assign(first_.size(), Vector{-HUGE_VAL, -HUGE_VAL, -HUGE_VAL});
        for (std::size_t i = 0; i < faces_.size(); ++i) {
            const std::size_t part = partOf_[i];
            facesOf_[part].push_back(i);
            for (const std::int32_t vertex : faces_[i])
                for (int axis = 0; axis < 3; ++axis) {
                    low_[part][axis] = std::min(low_[part][axis], vertices_[vertex][axis]);
                    high_[part][axis] = std::max(high_[part][axis], vertices_[vertex][axis]);
                }
        }
    }

    /// Whether a part lies in an odd number of other closed parts: it is the wall of a cavity then. So are all of too
    /// many.
    bool isCavity(std::size_t inner, const std::vector<std::uint8_t>& isRepairable) {
        if (static_cast<std::size_t>(std::count(isRepairable.begin(), isRepairable.end(), true)) > maxNested)
            return true;
        findBoxes();
        const Vector& point = vertices_[faces_[first_[inner]][0]];
        int around = 0;
        for (std::size_t part = 0; part < first_.size(); ++part) {
            bool isEnclosing = part != inner && isRepairable[part];
            for (int axis = 0; axis < 3; ++axis)
                isEnclosing =
                    isEnclosing && low_[part][axis] <= low_[inner][axis] && high_[inner][axis] <= high_[part][axis];
            if (isEnclosing) around += windingNumber(point, part);
        }
        return around % 2 != 0;
    }

    /// How often a closed part goes around a point, without its sign.
    int windingNumber(const Vector& point, std::size_t part) const {
        double angle = 0;
        for (const std::size_t face : facesOf_[part]) {
            const Vector a = difference(vertices_[faces_[face][0]], point),
                         b = difference(vertices_[faces_[face][1]], point),
                         c = difference(vertices_[faces_[face][2]], point);
            const double la = length(a), lb = length(b), lc = length(c);
            angle += fixed_order::arctan2(dot(a, cross(b, c)),
                                          la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb);
        }
        return static_cast<int>(std::abs(std::lround(angle / (2 * 3.14159265358979324))));
    }

    const std::vector<Vector>& vertices_;
    const std::vector<Face>& faces_;
    std::vector<std::size_t> partOf_, sideOf_, first_;
    std::vector<std::vector<std::size_t>> facesOf_;
    std::vector<Vector> low_, high_;
};

/// The faces of closed parts to reverse, so that all point outward.
inline Winding findWinding(const std::vector<Vector>& vertices, const std::vector<Face>& faces) {
    return WindingFinder(vertices, faces).find();
}

} // namespace colonnade::mesh
