// colonnade._core.Rays: the library of rays (driver/include/colonnade_rays.h) for Python, a device with one scene.
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>

#include <cstring>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "binding.hpp"
#include "rays/batch_bytes.hpp"
#include "rays/conversion.hpp"
#include "rays/device_registers.hpp"
#include "rays/traffic.hpp"

using namespace nanobind::literals;
using namespace colonnade;
using namespace colonnade::binding;

namespace {

template <class T> using Eights = nb::ndarray<const T, nb::shape<-1, 8>, nb::c_contig, nb::device::cpu>;
template <class T> using Threes = nb::ndarray<const T, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
template <class T> using Column = nb::ndarray<const T, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

const colonnade_rays_ray* raysOf(const Eights<double>& rays) {
    return reinterpret_cast<const colonnade_rays_ray*>(rays.data());
}

/// A device in Python as a backend: `colonnade.rays.device.RayDevice`. Its errors wait for the end of the library's
/// call.
class PythonDevice {
public:
    explicit PythonDevice(nb::object device) : device_(std::move(device)) {}

    colonnade_rays_backend backend() {
        return {this,
                [](void* self, const colonnade_rays_image* image) {
                    return call(self, [&](PythonDevice& device) { return device.load(*image); });
                },
                [](void* self, const colonnade_rays_batch* batch) {
                    return call(self, [&](PythonDevice& device) { return device.submit(*batch); });
                },
                [](void* self) {
                    return std::exchange(static_cast<PythonDevice*>(self)->status_,
                                         static_cast<int>(COLONNADE_RAYS_OK));
                },
                [](void* self, colonnade_rays_sums* sums) {
                    call(self, [&](PythonDevice& device) { return device.read(*sums); });
                },
                nullptr};
    }

    void raise() {
        if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
    }

private:
    template <class Call> static int call(void* self, const Call& of) {
        const nb::gil_scoped_acquire acquired;
        auto& device = *static_cast<PythonDevice*>(self);
        try {
            return of(device);
        } catch (...) {
            device.error_ = std::current_exception();
            return COLONNADE_RAYS_DEVICE;
        }
    }

    int load(const colonnade_rays_image& image) {
        device_.attr("load")(rays::registersOf(image),
                             nb::bytes(image.records, image.record_count * image.record_bytes), image.record_count);
        return COLONNADE_RAYS_OK;
    }

    int submit(const colonnade_rays_batch& batch) {
        const auto* const rays = reinterpret_cast<const char*>(batch.rays);
        const nb::object found = device_.attr("submit")(
            nb::bytes(&batch, sizeof batch), nb::bytes(rays, rays::rayBytes(batch)), rays::responseBytes(batch));
        std::uint32_t tag = 0;
        if (!nb::isinstance<nb::tuple>(found) || nb::len(found) != 2 || !nb::try_cast(nb::object(found[0]), tag) ||
            !nb::isinstance<nb::bytes>(found[1]))
            throw std::invalid_argument("the device must answer a batch with a tag of 32 bits and bytes");
        const nb::bytes hits(found[1]);
        if (hits.size() != rays::responseBytes(batch))
            throw std::invalid_argument("the device answers " + std::to_string(hits.size()) + " bytes in place of " +
                                        std::to_string(rays::responseBytes(batch)));
        std::memcpy(reinterpret_cast<void*>(batch.hits), hits.data(), hits.size());
        if (batch.done != 0) *reinterpret_cast<std::uint32_t*>(batch.done) = tag;
        if (tag >> 31) status_ = COLONNADE_RAYS_DEVICE;
        return COLONNADE_RAYS_OK;
    }

    int read(colonnade_rays_sums& sums) {
        rays::RegisterValues counters;
        if (!nb::try_cast(nb::object(device_.attr("counters")()), counters))
            throw std::invalid_argument("the device's counters must be numbers by name");
        sums = rays::sumsOf(counters);
        return COLONNADE_RAYS_OK;
    }

    nb::object device_;
    int status_ = COLONNADE_RAYS_OK;
    std::exception_ptr error_;
};

class Rays {
public:
    /// `design` None: the library's. `device` None: the model.
    Rays(const std::optional<std::string>& design, nb::object device) {
        colonnade_rays_backend backend{};
        if (!device.is_none()) {
            python_ = std::make_unique<PythonDevice>(std::move(device));
            backend = python_->backend();
        }
        check(colonnade_rays_open(design ? design->c_str() : nullptr, python_ ? &backend : nullptr, &device_));
        check(colonnade_rays_scene_new(device_, &scene_));
    }
    ~Rays() {
        colonnade_rays_scene_free(scene_);
        colonnade_rays_close(device_);
    }
    Rays(const Rays&) = delete;

