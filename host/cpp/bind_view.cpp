// colonnade._core.TargetView: driver/src/colonnade_view.c, which computes registers on a target, for Python.
// Without the model's headers: its namespace has the name of the driver's structure.
#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/tuple.h>

#include <algorithm>
#include <stdexcept>
#include <string>
#include <vector>

#include "colonnade_motion.h"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace {

using Position = std::array<std::int64_t, 3>;
using Rotation = std::array<std::int32_t, 9>;

constexpr std::uint32_t deviceBase = 0x8000;

void check(colonnade_error error) {
    if (error != COLONNADE_OK) throw std::invalid_argument(colonnade_error_name(error));
}

colonnade_pose poseOf(const Position& position, const Rotation& rotation) {
    colonnade_pose pose;
    std::copy(position.begin(), position.end(), pose.position);
    std::copy(rotation.begin(), rotation.end(), &pose.rotation[0][0]);
    return pose;
}

class TargetView {
public:
    TargetView(const std::array<std::uint32_t, 8>& formatHash, std::uint32_t first, std::uint32_t end,
               const nb::bytes& file)
        : file_(file.c_str(), file.size()) {
        colonnade_design design{};
        std::copy(formatHash.begin(), formatHash.end(), design.format_hash);
        design.frame_registers = deviceBase + 4 * first;
        design.device_end = deviceBase + 4 * end;
        check(colonnade_view_open(&view_, &design, file_.data(), file_.size()));
        writes_.resize(8 * std::size_t{colonnade_view_most_writes(&view_)});
    }

    void setCamera(const Position& position, const Rotation& rotation, std::int64_t fx, std::int64_t fy,
                   std::int64_t cx, std::int64_t cy, std::uint32_t width, std::uint32_t height) {
        const colonnade_camera camera{poseOf(position, rotation), fx, fy, cx, cy, width, height};
        check(colonnade_view_set_camera(&view_, &camera));
    }

    void setObject(const Position& position, const Rotation& rotation) {
        const colonnade_pose pose = poseOf(position, rotation);
        check(colonnade_view_set_object(&view_, &pose));
    }

    void setBounds(const std::array<std::int32_t, 3>& low, const std::array<std::int32_t, 3>& high) {
        check(colonnade_view_set_bounds(&view_, low.data(), high.data()));
    }

    auto move(const Position& shift, const Rotation& rotation, const Position& pivot, const Rotation& linear,
              std::int32_t exponent, const Position& position) const {
        const colonnade_pose pose = poseOf(shift, rotation), from = poseOf(position, linear);
        colonnade_transform transform{{}, exponent, {}};
        std::copy(&from.rotation[0][0], &from.rotation[0][0] + 9, &transform.linear[0][0]);
        std::copy(from.position, from.position + 3, transform.position);
        check(colonnade_motion_move(&view_, &pose, pivot.data(), &transform));
        Rotation moved;
        std::copy(&transform.linear[0][0], &transform.linear[0][0] + 9, moved.begin());
        return std::make_tuple(moved, transform.exponent,
                               Position{transform.position[0], transform.position[1], transform.position[2]});
    }

    void setLight(std::uint32_t index, const Position& position, const std::array<std::uint32_t, 3>& colour,
                  std::uint64_t reach) {
        colonnade_light light{{}, {}, reach};
        std::copy(position.begin(), position.end(), light.position);
        std::copy(colour.begin(), colour.end(), light.colour);
        check(colonnade_view_set_light(&view_, index, &light));
    }

    void setSample(std::uint32_t index, std::uint32_t count) { check(colonnade_view_set_sample(&view_, index, count)); }

    nb::bytes frame() {
        colonnade_frame frame;
        check(colonnade_view_frame(&view_, writes_.data(), static_cast<std::uint32_t>(writes_.size() / 8), &frame));
        return nb::bytes(reinterpret_cast<const char*>(writes_.data()), 8 * std::size_t{frame.count});
    }

    void accept() { colonnade_view_accept(&view_); }
    void forget() { colonnade_view_forget(&view_); }

private:
    std::string file_;
    colonnade_view view_;
    std::vector<std::uint8_t> writes_;
};

Rotation rotationOf(const std::array<std::int32_t, 4>& quaternion) {
    std::int32_t rotation[3][3];
    check(colonnade_rotation(rotation, quaternion.data()));
    Rotation result;
    std::copy(&rotation[0][0], &rotation[0][0] + 9, result.begin());
    return result;
}

} // namespace

void bind_view(nb::module_& module) {
    nb::class_<TargetView>(module, "TargetView")
        .def(nb::init<const std::array<std::uint32_t, 8>&, std::uint32_t, std::uint32_t, const nb::bytes&>(),
             "format_hash"_a, "first"_a, "end"_a, "file"_a)
        .def("set_camera", &TargetView::setCamera, "position"_a, "rotation"_a, "fx"_a, "fy"_a, "cx"_a, "cy"_a,
             "width"_a, "height"_a)
        .def("set_object", &TargetView::setObject, "position"_a, "rotation"_a)
        .def("set_bounds", &TargetView::setBounds, "low"_a, "high"_a)
        .def("move", &TargetView::move, "shift"_a, "rotation"_a, "pivot"_a, "linear"_a, "exponent"_a, "position"_a)
        .def("set_light", &TargetView::setLight, "index"_a, "position"_a, "colour"_a, "reach"_a)
        .def("set_sample", &TargetView::setSample, "index"_a, "count"_a)
        .def("frame", &TargetView::frame)
        .def("accept", &TargetView::accept)
        .def("forget", &TargetView::forget);
    module.def("target_rotation", &rotationOf, "quaternion"_a);
}
