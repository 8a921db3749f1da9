/// Parts of faces, which are bisected so that the surface stays watertight (Rivara 1984).
#pragma once

#include "normals.hpp"

namespace colonnade::mesh {

/// Faces of a mesh that is split, at most (host/colonnade/mesh/geometry/topology.py).
constexpr std::int64_t maxSplitFaces = 49152;

struct Piece {
    Face face;
    std::int64_t owner;  ///< the face that it is a part of
    Corners weights;     ///< of the owner's corners, at each corner
};

/// An edge from a corner to the next, equal for both its faces.
using EdgeKey = std::array<std::int32_t, 2>;

inline std::array<EdgeKey, 3> edgesOf(const Face& face) {
    std::array<EdgeKey, 3> edges;
    for (int corner = 0; corner < 3; ++corner) {
        const auto [low, high] = std::minmax({face[corner], face[(corner + 1) % 3]});
        edges[corner] = {low, high};
    }
    return edges;
}

class Pieces {
public:
    Pieces(std::vector<Vector> points, const std::vector<Face>& faces) : vertices(std::move(points)) {
        for (const Face& face : faces)
            pieces.push_back({face, static_cast<std::int64_t>(pieces.size()), {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}});
    }

    std::array<Vector, 2> bounds() const {
        std::array<Vector, 2> box{vertices[0], vertices[0]};
        for (const Vector& vertex : vertices)
            for (int axis = 0; axis < 3; ++axis) {
                box[0][axis] = std::min(box[0][axis], vertex[axis]);
                box[1][axis] = std::max(box[1][axis], vertex[axis]);
            }
        return box;
    }

    /// Length of edges that are not split: 1/400 of the surface.
    double shortest() const {
        const auto [low, high] = bounds();
        return std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]}) * (1.0 / 400);
    }

    /// Squares of the lengths of the edges from each corner to the next.
    Vector squares(const Piece& piece) const {
        Vector found;
        for (int corner = 0; corner < 3; ++corner) {
            const Vector edge = difference(vertices[piece.face[(corner + 1) % 3]], vertices[piece.face[corner]]);
            found[corner] = dot(edge, edge);
        }
        return found;
    }

    /// The square of the length of the longest edge.
    double longest(const Piece& piece) const {
        const Vector own = squares(piece);
        return std::max({own[0], own[1], own[2]});
    }

    /// Twice the area.
    double area(const Piece& piece) const {
        const Vector& corner = vertices[piece.face[0]];
        return length(cross(difference(vertices[piece.face[1]], corner), difference(vertices[piece.face[2]], corner)));
    }

    /// Bisects all faces with edges of these, ascending; those that stay come first.
    void bisect(const std::vector<EdgeKey>& marked) {
        const auto count = static_cast<std::int32_t>(vertices.size());
        for (const EdgeKey& edge : marked) {
            Vector middle;
            for (int axis = 0; axis < 3; ++axis) middle[axis] = (vertices[edge[0]][axis] + vertices[edge[1]][axis]) / 2;
            vertices.push_back(middle);
        }
        std::vector<Piece> done, rest = std::move(pieces);
        while (!rest.empty()) {
            std::vector<Piece> left, right;
            for (const Piece& piece : rest) {
                // The longest of its marked edges first; its parts have the others
                const std::array<EdgeKey, 3> edges = edgesOf(piece.face);
                const Vector own = squares(piece);
                int first = -1;
                for (int corner = 0; corner < 3; ++corner)
                    if ((first < 0 || own[corner] > own[first]) &&
                        std::binary_search(marked.begin(), marked.end(), edges[corner]))
                        first = corner;
                if (first < 0) {
                    done.push_back(piece);
                    continue;
                }
                const int second = (first + 1) % 3, third = (first + 2) % 3;
                const auto middle =
                    count + static_cast<std::int32_t>(std::lower_bound(marked.begin(), marked.end(), edges[first]) -
                                                      marked.begin());
                Vector half;
                for (int axis = 0; axis < 3; ++axis)
                    half[axis] = (piece.weights[first][axis] + piece.weights[second][axis]) / 2;
                left.push_back({{piece.face[first], middle, piece.face[third]},
                                piece.owner,
                                {piece.weights[first], half, piece.weights[third]}});
                right.push_back({{middle, piece.face[second], piece.face[third]},
                                 piece.owner,
                                 {half, piece.weights[second], piece.weights[third]}});
            }
            rest = std::move(left);
            rest.insert(rest.end(), right.begin(), right.end());
        }
        pieces = std::move(done);
    }

    /// Orders the pieces by the faces that they are parts of.
    void sort() {
        std::stable_sort(pieces.begin(), pieces.end(),
                         [](const Piece& a, const Piece& b) { return a.owner < b.owner; });
    }

    std::vector<Vector> vertices;
    std::vector<Piece> pieces;
};

/// The edges of pieces, by number, ascending; which of them are marked is a byte for each.
class PieceEdges {
public:
    explicit PieceEdges(const Pieces& from) : numbers_(from.pieces.size()), longest_(from.pieces.size()) {
        std::vector<EdgeKey> all;
        for (const Piece& piece : from.pieces)
            for (const EdgeKey& edge : edgesOf(piece.face)) all.push_back(edge);
        for (const std::int64_t i :
             sortedIndices(all.size(), [&](std::int64_t a, std::int64_t b) { return all[a] < all[b]; })) {
            if (keys_.empty() || keys_.back() != all[i]) keys_.push_back(all[i]);
            numbers_[i / 3][i % 3] = keys_.size() - 1;
        }
        for (std::size_t i = 0; i < longest_.size(); ++i) {
            const Vector squares = from.squares(from.pieces[i]);
            longest_[i] = numbers_[i][std::max_element(squares.begin(), squares.end()) - squares.begin()];
        }
    }

    bool isHit(std::size_t piece, const std::vector<std::uint8_t>& marked) const {
        return marked[numbers_[piece][0]] || marked[numbers_[piece][1]] || marked[numbers_[piece][2]];
    }

    /// The longest edges of these pieces, and those of all pieces that have one: so pieces do not become slivers.
    std::vector<std::uint8_t> closed(const std::vector<std::int64_t>& selected) const {
        std::vector<std::uint8_t> marked(keys_.size());
        for (const std::int64_t piece : selected) marked[longest_[piece]] = 1;
        for (bool isDone = false; !isDone;) {
            isDone = true;
            for (std::size_t i = 0; i < longest_.size(); ++i)
                if (!marked[longest_[i]] && isHit(i, marked)) {
                    marked[longest_[i]] = 1;
                    isDone = false;
                }
        }
        return marked;
    }

    /// How many pieces have marked edges, one for each edge.
    std::int64_t sides(const std::vector<std::uint8_t>& marked) const {
        std::int64_t count = 0;
        for (const auto& own : numbers_)
            for (const std::size_t edge : own) count += marked[edge];
        return count;
    }

    std::vector<EdgeKey> keys(const std::vector<std::uint8_t>& marked) const {
        std::vector<EdgeKey> found;
        for (std::size_t i = 0; i < keys_.size(); ++i)
            if (marked[i]) found.push_back(keys_[i]);
        return found;
    }

private:
    std::vector<EdgeKey> keys_;
    std::vector<std::array<std::size_t, 3>> numbers_;
    std::vector<std::size_t> longest_;
};

} // namespace colonnade::mesh
