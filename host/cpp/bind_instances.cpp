// colonnade._core.TargetInstances: driver/src/colonnade_instances.c, which places objects on a target, for Python.
#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <stdexcept>
#include <vector>

#include "colonnade_instances.h"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace {

using Corner = std::array<std::int32_t, 3>;

class TargetInstances {
public:
    TargetInstances(std::int32_t vertexBits, std::int32_t gridFraction, std::int32_t sceneBits) : world_{vertexBits, gridFraction, sceneBits} {}

    auto add(const Corner& low, const Corner& high, std::uint64_t offset, std::uint32_t root, std::uint32_t materialBase, const std::array<std::int32_t, 9>& linear,
             std::int32_t exponent, const std::array<std::int64_t, 3>& position) {
        colonnade_object object{{}, {}, offset, root, materialBase};
        std::copy(low.begin(), low.end(), object.low);
        std::copy(high.begin(), high.end(), object.high);
        colonnade_transform transform{{}, exponent, {}};
        std::copy(linear.begin(), linear.end(), &transform.linear[0][0]);
        std::copy(position.begin(), position.end(), transform.position);
        colonnade_instance placed;
        const colonnade_error error = colonnade_find_instance(&world_, &object, &transform, &placed);
        if (error != COLONNADE_OK) throw std::invalid_argument(colonnade_error_name(error));
        placed_.push_back(placed);
        return std::vector<std::uint32_t>(placed.words, placed.words + colonnade_instance_words(&world_));
    }

    auto shared() const {
        const colonnade_shared all = colonnade_find_shared(placed_.data(), static_cast<std::uint32_t>(placed_.size()));
        return std::make_tuple(Corner{all.low[0], all.low[1], all.low[2]}, Corner{all.high[0], all.high[1], all.high[2]}, all.offset);
    }

private:
    colonnade_world world_;
    std::vector<colonnade_instance> placed_;
};

} // namespace

void bind_instances(nb::module_& module) {
    nb::class_<TargetInstances>(module, "TargetInstances")
        .def(nb::init<std::int32_t, std::int32_t, std::int32_t>(), "vertex_bits"_a, "grid_fraction"_a, "scene_bits"_a)
        .def("add", &TargetInstances::add, "low"_a, "high"_a, "offset"_a, "root"_a, "material_base"_a, "linear"_a, "exponent"_a, "position"_a)
        .def("shared", &TargetInstances::shared);
}
