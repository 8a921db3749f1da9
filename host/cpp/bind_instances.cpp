// colonnade._core.TargetInstances, TargetMotion: driver/src/colonnade_instances.c and colonnade_motion.c, which move
// objects on a target, for Python.
#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <stdexcept>
#include <string>
#include <vector>

#include "colonnade_motion.h"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace {

using Corner = std::array<std::int32_t, 3>;
using Linear = std::array<std::int32_t, 9>;
using Position = std::array<std::int64_t, 3>;

constexpr std::uint32_t deviceBase = 0x8000;

void check(colonnade_error error) {
    if (error != COLONNADE_OK) throw std::invalid_argument(colonnade_error_name(error));
}

class TargetInstances {
public:
    TargetInstances(std::int32_t vertexBits, std::int32_t gridFraction, std::int32_t sceneBits)
        : world_{vertexBits, gridFraction, sceneBits} {}

    auto add(const Corner& low, const Corner& high, std::uint64_t offset, std::uint32_t root,
             std::uint32_t materialBase, const Linear& linear, std::int32_t exponent, const Position& position) {
        colonnade_object object{{}, {}, offset, root, materialBase};
        std::copy(low.begin(), low.end(), object.low);
        std::copy(high.begin(), high.end(), object.high);
        colonnade_transform transform{{}, exponent, {}};
        std::copy(linear.begin(), linear.end(), &transform.linear[0][0]);
        std::copy(position.begin(), position.end(), transform.position);
        colonnade_instance placed;
        check(colonnade_find_instance(&world_, &object, &transform, &placed));
        placed_.push_back(placed);
        return std::vector<std::uint32_t>(placed.words, placed.words + colonnade_instance_words(&world_));
    }

    auto shared() const {
        const colonnade_shared all = colonnade_find_shared(placed_.data(), static_cast<std::uint32_t>(placed_.size()));
        return std::make_tuple(Corner{all.low[0], all.low[1], all.low[2]},
                               Corner{all.high[0], all.high[1], all.high[2]}, all.offset);
    }

private:
    colonnade_world world_;
    std::vector<colonnade_instance> placed_;
};

class TargetMotion {
public:
    TargetMotion(const std::array<std::uint32_t, 8>& formatHash, std::uint32_t first, std::uint32_t end,
                 const nb::bytes& file)
        : file_(file.c_str(), file.size()) {
        std::copy(formatHash.begin(), formatHash.end(), design_.format_hash);
        design_.frame_registers = deviceBase + 4 * first;
        design_.device_end = deviceBase + 4 * end;
        check(colonnade_motion_open(&motion_, &design_, file_.data(), file_.size()));
    }

    auto transforms(std::uint32_t time) const {
        std::vector<std::tuple<Linear, std::int32_t, Position>> result;
        for (const colonnade_transform& one : at(time)) {
            Linear linear;
            Position position;
            std::copy(&one.linear[0][0], &one.linear[0][0] + 9, linear.begin());
            std::copy(one.position, one.position + 3, position.begin());
            result.emplace_back(linear, one.exponent, position);
        }
        return result;
    }

    /// The writes of a time; of those before it, if there is one, only what changes.
    nb::bytes writes(std::uint32_t time, std::int64_t before) const {
        std::vector<std::uint8_t> writes(8 * COLONNADE_MOTION_WRITES);
        const std::vector<colonnade_instance> now = found(time),
                                              last = before < 0 ? now : found(static_cast<std::uint32_t>(before));
        const std::size_t count =
            colonnade_motion_writes(&motion_, now.data(), before < 0 ? nullptr : last.data(), writes.data());
        return nb::bytes(reinterpret_cast<const char*>(writes.data()), 8 * count);
    }

    /// The address of the root of each mesh that bends, and its duration, 2^-16 s.
    auto meshes() const {
        std::vector<std::tuple<std::uint32_t, std::uint32_t>> result;
        for (std::uint32_t i = 0; i < motion_.clips; ++i) {
            result.emplace_back(motion_.roots[i][0], motion_.meshes[i].duration);
        }
        return result;
    }

private:
    std::vector<colonnade_transform> at(std::uint32_t time) const {
        std::vector<colonnade_transform> transforms(motion_.objects);
        colonnade_motion_transforms(&motion_, time, transforms.data());
        return transforms;
    }

    std::vector<colonnade_instance> found(std::uint32_t time) const {
        std::vector<colonnade_instance> instances(motion_.objects);
        check(colonnade_motion_find(&motion_, at(time).data(), instances.data()));
        return instances;
    }

    std::string file_;
    colonnade_design design_{};
    colonnade_motion motion_;
};

} // namespace

void bind_instances(nb::module_& module) {
    nb::class_<TargetInstances>(module, "TargetInstances")
        .def(nb::init<std::int32_t, std::int32_t, std::int32_t>(), "vertex_bits"_a, "grid_fraction"_a, "scene_bits"_a)
        .def("add", &TargetInstances::add, "low"_a, "high"_a, "offset"_a, "root"_a, "material_base"_a, "linear"_a,
             "exponent"_a, "position"_a)
        .def("shared", &TargetInstances::shared);
    nb::class_<TargetMotion>(module, "TargetMotion")
        .def(nb::init<const std::array<std::uint32_t, 8>&, std::uint32_t, std::uint32_t, const nb::bytes&>(),
             "format_hash"_a, "first"_a, "end"_a, "file"_a)
        .def("transforms", &TargetMotion::transforms, "time"_a)
        .def("writes", &TargetMotion::writes, "time"_a, "before"_a = -1)
        .def("meshes", &TargetMotion::meshes);
}
