#include <cstring>

#include "library.hpp"
#include "mesh/alpha_cut.hpp"
#include "mesh/emission.hpp"
#include "mesh/roughness.hpp"
#include "mesh/swatches.hpp"
#include "srgb.hpp"

namespace colonnade {

const std::array<double, 256>& linearCodes() {
    static const std::array<double, 256> values = [] {
        std::array<double, 256> linear;
        for (int code = 0; code < 256; ++code) linear[code] = linearFromSrgb(code / 255.0);
        return linear;
    }();
    return values;
}

mesh::Picture<std::uint8_t> pictureOf(const colonnade_texture& texture) {
    return {texture.pixels,
            texture.height,
            texture.width,
            3,
            static_cast<mesh::Wrap>(texture.wrap_u),
            static_cast<mesh::Wrap>(texture.wrap_v),
            texture.is_nearest != 0};
}

} // namespace colonnade

using namespace colonnade;

namespace {

/// Owners and weights of pieces, as the caller reads them.
struct PieceArrays {
    std::vector<std::int32_t> owners;
    std::vector<mesh::Corners> weights;

    template <class Piece> void assign(const std::vector<Piece>& pieces) {
        owners.clear();
        weights.clear();
        for (const Piece& piece : pieces) {
            owners.push_back(static_cast<std::int32_t>(piece.owner));
            weights.push_back(piece.weights);
        }
    }

    colonnade_pieces view() const {
        return {static_cast<std::uint32_t>(owners.size()), owners.data(),
                weights.empty() ? nullptr : weights[0][0].data()};
    }
};

PieceArrays pieceArrays;

/// A cut by alpha, as the caller reads it.
struct Cut {
    mesh::AlphaCut found;
    std::vector<std::uint8_t> filled;
};

} // namespace

const char* colonnade_model_metal(const colonnade_texture* map, const double* uvs, std::uint32_t count,
                                  const double* factors, std::uint8_t* isMetal, double* roughness) {
    for (std::uint32_t i = 0; i < count; ++i) {
        const mesh::FaceMetal face = mesh::metalOf(pictureOf(*map), uvs + 6 * i, factors);
        isMetal[i] = face.isMetal;
        roughness[i] = face.roughness;
    }
    return nullptr;
}

const char* colonnade_model_emission(const colonnade_texture* map, const double* uvs, const double* areas,
                                     std::uint32_t count, double* colours) {
    const std::vector<mesh::Rgb> found = mesh::emissionOf(pictureOf(*map), uvs, areas, count, linearCodes().data());
    std::memcpy(colours, found.data(), found.size() * sizeof found[0]);
    return nullptr;
}

const char* colonnade_model_emission_pieces(const colonnade_texture* map, const double* factors, const double* vertices,
                                            std::uint32_t vertexCount, const std::int32_t* faces,
                                            std::uint32_t faceCount, const std::uint8_t* shows, const double* uvs,
                                            std::int32_t budget, colonnade_pieces* pieces) {
    pieceArrays.assign(mesh::emissionPieces(
        pictureOf(*map), {factors[0], factors[1], factors[2]}, copied<mesh::Vector>(vertices, vertexCount),
        copied<mesh::Face>(faces, faceCount), shows, uvs, budget, linearCodes().data()));
    *pieces = pieceArrays.view();
    return nullptr;
}

const char* colonnade_model_cut(const colonnade_alpha* from, colonnade_cut* to) {
    std::vector<mesh::CoveredFace> faces(from->count);
    for (std::size_t i = 0; i < faces.size(); ++i) {
        std::memcpy(&faces[i].corners, from->corners + 9 * i, sizeof faces[i].corners);
        std::memcpy(&faces[i].uvs, from->uvs + 6 * i, sizeof faces[i].uvs);
        std::memcpy(&faces[i].alphas, from->alphas + 3 * i, sizeof faces[i].alphas);
    }
    mesh::Picture<std::uint8_t> colours{nullptr, 0, 0, 3, {}, {}, false}, alpha = colours;
    if (from->texture) colours = pictureOf(*from->texture);
    if (from->alpha) {
        alpha = colours;
        alpha.pixels = from->alpha;
        alpha.channels = 1;
    }
    mesh::Coverage coverage(colours, alpha, linearCodes().data(), from->values[0], from->values[1]);
    const std::optional<double> paneFactor = from->values[2] < 0 ? std::nullopt : std::optional(from->values[2]);
    static Cut cut;
    cut = {mesh::cutAlpha(coverage, faces, from->values[3], from->budget, paneFactor), {}};
    pieceArrays.assign(cut.found.pieces);
    const colonnade_pieces pieces = pieceArrays.view();
    if (from->alpha) cut.filled = coverage.filled();
    *to = {cut.found.kinds.data(),
           pieces.count,
           pieces.owners,
           pieces.weights,
           cut.found.panes.empty() ? nullptr : &cut.found.panes[0].alpha,
           cut.found.isCoarse,
           cut.found.isBlended,
           cut.filled.data()};
    return nullptr;
}

const char* colonnade_model_swatches(const colonnade_texture* texture, const double* uvs, std::uint32_t count,
                                     std::uint8_t* isPlain, double* colours) {
    const mesh::Swatches swatches(pictureOf(*texture), linearCodes().data());
    for (std::uint32_t i = 0; i < count; ++i) {
        mesh::Triangle own;
        std::memcpy(&own, uvs + 6 * i, sizeof own);
        const std::optional<mesh::Corners> found = swatches.colours(own);
        isPlain[i] = found.has_value();
        if (found) std::memcpy(colours + 9 * i, &*found, sizeof *found);
    }
    return nullptr;
}

const char* colonnade_model_merge(const double* values, const double* weights, const std::int32_t* kinds,
                                  std::uint32_t count, std::uint32_t left, double* merged) {
    const std::vector<double> found =
        mesh::mergedValues({values, values + count}, {weights, weights + count}, {kinds, kinds + count}, left);
    std::copy(found.begin(), found.end(), merged);
    return nullptr;
}
