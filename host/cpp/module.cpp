// colonnade._core: the compiled half of the host. Each bind_*.cpp exports one part.
#include <nanobind/nanobind.h>

namespace nb = nanobind;

void bind_environment(nb::module_& module);
void bind_bvh(nb::module_& module);
void bind_clip(nb::module_& module);
void bind_driver(nb::module_& module);
void bind_files(nb::module_& module);
void bind_fixed_order(nb::module_& module);
void bind_instances(nb::module_& module);
void bind_leaf(nb::module_& module);
void bind_live(nb::module_& module);
void bind_mesh(nb::module_& module);
void bind_model(nb::module_& module);
void bind_packer(nb::module_& module);
void bind_rays(nb::module_& module);
void bind_simulation(nb::module_& module);
void bind_surroundings(nb::module_& module);
void bind_view(nb::module_& module);

NB_MODULE(_core, module) {
    module.doc() =
        "Packer, bit-exact model of the device, live encoder, arithmetic in a fixed order, the driver, rays, registers "
        "and meshes as a target computes them.";
    bind_environment(module);
    bind_bvh(module);
    bind_clip(module);
    bind_driver(module);
    bind_files(module);
    bind_fixed_order(module);
    bind_instances(module);
    bind_leaf(module);
    bind_live(module);
    bind_mesh(module);
    bind_model(module);
    bind_packer(module);
    bind_rays(module);
    bind_simulation(module);
    bind_surroundings(module);
    bind_view(module);
}
