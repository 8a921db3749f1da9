// Shared by the bindings: the manifest's values, and numpy arrays.
#pragma once
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>

#include <tuple>

#include "model/formats.hpp"

namespace colonnade::binding {

namespace nb = nanobind;

using Values = std::map<std::string, std::int64_t>;
using FieldTuples = std::map<std::string, std::map<std::string, std::tuple<int, int, bool>>>;
using Records = nb::ndarray<const std::uint8_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Vectors = nb::ndarray<const std::int64_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;

template <class T> using Pixels = nb::ndarray<nb::numpy, T>;

/// Makes a numpy array that owns its memory.
template <class T> Pixels<T> makeArray(std::initializer_list<std::size_t> shape, T*& data) {
    std::size_t size = 1;
    for (const auto extent : shape) size *= extent;
    data = new T[size]();
    nb::capsule owner(data, [](void* memory) noexcept { delete[] static_cast<T*>(memory); });
    return Pixels<T>(data, shape, owner);
}

/// What a function of C++ alone returns, while other threads of Python run.
template <class Function> auto released(const Function& function) {
    nb::gil_scoped_release release;
    return function();
}

inline std::map<std::string, Layout> layoutsOf(const FieldTuples& tuples) {
    std::map<std::string, Layout> layouts;
    for (const auto& [record, fields] : tuples)
        for (const auto& [name, field] : fields)
            layouts[record][name] = {std::get<0>(field), std::get<1>(field), std::get<2>(field)};
    return layouts;
}

} // namespace colonnade::binding
