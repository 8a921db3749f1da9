/// Cuts away what the alpha of a material does not show (docs/textures.md, "Alpha").
///
/// A face whose texels are all below the cutoff is dropped. One with texels on both sides is split into four, the largest
/// first, until its pieces are as small as a texel or there are too many. What is left is cut along a line. The alpha of
/// corners multiplies that of the picture. Without a picture it is linear on a face, so the line is exact.
#pragma once

#include "../environment/nearest.hpp"
#include "pixel_boxes.hpp"
#include "relief.hpp"

namespace colonnade::mesh {

/// A face of the material: where it is, where it is in the picture, and the alpha of its corners.
struct CoveredFace {
    Corners corners;
    Triangle uvs;
    Vector alphas;
};

/// A shown part of a face.
struct CutPiece {
    std::int64_t owner;
    Corners weights;  ///< of the face's corners, at each corner
};

/// A face of which nothing is opaque, as a pane: its alpha, and the mean colour of its texture by alpha.
struct Pane {
    double alpha;
    Vector colour;
};
static_assert(sizeof(Pane) == 4 * sizeof(double));

class Coverage {
public:
    /// `alpha` has one channel, and the size of `colours`; a picture that is not there has no pixels. `factor` of alpha,
    /// which is shown from `cutoff` on.
    Coverage(const Picture<std::uint8_t>& colours, const Picture<std::uint8_t>& alpha, const double* linear, double factor, double cutoff)
        : colours_(colours), alpha_(alpha), linear_(linear), factor_(factor), least_(cutoff / std::max(factor, 1e-6)),
          size_{static_cast<double>(alpha.width), static_cast<double>(alpha.height)} {
        if (!hasPicture()) return;
        hidden_.emplace(alpha_, [&](std::int64_t x, std::int64_t y) { return !isOpaque(x, y); });
        visible_.emplace(alpha_, [&](std::int64_t x, std::int64_t y) { return isOpaque(x, y); });
    }

