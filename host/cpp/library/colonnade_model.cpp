#include "colonnade_model.h"

#include <cstring>
#include <memory>
#include <sstream>

#include "mesh/cleaning.hpp"
#include "model/frame.hpp"
#include "packer/records.hpp"
#include "packer/surface_offset.hpp"

namespace {

using namespace colonnade;

/// Up to this angle, 60 degrees, edges are smooth (host/colonnade/mesh/geometry/cleaning.py).
constexpr double leastCosine = 0.5000000000000001 - 1e-9;

struct Register {
    std::string name;
    std::uint32_t address, words;
    int width;
    bool isSigned;
};

/// A mesh and what its records were made of; the packer refers to the others.
struct Packed {
    mesh::CleanMesh clean;
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
    std::map<std::string, std::int64_t> mapSizes;
    std::map<std::string, Layout> mapLayouts;
    std::unique_ptr<AttributeImage> maps;
    std::unique_ptr<Device> device;
    std::unique_ptr<Packed> packed;
    std::vector<std::uint8_t> records;
    std::string error;
    std::array<double, 11> counters;
    std::vector<RayStep> steps;
    std::vector<colonnade_step> result;

    int number(const char* name) const { return static_cast<int>(lookUp(numbers, name)); }
};

std::unique_ptr<Library> library;

const char* refuse(const std::string& error) {
    library->error = error;
    return library->error.c_str();
}

const char* readDesign(std::istringstream& design) {
    std::string kind, record, name;
    while (design >> kind) {
        if (kind == "number" || kind == "size") {
            std::int64_t value;
            design >> name >> value;
            (kind == "number" ? library->numbers : library->mapSizes)[name] = value;
        } else if (kind == "layout" || kind == "map") {
            Field field;
            design >> record >> name >> field.offset >> field.width >> field.isSigned;
            (kind == "layout" ? library->format.layouts : library->mapLayouts)[record][name] = field;
        } else if (kind == "register") {
            Register each;
            std::int64_t limit;
            design >> each.name >> each.address >> each.words >> each.width >> each.isSigned >> limit;
            library->registers.push_back(each);
            if (limit >= 0) library->limits[each.name] = limit;
        } else return "the design has a line of an unknown kind";
        if (!design) return "a line of the design is not complete";
    }
    return nullptr;
}

std::array<mesh::Row<std::int64_t>, 3> colourCodes(const double* colours) {
    const double white = static_cast<double>((1 << library->number("colourBits")) - 1);
    std::array<mesh::Row<std::int64_t>, 3> codes;
    for (int i = 0; i < 9; ++i) codes[i / 3][i % 3] = static_cast<std::int64_t>(std::rint(std::clamp(colours[i], 0.0, 1.0) * white));
    return codes;
}

const char* checkFit(const packer::Sections& sections, const bvh::Bvh& tree) {
    const auto depth = static_cast<std::size_t>(library->number("depth"));
    if (sections.recordCount > depth) return refuse("the mesh needs " + std::to_string(sections.recordCount) + " records, this design has " + std::to_string(depth));
    const std::size_t ids = std::size_t{1} << library->format.layouts.at("triangles").at("firstTriangle").width;
    if (tree.order.size() >= ids)
        return refuse("the mesh has " + std::to_string(tree.order.size()) + " triangles, packed ids of this design reach " + std::to_string(ids - 2));
    if (library->format.bvh && static_cast<int>(tree.tree.stackBound) > library->format.stackDepth)
        return refuse("the mesh needs a stack of " + std::to_string(tree.tree.stackBound) + " entries, this design has " + std::to_string(library->format.stackDepth));
    return nullptr;
}

void describe(colonnade_packed& packed, std::uint32_t faceCount) {
    const Packed& from = *library->packed;
    const packer::Sections& sections = from.packer->sections();
    packed.triangles = static_cast<std::int32_t>(from.tree.order.size());
    packed.record_count = static_cast<std::int32_t>(sections.recordCount);
    packed.triangle_base = static_cast<std::int32_t>(sections.triangleBase);
    packed.triangle_records = static_cast<std::int32_t>(sections.triangleRecords);
    packed.attribute_base = static_cast<std::int32_t>(sections.attributeBase);
    std::copy(sections.boundsLow.begin(), sections.boundsLow.end(), packed.bounds_low);
    std::copy(sections.boundsHigh.begin(), sections.boundsHigh.end(), packed.bounds_high);
    const packer::OffsetFormat format{library->number("gridFraction"), library->number("weightBits"), library->number("mantissaBits"), library->number("distanceDigits")};
    packed.shading_offset = static_cast<std::int32_t>(packer::surfaceOffset(format, sections.largestTriangle));
    packed.tree_depth = static_cast<std::int32_t>(from.tree.tree.depth);
    packed.stack_bound = static_cast<std::int32_t>(from.tree.tree.stackBound);
    packed.dropped = static_cast<std::int32_t>(faceCount - from.tree.order.size());
    packed.flipped = static_cast<std::int32_t>(from.clean.normals.flipped);
    packed.reversed = static_cast<std::int32_t>(from.clean.winding.mixed + from.clean.winding.inverted);
    packed.replaced = static_cast<std::int32_t>(from.clean.normals.replaced + from.clean.normals.missing);
}

} // namespace

