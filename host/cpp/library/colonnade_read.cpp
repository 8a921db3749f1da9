#include "colonnade_read.h"

#include <list>

#include "mesh/files/files.hpp"
#include "mesh/files/gltf_nodes.hpp"
#include "mesh/teapot.hpp"

using namespace colonnade;

namespace {

std::unique_ptr<mesh::MeshReader> reader;
std::string text;
std::vector<double> materials;
std::unique_ptr<mesh::gltf::GltfDocument> document;
std::list<std::string> kept; // what the document refers to
std::string content;
mesh::Losses documentLosses;

std::uint32_t stateOf(mesh::gltf::Found found) {
    text = found == mesh::gltf::Found::buffer ? *document->bufferFile : document->refusal;
    return static_cast<std::uint32_t>(found);
}
colonnade_bytes bytesOf(mesh::Text of) {
    return {reinterpret_cast<const std::uint8_t*>(of.data()), static_cast<std::uint32_t>(of.size())};
}

const char* keep(const std::string& value) {
    text = value;
    return text.c_str();
}

const char* refusalUnless(bool isRead) { return isRead ? nullptr : reader->refusal.c_str(); }

template <class Number, class Row> const Number* numbersOf(const std::vector<Row>& rows) {
    return rows.empty() ? nullptr : reinterpret_cast<const Number*>(rows.data());
}

} // namespace

const char* colonnade_read_begin(const char* format, const char* name, const std::uint8_t* bytes, std::uint32_t count) {
    reader = mesh::readerOf(format, name);
    return refusalUnless(reader->begin({reinterpret_cast<const char*>(bytes), count}));
}

const char* colonnade_read_library(void) {
    std::string name;
    return reader->nextLibrary(name) ? keep(name) : nullptr;
}

const char* colonnade_read_materials(const char* name, const std::uint8_t* bytes, std::uint32_t count) {
    return refusalUnless(reader->giveLibrary(
        bytes ? std::optional(mesh::Text(reinterpret_cast<const char*>(bytes), count)) : std::nullopt, name));
}

const char* colonnade_read_picture(std::uint32_t index, std::int32_t* isClamped) {
    if (index == 0) reader->needPictures();
    if (index >= reader->pictures.size()) return nullptr;
    *isClamped = reader->pictures[index].isClamped;
    return reader->pictures[index].name.c_str();
}

void colonnade_read_lost(std::uint32_t index, std::uint32_t loss) {
    static constexpr const mesh::Loss* losses[]{&mesh::lost::noPictures, &mesh::lost::pictureFormats,
                                                &mesh::lost::damagedPictures};
    reader->losses.add(*losses[loss], 1, reader->pictures[index].name);
}

const char* colonnade_read_finish(const std::int32_t* numbers, colonnade_read* to) {
    if (!reader->finish({numbers, numbers + reader->pictures.size()})) return reader->refusal.c_str();
    const mesh::FileSurface& surface = reader->surface;
    materials.clear();
    for (const mesh::FileMaterial& one : surface.materials)
        for (const double value : {static_cast<double>(one.kind), one.albedo[0], one.albedo[1], one.albedo[2], one.ior,
                                   one.roughness, one.emission[0], one.emission[1], one.emission[2],
                                   one.alpha.value_or(-1), static_cast<double>(one.texture)})
            materials.push_back(value);
    static std::vector<std::int32_t> textures;
    textures.clear();
    for (const mesh::FileTexture& one : surface.textures)
        for (const std::int32_t value : {one.picture, one.mask, std::int32_t{one.isWhite}}) textures.push_back(value);
    const auto count = [](const auto& rows) { return static_cast<std::uint32_t>(rows.size()); };
    *to = {numbersOf<double>(surface.vertices),
           count(surface.vertices),
           numbersOf<std::int32_t>(surface.faces),
           count(surface.faces),
           numbersOf<double>(surface.normals),
           numbersOf<double>(surface.colours),
           numbersOf<double>(surface.uvs),
           numbersOf<std::int32_t>(surface.faceMaterials),
           materials.data(),
           count(surface.materials),
           numbersOf<std::int32_t>(textures),
           count(surface.textures)};
    return nullptr;
}

const char* colonnade_read_note(std::uint32_t index) {
    const std::vector<std::string> lines = reader->losses.lines();
    return index < lines.size() ? keep(lines[index]) : nullptr;
}

