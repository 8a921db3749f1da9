/// Bakes normal maps into corner normals: the device has normals at the corners of faces, and no maps of them.
///
/// Faces inside which a map varies are bisected at their longest edge, the worst first, on both sides of the edge, so
/// neighbours keep common vertices. The normals at the corners are then the least-squares fit to the map.
#pragma once

#include "pieces.hpp"
#include "relief.hpp"

namespace colonnade::mesh {

/// A surface whose corner normals are those of its normal maps; `pieces` in the order of the faces that they are parts of.
struct BakedMesh {
    std::vector<Vector> vertices;  ///< distinct, ascending
    std::vector<Piece> pieces;
    std::vector<Corners> normals;  ///< unit length
    double error = 0;              ///< root of the mean square of what they differ from the maps
};

class NormalBaker {
public:
    /// `normals` have unit length, or 0 for none.
    NormalBaker(std::vector<Vector> vertices, const std::vector<Face>& faces, std::vector<Corners> normals, const std::vector<NormalMap>& maps,
                const std::vector<ReliefFace>& relief)
        : maps_(maps), relief_(relief), normals_(std::move(normals)), pieces_(std::move(vertices), faces) {
        const std::vector<Vector> flat = faceNormals();
        for (std::size_t i = 0; i < normals_.size(); ++i)
            for (Vector& normal : normals_[i])
                if (normal == Vector{}) normal = flat[i];
        frames_ = framesOf(pieces_.vertices, faces, normals_, relief_);
    }

    /// The surface, of at most so many faces more.
    BakedMesh make(std::int64_t budget) {
        split(budget);
        std::stable_sort(pieces_.pieces.begin(), pieces_.pieces.end(), [](const Piece& a, const Piece& b) { return a.owner < b.owner; });
        BakedMesh baked;
        std::vector<Corners> base;
        for (const Piece& piece : pieces_.pieces) base.push_back(weighted(piece.weights, normals_[piece.owner]));
        baked.normals = fitted(base, baked.error);
        const std::vector<Vector> fronts = faceNormals();
        for (std::size_t i = 0; i < base.size(); ++i)
            for (int corner = 0; corner < 3; ++corner)
                // A normal that faces the back would be replaced when it is seen
                if (!(dot(baked.normals[i][corner], fronts[i]) > 0)) baked.normals[i][corner] = unit(base[i][corner]);
        const MergedRows<double> merged = mergeRows(pieces_.vertices.data(), pieces_.vertices.size());
        baked.vertices = merged.rows;
        baked.pieces = std::move(pieces_.pieces);
        for (Piece& piece : baked.pieces)
            for (std::int32_t& vertex : piece.face) vertex = static_cast<std::int32_t>(merged.index[vertex]);
        return baked;
    }

private:
    /// Mean square of the difference between the map and interpolated corners of a face that is not split: 2.5 degrees.
    static constexpr double flat = 2e-3;
    /// Faces are split at the same time if their errors are at least this part of the largest one.
    static constexpr double near = 0.25;
    /// Edges are not split below this part of the mesh.
    static constexpr double smallest = 1.0 / 400;
    static constexpr int fitSteps = 6;

    /// Unit normals of the pieces.
    std::vector<Vector> faceNormals() const {
        const auto [low, high] = pieces_.bounds();
        const double size = std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
        std::vector<Vector> normals;
        for (const Piece& piece : pieces_.pieces) {
            Corners scaled;
            for (int corner = 0; corner < 3; ++corner)
                for (int axis = 0; axis < 3; ++axis) scaled[corner][axis] = pieces_.vertices[piece.face[corner]][axis] / size;
            normals.push_back(unit(cross(difference(scaled[1], scaled[0]), difference(scaled[2], scaled[0]))));
        }
        return normals;
    }

    bool hasMap(const Piece& piece) const { return relief_[piece.owner].map >= 0; }