const char* colonnade_model_open(const char* design) {
    library = std::make_unique<Library>();
    std::istringstream lines(design);
    if (const char* error = readDesign(lines)) return error;
    packer::RecordFormat& format = library->format;
    format.recordBits = library->number("recordBits");
    format.vertexBits = library->number("vertexBits");
    format.boxBits = library->number("boxBits");
    format.arity = library->number("arity");
    format.trianglesPerRecord = library->number("trianglesPerRecord");
    format.stackDepth = library->number("stackDepth");
    format.normalFraction = library->number("normalFraction");
    format.bvh = library->number("bvh") != 0;
    std::uint32_t end = 0;
    for (const Register& each : library->registers) end = std::max(end, each.address + each.words);
    library->words.assign(end, 0);
    library->device = std::make_unique<Device>(Numbers(library->numbers), format.layouts, library->limits);
    return nullptr;
}

const char* colonnade_model_pack(const double* vertices, std::uint32_t vertexCount, const std::int32_t* faces, std::uint32_t faceCount, const double* normals,
                                 const double* colours, std::uint32_t isGlass, colonnade_packed* packed) {
    mesh::RawMesh raw;
    raw.vertices.resize(vertexCount);
    raw.faces.resize(faceCount);
    std::memcpy(raw.vertices.data(), vertices, vertexCount * sizeof(mesh::Vector));
    std::memcpy(raw.faces.data(), faces, faceCount * sizeof(mesh::Face));
    if (normals) {
        raw.normals.resize(faceCount);
        std::memcpy(raw.normals.data(), normals, faceCount * sizeof(mesh::Corners));
    }
    auto next = std::make_unique<Packed>();
    next->clean = mesh::clean(raw, leastCosine, faceCount);
    if (!next->clean.error.empty()) return refuse(next->clean.error);
    const mesh::CleanMesh& clean = next->clean;
    next->quantised = packer::quantise(clean.vertices.data(), clean.vertices.size(), clean.faces.data(), clean.faces.size(), library->format.vertexBits);
    if (next->quantised.faces.empty()) return "no triangle keeps an area in this design's vertex units";
    next->tree = packer::buildTree(next->quantised, library->format);
    next->packer = std::make_unique<packer::RecordPacker>(next->quantised, next->tree, library->format);
    if (const char* error = checkFit(next->packer->sections(), next->tree)) return error;

    const std::vector<std::uint8_t> materials(clean.faces.size(), 0), isClear(clean.faces.size(), isGlass != 0);
    std::vector<std::array<mesh::Row<std::int64_t>, 3>> codes;
    if (library->format.layouts.at("attributes").count("faces[0].colours[0].r")) {
        codes.resize(clean.faces.size());
        for (std::size_t i = 0; colours && i < codes.size(); ++i) {
            codes[i] = colourCodes(colours + 9 * clean.sources[i]);
            if (clean.winding.reversed[i]) std::reverse(codes[i].begin(), codes[i].end());
        }
    }
    library->records = next->packer->records({clean.normals.normals.data(), materials.data(), isClear.data(), codes.empty() ? nullptr : codes.data()});
    library->packed = std::move(next);
    describe(*packed, faceCount);
    library->device->load(library->records.data(), library->packed->packer->sections().recordCount, library->format.recordBytes());
    return nullptr;
}