const char* colonnade_gltf_begin(const char* name, const std::uint8_t* bytes, std::uint32_t count,
                                 colonnade_bytes* json) {
    document = std::make_unique<mesh::gltf::GltfDocument>(name);
    kept.clear();
    kept.emplace_back(bytes, bytes + count);
    if (!document->begin(kept.front()) || !document->checkExtensions()) return document->refusal.c_str();
    *json = bytesOf(document->text());
    return nullptr;
}

std::uint32_t colonnade_gltf_array(std::uint32_t index, colonnade_array* to) {
    static std::vector<double> values;
    mesh::gltf::Array array;
    const mesh::gltf::Found found = document->array(index, array);
    if (found == mesh::gltf::Found::yes) {
        values.resize(array.count * static_cast<std::size_t>(array.width));
        array.copy(values.data());
        *to = {static_cast<std::uint32_t>(array.count), static_cast<std::uint32_t>(array.width), array.isWhole,
               values.data()};
    }
    return stateOf(found);
}

std::uint32_t colonnade_gltf_image(std::uint32_t index, colonnade_bytes* image) {
    std::optional<std::string> file;
    const mesh::gltf::Found found = document->image(index, content, file);
    const std::uint32_t state = stateOf(found);
    if (found != mesh::gltf::Found::yes) return state;
    *image = bytesOf(content);
    text = file.value_or("");
    return file ? 3 : 0;
}

const char* colonnade_gltf_nodes(colonnade_nodes* to) {
    static mesh::Nodes nodes;
    nodes = {};
    if (!mesh::gltf::NodeReader(*document).readAll(nodes)) return document->refusal.c_str();
    *to = {static_cast<std::uint32_t>(nodes.parents.size()),
           nodes.parents.data(),
           nodes.order.data(),
           numbersOf<double>(nodes.matrices),
           numbersOf<double>(nodes.translations),
           numbersOf<double>(nodes.rotations),
           numbersOf<double>(nodes.scales)};
    return nullptr;
}

std::uint32_t colonnade_gltf_placements(std::uint32_t isAnimated, colonnade_placements* to) {
    static std::vector<std::int32_t> numbers, counts;
    static std::vector<mesh::Matrix> matrices;
    std::vector<mesh::gltf::Placement> found;
    documentLosses = {};
    numbers.clear();
    counts.clear();
    matrices.clear();
    const std::uint32_t state = stateOf(mesh::gltf::NodeReader(*document).read(isAnimated, found, documentLosses));
    for (const mesh::gltf::Placement& one : found) {
        numbers.push_back(one.node);
        counts.push_back(static_cast<std::int32_t>(one.matrices.size()));
        matrices.insert(matrices.end(), one.matrices.begin(), one.matrices.end());
    }
    *to = {static_cast<std::uint32_t>(numbers.size()), numbers.data(), counts.data(), numbersOf<double>(matrices)};
    return state;
}

const char* colonnade_gltf_note(std::uint32_t index) {
    const std::vector<std::string> lines = documentLosses.lines();
    return index < lines.size() ? keep(lines[index]) : nullptr;
}

const char* colonnade_gltf_text(void) { return text.c_str(); }

const char* colonnade_gltf_give(const std::uint8_t* bytes, std::uint32_t count) {
    std::optional<mesh::Text> given;
    if (bytes) given = kept.emplace_back(bytes, bytes + count);
    return document->give(given) ? nullptr : document->refusal.c_str();
}

void colonnade_read_teapot(std::uint32_t level, colonnade_read* to) {
    static mesh::RawMesh made;
    made = mesh::teapot(static_cast<int>(level));
    *to = {};
    to->vertices = made.vertices[0].data();
    to->vertex_count = static_cast<std::uint32_t>(made.vertices.size());
    to->faces = made.faces[0].data();
    to->face_count = static_cast<std::uint32_t>(made.faces.size());
}

void colonnade_read_mask(const std::uint8_t* pixels, const std::uint8_t* alpha, std::uint32_t maskWidth,
                         std::uint32_t maskHeight, std::uint32_t width, std::uint32_t height, std::uint8_t* to) {
    const std::vector<std::uint8_t> mask =
        mesh::maskOf({pixels, maskHeight, maskWidth, 3, {}, {}, false}, alpha, height, width);
    std::copy(mask.begin(), mask.end(), to);
}
