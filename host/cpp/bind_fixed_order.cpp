/// The functions of colonnade.common.fixed_order on numpy arrays.
#include "binding.hpp"
#include "fixed_order.hpp"

using namespace nanobind::literals;
using namespace colonnade::binding;
namespace fixed_order = colonnade::fixed_order;

// Wider vectors sum more elements side by side; the sums are the same.
#if defined(__x86_64__) && defined(__GLIBC__)
#define FOR_WIDE_VECTORS_TOO __attribute__((target_clones("avx2", "default")))
#else
#define FOR_WIDE_VECTORS_TOO
#endif

namespace {

template <class T> using Matrices = nb::ndarray<const T, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using Numbers = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

FOR_WIDE_VECTORS_TOO void multiply(const float* a, const float* b, float* out, std::size_t rows, std::size_t inner,
                                   std::size_t columns, bool isTransposed) {
    fixed_order::product(a, b, out, rows, inner, columns, isTransposed);
}

FOR_WIDE_VECTORS_TOO void multiply(const double* a, const double* b, double* out, std::size_t rows, std::size_t inner,
                                   std::size_t columns, bool isTransposed) {
    fixed_order::product(a, b, out, rows, inner, columns, isTransposed);
}

FOR_WIDE_VECTORS_TOO void powers(const double* x, double y, double* out, std::size_t count) {
    fixed_order::power(x, y, out, count);
}

/// Of stacks; the first one's matrices may be transposed.
template <class T> Pixels<T> product(const Matrices<T>& a, const Matrices<T>& b, bool isTransposed) {
    const std::size_t count = a.shape(0), rows = a.shape(isTransposed ? 2 : 1), inner = a.shape(isTransposed ? 1 : 2),
                      columns = b.shape(2);
    if (b.shape(0) != count || b.shape(1) != inner)
        throw std::invalid_argument("the shapes of the matrices do not fit");
    T* out;
    auto result = makeArray({count, rows, columns}, out);
    const T *first = a.data(), *second = b.data();
    nb::gil_scoped_release release;
    for (std::size_t i = 0; i < count; ++i)
        multiply(first + i * rows * inner, second + i * inner * columns, out + i * rows * columns, rows, inner, columns,
                 isTransposed);
    return result;
}

template <class Function> Pixels<double> eachOf(const Numbers& values, Function function) {
    double* out;
    auto result = makeArray({values.shape(0)}, out);
    const double* in = values.data();
    nb::gil_scoped_release release;
    for (std::size_t i = 0; i < values.shape(0); ++i) out[i] = function(in[i]);
    return result;
}

Pixels<double> power(const Numbers& x, double y) {
    double* out;
    auto result = makeArray({x.shape(0)}, out);
    nb::gil_scoped_release release;
    powers(x.data(), y, out, x.shape(0));
    return result;
}

Pixels<double> arctan2(const Numbers& y, const Numbers& x) {
    if (x.shape(0) != y.shape(0)) throw std::invalid_argument("the numbers of coordinates differ");
    double* out;
    auto result = makeArray({y.shape(0)}, out);
    for (std::size_t i = 0; i < y.shape(0); ++i) out[i] = fixed_order::arctan2(y(i), x(i));
    return result;
}

} // namespace

void bind_fixed_order(nb::module_& module) {
    module.def("product", &product<float>, "a"_a, "b"_a, "is_transposed"_a);
    module.def("product", &product<double>, "a"_a, "b"_a, "is_transposed"_a);
    module.def("log", [](const Numbers& x) { return eachOf(x, fixed_order::log); }, "x"_a);
    module.def("exp", [](const Numbers& x) { return eachOf(x, fixed_order::exp); }, "x"_a);
    module.def("power", &power, "x"_a, "y"_a);
    module.def("arccos", [](const Numbers& x) { return eachOf(x, fixed_order::arccos); }, "x"_a);
    module.def(
        "cosine",
        [](const Numbers& x, int quarters) {
            return eachOf(x, [quarters](double value) { return fixed_order::cosine(value, quarters); });
        },
        "x"_a, "quarters"_a);
    module.def("arctan2", &arctan2, "y"_a, "x"_a);
}
