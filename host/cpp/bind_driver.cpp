// colonnade._core.Driver: driver/src/colonnade.c, the driver in C, whose accesses to the registers Python makes.
// Without the model's headers: its namespace has the name of the driver's structure.
#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <exception>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "colonnade_batches.h"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace {

using Window = std::pair<std::uint64_t, std::uint64_t>;
using Memories = std::vector<std::pair<std::uint32_t, std::uint32_t>>;

/// A poll or a pause of the transport each; the transport ends a wait that is too long by an exception.
constexpr std::uint32_t attempts = 0xFFFFFFFF, resetAttempts = 100000;

class Driver {
public:
    Driver(nb::object transport, const std::array<std::uint32_t, 8>& formatHash,
           const std::map<std::string, std::uint32_t>& numbers, const Memories& maps)
        : transport_(std::move(transport)), bus_{&read, &write, &wait, this} {
        std::copy(formatHash.begin(), formatHash.end(), design_.format_hash);
        design_.device_end = numbers.at("device_end");
        design_.frame_registers = numbers.at("frame_registers");
        design_.errors = numbers.at("errors");
        design_.error_count = numbers.at("error_count");
        design_.counters = numbers.at("counters");
        design_.counter_count = numbers.at("counter_count");
        design_.tile_size = numbers.at("tile_size");
        design_.posted_writes = numbers.at("posted_writes");
        design_.scene_page = numbers.at("scene_page");
        design_.invalidate = numbers.at("invalidate");
        design_.rays_tail = numbers.at("rays_tail");
        design_.rays_head = numbers.at("rays_head");
        design_.bounds = numbers.at("bounds");
        design_.scene = numbers.at("scene");
        design_.placement = numbers.at("placement");
        design_.ring = numbers.at("ring");
        if (maps.size() > COLONNADE_MAX_MAPS) throw std::invalid_argument("too many maps");
        design_.map_count = static_cast<std::uint32_t>(maps.size());
        for (std::size_t i = 0; i < maps.size(); ++i) design_.maps[i] = {maps[i].first, maps[i].second};
    }

    // The driver keeps addresses of its bus and its design
    Driver(const Driver&) = delete;
    Driver& operator=(const Driver&) = delete;

    std::string probe() {
        return run([&] { return colonnade_probe(&device_, &bus_, &design_); });
    }

    std::string load(const nb::bytes& image, std::uint64_t address, Window window, bool isMaps) {
        const colonnade_image described{
            image.c_str(), static_cast<std::uint32_t>(image.size()), address, {window.first, window.second}};
        return run([&] { return (isMaps ? colonnade_load_maps : colonnade_load)(&device_, &described, attempts); });
    }

    std::string setScene(std::uint64_t address) {
        return run([&] { return colonnade_set_scene(&device_, address); });
    }

    std::string setFrame(const nb::bytes& file) {
        return run([&] {
            colonnade_frame frame;
            const colonnade_error error = colonnade_open_frame(&design_, file.c_str(), file.size(), &frame);
            return error == COLONNADE_OK ? colonnade_set_frame(&device_, &frame) : error;
        });
    }

    std::string setPhoto(std::uint64_t base, std::uint32_t stride, Window window, bool hasStrengths) {
        const colonnade_photo photo{base, stride, {window.first, window.second}, hasStrengths};
        return run([&] { return colonnade_set_photo(&device_, &photo); });
    }

    std::string clearPhoto() {
        return run([&] { return colonnade_set_photo(&device_, nullptr); });
    }

    std::string start(std::uint64_t base, std::uint32_t stride, std::uint32_t format, Window window) {
        const colonnade_framebuffer framebuffer{
            base, stride, static_cast<colonnade_format>(format), {window.first, window.second}};
        return run([&] { return colonnade_start(&device_, &framebuffer); });
    }

    std::string waitFor(std::uint32_t events) {
        return run([&] { return colonnade_wait(&device_, events, attempts); });
    }

    std::string result() {
        return run([&] { return colonnade_result(&device_); });
    }

    using Axes = std::array<std::int32_t, 3>;

    std::string setRays(const Axes& low, const Axes& high, std::size_t count, std::uint32_t mantissa,
                        std::int32_t exponent, const std::array<std::int64_t, 3>& base) {
        colonnade_rays_image image{nullptr, count, 0, {}, {}, mantissa, exponent, {}};
        std::copy(low.begin(), low.end(), image.bounds_low);
        std::copy(high.begin(), high.end(), image.bounds_high);
        std::copy(base.begin(), base.end(), image.base);
        return run([&] { return colonnade_set_rays(&device_, &image); });
    }

