#include <cstring>

#include "colonnade_clip.h"
#include "library.hpp"
#include "live/vector_map.hpp"
#include "mesh/atlas.hpp"
#include "mesh/baking.hpp"
#include "mesh/clip_faces.hpp"
#include "packer/clip_file.hpp"
#include "packer/surface_offset.hpp"
#include "srgb.hpp"

using namespace colonnade;

namespace {

/// Up to this angle, 60 degrees, edges are smooth (host/colonnade/mesh/geometry/cleaning.py).
constexpr double leastCosine = 0.5000000000000001 - 1e-9;
/// Equal frames that the live encoder takes for a still (host/colonnade/maps/live.py).
constexpr int stillRounds = 3;

using Codes = std::array<mesh::Row<std::int64_t>, 3>;

/// The codes at the corners of clean faces; at textured ones red and green are positions in the atlas.
std::vector<Codes> cornerCodes(const colonnade_mesh& mesh, const std::vector<Part>& parts,
                               const std::vector<mesh::Triangle>* uvs) {
    const double white = static_cast<double>((1 << library->number("colourBits")) - 1);
    std::vector<Codes> codes(parts.size());
    for (std::size_t i = 0; i < codes.size(); ++i) {
        const colonnade_surface& surface = mesh.surfaces[mesh.surface_of[parts[i].source]];
        if (surface.texture >= 0 && uvs) {
            const std::int64_t fraction = std::int64_t{1} << lookUp(library->textureSizes, "fractionBits"),
                               edge = lookUp(library->textureSizes, "width");
            for (int corner = 0; corner < 3; ++corner)
                for (int axis = 0; axis < 2; ++axis)
                    codes[i][corner][axis] = std::clamp<std::int64_t>(
                        static_cast<std::int64_t>(std::rint((*uvs)[i][corner][axis] * static_cast<double>(fraction))),
                        0, edge * fraction - 1);
        } else if (surface.has_colours) {
            const mesh::Corners own = mesh.colours ? parts[i].corners<mesh::Vector>(mesh.colours)
                                                   : mesh::Corners{{{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}};
            for (int at = 0; at < 9; ++at)
                codes[i][at / 3][at % 3] = static_cast<std::int64_t>(
                    std::rint(std::clamp(own[at / 3][at % 3], 0.0, 1.0) * surface.factor[at % 3] * white));
        }
    }
    return codes;
}

/// Encodes an atlas, or zeros without one, for the texture memory.
void encodeAtlas(const std::optional<mesh::Atlas>& atlas) {
    const AttributeSizes sizes = AttributeSizes::ofTexture(library->textureSizes);
    const live::VectorSizes own{static_cast<int>(sizes.tileColumns), static_cast<int>(sizes.tileRows),
                                1 << sizes.tileLog, static_cast<int>(sizes.paletteSize),
                                static_cast<int>(lookUp(library->textureSizes, "mapHeapWords"))};
    std::vector<std::uint32_t> descriptors(own.tiles());
    std::vector<std::uint64_t> palette(own.paletteSize);
    std::vector<std::uint16_t> heap(own.heapWords);
    if (atlas) {
        std::vector<std::uint8_t> codes;
        for (const mesh::Vector& colour : atlas->colours)
            for (const double value : colour)
                codes.push_back(static_cast<std::uint8_t>(std::rint(255 * srgbFromLinear(value))));
        live::VectorMap<live::ColourFields> map(own);
        for (int round = 0; round < stillRounds; ++round)
            map.encode(codes.data(), descriptors.data(), palette.data(), heap.data());
    }
    const auto store = [](const std::string& memory, const auto& words, std::size_t bytes) {
        std::vector<std::uint8_t>& into = library->textureWords["texture." + memory];
        into.clear();
        for (const auto word : words)
            for (std::size_t byte = 0; byte < bytes; ++byte)
                into.push_back(static_cast<std::uint8_t>(std::uint64_t{word} >> (8 * byte)));
        colonnade_model_load_memory(("texture." + memory).c_str(), into.data(),
                                    static_cast<std::uint32_t>(words.size()), static_cast<std::uint32_t>(bytes));
    };
    store("descriptors", descriptors, 4);
    store("palette", palette, 5);
    store("heap", heap, 2);
}

const char* checkFit(const packer::Sections& sections, const bvh::Bvh& tree) {
    const auto depth = static_cast<std::size_t>(library->number("depth"));
    if (sections.recordCount > depth)
        return refuse("the mesh needs " + std::to_string(sections.recordCount) + " records, this design has " +
                      std::to_string(depth));
    if (library->format.bvh && static_cast<int>(tree.tree.stackBound) > library->format.stackDepth)
        return refuse("the mesh needs a stack of " + std::to_string(tree.tree.stackBound) +
                      " entries, this design has " + std::to_string(library->format.stackDepth));
    return nullptr;
}

mesh::Clip clipOf(const colonnade_clip& from) {
    mesh::Clip clip;
    clip.nodes = {copied<std::int64_t>(from.parents, from.node_count),
                  copied<std::int64_t>(from.order, from.node_count),
                  copied<mesh::Matrix>(from.matrices, from.node_count),
                  copied<mesh::Vector>(from.translations, from.node_count),
                  copied<mesh::Quaternion>(from.rotations, from.node_count),
                  copied<mesh::Vector>(from.scales, from.node_count)};
    for (std::uint32_t i = 0; i < from.track_count; ++i) {
        const colonnade_track& track = from.tracks[i];
        clip.tracks.push_back(
            {track.node, static_cast<mesh::Path>(track.path), static_cast<mesh::Interpolation>(track.interpolation),
             copied<double>(track.times, track.key_count), copied<double>(track.values, track.value_count)});
        clip.duration = std::max(clip.duration, clip.tracks.back().times.back());
    }
    clip.joints = copied<std::int64_t>(from.joints, from.bone_count);
    clip.inverses = copied<mesh::Matrix>(from.inverses, from.bone_count);
    clip.positions = copied<mesh::Vector>(from.positions, from.vertex_count);
    clip.bones = copied<std::array<std::int64_t, mesh::influences>>(from.bones, from.vertex_count);
    clip.shares = copied<std::array<double, mesh::influences>>(from.weights, from.vertex_count);
    clip.morphs = {copied<std::int64_t>(from.target_nodes, from.target_count),
                   copied<std::int64_t>(from.target_places, from.target_count),
                   copied<double>(from.target_weights, from.target_count),
                   copied<std::int64_t>(from.change_targets, from.change_count),
                   copied<std::int64_t>(from.change_vertices, from.change_count),
                   copied<mesh::Vector>(from.changed_positions, from.change_count),
                   copied<mesh::Vector>(from.changed_normals, from.change_count)};
    return clip;
}

std::array<std::uint32_t, 8> formatHash() {
    std::array<std::uint32_t, 8> words;
    for (std::size_t i = 0; i < words.size(); ++i)
        words[i] = static_cast<std::uint32_t>(lookUp(library->numbers, "formatHash" + std::to_string(i)));
    return words;
}

const char* openClip() {
    const std::vector<std::uint8_t>& file = library->clipFile;
    const bool isGood = file.empty() || colonnade_clip_open(formatHash().data(), file.data(),
                                                            static_cast<std::uint32_t>(file.size())) == 0;
    return isGood ? nullptr : "the clip of the mesh is not one of this design";
}

/// The file of a clip whose records have these leaves.
std::vector<std::uint8_t> fileOf(packer::GridClip clip, std::vector<packer::ClipLeaf> leaves, std::size_t records,
                                 std::size_t depth, bool hasColours) {
    const std::map<std::string, Layout>& layouts = library->format.layouts;
    packer::orderByUse(clip, leaves);
    const int deltaBits = layouts.at("nearPair").at("body.deltas[0].x").width,
              addressBits = layouts.at("node").at("first").width;
    return packer::clipFile(clip,
                            {library->format.vertexBits, deltaBits, library->format.boxBits, addressBits,
                             hasColours ? 2 : 1, records, depth, leaves},
                            layouts, formatHash());
}

/// Puts a clean mesh, whose clip this is, in its rest pose on the grid of all poses; an error, or none.
std::string bend(const colonnade_mesh& given, Packed& next, packer::GridClip& grid) {
    if (!library->format.bvh) return "the mesh is animated, which needs a tree: this design has none";
    mesh::Clip clip = clipOf(*given.clip);
    mesh::CleanMesh& clean = next.clean;
    mesh::ClipPoints points(clip, next.parts.size());
    std::vector<mesh::Face> corners;
    for (const Part& part : next.parts) {
        mesh::Face face;
        std::memcpy(&face, given.clip_faces + 3 * given.clip_owners[part.source], sizeof face);
        corners.push_back(points.part(face, part.corners<mesh::Vector>(given.clip_weights)));
    }
    const mesh::BakedClip baked = mesh::BakedClip::of(clip);
    grid = packer::GridClipMaker({clip, clean.vertices, clean.faces, clean.normals.normals, corners}, baked,
                                 library->format.vertexBits)
               .make();
    if (!grid.error.empty()) return "the mesh: its animation " + grid.error;
    const std::vector<std::uint8_t> file = fileOf(grid, {{0, 0, 0, -1}}, 2, 1, false);
    std::vector<std::int32_t> rest(grid.rest.begin(), grid.rest.end());
    next.quantised = {std::vector<packer::Units>(grid.vertices.size()), grid.corners,
                      std::vector<std::int64_t>(grid.corners.size()), grid.scale, grid.offset};
    std::iota(next.quantised.meshFaces.begin(), next.quantised.meshFaces.end(), 0);
    std::vector<std::array<std::int16_t, 2>> codes(grid.vertices.size());
    const bool fits =
        colonnade_clip_open(formatHash().data(), file.data(), static_cast<std::uint32_t>(file.size())) == 0 &&
        colonnade_clip_skin(rest.data(), reinterpret_cast<std::int32_t (*)[3]>(next.quantised.vertices.data()),
                            reinterpret_cast<std::int16_t (*)[2]>(codes.data())) == 0;
    openClip(); // of the mesh before, which stays if this one does not fit
    if (!fits) return "the mesh: its animation does not fit this design";
    for (std::size_t face = 0; face < grid.corners.size(); ++face)
        for (int corner = 0; corner < 3; ++corner) {
            const auto& code = codes[static_cast<std::size_t>(grid.corners[face][corner])];
            clean.normals.normals[face][corner] = packer::directionOf(code[0], code[1]);
        }
    return "";
}

/// The clip file of packed records.
std::vector<std::uint8_t> packedClip(const packer::GridClip& grid, const Packed& packed, bool hasColours) {
    std::vector<packer::ClipLeaf> leaves;
    const std::vector<std::int64_t> corners = packed.packer->leafCorners();
    for (std::size_t i = 0; i < corners.size(); ++i) {
        if (i % 4 == 0) leaves.emplace_back();
        leaves.back()[i % 4] =
            corners[i] < 0
                ? -1
                : grid.corners[static_cast<std::size_t>(corners[i] / 3)][static_cast<std::size_t>(corners[i] % 3)];
    }
    return fileOf(grid, std::move(leaves), packed.packer->sections().recordCount, packed.tree.tree.depth, hasColours);
}

void describe(colonnade_packed& packed, std::uint32_t faceCount, const packer::GridClip* grid) {
    const Packed& from = *library->packed;
    packer::Sections sections = from.packer->sections();
    packed.duration = grid ? static_cast<std::int32_t>(grid->times.back()) : 0;
    if (grid) { // of all poses
        std::copy(grid->low.begin(), grid->low.end(), sections.boundsLow.begin());
        std::copy(grid->high.begin(), grid->high.end(), sections.boundsHigh.begin());
        sections.largestTriangle = 0;
        for (int axis = 0; axis < 3; ++axis)
            sections.largestTriangle = std::max(sections.largestTriangle, grid->high[axis] - grid->low[axis]);
    }
    packed.triangles = static_cast<std::int32_t>(from.tree.order.size());
    packed.record_count = static_cast<std::int32_t>(sections.recordCount);
    packed.nodes = static_cast<std::int32_t>(sections.nodes);
    packed.leaves = static_cast<std::int32_t>(sections.leaves);
    packed.has_colours = sections.recordCount > sections.nodes + sections.leaves;
    std::copy(sections.boundsLow.begin(), sections.boundsLow.end(), packed.bounds_low);
    std::copy(sections.boundsHigh.begin(), sections.boundsHigh.end(), packed.bounds_high);
    const packer::OffsetFormat format{library->number("gridFraction"), library->number("weightBits"),
                                      library->number("mantissaBits"), library->number("distanceDigits")};
    packed.shading_offset = static_cast<std::int32_t>(packer::surfaceOffset(format, sections.largestTriangle));
    packed.tree_depth = static_cast<std::int32_t>(from.tree.tree.depth);
    packed.stack_bound = static_cast<std::int32_t>(from.tree.tree.stackBound);
    packed.dropped =
        static_cast<std::int32_t>(faceCount - from.clean.sources.size() + from.parts.size() - from.tree.order.size());
    const double degrees = from.apart * 57.29577951308232;
    packed.smoothed = degrees > 3 ? static_cast<std::int32_t>(std::rint(degrees)) : 0;
    packed.flipped = static_cast<std::int32_t>(from.clean.normals.flipped);
    packed.reversed = static_cast<std::int32_t>(from.clean.winding.mixed + from.clean.winding.inverted);
    packed.replaced = static_cast<std::int32_t>(from.clean.normals.replaced + from.clean.normals.missing);
}

/// Bakes the normal maps of a clean mesh into its corner normals.
void bakeMaps(const colonnade_mesh& given, Packed& packed) {
    mesh::CleanMesh& clean = packed.clean;
    std::vector<mesh::NormalMap> maps;
    for (std::uint32_t i = 0; i < given.map_count; ++i)
        maps.emplace_back(pictureOf(given.textures[given.maps[i].texture]), given.maps[i].scale);
    std::vector<mesh::ReliefFace> relief(clean.faces.size());
    bool hasMap = false;
    for (std::size_t i = 0; i < relief.size(); ++i) {
        relief[i].map = given.map_of[clean.sources[i]];
        relief[i].uvs = packed.parts[i].corners<mesh::Pair>(given.map_uvs);
        relief[i].tangents = packed.parts[i].corners<std::array<double, 4>>(given.tangents);
        hasMap |= relief[i].map >= 0;
    }
    if (!hasMap) return;
    const std::int64_t budget = mesh::maxSplitFaces - static_cast<std::int64_t>(clean.faces.size());
    mesh::BakedMesh baked =
        mesh::NormalBaker(std::move(clean.vertices), clean.faces, std::move(clean.normals.normals), maps, relief)
            .make(budget);
    std::vector<Part> parts;
    clean.faces.clear();
    for (const mesh::Piece& piece : baked.pieces) {
        const Part& whole = packed.parts[piece.owner];
        parts.push_back({whole.source, whole.isReversed, piece.weights});
        clean.faces.push_back(piece.face);
    }
    clean.vertices = std::move(baked.vertices);
    clean.normals.normals = std::move(baked.normals);
    packed.parts = std::move(parts);
    packed.apart = baked.error;
}

} // namespace

const char* colonnade_model_rest(const colonnade_clip* from, const std::int32_t* faces, std::uint32_t faceCount,
                                 double* normals, double* vertices, std::uint8_t* isMirrored) {
    std::vector<mesh::Corners> rotated(normals ? faceCount : 0);
    if (normals) std::memcpy(rotated.data(), normals, faceCount * sizeof(mesh::Corners));
    const mesh::RestSurface found = mesh::restSurface(clipOf(*from), copied<mesh::Face>(faces, faceCount), rotated);
    if (!found.isFinite) return "the mesh: a transform of its rest pose is not finite, or too large: export it again";
    if (normals) std::memcpy(normals, rotated.data(), faceCount * sizeof(mesh::Corners));
    std::memcpy(vertices, found.vertices.data(), found.vertices.size() * sizeof(mesh::Vector));
    std::copy(found.isMirrored.begin(), found.isMirrored.end(), isMirrored);
    return nullptr;
}

const char* colonnade_model_pack(const colonnade_mesh* from, colonnade_packed* packed) {
    const colonnade_mesh& given = *from;
    mesh::RawMesh raw;
    raw.vertices.resize(given.vertex_count);
    raw.faces.resize(given.face_count);
    std::memcpy(raw.vertices.data(), given.vertices, given.vertex_count * sizeof(mesh::Vector));
    std::memcpy(raw.faces.data(), given.faces, given.face_count * sizeof(mesh::Face));
    if (given.normals) {
        raw.normals.resize(given.face_count);
        std::memcpy(raw.normals.data(), given.normals, given.face_count * sizeof(mesh::Corners));
    }
    auto next = std::make_unique<Packed>();
    next->clean = mesh::clean(raw, leastCosine, given.face_count);
    if (!next->clean.error.empty()) return refuse(next->clean.error);
    const mesh::CleanMesh& clean = next->clean;
    for (std::size_t i = 0; i < clean.faces.size(); ++i)
        next->parts.push_back({clean.sources[i], clean.winding.reversed[i] != 0, {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}});
    if (given.map_count > 0) bakeMaps(given, *next);
    packer::GridClip grid;
    library->format.bends = given.clip != nullptr;
    if (given.clip) {
        if (const std::string error = bend(given, *next, grid); !error.empty()) return refuse(error);
    } else
        next->quantised = packer::quantise(clean.vertices.data(), clean.vertices.size(), clean.faces.data(),
                                           clean.faces.size(), library->format.vertexBits);
    if (next->quantised.faces.empty()) return "no triangle keeps an area in this design's vertex units";
    std::vector<std::uint8_t> materials, isClear;
    std::vector<mesh::Triangle> uvs(clean.faces.size());
    std::vector<mesh::Paint> paints;
    bool isTextured = false, hasColours = false;
    for (std::size_t i = 0; i < clean.faces.size(); ++i) {
        const Part& part = next->parts[i];
        const colonnade_surface& surface = given.surfaces[given.surface_of[part.source]];
        materials.push_back(static_cast<std::uint8_t>(surface.entry));
        isClear.push_back(surface.is_glass != 0);
        paints.push_back({surface.texture, {surface.factor[0], surface.factor[1], surface.factor[2]}});
        isTextured |= surface.texture >= 0;
        hasColours |= surface.has_colours != 0;
        if (given.uvs) uvs[i] = part.corners<mesh::Pair>(given.uvs);
    }
    std::optional<mesh::Atlas> atlas;
    if (!library->textureSizes.empty() && isTextured) {
        std::vector<mesh::Picture<std::uint8_t>> textures;
        for (std::uint32_t i = 0; i < given.texture_count; ++i) textures.push_back(pictureOf(given.textures[i]));
        atlas =
            mesh::AtlasMaker(textures, linearCodes().data(), lookUp(library->textureSizes, "width")).make(uvs, paints);
        if (!atlas) return "the mesh has more textured materials than the atlas has tiles";
    }
    if (!library->textureSizes.empty()) encodeAtlas(atlas);
    std::vector<Codes> codes;
    if (library->format.layouts.count("colours") && (hasColours || atlas))
        codes = cornerCodes(given, next->parts, atlas ? &atlas->uvs : nullptr);
    const packer::FaceAttributes attributes{clean.normals.normals.data(), materials.data(), isClear.data(),
                                            codes.empty() ? nullptr : codes.data()};
    next->tree = packer::buildTree(next->quantised, attributes, library->format);
    next->packer = std::make_unique<packer::RecordPacker>(next->quantised, attributes, next->tree, library->format);
    if (const char* error = checkFit(next->packer->sections(), next->tree)) return error;
    library->records = next->packer->records();
    library->clipFile = given.clip ? packedClip(grid, *next, !codes.empty()) : std::vector<std::uint8_t>();
    library->packed = std::move(next);
    describe(*packed, given.face_count, given.clip ? &grid : nullptr);
    if (const char* error = openClip()) return error;
    library->device->load(library->records.data(), library->packed->packer->sections().recordCount,
                          library->format.recordBytes());
    return nullptr;
}

const char* colonnade_model_load_clip(const std::uint8_t* file, std::uint32_t bytes) {
    library->clipFile.assign(file, file + bytes);
    return openClip();
}

const char* colonnade_model_pose(std::uint32_t time, std::uint32_t* flatPairs) {
    *flatPairs = 0;
    if (library->clipFile.empty()) return nullptr;
    if (colonnade_clip_refit(time, reinterpret_cast<std::uint32_t*>(library->records.data()), flatPairs) != 0)
        return "a pose of the mesh leaves its grid";
    library->device->load(library->records.data(), library->records.size() / library->format.recordBytes(),
                          library->format.recordBytes());
    return nullptr;
}

const std::uint8_t* colonnade_model_clip(std::uint32_t* bytes) {
    *bytes = static_cast<std::uint32_t>(library->clipFile.size());
    return library->clipFile.data();
}
