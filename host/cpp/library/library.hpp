/// What the functions of colonnade_model.h share: the design that is open, and the mesh that it shows.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "colonnade_model.h"
#include "mesh/cleaning.hpp"
#include "mesh/relief.hpp"
#include "mesh/texture.hpp"
#include "model/frame.hpp"
#include "packer/records.hpp"

namespace colonnade {

struct Register {
    std::string name;
    std::uint32_t address, words;
    int width;
    bool isSigned;
};

/// What a packed face is of a face of the mesh: the whole, or a part by weights of its corners.
struct Part {
    std::int64_t source;
    bool isReversed;
    mesh::Corners weights;

    /// Values at its corners, of three for each face of the mesh.
    template <class Value> std::array<Value, 3> corners(const double* values) const {
        std::array<Value, 3> own;
        std::memcpy(&own, values + 3 * own[0].size() * source, sizeof own);
        if (isReversed) std::reverse(own.begin(), own.end());
        return mesh::weighted(weights, own);
    }
};

/// A mesh and what its records were made of; the packer refers to the others.
struct Packed {
    mesh::CleanMesh clean;
    std::vector<Part> parts;  ///< of each face
    double apart = 0;         ///< of corner normals and normal maps, radians
    packer::QuantisedMesh quantised;
    bvh::Bvh tree;
    std::unique_ptr<packer::RecordPacker> packer;
};

struct Library {
    std::map<std::string, std::int64_t> numbers;
    packer::RecordFormat format;
    std::vector<Register> registers;
    std::vector<std::uint32_t> words;
    Registers limits;
    std::map<std::string, std::int64_t> mapSizes, textureSizes;
    std::map<std::string, Layout> mapLayouts, textureLayouts;
    std::unique_ptr<AttributeImage> maps;
    std::unique_ptr<TextureImage> texture;
    std::map<std::string, std::vector<std::uint8_t>> textureWords;
    std::unique_ptr<Device> device;
    std::unique_ptr<Packed> packed;
    std::vector<std::uint8_t> records, clipFile;
    std::string error;
    std::array<double, 11> counters;
    std::vector<RayStep> steps;
    std::vector<colonnade_step> result;

    int number(const char* name) const { return static_cast<int>(lookUp(numbers, name)); }
};

/// The open design.
extern std::unique_ptr<Library> library;

/// Keeps an error for the caller.
const char* refuse(const std::string& error);

/// Linear values of the codes of sRGB.
const std::array<double, 256>& linearCodes();

/// Values of C, in the types of C++.
template <class To, class From> std::vector<To> copied(const From* from, std::uint32_t count) {
    std::vector<To> values(count);
    if constexpr (std::is_arithmetic_v<To>) std::copy(from, from + count, values.begin());
    else
        for (std::uint32_t i = 0; i < count; ++i)
            std::copy(from + values[i].size() * i, from + values[i].size() * (i + 1), values[i].begin());
    return values;
}

mesh::Picture<std::uint8_t> pictureOf(const colonnade_texture& texture);

} // namespace colonnade