    /// Normals of a piece at points, by weights of its corners, at most of unit length. They are means over squares so wide;
    /// without a width as wide as points that fill a triangle are apart.
    std::vector<Vector> normalsAt(const Piece& piece, const std::vector<Vector>& points, std::optional<double> width = {}) const {
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
            const double spacing = width ? texels * *width / std::sqrt(pieces_.longest(piece)) : texels / std::sqrt(2.0 * static_cast<double>(points.size()));
            int exponent;
            std::frexp(std::max(spacing, 1.0), &exponent);
            level = static_cast<std::size_t>(std::max(exponent - 1, 0));
        }
        std::vector<Vector> normals;
        for (const Vector& point : points) {
            const std::array<double, 9> axes = weighted(point, frames);
            const Vector tilt = own.map < 0 ? Vector{0, 0, 1} : maps_[own.map].normal(weighted(point, uvs), level);
            Vector normal;
            for (int axis = 0; axis < 3; ++axis) normal[axis] = tilt[0] * axes[axis] + tilt[1] * axes[3 + axis] + tilt[2] * axes[6 + axis];
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

    /// Area times the mean square of what interpolated corners of pieces from one on differ from the map, 0 where little.
    std::vector<double> errorsFrom(std::size_t first, double width) const {
        const std::size_t count = pieces_.pieces.size();
        std::size_t users = 0;
        for (std::size_t i = first; i < count; ++i) users += hasMap(pieces_.pieces[i]);
        const std::vector<Vector> points = trianglePoints(stepsOf(users));
        std::vector<Vector> samples{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
        samples.insert(samples.end(), points.begin(), points.end());
        std::vector<double> errors(count - first);
        for (std::size_t i = first; i < count; ++i) {
            const Piece& piece = pieces_.pieces[i];
            if (!hasMap(piece)) continue;
            const std::vector<Vector> found = normalsAt(piece, samples, width);
            double spread = 0;
            for (std::size_t at = 0; at < points.size(); ++at) {
                const Vector apart = difference(found[3 + at], weighted(points[at], Corners{found[0], found[1], found[2]}));
                spread += dot(apart, apart);
            }
            spread /= static_cast<double>(points.size());
            errors[i - first] = spread > flat ? spread * pieces_.area(piece) : 0.0;
        }
        return errors;
    }

    /// Splits faces until their maps are nearly linear on them, edges are too short, or there are so many more.
    void split(std::int64_t budget) {
        const auto [low, high] = pieces_.bounds();
        const double shortest = std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]}) * smallest;
        double area = 0;
        for (const Piece& piece : pieces_.pieces)
            if (hasMap(piece)) area += pieces_.area(piece);
        // Half an edge of as many equal faces: finer detail is not looked for
        const double faces = static_cast<double>(pieces_.pieces.size()) + static_cast<double>(std::max<std::int64_t>(budget, 0));
        const double width = std::max(shortest, std::sqrt(area / faces) / 2);
        std::vector<double> errors = errorsFrom(0, width);
        while (budget > 1) {
            std::vector<double> splittable(errors.size());
            for (std::size_t i = 0; i < errors.size(); ++i)
                if (pieces_.longest(pieces_.pieces[i]) > shortest * shortest) splittable[i] = errors[i];
            const double least = near * *std::max_element(splittable.begin(), splittable.end());
            std::vector<std::int64_t> selected;
            for (std::size_t i = 0; i < splittable.size(); ++i)
                if (splittable[i] > least) selected.push_back(static_cast<std::int64_t>(i));
            std::stable_sort(selected.begin(), selected.end(), [&](std::int64_t a, std::int64_t b) { return errors[a] > errors[b]; });
            selected.resize(std::min(selected.size(), static_cast<std::size_t>(budget / 2)));
            const PieceEdges edges(pieces_);
            std::vector<std::uint8_t> marked = edges.closed(selected);
            while (!selected.empty() && edges.sides(marked) > budget) {
                selected.resize(selected.size() / 2);
                marked = edges.closed(selected);
            }
            if (selected.empty()) break;
            std::vector<double> kept;
            for (std::size_t i = 0; i < errors.size(); ++i)
                if (!edges.isHit(i, marked)) kept.push_back(errors[i]);
            const std::size_t before = pieces_.pieces.size();
            pieces_.bisect(edges.keys(marked));
            const std::vector<double> others = errorsFrom(kept.size(), width);
            kept.insert(kept.end(), others.begin(), others.end());
            errors = std::move(kept);
            budget -= static_cast<std::int64_t>(pieces_.pieces.size() - before);
        }
    }

