/// Bakes normal maps into corner normals: the device has normals at the corners of faces, and no maps of them.
///
/// Faces inside which a map varies are bisected at their longest edge, the worst first, on both sides of the edge, so
/// neighbours keep common vertices. The normals at the corners are then the least-squares fit to the map.
#pragma once

#include "bisection.hpp"
#include "relief_surface.hpp"

namespace colonnade::mesh {

/// A surface whose corner normals are those of its normal maps; `pieces` in the order of the faces that they are parts
/// of.
struct BakedMesh {
    std::vector<Vector> vertices;  ///< distinct, ascending
    std::vector<Piece> pieces;
    std::vector<Corners> normals;  ///< unit length
    double error = 0;              ///< root of the mean square of what they differ from the maps
};

class NormalBaker {
public:
    /// `normals` have unit length, or 0 for none.
    NormalBaker(std::vector<Vector> vertices, const std::vector<Face>& faces, std::vector<Corners> normals,
                const std::vector<NormalMap>& maps, const std::vector<ReliefFace>& relief)
        : surface_(std::move(vertices), faces, std::move(normals), maps, relief) {}

    /// The surface, of at most so many faces more.
    BakedMesh make(std::int64_t budget) {
        split(budget);
        surface_.pieces.sort();
        BakedMesh baked;
        std::vector<Corners> base;
        for (const Piece& piece : surface_.pieces.pieces) base.push_back(surface_.smooth(piece));
        baked.normals = fitted(base, baked.error);
        const std::vector<Vector> fronts = surface_.faceNormals();
        for (std::size_t i = 0; i < base.size(); ++i)
            for (int corner = 0; corner < 3; ++corner)
                // A normal that faces the back would be replaced when it is seen
                if (!(dot(baked.normals[i][corner], fronts[i]) > 0)) baked.normals[i][corner] = unit(base[i][corner]);
        const MergedRows<double> merged = mergeRows(surface_.pieces.vertices.data(), surface_.pieces.vertices.size());
        baked.vertices = merged.rows;
        baked.pieces = std::move(surface_.pieces.pieces);
        for (Piece& piece : baked.pieces)
            for (std::int32_t& vertex : piece.face) vertex = static_cast<std::int32_t>(merged.index[vertex]);
        return baked;
    }

private:
    /// Mean square of the difference between the map and interpolated corners of a face that is not split: 2.5 degrees.
    static constexpr double flat = 2e-3;
    static constexpr int fitSteps = 6;

