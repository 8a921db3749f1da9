/// What a mesh file holds and a picture does not show: of each kind a line, its number and what is done instead.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace colonnade::mesh {

/// A kind of content that is not shown: subject and verb of the line, in the singular and the plural, and what is done
/// instead.
struct Loss {
    const char *one, *several, *instead;
};

namespace lost {
inline constexpr const char *onlyFaces = "only faces are rendered", *isOpaque = "transparency is not rendered",
                            *isPlain = "surfaces have their base colour",
                            *isDefault = "faces have the default material";
inline constexpr Loss lines{"line primitive is not shown", "line primitives are not shown", onlyFaces};
inline constexpr Loss points{"point primitive is not shown", "point primitives are not shown", onlyFaces};
inline constexpr Loss curves{"free-form curve or surface is not shown", "free-form curves and surfaces are not shown",
                             onlyFaces};
inline constexpr Loss groups{"smoothing group is not used", "smoothing groups are not used",
                             "edges are smooth up to the crease angle"};
inline constexpr Loss missing{"corner has no normal", "corners have no normal", "normals are computed from the faces"};
inline constexpr Loss alpha{"partly transparent vertex is opaque", "partly transparent vertices are opaque", isOpaque};
inline constexpr Loss faceAlpha{"partly transparent face is opaque", "partly transparent faces are opaque", isOpaque};
inline constexpr Loss clippedColours{"colour of a vertex is clipped", "colours of vertices are clipped",
                                     "colours are from 0 to 1"};
inline constexpr Loss darkColours{"colour of a vertex is black", "colours of vertices are black",
                                  "colours are finite numbers"};
inline constexpr Loss someColours{"colour of a vertex is not shown", "colours of vertices are not shown",
                                  "not all vertices have one"};
inline constexpr Loss texturedColours{"colour of a textured face is not shown",
                                      "colours of textured faces are not shown", "textures are"};
inline constexpr Loss noUvs{"face of a textured material is untextured", "faces of a textured material are untextured",
                            "texture coordinates are missing"};
inline constexpr Loss shortFaces{"face of fewer than three corners is left out",
                                 "faces of fewer than three corners are left out", "they have no area"};
inline constexpr Loss crossed{"polygon crosses or folds over itself", "polygons cross or fold over themselves",
                              "triangles may overlap"};
inline constexpr Loss surplus{"value beyond those of the header is not read",
                              "values beyond those of the header are not read", "a row has those of the header"};
inline constexpr Loss spareBytes{"byte after the last facet is not read", "bytes after the last facet are not read",
                                 "the header has the number of facets"};
inline constexpr Loss facetColours{"facet colour is not shown", "facet colours are not shown",
                                   "STL has no standard for them"};
inline constexpr Loss noMaterials{"file of materials is missing", "files of materials are missing", isDefault};
inline constexpr Loss unknownMaterials{"material name is not defined", "material names are not defined", isDefault};
inline constexpr Loss otherMaps{"texture map is not shown", "texture maps are not shown", "only map_Kd is"};
inline constexpr Loss mapOptions{"option of a texture map is not used", "options of texture maps are not used",
                                 "only -s, -o and -clamp are"};
inline constexpr Loss emission{"emissive mirror or glass is not emitting",
                               "emissive mirrors or glasses are not emitting", "only diffuse surfaces do"};
inline constexpr Loss bright{"material shines brighter than the hardware shows",
                             "materials shine brighter than the hardware shows",
                             "the largest channel of an emission is 1"};
inline constexpr Loss partlyGlass{"partly transmissive material is rounded to opaque or glass",
                                  "partly transmissive materials are rounded to opaque or glass", "above 1/2 is glass"};
inline constexpr Loss blended{"partly transparent material is not blended",
                              "partly transparent materials are not blended",
                              "from alpha 1/2 on it is opaque, else a tinted pane or not shown"};
inline constexpr Loss highlights{"glossy material is diffuse", "glossy materials are diffuse",
                                 "highlights are not rendered"};
inline constexpr Loss negativeShininess{"material's negative Ns is taken as 0", "materials' negative Ns are taken as 0",
                                        "highlights are not rendered"};
inline constexpr Loss noValues{"value of a material is not read", "values of materials are not read",
                               "a colour has three numbers, others have one"};
inline constexpr Loss noPictures{"picture of a texture is missing", "pictures of textures are missing", isPlain};
inline constexpr Loss pictureFormats{"picture of a texture is not readable", "pictures of textures are not readable",
                                     "pictures must be PNG, JPEG or WebP, or TGA outside a browser"};
inline constexpr Loss damagedPictures{"picture of a texture is truncated or damaged",
                                      "pictures of textures are truncated or damaged", isPlain};

/// Those that other readers count, too, by their names there.
inline constexpr struct {
    const char* name;
    const Loss* loss;
} shared[]{{"LINES", &lines},
           {"POINTS", &points},
           {"MISSING", &missing},
           {"ALPHA", &alpha},
           {"CLIPPED_COLOURS", &clippedColours},
           {"TEXTURED_COLOURS", &texturedColours},
           {"NO_UVS", &noUvs},
           {"SHORT_FACES", &shortFaces},
           {"CROSSED", &crossed},
           {"EMISSION", &emission},
           {"BRIGHT", &bright},
           {"PARTLY_GLASS", &partlyGlass},
           {"BLENDED", &blended},
           {"NO_PICTURES", &noPictures},
           {"PICTURE_FORMATS", &pictureFormats},
           {"DAMAGED_PICTURES", &damagedPictures}};
} // namespace lost

/// A number with a comma before each group of three digits.
inline std::string grouped(std::uint64_t number) {
    std::string text = std::to_string(number);
    for (std::size_t end = text.size(); end > 3; end -= 3) text.insert(end - 3, ",");
    return text;
}

/// Text of a file in a line: white space is a blank, other control characters are escaped, of a long text there is the
/// beginning.
inline std::string oneLine(const std::string& text) {
    constexpr std::size_t most = 1000;
    static constexpr char digits[] = "0123456789abcdef";
    std::string line;
    for (const char one : text.substr(0, most)) {
        const auto code = static_cast<unsigned char>(one);
        if (code >= 0x20 && code != 0x7f) line += one;
        else if (code >= '\t' && code <= '\r') line += ' ';
        else line += {'\\', 'x', digits[code >> 4], digits[code & 15]};
    }
    return line;
}

/// What one file loses, in the order of discovery; of each kind its number, and what the first is named.
class Losses {
public:
    struct Entry {
        std::string one, several, instead;
        std::uint64_t count;
        std::string name;
    };

    /// Counts a loss; none for a count of 0. `instead` replaces that of the kind.
    void add(const Loss& loss, std::uint64_t count = 1, const std::string& name = "", const std::string& instead = "") {
        if (count == 0) return;
        for (Entry& entry : entries)
            if (entry.one == loss.one) {
                entry.count += count;
                return;
            }
        entries.push_back(
            {loss.one, loss.several, instead.empty() ? loss.instead : oneLine(instead), count, oneLine(name)});
    }

    /// One line for each kind.
    std::vector<std::string> lines() const {
        std::vector<std::string> found;
        for (const Entry& entry : entries) {
            std::string line = grouped(entry.count) + " " + (entry.count == 1 ? entry.one : entry.several);
            if (!entry.name.empty()) line += (entry.count == 1 ? " (" : " (the first is ") + entry.name + ")";
            found.push_back(line + ": " + entry.instead);
        }
        return found;
    }

    std::vector<Entry> entries;
};

} // namespace colonnade::mesh
