"""The host's frames of registers that the page wrote."""

from __future__ import annotations

import base64
from dataclasses import replace
from typing import Any

import numpy as np
from built_page import ROOT, cube_of
from playwright.sync_api import Page

from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import render_model
from colonnade.environment.light_cube import LightCube
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.mesh import Mesh
from colonnade.registers.frame import frame_registers
from colonnade.scene.parser import load_scene
from colonnade.scene.passes import exposed
from colonnade.scene.prepared.device_scene import DeviceScene
from colonnade.scene.prepared.gathered_light import with_cube
from colonnade.scene_image.environment import with_environment
from colonnade.scene_image.packer import pack


def registers_of(picture: dict[str, Any], manifest: Manifest) -> dict[str, int]:
    """The registers that the page wrote, by name."""
    words = {address: value for address, value in picture["writes"]}
    return {
        register.name: register.decode([words.get(register.address + word, 0) for word in range(register.words)])
        for register in manifest.registers.values()
        if register.access == "rw"
    }


def host_frame(
    picture: dict[str, Any],
    mesh: Mesh,
    design: str,
    is_in_room: bool = False,
    light: LightCube | None = None,
    progress: float = 0.0,
) -> Any:
    """The host's frame of the registers that the page wrote; the mesh's are the host's.

    Args:
        light: Around the object, in its axes, of a room whose light is gathered.
        progress: Of the clip of a mesh that has one.
    """
    manifest = Manifest.load(ROOT / "configs" / "golden" / f"{design}.json")
    registers = registers_of(picture, manifest)
    image = pack(mesh, manifest).posed(progress)
    own = frame_registers(load_scene(ROOT / "scenes" / "object.toml"), image.header, manifest, 64, 48)
    of_mesh = [name for name in own if name.startswith(("bounds.", "scene.")) or name == "shading.offset"]
    assert len(of_mesh) == 10 and {name: registers[name] for name in of_mesh} == {name: own[name] for name in of_mesh}
    if is_in_room:
        scene = load_scene(ROOT / "scenes" / "room.toml")
        if light is not None:
            scene = exposed(replace(scene, names_light=False, paths=replace(scene.paths, gather=1)))
        maps = DeviceScene.of(scene, manifest, load_mesh("cube"), encoder="live").maps
        assert maps is not None
        image = with_cube(with_environment(image, maps, manifest), light)
    return render_model(manifest, image, registers)


def light_around(page: Page) -> LightCube:
    """The room's cube in the axes of the object, which the page turns."""
    cube = cube_of(base64.b64decode(page.evaluate("colonnade.light")["cube"]))
    angle = np.radians(float(page.evaluate("/azimuth=([\\d.]+)/.exec(location.hash)?.[1] ?? 24")) - 24)
    return cube.turned(np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]))
