// colonnade._core.Model: the bit-exact model of the device (cpp/model) for Python.
#include <cmath>
#include <memory>

#include "binding.hpp"
#include "cycles/simulation.hpp"
#include "model/frame.hpp"

using namespace nanobind::literals;
using namespace colonnade;
using namespace colonnade::binding;

namespace {

class Model {
public:
    Model(const Values& numbers, const FieldTuples& layouts, const Values& limits)
        : numbers_(numbers), device_(numbers_, layoutsOf(layouts), limits) {}

    void load(const Records& records) { device_.load(records.data(), records.shape(0), records.shape(1)); }

    /// Adds a physical-attribute memory to the device.
    void addEnvironment(const Values& sizes, const FieldTuples& layouts) {
        environment_ = std::make_unique<AttributeImage>(AttributeSizes(sizes), layoutsOf(layouts));
    }

    void loadEnvironment(const std::string& memory, const Records& words) {
        if (!environment_) throw std::invalid_argument("there is no physical-attribute memory");
        environment_->load(memory, words.data(), words.shape(0), words.shape(1));
        device_.load(*environment_);
    }

    /// Adds a texture memory to the device.
    void addTexture(const Values& sizes, const FieldTuples& layouts) {
        texture_ = std::make_unique<TextureImage>(sizes, layoutsOf(layouts));
        device_.load(*texture_);
    }

    void loadTexture(const std::string& memory, const Records& words) {
        if (!texture_) throw std::invalid_argument("there is no texture memory");
        texture_->load(memory, words.data(), words.shape(0), words.shape(1));
    }

    void loadCube(const Records& words) {
        if (words.shape(1) != LightCube::wordBytes) throw std::invalid_argument("words of the light cube have 4 bytes");
        device_.loadCube(words.data(), words.shape(0));
    }

    /// Loads the registers and clears counters and errors.
    void start(const Values& registers) {
        gathers_ = registers.count("gather.bounces") != 0;
        device_.start(registers);
        device_.work.writeTo(nullptr);
    }

    /// Renders all rows of the frame and notes the work of the units, instead of the pixels.
    void noteWork(std::int64_t height) {
        work_ = {};
        device_.work.writeTo(&work_);
        const nb::gil_scoped_release release;
        for (std::int64_t y = 0; y < height; ++y)
            for (std::int64_t x = 0; x < device_.frame().width; ++x) device_.render(x, y);
        work_.pixels.push_back(static_cast<std::uint32_t>(work_.steps.size()));
        height_ = static_cast<unsigned>(height);
        device_.work.writeTo(nullptr);
    }

    Values cycles(const Values& design, const cycles::DramDesign& dram) const {
        const nb::gil_scoped_release release;
        return cycles::simulate(cycles::Design(design), dram, work_, device_.frame(), height_);
    }

    nb::dict rows(std::int64_t first, std::int64_t last) {
        const std::int64_t width = device_.frame().width;
        const auto size = static_cast<std::size_t>(width), count = static_cast<std::size_t>(last - first);
        std::uint16_t *colour, *ratio;
        bool* isObject;
        std::int64_t *triangle, *instance;
        double* distance;
        nb::dict result;
        result["colour"] = makeArray<std::uint16_t>({count, size, 3}, colour);
        result["ratio"] = makeArray<std::uint16_t>({count, size, 3}, ratio);
        result["is_object"] = makeArray<bool>({count, size}, isObject);
        result["triangle"] = makeArray<std::int64_t>({count, size}, triangle);
        result["instance"] = makeArray<std::int64_t>({count, size}, instance);
        result["distance"] = makeArray<double>({count, size}, distance);
        const double step = std::ldexp(1.0, -numbers_.gridFraction);
        nb::gil_scoped_release release;
        std::size_t i = 0;
        for (std::int64_t y = first; y < last; ++y)
            for (std::int64_t x = 0; x < width; ++x, ++i) {
                const Pixel pixel = device_.render(x, y);
                for (int channel = 0; channel < 3; ++channel) {
                    colour[3 * i + channel] = static_cast<std::uint16_t>(pixel.colour[channel]);
                    ratio[3 * i + channel] = static_cast<std::uint16_t>(pixel.ratio[channel]);
                }
                isObject[i] = pixel.isObject;
                triangle[i] = pixel.isObject ? static_cast<std::int64_t>(pixel.triangle) : -1;
                instance[i] = pixel.isObject ? pixel.instance : -1;
                distance[i] = static_cast<double>(pixel.distance) * step;
            }
        return result;
    }

