// Meshes of an application, packed for a device, and the hits of its rays.
#pragma once
#include <memory>
#include <stdexcept>

#include "design.hpp"
#include "masks.hpp"
#include "mesh.hpp"
#include "tracer.hpp"

namespace colonnade::rays {

/// A call that fails: its status, and what to do.
struct Failure : std::runtime_error {
    int status;
    Failure(int status, const std::string& what) : std::runtime_error(what), status(status) {}
};

struct MeshPart {
    std::vector<mesh::Vector> vertices;
    std::vector<mesh::Face> faces;
    std::vector<std::uint8_t> isOpaque; ///< empty: all
    std::uint32_t mask = UINT32_MAX;
    bool isEnabled = true;
};

/// What a committed scene is to the device and to the library. After `pack` it does not change, but for the neighbours
/// of faces, which the first thread that needs them finds.
class PackedScene {
public:
    /// Rounds the faces of the enabled meshes, joined, to the grid of a design.
    PackedScene(const Design& design, const std::vector<std::unique_ptr<MeshPart>>& meshes) : design_(design) {
        join(meshes);
        if (isEmpty()) return;
        const packer::QuantiseOptions options{Placement::scaleBits, true};
        quantised_ = packer::quantise(faces_.vertices().data(), faces_.vertices().size(), faces_.faces().data(),
                                      faces_.faces().size(), design.format.vertexBits, options);
        unit_ = 1 / quantised_.scale;
        edge_ = std::ldexp(unit_, design.format.vertexBits);
        std::size_t whole = 0;
        for (std::size_t i = 0; i < faces_.faces().size(); ++i) {
            const double altitude = faces_.altitude(i);
            whole += altitude > std::ldexp(edge_, thinLog);
            slivers_ += altitude < unit_ && altitude <= std::ldexp(faces_.longestEdge(i), sliverLog);
        }
        dropped_ = whole - std::min(whole, quantised_.faces.size());
    }

    /// Faces that the grid drops, as their corners become one line; not faces so thin that rounding to double makes
    /// them lines.
    std::size_t dropped() const { return dropped_; }

    /// Why the grid is too coarse; nothing if it is not. Slivers count while there is a finer grid to try: without them
    /// the surface has cracks that are no wider.
    std::string whyTooCoarse(bool hasFiner) const {
        const std::size_t count = faces_.faces().size();
        const bool isLost = count != 0 && quantised_.faces.empty();
        const std::size_t counted = hasFiner ? dropped_ : dropped_ - std::min(dropped_, slivers_);
        if (!isLost && counted <= count / droppedShare) return {};
        return (isLost ? "no face keeps an area at "
                       : std::to_string(dropped_) + " of " + std::to_string(count) + " faces vanish at ") +
               std::to_string(design_.format.vertexBits) +
               " bits a coordinate: " + (design_.format.vertexBits < maxBits ? "use a design with more, or " : "") +
               "leave out what widens the box";
    }

    /// Makes the records; with a model, what traces them.
    void pack(bool hasModel) {
        if (isEmpty()) return;
        const std::size_t count = faces_.faces().size();
        const std::vector<std::array<mesh::Vector, 3>> normals(count);
        const packer::FaceAttributes attributes{normals.data(), masks_.data(), isClear_.data(), nullptr};
        tree_ = packer::buildTree(quantised_, attributes, design_.format);
        const packer::RecordPacker packer(quantised_, attributes, tree_, design_.format);
        checkFit(packer.sections());
        const std::vector<std::int64_t> indices = packer.indices();
        const std::vector<std::uint8_t> rotations = packer.rotations();
        faceOfId_.assign(indices.size(), noFace);
        rotationOfId_.assign(indices.size(), 0);
        for (std::size_t id = 0; id < indices.size(); ++id) {
            if (indices[id] < 0) continue;
            faceOfId_[id] =
                static_cast<std::uint32_t>(quantised_.meshFaces[tree_.order[static_cast<std::size_t>(indices[id])]]);
            rotationOfId_[id] = rotations[static_cast<std::size_t>(indices[id])];
        }
        records_ = packer.records();
        describe(packer.sections());
        const FaceTable table{faceOfId_.data(), reinterpret_cast<const std::uint8_t*>(&faces_[0]), sizeof(FaceRecord)};
        if (hasModel)
            model_ = std::make_unique<RayModel>(Numbers(design_.numbers), design_.number("directionBits"),
                                                design_.format.layouts, image_, table);
    }

    bool isEmpty() const { return faces_.faces().empty(); }
    const RayModel* model() const { return model_.get(); }
    const Design& design() const { return design_; }
    const MaskMap& masks() const { return maskMap_; }
    Faces& faces() { return faces_; }
    const Faces& faces() const { return faces_; }
    const colonnade_rays_image& image() const { return image_; }
    const std::array<double, 3>& corner() const { return corner_; }
    double unit() const { return unit_; }
    /// The box of the cube of all vertex units.
    double edge() const { return edge_; }

    std::uint32_t meshOf(std::size_t face) const { return faces_[face].mesh; }
    std::uint32_t faceOf(std::size_t face) const { return faces_[face].face; }
    std::uint32_t maskOf(std::size_t face) const { return meshMasks_[faces_[face].mesh]; }
    bool isOpaque(std::size_t face) const { return !faces_[face].isClear; }

