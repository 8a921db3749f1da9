// colonnade._core.RaySimulation and RayRegisters: the simulated device for rays, and sums of any device's counters.
#include <nanobind/stl/function.h>

#include "binding.hpp"
#include "rays/simulation.hpp"

using namespace nanobind::literals;
using namespace colonnade;
using namespace colonnade::binding;

namespace {

class RaySimulation {
public:
    RaySimulation(const std::string& registers, int commands, int answers, int errors)
        : simulation_(registers, {commands, answers, errors}) {}

    void load(const rays::RegisterValues& values, const nb::bytes& records, std::size_t count) {
        const auto* const data = static_cast<const std::uint8_t*>(records.data());
        released([&] { simulation_.load(values, data, count, records.size() / count); });
    }

    nb::tuple submit(const nb::bytes& batch, const nb::bytes& rays, std::size_t size) {
        colonnade_rays_batch words;
        if (batch.size() != sizeof words) throw std::invalid_argument("a batch has 64 bytes");
        std::memcpy(&words, batch.data(), sizeof words);
        std::string hits(size, '\0');
        const std::uint32_t tag =
            released([&] { return simulation_.submit(words, rays.data(), rays.size(), hits.data(), size); });
        return nb::make_tuple(tag, nb::bytes(hits.data(), size));
    }

    rays::RegisterValues counters() {
        return released([&] { return simulation_.counters(); });
    }

private:
    rays::Simulation simulation_;
};

} // namespace

void bind_simulation(nb::module_& module) {
    nb::class_<RaySimulation>(module, "RaySimulation")
        .def(nb::init<const std::string&, int, int, int>(), "registers"_a, "commands"_a, "answers"_a, "errors"_a)
        .def("load", &RaySimulation::load, "values"_a, "records"_a, "count"_a)
        .def("submit", &RaySimulation::submit, "batch"_a, "rays"_a, "size"_a)
        .def("counters", &RaySimulation::counters);
    using Read = std::function<std::uint32_t(std::uint32_t)>;
    nb::class_<rays::DeviceRegisters>(module, "RayRegisters")
        .def(nb::init<const std::string&>(), "registers"_a)
        .def(
            "sums", [](const rays::DeviceRegisters& registers, const Read& read) { return registers.sums(read); },
            "read"_a)
        .def(
            "keep_sums", [](rays::DeviceRegisters& registers, const Read& read) { registers.keepSums(read); },
            "read"_a);
}