    /// Closest hits of rays with scene positions (grid steps) and directions of any scale: packed ids, -1 for a miss.
    nb::object trace(const Vectors& origins, const Vectors& directions) {
        std::int64_t* ids;
        auto result = makeArray<std::int64_t>({origins.shape(0)}, ids);
        for (std::size_t i = 0; i < origins.shape(0); ++i) {
            const Hit hit =
                device_.trace(prepareRay(requestOf(origins, directions, i), device_.frame().bounds, numbers_));
            ids[i] = hit.found ? static_cast<std::int64_t>(hit.id) : -1;
        }
        return nb::cast(result);
    }

    /// Closest hits of rays as in `trace`, and where rays from there begin.
    nb::dict nearest(const Vectors& origins, const Vectors& directions) {
        const std::size_t count = origins.shape(0);
        std::int64_t *triangle, *instance, *distance, *start, *normal;
        nb::dict result;
        result["triangle"] = makeArray<std::int64_t>({count}, triangle);
        result["instance"] = makeArray<std::int64_t>({count}, instance);
        result["distance"] = makeArray<std::int64_t>({count}, distance);
        result["start"] = makeArray<std::int64_t>({count, 3}, start);
        result["normal"] = makeArray<std::int64_t>({count, 3}, normal);
        for (std::size_t i = 0; i < count; ++i) {
            const NearestHit hit = device_.nearest(requestOf(origins, directions, i));
            triangle[i] = hit.triangle;
            instance[i] = hit.instance;
            distance[i] = hit.distance;
            for (std::size_t a = 0; a < 3; ++a) {
                start[3 * i + a] = static_cast<std::int64_t>(hit.start[a]);
                normal[3 * i + a] = hit.normal[a];
            }
        }
        return result;
    }

    /// Sets up rays and tests each against its own box, for comparison with exact arithmetic.
    nb::dict testBoxes(const Vectors& origins, const Vectors& directions, const Vectors& corners,
                       const Vectors& exponents, const Vectors& low, const Vectors& high) {
        const std::size_t count = origins.shape(0);
        bool *enters, *isHit;
        std::int64_t *heading, *origin, *shear;
        nb::dict result;
        result["enters"] = makeArray<bool>({count}, enters);
        result["is_hit"] = makeArray<bool>({count}, isHit);
        result["heading"] = makeArray<std::int64_t>({count, 4}, heading);
        result["origin"] = makeArray<std::int64_t>({count, 3}, origin);
        result["shear"] = makeArray<std::int64_t>({count, 2}, shear);
        for (std::size_t i = 0; i < count; ++i) {
            const Ray ray = prepareRay(requestOf(origins, directions, i), device_.frame().bounds, numbers_);
            Node node{};
            node.leaves = 1;
            for (std::size_t a = 0; a < 3; ++a) {
                node.origin[a] = static_cast<std::int32_t>(corners(i, a));
                node.exponent[a] = static_cast<std::int8_t>(exponents(i, a));
                node.low[a][0] = static_cast<std::uint8_t>(low(i, a));
                node.high[a][0] = static_cast<std::uint8_t>(high(i, a));
                heading[4 * i + 1 + a] = ray.negative[a];
                origin[3 * i + a] = ray.origin[a];
            }
            heading[4 * i] = ray.axis;
            shear[2 * i] = ray.shear[0];
            shear[2 * i + 1] = ray.shear[1];
            std::array<Entered, 4> entered;
            enters[i] = ray.enters;
            isHit[i] = ray.enters && colonnade::testBoxes(ray, node, ray.tMax, numbers_, entered) > 0;
        }
        return result;
    }

    Values counters() const {
        const Counters& c = device_.counters;
        const auto value = [](std::uint64_t count) { return static_cast<std::int64_t>(count); };
        Values values = {{"raysPrimary", value(c.raysPrimary)},
                         {"raysShadow", value(c.raysShadow)},
                         {"raysReflection", value(c.raysReflection)},
                         {"raysRefraction", value(c.raysRefraction)},
                         {"raysInBox", value(c.raysInBox)},
                         {"nodeReads", value(c.nodeReads)},
                         {"boxTests", value(c.boxTests)},
                         {"triangleTests", value(c.triangleTests)},
                         {"hits", value(c.hits)},
                         {"deepestStack", value(c.deepestStack)}};
        if (environment_)
            values.merge(Values{{"raysEnvironment", value(c.raysEnvironment)},
                                {"marchSteps", value(c.marchSteps)},
                                {"albedoReads", value(c.albedoReads)},
                                {"normalReads", value(c.albedoReads)}});
        if (gathers_) values["raysGather"] = value(c.raysGather);
        return values;
    }