    /// The face of a packed id; all ones for an id of none.
    std::size_t faceOfId(std::uint32_t id) const {
        return id < faceOfId_.size() && faceOfId_[id] != noFace ? faceOfId_[id] : ~std::size_t{0};
    }

    /// u, v of a response by the corners of the face.
    std::array<double, 2> weightsOf(const colonnade_rays_response& response) const {
        const std::uint32_t id = response.id & ~(COLONNADE_RAYS_BACK_SIDE | COLONNADE_RAYS_NON_OPAQUE);
        const double packed[3] = {std::max(0.0, 1.0 - response.u - response.v), response.u, response.v};
        double weights[3];
        for (int i = 0; i < 3; ++i) weights[(rotationOfId_[id] + i) % 3] = packed[i];
        return {weights[1], weights[2]};
    }

private:
    static constexpr std::uint32_t noFace = UINT32_MAX;
    /// Of the faces, one in so many may vanish.
    static constexpr std::size_t droppedShare = 100;
    /// A sliver's altitude is at most so much of its longest edge.
    static constexpr int sliverLog = -12;
    static constexpr int maxBits = 24, thinLog = -36;

    void join(const std::vector<std::unique_ptr<MeshPart>>& meshes) {
        std::vector<std::uint32_t> enabledMasks;
        for (const auto& each : meshes) {
            meshMasks_.push_back(each ? each->mask : 0);
            if (each && each->isEnabled) enabledMasks.push_back(each->mask);
        }
        maskMap_ = MaskMap(enabledMasks);
        std::vector<mesh::Vector> vertices;
        std::vector<mesh::Face> faces;
        std::vector<FaceRecord> records;
        for (std::size_t number = 0; number < meshes.size(); ++number) {
            if (!meshes[number] || !meshes[number]->isEnabled) continue;
            const MeshPart& part = *meshes[number];
            // Vertices of no face would widen the box
            std::vector<std::int32_t> indices(part.vertices.size(), -1);
            for (std::size_t i = 0; i < part.faces.size(); ++i) {
                mesh::Face face;
                for (int corner = 0; corner < 3; ++corner) {
                    std::int32_t& index = indices[part.faces[i][corner]];
                    if (index < 0) {
                        index = static_cast<std::int32_t>(vertices.size());
                        vertices.push_back(part.vertices[part.faces[i][corner]]);
                    }
                    face[corner] = index;
                }
                faces.push_back(face);
                const bool isClear = !part.isOpaque.empty() && !part.isOpaque[i];
                records.push_back({{}, static_cast<std::uint32_t>(number), static_cast<std::uint32_t>(i), isClear});
                masks_.push_back(maskMap_.of(part.mask));
                isClear_.push_back(isClear);
            }
        }
        faces_ = Faces(std::move(vertices), std::move(faces), std::move(records));
    }

    void checkFit(const packer::Sections& sections) const {
        const auto refuse = [](const char* what, std::size_t needs, std::size_t has) {
            if (needs > has)
                throw Failure(COLONNADE_RAYS_DOES_NOT_FIT, "the scene needs " + std::to_string(needs) + " " + what +
                                                               ", the design has " + std::to_string(has) +
                                                               ": use one with more, or fewer faces");
        };
        refuse("records", sections.recordCount, static_cast<std::size_t>(design_.number("depth")));
        if (design_.format.bvh)
            refuse("stack entries", tree_.tree.stackBound, static_cast<std::size_t>(design_.format.stackDepth));
    }

    void describe(const packer::Sections& s) {
        image_ = {records_.data(), s.recordCount, design_.format.recordBytes(), {}, {}, 0, 0, {}};
        const double mantissa = std::frexp(quantised_.scale, &image_.scale_exponent);
        image_.scale_mantissa = static_cast<std::uint32_t>(std::ldexp(mantissa, Placement::scaleBits));
        const int fraction = design_.number("gridFraction") + image_.scale_exponent + Placement::fractionBits;
        for (int a = 0; a < 3; ++a) {
            image_.bounds_low[a] = s.boundsLow[a];
            image_.bounds_high[a] = s.boundsHigh[a];
            const double base = std::rint(std::ldexp(quantised_.offset[a], fraction));
            if (!(std::abs(base) < std::ldexp(1.0, 62)) || std::abs(image_.scale_exponent) > 120)
                throw Failure(COLONNADE_RAYS_BAD_MESH,
                              "the scene is too small, too large, or too far from the origin for its size: move it, or "
                              "change its unit");
            image_.base[a] = static_cast<std::int64_t>(base);
            corner_[a] = std::ldexp(base, -fraction);
        }
    }

    const Design& design_;
    Faces faces_;
    std::vector<std::uint32_t> meshMasks_;
    MaskMap maskMap_;
    std::vector<std::uint8_t> masks_, isClear_; ///< of the faces; a leaf has the device's mask in place of a material
    std::size_t dropped_ = 0;
    std::size_t slivers_ = 0; ///< that the grid may drop
    double unit_ = 0, edge_ = 0;
    packer::QuantisedMesh quantised_;
    bvh::Bvh tree_;
    std::vector<std::uint32_t> faceOfId_;     ///< of each packed id
    std::vector<std::uint8_t> rotationOfId_; ///< the corner of its face that is corner 0
    std::vector<std::uint8_t> records_;
    colonnade_rays_image image_{};
    std::array<double, 3> corner_{};
    std::unique_ptr<RayModel> model_;
};

} // namespace colonnade::rays
