#include <cstring>
#include <sstream>

#include "library.hpp"

namespace colonnade {

std::unique_ptr<Library> library;

const char* refuse(const std::string& error) {
    library->error = error;
    return library->error.c_str();
}

} // namespace colonnade

using namespace colonnade;

namespace {

const char* readDesign(std::istringstream& design) {
    std::string kind, record, name;
    while (design >> kind) {
        if (kind == "number" || kind == "size" || kind == "textureSize") {
            std::int64_t value;
            design >> name >> value;
            (kind == "number" ? library->numbers
             : kind == "size" ? library->mapSizes
                              : library->textureSizes)[name] = value;
        } else if (kind == "layout" || kind == "map" || kind == "textureMap") {
            Field field;
            design >> record >> name >> field.offset >> field.width >> field.isSigned;
            (kind == "layout" ? library->format.layouts
             : kind == "map"  ? library->mapLayouts
                              : library->textureLayouts)[record][name] = field;
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

} // namespace

const char* colonnade_model_open(const char* design) {
    library = std::make_unique<Library>();
    std::istringstream lines(design);
    if (const char* error = readDesign(lines)) return error;
    packer::RecordFormat& format = library->format;
    format.recordBits = library->number("recordBits");
    format.vertexBits = library->number("vertexBits");
    format.boxBits = library->number("boxBits");
    format.stackDepth = library->number("stackDepth");
    format.normalFraction = library->number("normalFraction");
    format.bvh = library->number("bvh") != 0;
    std::uint32_t end = 0;
    for (const Register& each : library->registers) end = std::max(end, each.address + each.words);
    library->words.assign(end, 0);
    library->device = std::make_unique<Device>(Numbers(library->numbers), format.layouts, library->limits);
    return nullptr;
}

const char* colonnade_model_load(const std::uint8_t* records, std::uint32_t count) {
    library->device->load(records, count, library->format.recordBytes());
    library->records.assign(records, records + count * library->format.recordBytes());
    return nullptr;
}

const char* colonnade_model_load_memory(const char* memory, const std::uint8_t* words, std::uint32_t count,
                                        std::uint32_t bytes) {
    if (memory == std::string("light.cube")) {
        if (bytes != LightCube::wordBytes) return "words of the light cube have 4 bytes";
        library->device->loadCube(words, count);
        return nullptr;
    }
    if (std::strncmp(memory, "texture.", 8) == 0) {
        if (library->textureSizes.empty()) return "this design has no memory for textures";
        if (!library->texture)
            library->texture = std::make_unique<TextureImage>(library->textureSizes, library->textureLayouts);
        library->texture->load(memory, words, count, bytes);
        library->device->load(*library->texture);
        return nullptr;
    }
    if (library->mapSizes.empty()) return "this design has no memory for a room";
    if (!library->maps)
        library->maps = std::make_unique<AttributeImage>(AttributeSizes(library->mapSizes), library->mapLayouts);
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
        for (std::uint32_t word = 0; word < std::min(each.words, 2u); ++word)
            bits |= std::uint64_t{library->words[each.address + word]} << (32 * word);
        const int above = 64 - each.width;
        registers[each.name] = each.isSigned ? static_cast<std::int64_t>(bits << above) >> above
                                             : static_cast<std::int64_t>(bits << above >> above);
    }
    library->device->start(registers);
    return nullptr;
}

const char* colonnade_model_rows(std::uint32_t first, std::uint32_t last, std::uint16_t* colours, std::uint16_t* ratios,
                                 std::int32_t* triangles) {
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

const std::uint8_t* colonnade_model_texture(const char* memory) { return library->textureWords[memory].data(); }

const std::uint8_t* colonnade_model_records(void) { return library->records.data(); }

const double* colonnade_model_counters(void) {
    const Counters& from = library->device->counters;
    const std::array<std::uint64_t, 11> values{
        from.raysPrimary, from.raysShadow, from.raysReflection, from.raysRefraction, from.raysGather,  from.raysInBox,
        from.nodeReads,   from.boxTests,   from.triangleTests,  from.hits,           from.deepestStack};
    std::copy(values.begin(), values.end(), library->counters.begin());
    return library->counters.data();
}