    std::map<std::string, bool> errors() const {
        const Errors& e = device_.errors;
        return {{"stackOverflow", e.stackOverflow}, {"illegalRecord", e.illegalRecord}, {"watchdog", e.watchdog}};
    }

private:
    RayRequest requestOf(const Vectors& origins, const Vectors& directions, std::size_t i) const {
        RayRequest request{{}, {}, numbers_.unlimited()};
        for (std::size_t a = 0; a < 3; ++a) {
            request.origin[a] = origins(i, a);
            request.direction[a] = directions(i, a);
        }
        return request;
    }

    Numbers numbers_;
    Device device_;
    std::unique_ptr<AttributeImage> environment_;
    std::unique_ptr<TextureImage> texture_;
    bool gathers_ = false;
    FrameWork work_;
    unsigned height_ = 0;
};

} // namespace

void bind_model(nb::module_& module) {
    nb::class_<Model>(module, "Model", "The untimed, bit-exact model of the device.")
        .def(nb::init<const Values&, const FieldTuples&, const Values&>(), "numbers"_a, "layouts"_a, "limits"_a,
             "From the manifest's numbers (with stackDepth, bvh), record layouts (record -> field -> (offset, width, "
             "signed)) and register limits.")
        .def("load", &Model::load, "records"_a, "Loads the column memory: uint8 [records, bytes].")
        .def("add_environment", &Model::addEnvironment, "sizes"_a, "layouts"_a,
             "Adds a physical-attribute memory with the manifest's attribute sizes and layouts.")
        .def("load_environment", &Model::loadEnvironment, "memory"_a, "words"_a,
             "Loads one of its memories, by its name in the manifest: uint8 [words, bytes], low byte first.")
        .def("add_texture", &Model::addTexture, "sizes"_a, "layouts"_a,
             "Adds a texture memory with the manifest's texture sizes and layouts.")
        .def("load_texture", &Model::loadTexture, "memory"_a, "words"_a,
             "As load_environment, for a memory of the textures.")
        .def("load_cube", &Model::loadCube, "words"_a, "Loads the light cube: uint8 [words, bytes], low byte first.")
        .def("start", &Model::start, "registers"_a,
             "Starts a frame: loads the registers (name -> value); clears counters and errors.")
        .def("rows", &Model::rows, "first"_a, "last"_a,
             "Pixels of rows first..last-1: colour uint16 [h, w, 3] linear, ratio uint16 [h, w, 3] of light with the "
             "object over light without it (4096 is 1), is_object bool, triangle int64 packed id or -1, instance int64 "
             "or -1, distance float64 in vertex units.")
        .def("trace", &Model::trace, "origins"_a, "directions"_a,
             "Packed ids of the closest hits, int64 [n], -1 for a miss. Origins and directions: int64 [n, 3], grid "
             "steps.")
        .def("nearest", &Model::nearest, "origins"_a, "directions"_a,
             "The same hits as `trace`: triangle (packed id) and instance int64 [n], -1 for a miss; distance int64 [n] "
             "along the dominant axis, grid steps; start int64 [n, 3], "
             "where rays from the hit begin, grid steps; normal int64 [n, 3], geometric, against the ray, 11 fraction "
             "bits.")
        .def("test_boxes", &Model::testBoxes, "origins"_a, "directions"_a, "corners"_a, "exponents"_a, "low"_a,
             "high"_a,
             "Tests each ray against one box (planes corner + (low << exponent), corner + (high << exponent), vertex "
             "units). Returns enters (the object's box), is_hit, "
             "and the prepared ray in its permuted frame: heading int64 [n, 4] (axis, three signs), origin int64 [n, "
             "3], shear int64 [n, 2].")
        .def("note_work", &Model::noteWork, "height"_a,
             "Renders the rows of the frame, and notes the work of the device's units instead of pixels.")
        .def(
            "cycles",
            [](const Model& model, const Values& design, int latency, int interval) {
                return model.cycles(design, {latency, interval});
            },
            "design"_a, "latency"_a, "interval"_a,
            "Counters of the noted frame, by name, with timing-dependent ones. `design`: its configuration by paths, "
            "numbers and `recordBytes`; DRAM's latency and the cycles between its beats.")
        .def("counters", &Model::counters, "Timing-independent counters since `start`, by name.")
        .def("errors", &Model::errors, "Sticky error bits since `start`, by name.");
    module.def(
        "bounce_cycles",
        [](const Values& design) -> Values {
            const cycles::BounceCycles bounces = cycles::Design(design).bounceCycles;
            return {{"mirror", bounces.mirror},
                    {"totalReflection", bounces.totalReflection},
                    {"behind", bounces.glassFromBehind},
                    {"front", bounces.glassFromFront}};
        },
        "design"_a,
        "Cycles of a bounce unit on a design, as of `Model.cycles`. ValueError for one that the cycle model does not "
        "know.");
}