    /// The shown parts of faces on both sides of the cutoff, of at most so many more; edges are not split below a length.
    std::vector<CutPiece> pieces(const std::vector<CoveredFace>& faces, double smallest, std::int64_t budget) {
        std::vector<CutPiece> found, mixed;
        for (std::size_t i = 0; i < faces.size(); ++i) mixed.push_back({static_cast<std::int64_t>(i), {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}});
        while (true) {
            std::vector<double> edges;
            double largest = 0;
            for (const CutPiece& piece : mixed) {
                const bool canSplit = texels(faces, piece) > 1;
                const double edge = canSplit ? longestEdge(faces, piece) : 0;
                edges.push_back(edge > smallest ? edge : 0);
                largest = std::max(largest, edges.back());
            }
            isCoarse = largest > 0;
            // Pieces of about the same size at a time, the largest of them within the budget
            std::vector<std::size_t> selected;
            for (std::size_t i = 0; i < edges.size(); ++i)
                if (edges[i] > 0.5 * largest) selected.push_back(i);
            std::stable_sort(selected.begin(), selected.end(), [&](std::size_t a, std::size_t b) { return edges[a] > edges[b]; });
            selected.resize(std::min(selected.size(), static_cast<std::size_t>(std::max<std::int64_t>(budget, 0) / 3)));
            if (selected.empty()) break;
            budget -= 3 * static_cast<std::int64_t>(selected.size());
            std::vector<bool> isSelected(mixed.size());
            std::vector<CutPiece> parts, rest;
            for (const std::size_t i : selected) {
                isSelected[i] = true;
                for (const Corners& weights : quarters(mixed[i].weights)) {
                    const CutPiece part{mixed[i].owner, weights};
                    const int kind = kindOf(faces, part);
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
        cutStraight(faces, mixed, found);
        return found;
    }

    /// 1 for a face that is shown, -1 for one that is hidden, 0 for others.
    int kindOf(const CoveredFace& face) const { return kindOf({face}, {0, {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}}); }

    /// Whether a face shows texels, or points between its corners, that are neither opaque nor invisible.
    bool isBlended(const CoveredFace& face) {
        if (!hasPicture() || face.alphas != Vector{1, 1, 1}) {
            const auto [low, high] = std::minmax({face.alphas[0] * factor_, face.alphas[1] * factor_, face.alphas[2] * factor_});
            if (high > 0.01 && low < 0.99) return true;
        }
        if (!hasPicture()) return false;
        if (!blended_)
            blended_.emplace(alpha_, [&](std::int64_t x, std::int64_t y) {
                const double alpha = alphaAt(x, y) * factor_;
                return alpha > 2 && alpha < 253;
            });
        return blended_->within(PixelBox(face.uvs, size_)) > 0;
    }

    /// A face as a pane, whose alpha has this factor.
    Pane paneOf(const CoveredFace& face, double factor) const {
        const std::vector<Vector> points = trianglePoints(4);
        Pane pane{0, {1, 1, 1}};
        Vector sums{};
        for (const Vector& point : points) {
            const double alpha = factor * alphaAt(face, point);
            pane.alpha += alpha;
            if (!colours_.pixels) continue;
            Vector colour;
            colours_.sample(weighted(point, face.uvs).data(), [this](std::uint8_t code) { return linear_[code]; }, colour.data());
            for (int channel = 0; channel < 3; ++channel) sums[channel] += colour[channel] * alpha;
        }
        if (colours_.pixels)
            for (int channel = 0; channel < 3; ++channel) pane.colour[channel] = sums[channel] / std::max(pane.alpha, 1e-12);
        pane.alpha /= static_cast<double>(points.size());
        return pane;
    }

    /// The texture with the nearest shown colour where it is hidden, so that filters find no other.
    std::vector<std::uint8_t> filled() const {
        std::vector<std::uint8_t> pixels(colours_.pixels, colours_.pixels + 3 * colours_.width * colours_.height), missing;
        for (std::int64_t i = 0; i < alpha_.width * alpha_.height; ++i) missing.push_back(!(alpha_.pixels[i] >= least_ * 255));
        const std::vector<std::int32_t> nearest = environment::nearestKnown(missing.data(), alpha_.width, alpha_.height);
        for (std::size_t i = 0; i < nearest.size(); ++i)
            if (nearest[i] >= 0) std::copy_n(colours_.pixels + 3 * nearest[i], 3, pixels.begin() + 3 * static_cast<std::ptrdiff_t>(i));
        return pixels;
    }

    bool isCoarse = false;  ///< pieces ended before they were small enough

private:
    /// Steps of samples along an edge of a face, at most.
    static constexpr int maxSteps = 32;

    bool hasPicture() const { return alpha_.pixels != nullptr; }
    double alphaAt(std::int64_t x, std::int64_t y) const {
        return alpha_.pixels[wrapped(y, alpha_.height, alpha_.wrapV) * alpha_.width + wrapped(x, alpha_.width, alpha_.wrapU)];
    }
    bool isOpaque(std::int64_t x, std::int64_t y) const { return alphaAt(x, y) >= least_ * 255; }

    /// Alpha at a point of a face or a part of one, by the weights of its corners, without the factor.
    double alphaAt(const CoveredFace& face, const Vector& point) const {
        double alpha = 1;
        if (hasPicture()) alpha_.sample(weighted(point, face.uvs).data(), [](std::uint8_t code) { return code / 255.0; }, &alpha);
        return alpha * (point[0] * face.alphas[0] + point[1] * face.alphas[1] + point[2] * face.alphas[2]);
    }

    static CoveredFace partOf(const std::vector<CoveredFace>& faces, const CutPiece& piece) {
        const CoveredFace& owner = faces[piece.owner];
        CoveredFace part{weighted(piece.weights, owner.corners), weighted(piece.weights, owner.uvs), {}};
        for (int corner = 0; corner < 3; ++corner) part.alphas[corner] = dot(piece.weights[corner], owner.alphas);
        return part;
    }

    double texels(const Triangle& uvs) const {
        double longest = 0;
        for (int axis = 0; axis < 2 && hasPicture(); ++axis) {
            const auto [low, high] = std::minmax({uvs[0][axis] * size_[axis], uvs[1][axis] * size_[axis], uvs[2][axis] * size_[axis]});
            longest = std::max(longest, high - low);
        }
        return longest;
    }
    double texels(const std::vector<CoveredFace>& faces, const CutPiece& piece) const { return texels(weighted(piece.weights, faces[piece.owner].uvs)); }

    static double longestEdge(const std::vector<CoveredFace>& faces, const CutPiece& piece) {
        const Corners own = weighted(piece.weights, faces[piece.owner].corners);
        return std::max({length(difference(own[0], own[2])), length(difference(own[1], own[0])), length(difference(own[2], own[1]))});
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

    int kindOf(const std::vector<CoveredFace>& faces, const CutPiece& piece) const {
        const CoveredFace part = partOf(faces, piece);
        const auto share = [&](const std::vector<Vector>& points) {
            std::size_t visible = 0;
            for (const Vector& point : points) visible += alphaAt(part, point) >= least_;
            return visible == points.size() ? 1 : visible == 0 ? -1 : 0;
        };
        if (!hasPicture()) return share({{1, 0, 0}, {0, 1, 0}, {0, 0, 1}});
        if (faces[piece.owner].alphas == Vector{1, 1, 1}) {
            const PixelBox box(part.uvs, size_);
            if (!(hidden_->within(box) > 0)) return visible_->within(box) > 0 ? 1 : -1;
            if (!(visible_->within(box) > 0)) return -1;
        }
        // The box of a face is larger than the face: look at its own texels
        const double extent = texels(part.uvs);
        int steps = 2;
        while (steps < maxSteps && steps < extent) steps *= 2;
        return extent <= 2 * steps ? share(trianglePoints(steps)) : 0;
    }

    /// Adds the shown side of pieces, cut where the alpha of their corners crosses the cutoff.
    void cutStraight(const std::vector<CoveredFace>& faces, const std::vector<CutPiece>& pieces, std::vector<CutPiece>& found) const {
        std::array<std::vector<CutPiece>, 4> cut;
        for (const CutPiece& piece : pieces) {
            const CoveredFace part = partOf(faces, piece);
            Vector above;
            int count = 0;
            for (int corner = 0; corner < 3; ++corner) {
                above[corner] = alphaAt(part, {double(corner == 0), double(corner == 1), double(corner == 2)}) - least_;
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
                for (int axis = 0; axis < 3; ++axis) point[axis] = piece.weights[alone][axis] + share * (piece.weights[other][axis] - piece.weights[alone][axis]);
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

    Picture<std::uint8_t> colours_, alpha_;
    const double* linear_;
    double factor_, least_;
    Pair size_;
    std::optional<PixelCounts> hidden_, visible_, blended_;
};

/// What of a material's faces is shown.
struct AlphaCut {
    std::vector<std::int8_t> kinds;  ///< of each face: 1 shown, -1 hidden, 0 by its pieces
    std::vector<CutPiece> pieces;
    std::vector<Pane> panes;         ///< of each face, meaningful for hidden ones of a blended material
    bool isCoarse, isBlended;
};

/// `paneFactor` of a blended material's alpha; nothing for a mask.
inline AlphaCut cutAlpha(Coverage& coverage, const std::vector<CoveredFace>& faces, double smallest, std::int64_t budget, std::optional<double> paneFactor) {
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
    if (!mixed.empty()) cut.pieces = coverage.pieces(mixed, smallest, budget);
    for (CutPiece& piece : cut.pieces) piece.owner = owners[piece.owner];
    cut.isCoarse = coverage.isCoarse;
    return cut;
}

} // namespace colonnade::mesh
