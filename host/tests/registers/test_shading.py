"""Lights, materials and paths in registers: the values of a scene, and errors beyond the hardware's limits."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import pytest
from leaves import leaf_addresses

from colonnade.common.errors import UserError
from colonnade.design.manifest import Manifest
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.materials import MeshMaterial
from colonnade.registers.frame import frame_registers, registers_of
from colonnade.scene.model import Light, Material, MeshSource, Paths, Scene
from colonnade.scene.object_pose import Placed
from colonnade.scene.view import make_view
from colonnade.scene_image.packer import pack

SCENE = Scene(mesh=MeshSource(name="cube"))


def registers(manifest: Manifest, **changes: object) -> dict[str, int]:
    scene = dataclasses.replace(SCENE, **changes)  # type: ignore[arg-type]
    return frame_registers(scene, pack(load_mesh("cube"), manifest).header, manifest, 32, 24)


def test_every_writable_register_has_a_value_that_fits(make_manifest: Callable[..., Manifest]) -> None:
    manifest = make_manifest()
    glass = Material(kind="glass", albedo=(1.0, 0.9, 0.8), ior=1.5)
    values = registers(manifest, material=glass, light=Light(falloff=2.0), more_lights=(Light(offset=(-1, 1, 1)),))
    writable = {name for name, register in manifest.registers.items() if register.access == "rw"}
    assert set(values) == writable
    for name, value in values.items():
        manifest.registers[name].encode(value)


def test_glass_has_inverse_indices_at_front_and_back(make_manifest: Callable[..., Manifest]) -> None:
    values = registers(make_manifest(), material=Material(kind="glass", ior=1.6))
    assert values["materials[0].kind"] == 2
    assert values["materials[0].etaFront"] == round(8192 / 1.6)
    assert values["materials[0].etaBack"] == round(8192 * 1.6)
    assert values["materials[0].reflectance"] == round(4096 * (0.6 / 2.6) ** 2)


def test_the_reference_distance_is_squared_in_grid_steps(make_manifest: Callable[..., Manifest]) -> None:
    manifest = make_manifest()
    mesh = load_mesh("cube")
    header = pack(mesh, manifest).header
    values = registers(manifest, light=Light(falloff=0.7))
    steps = 0.7 * header.frame.scale * 2.0 ** manifest.numbers["gridFraction"]
    assert values["lights[0].reachMantissa"] >> 31 == 1
    reached = values["lights[0].reachMantissa"] * 2.0 ** values["lights[0].reachExponent"]
    assert reached == pytest.approx(steps**2, rel=1e-9)
    assert registers(manifest)["lights[0].reachMantissa"] == 0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"more_lights": (Light(), Light())}, "the scene has 3 lights, the hardware supports 2: .*frame.lights"),
        (
            {"material": Material(kind="mirror"), "paths": Paths(bounces=9)},
            "traces 9 bounces, the hardware at most 4",
        ),
        ({"material": Material(kind="glass", ior=2.9)}, "index of refraction of 2.9; it must be from 1 to 2.8"),
    ],
)
def test_more_than_the_hardware_has_is_refused(
    make_manifest: Callable[..., Manifest], changes: dict[str, object], message: str
) -> None:
    with pytest.raises(UserError, match=message):
        registers(make_manifest(), **changes)


def test_mirrors_need_bounces(make_manifest: Callable[..., Manifest]) -> None:
    manifest = make_manifest()
    config = {**manifest.config, "frame": {**manifest.config["frame"], "maxBounces": 0}}
    with pytest.raises(
        UserError, match=r"the scene has mirror, the hardware supports only diffuse .* frame.maxBounces"
    ):
        registers(dataclasses.replace(manifest, config=config), material=Material(kind="mirror"))


def test_too_many_materials_are_refused(make_manifest: Callable[..., Manifest]) -> None:
    manifest = make_manifest()
    mesh = load_mesh("cube")
    header = pack(mesh, manifest).header
    view = make_view(Placed(SCENE, mesh.extent), 32, 24, (MeshMaterial(),) * 3)
    with pytest.raises(UserError, match=r"the scene has 3 materials, the hardware supports 2: .*frame.materials"):
        registers_of(view, header, manifest)


def test_only_glass_is_transmissive(make_manifest: Callable[..., Manifest]) -> None:
    manifest = make_manifest()
    mesh = load_mesh("cube")
    layout = manifest.layouts["nearPair"]
    for kind, expected in (("glass", 1), ("mirror", 0), ("diffuse", 0)):
        image = pack(mesh, manifest, (MeshMaterial(kind),))
        leaves = image.records[leaf_addresses(image)]
        assert set(layout.unpack(leaves)["isClear"].tolist()) == {expected}