    std::uint32_t add(const Threes<double>& vertices, const Threes<std::uint32_t>& faces) {
        std::uint32_t mesh = 0;
        check(colonnade_rays_mesh_add(scene_, vertices.data(), vertices.shape(0), faces.data(), faces.shape(0), &mesh));
        return mesh;
    }
    void update(std::uint32_t mesh, const Threes<double>& vertices) {
        check(colonnade_rays_mesh_update(scene_, mesh, vertices.data(), vertices.shape(0)));
    }
    void remove(std::uint32_t mesh) { check(colonnade_rays_mesh_remove(scene_, mesh)); }
    void enable(std::uint32_t mesh, bool isEnabled) { check(colonnade_rays_mesh_enable(scene_, mesh, isEnabled)); }
    void mask(std::uint32_t mesh, std::uint32_t mask) { check(colonnade_rays_mesh_mask(scene_, mesh, mask)); }
    void opacity(std::uint32_t mesh, const std::optional<Column<std::uint8_t>>& isOpaque) {
        check(colonnade_rays_mesh_opacity(scene_, mesh, isOpaque ? isOpaque->data() : nullptr,
                                          isOpaque ? isOpaque->size() : 0));
    }
    void refine(bool isRefined) { colonnade_rays_refine(scene_, isRefined); }
    void commit() {
        check(released([&] { return colonnade_rays_commit(scene_); }));
    }

    std::size_t dropped() const {
        std::size_t faces;
        check(colonnade_rays_dropped(scene_, &faces));
        return faces;
    }
    nb::tuple bounds() const {
        std::array<double, 3> low, high;
        check(colonnade_rays_bounds(scene_, low.data(), high.data()));
        return nb::make_tuple(low, high);
    }
    nb::tuple grid() const {
        double unit;
        std::array<double, 3> corner;
        check(colonnade_rays_grid(scene_, &unit, corner.data()));
        return nb::make_tuple(unit, corner);
    }

    nb::dict closest(const Eights<double>& rays, std::uint32_t mode, std::uint32_t mask) {
        std::vector<colonnade_rays_hit> hits(rays.shape(0));
        inParts(rays.shape(0), [&](std::size_t first, std::size_t count) {
            check(released([&] {
                return colonnade_rays_closest(scene_, raysOf(rays) + first, count, mode, mask, hits.data() + first);
            }));
            number(hits.data() + first, count, first);
        });
        return columns(hits);
    }
    nb::dict all(const Eights<double>& rays, std::uint32_t mode, std::uint32_t mask, std::size_t most) {
        std::vector<colonnade_rays_hit> hits;
        inParts(rays.shape(0), [&](std::size_t first, std::size_t rayCount) {
            const std::size_t before = hits.size();
            std::size_t found = 2 * rayCount;
            for (bool isShort = true; isShort;) {
                hits.resize(before + found);
                const std::size_t capacity = found;
                check(released([&] {
                    return colonnade_rays_all(scene_, raysOf(rays) + first, rayCount, mode, mask, most,
                                              hits.data() + before, capacity, &found);
                }));
                isShort = found > capacity;
            }
            hits.resize(before + found);
            number(hits.data() + before, found, first);
        });
        return columns(hits);
    }
    Pixels<bool> occluded(const Eights<double>& rays, std::uint32_t mode, std::uint32_t mask) {
        bool* isOccluded;
        auto result = makeArray<bool>({rays.shape(0)}, isOccluded);
        inParts(rays.shape(0), [&](std::size_t first, std::size_t count) {
            check(released([&] {
                return colonnade_rays_occluded(scene_, raysOf(rays) + first, count, mode, mask,
                                               reinterpret_cast<std::uint8_t*>(isOccluded) + first);
            }));
        });
        return result;
    }
    Pixels<std::uint32_t> order(const Eights<double>& rays) const {
        std::uint32_t* order;
        auto result = makeArray<std::uint32_t>({rays.shape(0)}, order);
        check(colonnade_rays_order(scene_, raysOf(rays), rays.shape(0), order));
        return result;
    }