    /// Area times the mean square of what interpolated corners of pieces from one on differ from the map, 0 where
    /// little.
    std::vector<double> errorsFrom(std::size_t first, double width) const {
        const std::size_t count = surface_.pieces.pieces.size();
        std::size_t users = 0;
        for (std::size_t i = first; i < count; ++i) users += surface_.hasMap(surface_.pieces.pieces[i]);
        const std::vector<Vector> points = trianglePoints(ReliefSurface::stepsOf(users));
        std::vector<Vector> samples{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
        samples.insert(samples.end(), points.begin(), points.end());
        std::vector<double> errors(count - first);
        for (std::size_t i = first; i < count; ++i) {
            const Piece& piece = surface_.pieces.pieces[i];
            if (!surface_.hasMap(piece)) continue;
            const std::vector<Vector> found = surface_.normalsAt(piece, samples, width);
            double spread = 0;
            for (std::size_t at = 0; at < points.size(); ++at) {
                const Vector apart =
                    difference(found[3 + at], weighted(points[at], Corners{found[0], found[1], found[2]}));
                spread += dot(apart, apart);
            }
            spread /= static_cast<double>(points.size());
            errors[i - first] = spread > flat ? spread * surface_.pieces.area(piece) : 0.0;
        }
        return errors;
    }

    /// Splits faces until their maps are nearly linear on them, edges are too short, or there are so many more.
    void split(std::int64_t budget) {
        const double shortest = surface_.pieces.shortest();
        double area = 0;
        for (const Piece& piece : surface_.pieces.pieces)
            if (surface_.hasMap(piece)) area += surface_.pieces.area(piece);
        // Half an edge of as many equal faces: finer detail is not looked for
        const double faces =
            static_cast<double>(surface_.pieces.pieces.size()) + static_cast<double>(std::max<std::int64_t>(budget, 0));
        const double width = std::max(shortest, std::sqrt(area / faces) / 2);
        bisectWorst(surface_.pieces, shortest, budget, [&](std::size_t first) { return errorsFrom(first, width); });
    }

    /// Normals at the corners. Those of one vertex and base normal are equal; where no face of theirs has a map, the
    /// base normal.
    std::vector<Corners> fitted(const std::vector<Corners>& base, double& error) const {
        const std::vector<Piece>& pieces = surface_.pieces.pieces;
        std::vector<std::array<double, 4>> keys;
        for (std::size_t i = 0; i < pieces.size(); ++i)
            for (int corner = 0; corner < 3; ++corner)
                keys.push_back({static_cast<double>(pieces[i].face[corner]), base[i][corner][0] + 0.0,
                                base[i][corner][1] + 0.0, base[i][corner][2] + 0.0});
        const std::vector<std::int64_t> order =
            sortedIndices(keys.size(), [&](std::int64_t a, std::int64_t b) { return keys[a] < keys[b]; });
        std::vector<std::size_t> group(keys.size());
        std::size_t groups = 0;
        for (std::size_t i = 0; i < order.size(); ++i) {
            if (i > 0 && keys[order[i]] != keys[order[i - 1]]) ++groups;
            group[order[i]] = groups;
        }
        std::vector<std::uint8_t> isTouched(groups + 1);
        for (std::size_t i = 0; i < keys.size(); ++i) isTouched[group[i]] |= surface_.hasMap(pieces[i / 3]);
        std::vector<std::size_t> users;
        for (std::size_t i = 0; i < pieces.size(); ++i)
            if (isTouched[group[3 * i]] || isTouched[group[3 * i + 1]] || isTouched[group[3 * i + 2]])
                users.push_back(i);
        const std::vector<Vector> points = trianglePoints(ReliefSurface::stepsOf(users.size()));
        std::vector<std::vector<Vector>> targets;
        std::vector<double> areas, totals(isTouched.size());
        double share = 0;
        for (const Vector& point : points) share += point[0];
        for (const std::size_t i : users) {
            targets.push_back(surface_.normalsAt(pieces[i], points));
            areas.push_back(surface_.pieces.area(pieces[i]));
            for (int corner = 0; corner < 3; ++corner) totals[group[3 * i + corner]] += areas.back() * share;
        }
        std::vector<Vector> fit(isTouched.size());
        const auto cornersOf = [&](std::size_t i) {
            return Corners{fit[group[3 * i]], fit[group[3 * i + 1]], fit[group[3 * i + 2]]};
        };
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
                    for (int axis = 0; axis < 3; ++axis)
                        sums[group[3 * users[user] + corner]][axis] += moments[corner][axis] * areas[user];
            }
            for (std::size_t i = 0; i < fit.size(); ++i)
                for (int axis = 0; axis < 3; ++axis) fit[i][axis] += sums[i][axis] / (totals[i] > 0 ? totals[i] : 1.0);
        }
        std::vector<Corners> normals(base.size());
        for (std::size_t i = 0; i < keys.size(); ++i)
            normals[i / 3][i % 3] = isTouched[group[i]] ? unit(fit[group[i]]) : unit(base[i / 3][i % 3]);
        double squares = 0, area = 0;
        for (std::size_t user = 0; user < users.size(); ++user) {
            if (!surface_.hasMap(pieces[users[user]])) continue;
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

    ReliefSurface surface_;
};

} // namespace colonnade::mesh
