/// Mesh files of one mesh without nodes: OBJ with MTL, PLY, STL and OFF, for the host and the browser tab (reader.hpp).
#pragma once

#include "mesh/files/obj.hpp"
#include "mesh/files/off.hpp"
#include "mesh/files/ply.hpp"
#include "mesh/files/stl.hpp"

namespace colonnade::mesh {

/// The reader of a format; nothing for one that has none.
inline std::unique_ptr<MeshReader> readerOf(Text format, const std::string& where) {
    if (format == "obj") return std::make_unique<ObjReader>(where);
    if (format == "ply") return std::make_unique<PlyReader>(where);
    if (format == "stl") return std::make_unique<StlReader>(where);
    if (format == "off") return std::make_unique<OffReader>(where);
    return nullptr;
}

/// The alpha of a texture of so many pixels: that of another picture at the nearest pixels, or its brightness if it has
/// none.
inline std::vector<std::uint8_t> maskOf(const Picture<std::uint8_t>& picture, const std::uint8_t* alpha,
                                        std::int64_t height, std::int64_t width) {
    std::vector<std::uint8_t> found;
    for (std::int64_t row = 0; row < height; ++row)
        for (std::int64_t column = 0; column < width; ++column) {
            const std::int64_t at = row * picture.height / height * picture.width + column * picture.width / width;
            found.push_back(alpha ? alpha[at]
                                  : *std::max_element(picture.pixels + 3 * at, picture.pixels + 3 * at + 3));
        }
    return found;
}

} // namespace colonnade::mesh
