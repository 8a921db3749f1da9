/// Cuts away what the alpha of a material does not show (docs/textures.md, "Alpha").
///
/// A face whose texels are all below the cutoff is dropped. One with texels on both sides is split into four, the
/// largest first, until its pieces are as small as a texel or there are too many. What is left is cut along a line,
/// which is exact without a picture.
#pragma once

#include "coverage.hpp"

namespace colonnade::mesh {

/// A shown part of a face.
struct CutPiece {
    std::int64_t owner;
    Corners weights;  ///< of the face's corners, at each corner
};

/// Cuts faces on both sides of the cutoff.
class AlphaCutter {
public:
    AlphaCutter(const Coverage& coverage, const std::vector<CoveredFace>& faces) : coverage_(coverage), faces_(faces) {}

    /// The shown parts of faces, of at most so many more; edges are not split below a length.
    std::vector<CutPiece> pieces(double smallest, std::int64_t budget) {
        std::vector<CutPiece> found, mixed;
        for (std::size_t i = 0; i < faces_.size(); ++i)
            mixed.push_back({static_cast<std::int64_t>(i), {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}});
        while (true) {
            std::vector<double> edges;
            double largest = 0;
            for (const CutPiece& piece : mixed) {
                const bool canSplit = coverage_.texels(partOf(piece).uvs) > 1;
                const double edge = canSplit ? longestEdge(piece) : 0;
                edges.push_back(edge > smallest ? edge : 0);
                largest = std::max(largest, edges.back());
            }
            isCoarse = largest > 0;
            // Pieces of about the same size at a time, the largest of them within the budget
            std::vector<std::size_t> selected;
            for (std::size_t i = 0; i < edges.size(); ++i)
                if (edges[i] > 0.5 * largest) selected.push_back(i);
            std::stable_sort(selected.begin(), selected.end(),
                             [&](std::size_t a, std::size_t b) { return edges[a] > edges[b]; });
            selected.resize(std::min(selected.size(), static_cast<std::size_t>(std::max<std::int64_t>(budget, 0) / 3)));
            if (selected.empty()) break;
            budget -= 3 * static_cast<std::int64_t>(selected.size());
            std::vector<bool> isSelected(mixed.size());
            std::vector<CutPiece> parts, rest;
            for (const std::size_t i : selected) {
                isSelected[i] = true;
                for (const Corners& weights : quarters(mixed[i].weights)) {
                    const CutPiece part{mixed[i].owner, weights};
                    const int kind = coverage_.kindOf(partOf(part));
                    if (kind > 0) found.push_back(part);
                    else if (kind == 0) parts.push_back(part);
                    else ++budget;
                }
            }
            for (std::size_t i = 0; i < mixed.size(); ++i)
                if (!isSelected[i]) rest.push_back(mixed[i]);
            rest.insert(rest.end(), parts.begin(), parts.end());
            mixed = std::move(rest);
        }
        cutStraight(mixed, found);
        return found;
    }

    bool isCoarse = false;  ///< pieces ended before they were small enough

private:
    CoveredFace partOf(const CutPiece& piece) const {
        const CoveredFace& owner = faces_[piece.owner];
        CoveredFace part{weighted(piece.weights, owner.corners), weighted(piece.weights, owner.uvs), {}};
        for (int corner = 0; corner < 3; ++corner) part.alphas[corner] = dot(piece.weights[corner], owner.alphas);
        return part;
    }

    double longestEdge(const CutPiece& piece) const {
        const Corners own = weighted(piece.weights, faces_[piece.owner].corners);
        return std::max({length(difference(own[0], own[2])), length(difference(own[1], own[0])),
                         length(difference(own[2], own[1]))});
    }

    static std::array<Corners, 4> quarters(const Corners& corners) {
        const auto middle = [&](int i, int j) {
            Vector found;
            for (int axis = 0; axis < 3; ++axis) found[axis] = (corners[i][axis] + corners[j][axis]) / 2;
            return found;
        };
        const auto& [a, b, c] = corners;
        const Vector ab = middle(0, 1), bc = middle(1, 2), ca = middle(2, 0);
        return {{{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}}};
    }

    /// Adds the shown side of pieces, cut where the alpha of their corners crosses the cutoff.
    void cutStraight(const std::vector<CutPiece>& pieces, std::vector<CutPiece>& found) const {
        std::array<std::vector<CutPiece>, 4> cut;
        for (const CutPiece& piece : pieces) {
            const CoveredFace part = partOf(piece);
            Vector above;
            int count = 0;
            for (int corner = 0; corner < 3; ++corner) {
                above[corner] = coverage_.excess(part, {double(corner == 0), double(corner == 1), double(corner == 2)});
                count += above[corner] >= 0;
            }
            if (count == 3) found.push_back(piece);
            if (count != 1 && count != 2) continue;
            // The corner that is alone comes first
            int alone = 0;
            while ((above[alone] >= 0) != (count == 1)) ++alone;
            const int next = (alone + 1) % 3, last = (alone + 2) % 3;
            const auto at = [&](int other) {
                const double share = above[alone] / (above[alone] - above[other]);
                Vector point;
                for (int axis = 0; axis < 3; ++axis)
                    point[axis] =
                        piece.weights[alone][axis] + share * (piece.weights[other][axis] - piece.weights[alone][axis]);
                return point;
            };
            const Vector first = at(next), second = at(last);
            if (count == 1) cut[0].push_back({piece.owner, {piece.weights[alone], first, second}});
            else {
                cut[1].push_back({piece.owner, {first, piece.weights[next], piece.weights[last]}});
                cut[2].push_back({piece.owner, {first, piece.weights[last], second}});
            }
        }
        for (const std::vector<CutPiece>& each : cut) found.insert(found.end(), each.begin(), each.end());
    }

    const Coverage& coverage_;
    const std::vector<CoveredFace>& faces_;
};

/// What of a material's faces is shown.
struct AlphaCut {
    std::vector<std::int8_t> kinds;  ///< of each face: 1 shown, -1 hidden, 0 by its pieces
    std::vector<CutPiece> pieces;
    std::vector<Pane> panes;         ///< of each face, meaningful for hidden ones of a blended material
    bool isCoarse, isBlended;
};

/// `paneFactor` of a blended material's alpha; nothing for a mask.
inline AlphaCut cutAlpha(Coverage& coverage, const std::vector<CoveredFace>& faces, double smallest,
                         std::int64_t budget, std::optional<double> paneFactor) {
    AlphaCut cut{{}, {}, {}, false, false};
    std::vector<CoveredFace> mixed;
    std::vector<std::int64_t> owners;
    for (const CoveredFace& face : faces) {
        cut.kinds.push_back(static_cast<std::int8_t>(coverage.kindOf(face)));
        if (cut.kinds.back() == 0) {
            owners.push_back(static_cast<std::int64_t>(cut.kinds.size()) - 1);
            mixed.push_back(face);
        }
        if (!paneFactor) continue;
        cut.isBlended = cut.isBlended || coverage.isBlended(face);
        cut.panes.push_back(cut.kinds.back() < 0 ? coverage.paneOf(face, *paneFactor) : Pane{});
    }
    AlphaCutter cutter(coverage, mixed);
    if (!mixed.empty()) cut.pieces = cutter.pieces(smallest, budget);
    for (CutPiece& piece : cut.pieces) piece.owner = owners[piece.owner];
    cut.isCoarse = cutter.isCoarse;
    return cut;
}

} // namespace colonnade::mesh