    /// Normals at the corners. Those of one vertex and base normal are equal; where no face of theirs has a map, the base normal.
    std::vector<Corners> fitted(const std::vector<Corners>& base, double& error) const {
        const std::vector<Piece>& pieces = pieces_.pieces;
        std::vector<std::array<double, 4>> keys;
        for (std::size_t i = 0; i < pieces.size(); ++i)
            for (int corner = 0; corner < 3; ++corner)
                keys.push_back({static_cast<double>(pieces[i].face[corner]), base[i][corner][0] + 0.0, base[i][corner][1] + 0.0, base[i][corner][2] + 0.0});
        const std::vector<std::int64_t> order = sortedIndices(keys.size(), [&](std::int64_t a, std::int64_t b) { return keys[a] < keys[b]; });
        std::vector<std::size_t> group(keys.size());
        std::size_t groups = 0;
        for (std::size_t i = 0; i < order.size(); ++i) {
            if (i > 0 && keys[order[i]] != keys[order[i - 1]]) ++groups;
            group[order[i]] = groups;
        }
        std::vector<std::uint8_t> isTouched(groups + 1);
        for (std::size_t i = 0; i < keys.size(); ++i) isTouched[group[i]] |= hasMap(pieces[i / 3]);
        std::vector<std::size_t> users;
        for (std::size_t i = 0; i < pieces.size(); ++i)
            if (isTouched[group[3 * i]] || isTouched[group[3 * i + 1]] || isTouched[group[3 * i + 2]]) users.push_back(i);
        const std::vector<Vector> points = trianglePoints(stepsOf(users.size()));
        std::vector<std::vector<Vector>> targets;
        std::vector<double> areas, totals(isTouched.size());
        double share = 0;
        for (const Vector& point : points) share += point[0];
        for (const std::size_t i : users) {
            targets.push_back(normalsAt(pieces[i], points));
            areas.push_back(pieces_.area(pieces[i]));
            for (int corner = 0; corner < 3; ++corner) totals[group[3 * i + corner]] += areas.back() * share;
        }
        std::vector<Vector> fit(isTouched.size());
        const auto cornersOf = [&](std::size_t i) { return Corners{fit[group[3 * i]], fit[group[3 * i + 1]], fit[group[3 * i + 2]]}; };
        for (int step = 0; step < fitSteps; ++step) {
            std::vector<Vector> sums(fit.size());
            for (std::size_t user = 0; user < users.size(); ++user) {
                const Corners own = cornersOf(users[user]);
                Corners moments{};
                for (std::size_t at = 0; at < points.size(); ++at) {
                    const Vector left = difference(targets[user][at], weighted(points[at], own));
                    for (int corner = 0; corner < 3; ++corner)
                        for (int axis = 0; axis < 3; ++axis) moments[corner][axis] += points[at][corner] * left[axis];
                }
                for (int corner = 0; corner < 3; ++corner)
                    for (int axis = 0; axis < 3; ++axis) sums[group[3 * users[user] + corner]][axis] += moments[corner][axis] * areas[user];
            }
            for (std::size_t i = 0; i < fit.size(); ++i)
                for (int axis = 0; axis < 3; ++axis) fit[i][axis] += sums[i][axis] / (totals[i] > 0 ? totals[i] : 1.0);
        }
        std::vector<Corners> normals(base.size());
        for (std::size_t i = 0; i < keys.size(); ++i) normals[i / 3][i % 3] = isTouched[group[i]] ? unit(fit[group[i]]) : unit(base[i / 3][i % 3]);
        double squares = 0, area = 0;
        for (std::size_t user = 0; user < users.size(); ++user) {
            if (!hasMap(pieces[users[user]])) continue;
            double own = 0;
            for (std::size_t at = 0; at < points.size(); ++at) {
                const Vector& target = targets[user][at];
                const Vector apart = difference(target, unit(weighted(points[at], normals[users[user]])));
                // The mean of unit normals is as short as they differ
                own += dot(apart, apart) + 1.0 - dot(target, target);
            }
            squares += own / static_cast<double>(points.size()) * areas[user];
            area += areas[user];
        }
        error = std::sqrt(std::max(squares / std::max(area, 1e-300), 0.0));
        return normals;
    }

    const std::vector<NormalMap>& maps_;
    const std::vector<ReliefFace>& relief_;
    std::vector<Corners> normals_;
    std::vector<Frames> frames_;
    Pieces pieces_;
};

} // namespace colonnade::mesh
