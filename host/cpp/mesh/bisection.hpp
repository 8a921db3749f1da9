/// Bisects the pieces of a surface on which something varies, the worst first.
#pragma once

#include "pieces.hpp"

namespace colonnade::mesh {

/// Bisects pieces at their longest edge, on both sides of it, until none has an error, edges are too short, or there
/// are so many more.
/// @param shortest length of edges that are not split
/// @param errorsFrom errors of all pieces from one on, 0 for those that may stay
template <class ErrorsFrom>
void bisectWorst(Pieces& pieces, double shortest, std::int64_t budget, ErrorsFrom errorsFrom) {
    /// Pieces are split at the same time if their errors are at least this part of the largest one.
    constexpr double near = 0.25;
    if (budget <= 1) return;
    std::vector<double> errors = errorsFrom(0);
    while (budget > 1) {
        std::vector<double> splittable(errors.size());
        for (std::size_t i = 0; i < errors.size(); ++i)
            if (pieces.longest(pieces.pieces[i]) > shortest * shortest) splittable[i] = errors[i];
        const double least = near * *std::max_element(splittable.begin(), splittable.end());
        std::vector<std::int64_t> selected;
        for (std::size_t i = 0; i < splittable.size(); ++i)
            if (splittable[i] > least) selected.push_back(static_cast<std::int64_t>(i));
        std::stable_sort(selected.begin(), selected.end(),
                         [&](std::int64_t a, std::int64_t b) { return errors[a] > errors[b]; });
        selected.resize(std::min(selected.size(), static_cast<std::size_t>(budget / 2)));
        const PieceEdges edges(pieces);
        std::vector<std::uint8_t> marked = edges.closed(selected);
        while (!selected.empty() && edges.sides(marked) > budget) {
            selected.resize(selected.size() / 2);
            marked = edges.closed(selected);
        }
        if (selected.empty()) break;
        std::vector<double> kept;
        for (std::size_t i = 0; i < errors.size(); ++i)
            if (!edges.isHit(i, marked)) kept.push_back(errors[i]);
        const std::size_t before = pieces.pieces.size();
        pieces.bisect(edges.keys(marked));
        const std::vector<double> others = errorsFrom(kept.size());
        kept.insert(kept.end(), others.begin(), others.end());
        errors = std::move(kept);
        budget -= static_cast<std::int64_t>(pieces.pieces.size() - before);
    }
}

} // namespace colonnade::mesh