    /// What the caches of an array read for rays: records, and lines from DRAM.
    Values traffic(const Eights<double>& rays, std::uint32_t mode, std::uint32_t mask, bool isOcclusion,
                   const std::array<std::size_t, 7>& shape) {
        const rays::Traffic found = released([&] {
            const auto reads = rays::readsOf(*scene_, raysOf(rays), rays.shape(0), mode, mask, isOcclusion);
            return rays::trafficOf(reads, {shape[0], shape[1], shape[2], shape[3], shape[4], shape[5], shape[6]});
        });
        return {{"reads", static_cast<std::int64_t>(found.reads)}, {"lines", static_cast<std::int64_t>(found.lines)}};
    }

    /// A batch of `count` rays from memory: the bytes of its records or its sensor in, the bytes of its responses out.
    Pixels<std::uint8_t> submit(const Column<std::uint8_t>& rays, std::uint32_t count, std::uint32_t mode,
                                const std::array<float, 3>& origin, float tnear, float tfar) {
        struct alignas(64) Line {
            std::uint8_t bytes[64];
        };
        colonnade_rays_batch batch{};
        batch.count = count;
        batch.mode = mode;
        const std::size_t bytes = rays::responseBytes(batch);
        if (rays.size() != rays::rayBytes(batch)) throw std::invalid_argument("rays of this form have other records");
        std::vector<Line> records(rays.size() / 64 + 1), responses(bytes / 64 + 1);
        if (rays.size() != 0) std::memcpy(records.data()->bytes, rays.data(), rays.size());
        std::uint32_t done = 0;
        batch.rays = reinterpret_cast<std::uintptr_t>(records.data());
        batch.hits = reinterpret_cast<std::uintptr_t>(responses.data());
        std::copy(origin.begin(), origin.end(), batch.origin);
        batch.tnear = tnear;
        batch.tfar = tfar;
        batch.tag = 1;
        batch.done = reinterpret_cast<std::uintptr_t>(&done);
        check(released([&] { return colonnade_rays_submit(scene_, &batch); }));
        check(colonnade_rays_wait(scene_));
        if (done != 1) throw std::runtime_error("the batch is not done");
        std::uint8_t* data;
        auto result = makeArray<std::uint8_t>({bytes}, data);
        std::memcpy(data, responses.data()->bytes, bytes);
        return result;
    }

    nb::tuple face(std::uint32_t id) const {
        std::uint32_t mesh, face;
        check(colonnade_rays_face(scene_, id, &mesh, &face));
        return nb::make_tuple(mesh, face);
    }

    Values counters() const {
        colonnade_rays_sums c;
        colonnade_rays_counters(device_, &c);
        if (python_) python_->raise();
        const auto value = [](std::uint64_t count) { return static_cast<std::int64_t>(count); };
        return {{"rays", value(c.rays)},
                {"raysRefused", value(c.rays_refused)},
                {"raysInBox", value(c.rays_in_box)},
                {"nodeReads", value(c.node_reads)},
                {"boxTests", value(c.box_tests)},
                {"triangleTests", value(c.triangle_tests)},
                {"deepestStack", value(c.deepest_stack)}};
    }

private:
    /// Calls `part` with parts of the rays, between which the interpreter handles signals.
    template <class Part> static void inParts(std::size_t count, const Part& part) {
        constexpr std::size_t most = 1 << 16;
        for (std::size_t first = 0; first < count; first += most) {
            if (first != 0 && PyErr_CheckSignals() != 0) throw nb::python_error();
            part(first, std::min(most, count - first));
        }
    }

    /// Numbers the rays of hits of a part from its first one.
    static void number(colonnade_rays_hit* hits, std::size_t count, std::size_t first) {
        for (std::size_t i = 0; i < count; ++i) hits[i].ray += static_cast<std::uint32_t>(first);
    }

    void check(int status) const {
        if (python_) python_->raise();
        if (status == COLONNADE_RAYS_NO_MEMORY) throw std::bad_alloc();
        if (status != COLONNADE_RAYS_OK) {
            const std::string error = colonnade_rays_error(device_);
            throw std::invalid_argument(error);
        }
    }