    std::string openRing(std::uint64_t address, std::uint32_t sizeLog, Window window) {
        const colonnade_window bounds{window.first, window.second};
        return run([&] { return colonnade_open_ring(&ring_, &device_, address, sizeLog, &bounds); });
    }

    std::pair<std::string, std::uint64_t> nextBatch() {
        std::uint64_t address = 0;
        std::string error = run([&] { return colonnade_next_batch(&ring_, &address); });
        return {std::move(error), address};
    }

    std::string submit() {
        return run([&] { return colonnade_submit(&ring_); });
    }

    std::string waitBatches() {
        return run([&] { return colonnade_wait_batches(&ring_, attempts); });
    }

    std::string reset() {
        return run([&] { return colonnade_reset(&device_, resetAttempts); });
    }

    void acknowledge(std::uint32_t events) {
        run([&] { return colonnade_acknowledge(&device_, events), COLONNADE_OK; });
    }

    void enableInterrupts(std::uint32_t events) {
        run([&] { return colonnade_enable_interrupts(&device_, events), COLONNADE_OK; });
    }

    std::uint32_t deviceErrors() {
        std::uint32_t bits = 0;
        run([&] { return bits = colonnade_device_errors(&device_), COLONNADE_OK; });
        return bits;
    }

    std::uint64_t counter(std::uint32_t index) {
        std::uint64_t value = 0;
        run([&] { return value = colonnade_counter(&device_, index), COLONNADE_OK; });
        return value;
    }

private:
    /// Makes a call of the driver. An exception of an access ends it: further accesses are not made and read as ones,
    /// so that waits end, and the exception goes on when the driver, which is C, has returned.
    template <class Call> std::string run(Call call) {
        const colonnade_error error = call();
        if (problem_) std::rethrow_exception(std::exchange(problem_, nullptr));
        return colonnade_error_name(error);
    }

    template <class Access> std::uint32_t access(Access make) noexcept {
        if (problem_) return ~std::uint32_t{0};
        try {
            return make();
        } catch (...) {
            problem_ = std::current_exception();
            return ~std::uint32_t{0};
        }
    }

    static Driver& of(void* context) { return *static_cast<Driver*>(context); }

    static std::uint32_t read(void* context, std::uint32_t address) {
        return of(context).access(
            [&] { return nb::cast<std::uint32_t>(of(context).transport_.attr("read32")(address)); });
    }

    static void write(void* context, std::uint32_t address, std::uint32_t value) {
        of(context).access([&] { return of(context).transport_.attr("write32")(address, value), 0u; });
    }

    static void wait(void* context) {
        of(context).access([&] { return of(context).transport_.attr("wait")(), 0u; });
    }

    nb::object transport_;
    colonnade_bus bus_;
    colonnade_design design_{};
    colonnade device_{};
    colonnade_ring ring_{};
    std::exception_ptr problem_;
};

} // namespace

void bind_driver(nb::module_& module) {
    nb::class_<Driver>(module, "Driver")
        .def(nb::init<nb::object, const std::array<std::uint32_t, 8>&, const std::map<std::string, std::uint32_t>&,
                      const Memories&>(),
             "transport"_a, "format_hash"_a, "numbers"_a, "maps"_a)
        .def("probe", &Driver::probe)
        .def("load", &Driver::load, "image"_a, "address"_a, "window"_a, "is_maps"_a)
        .def("set_scene", &Driver::setScene, "address"_a)
        .def("set_frame", &Driver::setFrame, "file"_a)
        .def("set_photo", &Driver::setPhoto, "base"_a, "stride"_a, "window"_a, "has_strengths"_a)
        .def("clear_photo", &Driver::clearPhoto)
        .def("start", &Driver::start, "base"_a, "stride"_a, "format"_a, "window"_a)
        .def("wait", &Driver::waitFor, "events"_a)
        .def("result", &Driver::result)
        .def("set_rays", &Driver::setRays, "low"_a, "high"_a, "count"_a, "mantissa"_a, "exponent"_a, "base"_a)
        .def("open_ring", &Driver::openRing, "address"_a, "size_log"_a, "window"_a)
        .def("next_batch", &Driver::nextBatch)
        .def("submit", &Driver::submit)
        .def("wait_batches", &Driver::waitBatches)
        .def("reset", &Driver::reset)
        .def("acknowledge", &Driver::acknowledge, "events"_a)
        .def("enable_interrupts", &Driver::enableInterrupts, "events"_a)
        .def("device_errors", &Driver::deviceErrors)
        .def("counter", &Driver::counter, "index"_a);
}
