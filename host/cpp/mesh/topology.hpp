/// Vectors of meshes, and operations on indexed triangles: merging vertices and dropping faces.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

namespace colonnade::mesh {

template <class T> using Row = std::array<T, 3>;
using Vector = Row<double>;
using Face = Row<std::int32_t>;

template <class T> Row<T> difference(const Row<T>& a, const Row<T>& b) {
    return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
template <class T> Row<T> cross(const Row<T>& a, const Row<T>& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
inline double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
inline double length(const Vector& a) { return std::sqrt(dot(a, a)); }

/// A vector of any finite length scaled to length 1; zero stays zero.
inline Vector unit(const Vector& vector) {
    const double largest = std::max({std::fabs(vector[0]), std::fabs(vector[1]), std::fabs(vector[2])}),
                 scale = largest > 0 ? largest : 1;
    const Vector safe{vector[0] / scale, vector[1] / scale, vector[2] / scale};
    const double norm = length(safe), divisor = norm > 0 ? norm : 1;
    return {safe[0] / divisor, safe[1] / divisor, safe[2] / divisor};
}

/// Indices 0 … count − 1, sorted; equal ones stay in their order.
template <class Less> std::vector<std::int64_t> sortedIndices(std::size_t count, Less less) {
    std::vector<std::int64_t> order(count);
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), less);
    return order;
}

/// Distinct rows in ascending order, and each row's index among them.
template <class T> struct MergedRows {
    std::vector<Row<T>> rows;
    std::vector<std::int64_t> index;
};

template <class T> MergedRows<T> mergeRows(const Row<T>* rows, std::size_t count) {
    MergedRows<T> merged;
    merged.index.resize(count);
    for (const std::int64_t i :
         sortedIndices(count, [&](std::int64_t one, std::int64_t other) { return rows[one] < rows[other]; })) {
        if (merged.rows.empty() || merged.rows.back() != rows[i]) merged.rows.push_back(rows[i]);
        merged.index[i] = static_cast<std::int64_t>(merged.rows.size()) - 1;
    }
    return merged;
}

/// Indices of the faces to keep, ascending: with an area, and unless `keepsEqual` the first of each set of vertices.
template <class T> std::vector<std::int64_t> dropFaces(const std::vector<Row<T>>& vertices,
                                                       const std::vector<Row<std::int64_t>>& faces,
                                                       bool keepsEqual = false) {
    std::vector<std::int64_t> candidates;
    std::vector<Row<std::int64_t>> sets;
    for (std::size_t i = 0; i < faces.size(); ++i) {
        const Row<T>& corner = vertices[faces[i][0]];
        const Row<T> area = cross(difference(vertices[faces[i][1]], corner), difference(vertices[faces[i][2]], corner));
        if (area[0] == 0 && area[1] == 0 && area[2] == 0) continue;
        candidates.push_back(static_cast<std::int64_t>(i));
        sets.push_back(faces[i]);
        std::sort(sets.back().begin(), sets.back().end());
    }
    if (keepsEqual) return candidates;
    const std::vector<std::int64_t> index = mergeRows(sets.data(), sets.size()).index;
    std::vector<bool> isKnown(sets.size());
    std::vector<std::int64_t> keep;
    for (std::size_t i = 0; i < sets.size(); ++i) {
        if (!isKnown[index[i]]) keep.push_back(candidates[i]);
        isKnown[index[i]] = true;
    }
    return keep;
}

} // namespace colonnade::mesh
