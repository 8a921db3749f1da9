// colonnade._core.EnvironmentModel: the bit-exact model of the environment march (cpp/model) for Python.
#include <cmath>

#include "binding.hpp"
#include "model/environment_march.hpp"

using namespace nanobind::literals;
using namespace colonnade;
using namespace colonnade::binding;

namespace {

EnvironmentView viewOf(const Values& registers) {
    EnvironmentView view{};
    const auto vector = [&](const std::string& name) {
        return Vector{lookUp(registers, name + ".x"), lookUp(registers, name + ".y"), lookUp(registers, name + ".z")};
    };
    for (int row = 0; row < 3; ++row) view.matrix[row] = vector("matrix[" + std::to_string(row) + "]");
    view.offset = vector("offset");
    view.offsetShift = static_cast<int>(lookUp(registers, "offsetShift"));
    view.exponent = static_cast<int>(lookUp(registers, "exponent"));
    view.boundingPlanes = static_cast<int>(lookUp(registers, "boundingPlanes"));
    return view;
}

class EnvironmentModel {
public:
    EnvironmentModel(const Values& numbers, const Values& sizes, const FieldTuples& layouts)
        : numbers_(numbers), image_(AttributeSizes(sizes), layoutsOf(layouts)) {}

    void load(const std::string& memory, const Records& words) {
        image_.load(memory, words.data(), words.shape(0), words.shape(1));
    }

    nb::dict march(const Values& registers, const Vectors& origins, const Vectors& directions, bool isFromCamera) {
        const EnvironmentView view = viewOf(registers);
        const EnvironmentMarch march(numbers_, image_);
        const std::size_t count = origins.shape(0);
        std::int64_t *kind, *x, *y, *entry, *steps;
        bool* isHidden;
        double* travel;
        nb::dict result;
        result["kind"] = makeArray({count}, kind);
        result["x"] = makeArray({count}, x);
        result["y"] = makeArray({count}, y);
        result["entry"] = makeArray({count}, entry);
        result["steps"] = makeArray({count}, steps);
        result["is_hidden"] = makeArray({count}, isHidden);
        result["travel"] = makeArray({count}, travel);
        nb::gil_scoped_release release;
        for (std::size_t i = 0; i < count; ++i) {
            WideVector origin;
            Vector direction;
            for (std::size_t a = 0; a < 3; ++a) {
                origin[a] = origins(i, a);
                direction[a] = directions(i, a);
            }
            const EnvironmentPoint point =
                isFromCamera ? march.cameraView(origin, direction, view) : march.findHit(origin, direction, view);
            kind[i] = static_cast<std::int64_t>(point.kind);
            x[i] = point.x;
            y[i] = point.y;
            entry[i] = point.entry;
            steps[i] = point.steps;
            isHidden[i] = point.isHidden;
            travel[i] = std::ldexp(static_cast<double>(point.travel), point.travelExponent);
        }
        return result;
    }

private:
    Numbers numbers_;
    AttributeImage image_;
};

} // namespace

void bind_environment(nb::module_& module) {
    nb::class_<EnvironmentModel>(module, "EnvironmentModel",
                                 "Model of the environment march over maps in the physical-attribute memory.")
        .def(nb::init<const Values&, const Values&, const FieldTuples&>(), "numbers"_a, "sizes"_a, "layouts"_a,
             "From the manifest's numbers, and its attributes' sizes and layouts: word -> field -> (offset, width, "
             "signed).")
        .def("load", &EnvironmentModel::load, "memory"_a, "words"_a,
             "Loads a memory, by its name in the manifest: uint8 [words, bytes], low byte first.")
        .def("march", &EnvironmentModel::march, "registers"_a, "origins"_a, "directions"_a, "is_from_camera"_a = false,
             "Finds where rays hit the environment, or what a camera's rays see of its maps. Origins int64 [n, 3], "
             "grid steps; directions int64 [n, 3], components of shadeBits bits and a sign. Registers: "
             "matrix[0..2].{x,y,z}, offset.{x,y,z}, offsetShift, exponent, boundingPlanes. Returns kind int64 [n] (0 "
             "miss, 1 map, 2 bounding plane), the map's pixel "
             "x, y, the bounding plane's entry, is_hidden bool, travel float64 (in ray directions from the origin), "
             "steps.");
}
