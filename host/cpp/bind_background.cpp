// colonnade._core.RoomModel: the bit-exact model of a room in the physical-attribute memory (cpp/model) for Python.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>

#include <cmath>
#include <tuple>

#include "model/background.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace colonnade;

namespace {

using Values = std::map<std::string, std::int64_t>;
using FieldTuples = std::map<std::string, std::map<std::string, std::tuple<int, int, bool>>>;
using Words = nb::ndarray<const std::uint8_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Vectors = nb::ndarray<const std::int64_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;

template <class T> using Values1 = nb::ndarray<nb::numpy, T, nb::ndim<1>>;

template <class T> Values1<T> newArray(std::size_t size, T*& data) {
    data = new T[size]();
    nb::capsule owner(data, [](void* memory) noexcept { delete[] static_cast<T*>(memory); });
    return Values1<T>(data, {size}, owner);
}

std::map<std::string, Layout> layoutsOf(const FieldTuples& tuples) {
    std::map<std::string, Layout> layouts;
    for (const auto& [record, fields] : tuples)
        for (const auto& [name, field] : fields) layouts[record][name] = {std::get<0>(field), std::get<1>(field), std::get<2>(field)};
    return layouts;
}

RoomView viewOf(const Values& registers) {
    RoomView view{};
    const auto vector = [&](const std::string& name) { return Vector{lookUp(registers, name + ".x"), lookUp(registers, name + ".y"), lookUp(registers, name + ".z")}; };
    for (int row = 0; row < 3; ++row) view.matrix[row] = vector("matrix[" + std::to_string(row) + "]");
    view.offset = vector("offset");
    view.offsetShift = static_cast<int>(lookUp(registers, "offsetShift"));
    view.exponent = static_cast<int>(lookUp(registers, "exponent"));
    view.shellPlanes = static_cast<int>(lookUp(registers, "shellPlanes"));
    return view;
}

class RoomModel {
public:
    RoomModel(const Values& numbers, const Values& sizes, const FieldTuples& layouts)
        : numbers_(numbers), image_(AttributeSizes(sizes), layoutsOf(layouts)) {}

    void load(const std::string& memory, const Words& words) { image_.load(memory, words.data(), words.shape(0), words.shape(1)); }

    nb::dict march(const Values& registers, const Vectors& origins, const Vectors& directions) {
        const RoomView view = viewOf(registers);
        const Background background(numbers_, image_);
        const std::size_t count = origins.shape(0);
        std::int64_t *kind, *x, *y, *entry, *steps;
        bool* isHidden;
        double* travel;
        nb::dict result;
        result["kind"] = newArray(count, kind);
        result["x"] = newArray(count, x);
        result["y"] = newArray(count, y);
        result["entry"] = newArray(count, entry);
        result["steps"] = newArray(count, steps);
        result["is_hidden"] = newArray(count, isHidden);
        result["travel"] = newArray(count, travel);
        nb::gil_scoped_release release;
        for (std::size_t i = 0; i < count; ++i) {
            WideVector origin;
            Vector direction;
            for (std::size_t a = 0; a < 3; ++a) {
                origin[a] = origins(i, a);
                direction[a] = directions(i, a);
            }
            const RoomPoint point = background.meet(origin, direction, view);
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

void bind_background(nb::module_& module) {
    nb::class_<RoomModel>(module, "RoomModel", "A room in the physical-attribute memory: rays go in, the points of the room that they meet come out.")
        .def(nb::init<const Values&, const Values&, const FieldTuples&>(), "numbers"_a, "sizes"_a, "layouts"_a,
             "From the manifest's numbers and its attributes: sizes, and layouts as word -> field -> (offset, width, signed).")
        .def("load", &RoomModel::load, "memory"_a, "words"_a, "Fills a memory by its name: uint8 [words, bytes], low byte first.")
        .def("march", &RoomModel::march, "registers"_a, "origins"_a, "directions"_a,
             "Where rays meet the room. Origins int64 [n, 3], grid steps; directions int64 [n, 3], components of shadeBits bits and a sign. Registers: "
             "matrix[0..2].{x,y,z}, offset.{x,y,z}, offsetShift, exponent, shellPlanes. Gives kind int64 [n] (0 nothing, 1 map, 2 shell), the map's pixel "
             "x, y, the shell's entry, is_hidden bool, travel float64 (directions from the origin), steps.");
}
