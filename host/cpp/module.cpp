// colonnade._core: the compiled half of the host. Each bind_*.cpp of this folder adds one subject.
#include <nanobind/nanobind.h>

namespace nb = nanobind;

void bind_background(nb::module_& module);
void bind_bvh(nb::module_& module);
void bind_model(nb::module_& module);

NB_MODULE(_core, module) {
  module.doc() = "Bounding-volume hierarchy builder and bit-exact model of the accelerator.";
#ifdef COLONNADE_HAS_BACKGROUND
  bind_background(module);
#endif
#ifdef COLONNADE_HAS_BVH
  bind_bvh(module);
#endif
#ifdef COLONNADE_HAS_MODEL
  bind_model(module);
#endif
}
