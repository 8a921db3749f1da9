// Reads any bytes as a mesh file: the first chooses the format, the rest is the file, and for OBJ with a zero byte then
// its materials. A surface that is read is whole, and so are the arrays of a glTF document, whose buffers of other
// files are its own bytes. tools/reader-fuzz runs it.

#include <cstdio>
#include <cstdlib>

#include "mesh/files/files.hpp"
#include "mesh/files/gltf_nodes.hpp"

using namespace colonnade::mesh;

namespace {

void require(bool holds, const char* what) {
    if (holds) return;
    std::fprintf(stderr, "fuzz_files.cpp: %s\n", what);
    std::abort();
}

bool read(MeshReader& reader, Text file, Text materials) {
    if (!reader.begin(file)) return false;
    std::string name;
    for (bool isFirst = true; reader.nextLibrary(name); isFirst = false)
        if (!reader.giveLibrary(isFirst && !materials.empty() ? std::optional(materials) : std::nullopt, name))
            return false;
    if (!reader.needPictures()) return false;
    std::vector<std::int32_t> numbers;
    for (const auto& picture : reader.pictures)
        numbers.push_back(picture.name.size() % 3 == 0 ? -1 : static_cast<std::int32_t>(numbers.size()));
    return reader.finish(numbers);
}

void check(const FileSurface& surface) {
    const std::size_t count = surface.faces.size();
    for (const Face& face : surface.faces)
        for (const std::int32_t vertex : face)
            require(vertex >= 0 && static_cast<std::size_t>(vertex) < surface.vertices.size(),
                    "a face names a vertex that does not exist");
    require(surface.normals.empty() || surface.normals.size() == count, "faces have no normals");
    require(surface.colours.empty() || surface.colours.size() == count, "faces have no colours");
    require(surface.uvs.empty() || surface.uvs.size() == count, "faces have no positions");
    for (const Triangle& face : surface.uvs)
        for (const Pair& uv : face)
            require(std::fabs(uv[0]) <= maxUv + 1 && std::fabs(uv[1]) <= maxUv + 1,
                    "a position is beyond all pictures");
    require(surface.faceMaterials.empty() || surface.faceMaterials.size() == count, "faces have no materials");
    for (const std::int32_t number : surface.faceMaterials)
        require(number >= 0 && static_cast<std::size_t>(number) < surface.materials.size(),
                "a face has no such material");
    for (const FileMaterial& material : surface.materials) {
        require(material.texture < static_cast<std::int32_t>(surface.textures.size()),
                "a material has no such texture");
        for (const double value : material.albedo) require(value >= 0 && value <= 1, "an albedo is none");
        for (const double value : material.emission) require(value >= 0 && value <= 1, "an emission is none");
    }
}

/// Asks for something of a document until it needs no buffer; whether it is found.
template <class Ask> bool found(gltf::GltfDocument& document, Text bytes, const Ask& ask) {
    for (;;) {
        const gltf::Found state = ask();
        require((state == gltf::Found::refused) != document.refusal.empty(), "a refusal says nothing");
        if (state != gltf::Found::buffer) return state == gltf::Found::yes;
        require(document.give(bytes), "a buffer is not taken");
    }
}

void readDocument(Text bytes) {
    using Document = gltf::GltfDocument;
    Document whole("file");
    const bool isRead = whole.begin(bytes) && whole.checkExtensions();
    require(isRead == whole.refusal.empty(), "a refusal says nothing, or what is read has one");
    require(whole.refusal.find('\n') == std::string::npos, "a refusal has several lines");
    if (!isRead) return;
    const auto fresh = [&](auto&& use) {
        Document document("file");
        require(document.begin(bytes), "what was read is not read again");
        use(document);
    };
    for (std::size_t index = 0; index < std::min<std::size_t>(whole.count(Document::accessors), 8); ++index)
        fresh([&](Document& document) {
            gltf::Array array;
            const std::vector<double> decoded(9, 0.5);
            const gltf::Decoded given{decoded.data(), 3, 3, index % 2 == 0};
            for (const gltf::Decoded* const one : {static_cast<const gltf::Decoded*>(nullptr), &given}) {
                if (!found(document, bytes, [&] { return document.array(index, array, one); })) return;
                // Zeros take no bytes of a file
                if (array.count > (1 << 16)) continue;
                std::vector<double> values(array.count * static_cast<std::size_t>(array.width));
                array.copy(values.data());
                for (const double value : values)
                    require(!array.isWhole || value == std::nearbyint(value) || one, "an integer has a fraction");
            }
        });
    fresh([&](Document& document) {
        Nodes nodes;
        if (!gltf::NodeReader(document).readAll(nodes)) return;
        require(nodes.order.size() == nodes.parents.size() && nodes.matrices.size() == nodes.parents.size(),
                "a node has no parent or matrix");
    });
    fresh([&](Document& document) { gltf::NodeReader(document).triangles(); });
    fresh([&](Document& document) {
        std::vector<gltf::Placement> placements;
        Losses losses;
        if (!found(document, bytes,
                   [&] { return gltf::NodeReader(document).read(bytes.size() % 2 == 0, placements, losses); }))
            return;
        for (const gltf::Placement& one : placements)
            for (const Matrix& matrix : one.matrices)
                for (const double value : matrix) require(std::isfinite(value), "a transform is not finite");
    });
    std::string content;
    std::optional<std::string> file;
    for (std::size_t index = 0; index < std::min<std::size_t>(whole.count(Document::images), 8); ++index)
        fresh(
            [&](Document& document) { found(document, bytes, [&] { return document.image(index, content, file); }); });
    for (std::size_t index = 0; index < std::min<std::size_t>(whole.count(Document::bufferViews), 8); ++index)
        fresh([&](Document& document) { found(document, bytes, [&] { return document.viewBytes(index, content); }); });
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static constexpr const char* formats[]{"obj", "ply", "stl", "off"};
    if (size == 0) return 0;
    const Text bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
    if (data[0] % 5 == 4) {
        readDocument(bytes);
        return 0;
    }
    const std::size_t split = data[0] % 5 == 0 ? std::min(bytes.find('\0'), bytes.size()) : bytes.size();
    const std::unique_ptr<MeshReader> reader = readerOf(formats[data[0] % 5], "file");
    const bool isRead = read(*reader, bytes.substr(0, split), bytes.substr(std::min(split + 1, bytes.size())));
    require(isRead == reader->refusal.empty(), "a refusal says nothing, or what is read has one");
    require(reader->refusal.find('\n') == std::string::npos, "a refusal has several lines");
    if (isRead) check(reader->surface);
    for (const std::string& line : reader->losses.lines())
        require(!line.empty() && line.find('\n') == std::string::npos, "a note is no line");
    return 0;
}