    static nb::dict columns(const std::vector<colonnade_rays_hit>& hits) {
        double *t, *weights;
        std::int64_t *mesh, *face, *ray;
        bool *backSide, *opaque;
        nb::dict result;
        result["ray"] = makeArray<std::int64_t>({hits.size()}, ray);
        result["mesh"] = makeArray<std::int64_t>({hits.size()}, mesh);
        result["face"] = makeArray<std::int64_t>({hits.size()}, face);
        result["t"] = makeArray<double>({hits.size()}, t);
        result["uv"] = makeArray<double>({hits.size(), 2}, weights);
        result["is_back"] = makeArray<bool>({hits.size()}, backSide);
        result["is_opaque"] = makeArray<bool>({hits.size()}, opaque);
        for (std::size_t i = 0; i < hits.size(); ++i) {
            const colonnade_rays_hit& hit = hits[i];
            ray[i] = hit.ray;
            mesh[i] = hit.mesh == UINT32_MAX ? -1 : static_cast<std::int64_t>(hit.mesh);
            face[i] = hit.face == UINT32_MAX ? -1 : static_cast<std::int64_t>(hit.face);
            t[i] = hit.t;
            weights[2 * i] = hit.u;
            weights[2 * i + 1] = hit.v;
            backSide[i] = (hit.flags & COLONNADE_RAYS_BACK_SIDE) != 0;
            opaque[i] = (hit.flags & COLONNADE_RAYS_NON_OPAQUE) == 0;
        }
        return result;
    }

    std::unique_ptr<PythonDevice> python_;
    colonnade_rays_device* device_ = nullptr;
    colonnade_rays_scene* scene_ = nullptr;
};

/// Rays in the device's integers, for comparison with exact arithmetic: kind, origin [3], direction [3], tMin, tMax,
/// product, exponent.
nb::list converted(const Values& numbers, const Eights<float>& rays, bool isLocal, std::uint32_t mantissa, int exponent,
                   const std::array<std::int64_t, 3>& base) {
    const rays::RayConverter converter(Numbers(numbers), static_cast<int>(lookUp(numbers, "directionBits")),
                                       {mantissa, exponent, base});
    nb::list result;
    for (std::size_t i = 0; i < rays.shape(0); ++i) {
        colonnade_rays_record record;
        std::memcpy(&record, rays.data() + 8 * i, sizeof record);
        const rays::ConvertedRay ray = converter.convert(record, isLocal);
        std::array<std::int64_t, 8> values;
        for (int a = 0; a < 3; ++a) {
            values[a] = static_cast<std::int64_t>(ray.request.origin[a]);
            values[3 + a] = static_cast<std::int64_t>(ray.request.direction[a]);
        }
        values[6] = static_cast<std::int64_t>(ray.request.tMin);
        values[7] = static_cast<std::int64_t>(ray.request.tMax);
        result.append(nb::make_tuple(static_cast<int>(ray.kind), values, ray.product, ray.exponent));
    }
    return result;
}

} // namespace

void bind_rays(nb::module_& module) {
    nb::class_<Rays>(
        module, "Rays",
        "A device that traces rays, with one scene: the calls of colonnade_rays.h, on the bit-exact model or a device.")
        .def(nb::init<const std::optional<std::string>&, nb::object>(), "design"_a.none(), "device"_a = nb::none())
        .def("add", &Rays::add, "vertices"_a, "faces"_a)
        .def("update", &Rays::update, "mesh"_a, "vertices"_a)
        .def("remove", &Rays::remove, "mesh"_a)
        .def("enable", &Rays::enable, "mesh"_a, "is_enabled"_a)
        .def("mask", &Rays::mask, "mesh"_a, "mask"_a)
        .def("opacity", &Rays::opacity, "mesh"_a, "is_opaque"_a.none())
        .def("refine", &Rays::refine, "is_refined"_a)
        .def("commit", &Rays::commit)
        .def("bounds", &Rays::bounds)
        .def("dropped", &Rays::dropped)
        .def("grid", &Rays::grid)
        .def("closest", &Rays::closest, "rays"_a, "mode"_a, "mask"_a)
        .def("all", &Rays::all, "rays"_a, "mode"_a, "mask"_a, "most"_a)
        .def("occluded", &Rays::occluded, "rays"_a, "mode"_a, "mask"_a)
        .def("order", &Rays::order, "rays"_a)
        .def("traffic", &Rays::traffic, "rays"_a, "mode"_a, "mask"_a, "is_occlusion"_a, "shape"_a)
        .def("submit", &Rays::submit, "rays"_a, "count"_a, "mode"_a, "origin"_a = std::array<float, 3>{},
             "tnear"_a = 0.0f, "tfar"_a = std::numeric_limits<float>::infinity())
        .def("face", &Rays::face, "id"_a)
        .def("counters", &Rays::counters);
    module.def("convert_rays", &converted, "numbers"_a, "rays"_a, "is_local"_a, "mantissa"_a, "exponent"_a, "base"_a);
    module.def("nearest_float", &rays::nearestFloat, "numerator"_a, "denominator"_a, "exponent"_a);
}