const char* colonnade_model_load(const std::uint8_t* records, std::uint32_t count) {
    library->device->load(records, count, library->format.recordBytes());
    return nullptr;
}

const char* colonnade_model_load_memory(const char* memory, const std::uint8_t* words, std::uint32_t count, std::uint32_t bytes) {
    if (memory == std::string("light.cube")) {
        if (bytes != LightCube::wordBytes) return "words of the light cube have 4 bytes";
        library->device->loadCube(words, count);
        return nullptr;
    }
    if (library->mapSizes.empty()) return "this design has no memory for a room";
    if (!library->maps) library->maps = std::make_unique<AttributeImage>(AttributeSizes(library->mapSizes), library->mapLayouts);
    library->maps->load(memory, words, count, bytes);
    library->device->load(*library->maps);
    return nullptr;
}

const char* colonnade_model_start(const std::uint8_t* writes, std::uint32_t count) {
    const auto wordAt = [&](std::uint32_t index) {
        std::uint32_t word = 0;
        for (int byte = 3; byte >= 0; --byte) word = word << 8 | writes[4 * index + byte];
        return word;
    };
    for (std::uint32_t i = 0; i < count; ++i) {
        if (wordAt(2 * i) >= library->words.size()) return "a write is to no register of this design";
        library->words[wordAt(2 * i)] = wordAt(2 * i + 1);
    }
    Registers registers;
    for (const Register& each : library->registers) {
        std::uint64_t bits = 0;
        for (std::uint32_t word = 0; word < std::min(each.words, 2u); ++word) bits |= std::uint64_t{library->words[each.address + word]} << (32 * word);
        const int above = 64 - each.width;
        registers[each.name] = each.isSigned ? static_cast<std::int64_t>(bits << above) >> above : static_cast<std::int64_t>(bits << above >> above);
    }
    library->device->start(registers);
    return nullptr;
}

const char* colonnade_model_rows(std::uint32_t first, std::uint32_t last, std::uint16_t* colours, std::uint16_t* ratios, std::int32_t* triangles) {
    const Frame& frame = library->device->frame();
    if (last > static_cast<std::uint32_t>(frame.height) || first > last) return "these rows are not those of the frame";
    for (std::uint32_t y = first; y < last; ++y)
        for (std::int64_t x = 0; x < frame.width; ++x) {
            const Pixel pixel = library->device->render(x, y);
            for (int channel = 0; channel < 3; ++channel) {
                *colours++ = static_cast<std::uint16_t>(pixel.colour[channel]);
                *ratios++ = static_cast<std::uint16_t>(pixel.ratio[channel]);
            }
            *triangles++ = pixel.isObject ? static_cast<std::int32_t>(pixel.triangle) : -1;
        }
    return nullptr;
}

std::uint32_t colonnade_model_trace(std::uint32_t x, std::uint32_t y, const colonnade_step** steps) {
    const Counters before = library->device->counters;
    library->steps.clear();
    library->device->log.writeTo(&library->steps);
    library->device->render(x, y);
    library->device->log.writeTo(nullptr);
    library->device->counters = before;
    library->result.clear();
    for (const RayStep& step : library->steps) {
        colonnade_step each{static_cast<std::int32_t>(step.kind), step.value, step.isHit, step.isLeaf, {}};
        std::copy(step.values.begin(), step.values.end(), each.values);
        library->result.push_back(each);
    }
    *steps = library->result.data();
    return static_cast<std::uint32_t>(library->result.size());
}

const std::uint8_t* colonnade_model_records(void) { return library->records.data(); }

const double* colonnade_model_counters(void) {
    const Counters& from = library->device->counters;
    const std::array<std::uint64_t, 11> values{from.raysPrimary, from.raysShadow, from.raysReflection, from.raysRefraction, from.raysGather,  from.raysInBox,
                                               from.nodeReads,   from.boxTests,   from.triangleTests,  from.hits,           from.deepestStack};
    std::copy(values.begin(), values.end(), library->counters.begin());
    return library->counters.data();
}
