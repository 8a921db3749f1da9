// Meshes of an application, packed for a device, and the hits of its rays.
#pragma once
#include <memory>
#include <stdexcept>

#include "design.hpp"
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
    std::uint8_t mask = 0xff;
    bool isEnabled = true;
};

/// What a committed scene is to the device and to the library.
class PackedScene {
public:
    /// The faces of the enabled meshes, joined.
    PackedScene(const Design& design, const std::vector<std::unique_ptr<MeshPart>>& meshes) : gridFraction_(design.number("gridFraction")) {
        join(meshes);
        if (faces_.faces().empty()) return;
        const packer::QuantiseOptions options{Placement::scaleBits, true};
        quantised_ =
            packer::quantise(faces_.vertices().data(), faces_.vertices().size(), faces_.faces().data(), faces_.faces().size(), design.format.vertexBits, options);
        if (quantised_.faces.empty())
            throw Failure(COLONNADE_RAYS_BAD_MESH, "no face keeps an area at " + std::to_string(design.format.vertexBits) + " bits a coordinate: use a design with more");
        const std::size_t count = faces_.faces().size();
        const std::vector<std::array<mesh::Vector, 3>> normals(count);
        const packer::FaceAttributes attributes{normals.data(), masks_.data(), isClear_.data(), nullptr};
        tree_ = packer::buildTree(quantised_, attributes, design.format);
        packer_ = std::make_unique<packer::RecordPacker>(quantised_, attributes, tree_, design.format);
        checkFit(design);
        indices_ = packer_->indices();
        rotations_ = packer_->rotations();
        records_ = packer_->records();
        describe(design);
    }

    bool isEmpty() const { return faces_.faces().empty(); }
    Faces& faces() { return faces_; }
    const Faces& faces() const { return faces_; }
    const colonnade_rays_image& image() const { return image_; }
    const std::array<double, 3>& corner() const { return corner_; }
    double unit() const { return 1 / quantised_.scale; }

    std::uint32_t meshOf(std::size_t face) const { return owners_[face].first; }
    std::uint32_t faceOf(std::size_t face) const { return owners_[face].second; }
    std::uint8_t maskOf(std::size_t face) const { return masks_[face]; }
    bool isOpaque(std::size_t face) const { return isClear_[face] == 0; }

    /// The face of a packed id; all ones for an id of none.
    std::size_t faceOfId(std::uint32_t id) const {
        return id < indices_.size() && indices_[id] >= 0 ? static_cast<std::size_t>(quantised_.meshFaces[tree_.order[indices_[id]]]) : ~std::size_t{0};
    }

    /// u, v of an response by the corners of the face.
    std::array<double, 2> weightsOf(const colonnade_rays_response& response) const {
        const std::uint32_t id = response.id & ~(COLONNADE_RAYS_BACK_SIDE | COLONNADE_RAYS_NON_OPAQUE);
        const double packed[3] = {std::max(0.0, 1.0 - response.u - response.v), response.u, response.v};
        double weights[3];
        for (int i = 0; i < 3; ++i) weights[(rotations_[static_cast<std::size_t>(indices_[id])] + i) % 3] = packed[i];
        return {weights[1], weights[2]};
    }

private:
    void join(const std::vector<std::unique_ptr<MeshPart>>& meshes) {
        std::vector<mesh::Vector> vertices;
        std::vector<mesh::Face> faces;
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
                owners_.push_back({static_cast<std::uint32_t>(number), static_cast<std::uint32_t>(i)});
                masks_.push_back(part.mask);
                isClear_.push_back(!part.isOpaque.empty() && !part.isOpaque[i]);
            }
        }
        faces_ = Faces(std::move(vertices), std::move(faces));
    }

    void checkFit(const Design& design) const {
        const packer::Sections& sections = packer_->sections();
        const auto refuse = [](const char* what, std::size_t needs, std::size_t has) {
            if (needs > has)
                throw Failure(COLONNADE_RAYS_DOES_NOT_FIT, "the scene needs " + std::to_string(needs) + " " + what + ", the design has " + std::to_string(has) +
                                                               ": use one with more, or fewer faces");
        };
        refuse("records", sections.recordCount, static_cast<std::size_t>(design.number("depth")));
        if (design.format.bvh) refuse("stack entries", tree_.tree.stackBound, static_cast<std::size_t>(design.format.stackDepth));
    }

    void describe(const Design& design) {
        const packer::Sections& s = packer_->sections();
        image_ = {records_.data(), s.recordCount, design.format.recordBytes(), {}, {}, 0, 0, {}};
        const double mantissa = std::frexp(quantised_.scale, &image_.scale_exponent);
        image_.scale_mantissa = static_cast<std::uint32_t>(std::ldexp(mantissa, Placement::scaleBits));
        const int fraction = gridFraction_ + image_.scale_exponent + Placement::fractionBits;
        for (int a = 0; a < 3; ++a) {
            image_.bounds_low[a] = s.boundsLow[a];
            image_.bounds_high[a] = s.boundsHigh[a];
            const double base = std::rint(std::ldexp(quantised_.offset[a], fraction));
            if (!(std::abs(base) < std::ldexp(1.0, 62)) || std::abs(image_.scale_exponent) > 120)
                throw Failure(COLONNADE_RAYS_BAD_MESH, "the scene is too small, too large, or too far from the origin for its size: move it, or change its unit");
            image_.base[a] = static_cast<std::int64_t>(base);
            corner_[a] = std::ldexp(base, -fraction);
        }
    }

    int gridFraction_;
    Faces faces_;
    std::vector<std::pair<std::uint32_t, std::uint32_t>> owners_;
    std::vector<std::uint8_t> masks_, isClear_; // of the faces; a leaf has the mask in place of a material
    packer::QuantisedMesh quantised_;
    bvh::Bvh tree_;
    std::unique_ptr<packer::RecordPacker> packer_;
    std::vector<std::int64_t> indices_;
    std::vector<std::uint8_t> rotations_;
    std::vector<std::uint8_t> records_;
    colonnade_rays_image image_{};
    std::array<double, 3> corner_{};
};

} // namespace colonnade::rays
