"""Quality loss of AR frames by source: encoded maps, reconstructed geometry, and fixed-point arithmetic.

The ground truth is the float reference with full maps and depth mesh
(`colonnade.reference.environment.decoded.backdrops`). The bit-exact model renders the device's frames.

`colonnade study frames ROOM …` prints the losses of three objects in rooms.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from colonnade.common.image_io import encode_srgb, write_png
from colonnade.common.progress import QUIET, Progress
from colonnade.common.types import Floats
from colonnade.reference.environment.decoded import backdrops
from colonnade.reference.render import ReferenceResult, render_reference
from colonnade.scene.model import Background, Colour, Light, Material, MeshSource, Placement, Scene, Transform

from colonnade_lab.evaluation.region_metrics import RegionDifference, compare_regions, frame_regions

if TYPE_CHECKING:
    from colonnade.design.manifest import Manifest
    from colonnade.environment.model import Environment
    from colonnade.maps.encoded import EncodedEnvironment
    from colonnade.maps.image import AttributeImage
    from colonnade.mesh.materials.mesh import Mesh
    from colonnade.reference.environment.ray_march import RayMarch
    from colonnade.scene.view import View

#: Differences by region of the picture: frame, object, shadow.
Regions = Mapping[str, RegionDifference]


@dataclass(frozen=True)
class Losses:
    """The losses of a frame against the ground truth.

    Attributes:
        pictures: Float frames: `full` (ground truth), `clustering` (encoded maps), `rebuild` (reconstructed geometry)
            and `both`.
        by_loss: The other frames against `full`. With a device's frame also `fixed point`, the device against `both`,
            and `device`, the device against `full`.
    """

    pictures: Mapping[str, ReferenceResult]
    by_loss: Mapping[str, Regions]


def losses(
    mesh: Mesh,
    view: View,
    environment: Environment,
    image: AttributeImage,
    march: RayMarch,
    device: Floats | None = None,
    with_dists: bool = True,
    progress: Progress = QUIET,
) -> Losses:
    """Measure the loss of a frame by source.

    Args:
        mesh: The object.
        view: Camera, lights and object in the room.
        environment: The room with its full maps.
        image: The encoded maps and planes.
        march: The ray march through the reconstructed room.
        device: The device's frame, relit, linear, float64 [height, width, 3].
        with_dists: Compute DISTS too.
        progress: Shows the frames.
    """
    pictures = {
        name: render_reference(mesh, view, progress, backdrop)
        for name, backdrop in backdrops(environment, image, march).items()
    }
    truth = pictures["full"]
    regions = frame_regions(truth.object_mask, truth.shadow_ratio)
    encoded = {name: encode_srgb(picture.image) for name, picture in pictures.items()}
    pairs = {name: (encoded["full"], encoded[name]) for name in encoded if name != "full"}
    if device is not None:
        device_srgb = encode_srgb(device)
        pairs |= {"fixed point": (encoded["both"], device_srgb), "device": (encoded["full"], device_srgb)}
    return Losses(pictures, {name: compare_regions(*pair, regions, with_dists) for name, pair in pairs.items()})


#: Placement of the objects in the project's rooms: on the table, on the bed, on the table.
PLACEMENTS = {
    "living": Placement((345.0, 304.0), 0.24, 25.0),
    "office": Placement((170.0, 392.0), 0.40, 25.0),
    "attic": Placement((318.0, 284.0), 0.40, 25.0),
}
#: Mesh and material of the measured frames.
OBJECTS = {
    "teapot, mirror": ("teapot", Material("mirror", (0.95, 0.95, 0.95))),
    "teapot, glass": ("teapot", Material("glass", (0.92, 0.97, 0.95))),
    "bunny, diffuse": ("bunny", Material("diffuse", (0.75, 0.6, 0.5))),
}


def placed_scene(mesh: str, material: Material, environment: Environment, placement: Placement) -> Scene:
    """A scene with an object in a room, a lamp about 1.5 m away from it, and ambient light."""
    from colonnade.mesh.load import load_mesh
    from colonnade.scene.object_pose import free_placement, rotation_matrix
    from colonnade.scene.standing import surface_point

    if placement.stand_at is None:
        placement = free_placement(
            placement, rotation_matrix(Transform()), load_mesh(mesh).extent, environment, "object"
        )
    assert placement.stand_at is not None
    x, y, z = surface_point(placement.stand_at, environment, "object.stand_at")
    return Scene(
        MeshSource(mesh),
        placement=placement,
        material=material,
        light=Light((x - 0.5, y + 1.3, z + 0.5), colour=(0.75, 0.72, 0.65), falloff=1.4),
        ambient=Colour((0.30, 0.31, 0.33)),
        background=Background((0.0, 0.0, 0.0), Path(environment.name)),
    )


def table(by_frame: Mapping[str, Mapping[str, Regions]]) -> str:
    """The losses as a Markdown table: PSNR, FLIP and DISTS of each region, by frame."""
    parts = ("frame", "object", "shadow")
    lines = [("frame", "loss", *(f"{part}: PSNR dB, FLIP, DISTS" for part in parts)), ("---",) * (2 + len(parts))]
    for frame, by_loss in by_frame.items():
        for loss, regions in by_loss.items():
            lines.append((frame, loss, *(_format_difference(regions[part]) for part in parts)))
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _format_difference(difference: RegionDifference) -> str:
    if difference.psnr is None or difference.flip is None:
        return "none"
    dists = "-" if difference.dists is None else f"{difference.dists:.3f}"
    return f"{difference.psnr:.1f}, {difference.flip:.3f}, {dists}"


def device_frame(mesh: Mesh, view: View, encoded: EncodedEnvironment, manifest: Manifest) -> Floats:
    """The device's relit frame by the bit-exact model, linear, float64 [height, width, 3].

    Args:
        mesh: The object.
        view: Camera, lights and object in the room.
        encoded: The room and its encoded maps.
        manifest: The manifest of the design.
    """
    from colonnade.device.bit_exact import render_model
    from colonnade.device.device import require_no_errors
    from colonnade.registers.frame import registers_of
    from colonnade.scene_image.environment import with_environment
    from colonnade.scene_image.packer import pack

    packed = with_environment(pack(mesh, manifest, view.materials), encoded, manifest)
    frame = render_model(manifest, packed, registers_of(view, packed.header, manifest, encoded))
    require_no_errors(frame.errors)
    return frame.colour / float((1 << manifest.numbers["colourBits"]) - 1)


def study_frames(
    folders: Iterable[Path], with_dists: bool = True, progress: Progress = QUIET, output: Path | None = None
) -> dict[str, Mapping[str, Regions]]:
    """The losses of `OBJECTS` in rooms, by room and object. ``output`` is a folder for the pictures."""
    from colonnade.design.generator import manifest_for
    from colonnade.environment.load import load_environment
    from colonnade.maps.cache import encoded_environment
    from colonnade.maps.encoded import EncodedEnvironment
    from colonnade.maps.layout import AttributeLayout
    from colonnade.mesh.load import load_mesh
    from colonnade.reference.environment.decoded import float_plane_march
    from colonnade.scene.object_pose import Placed
    from colonnade.scene.view import make_view

    by_frame = {}
    meshes = {name: load_mesh(name) for name, _ in OBJECTS.values()}
    for folder in folders:
        environment = load_environment(folder)
        layout = AttributeLayout(width=environment.width, height=environment.height)
        image = encoded_environment(environment, layout)
        hardware = f"physicalAttributeMemory={json.dumps(layout.to_config())}"
        manifest = manifest_for("small", (hardware,), progress).manifest
        march = float_plane_march(environment, image)
        for name, (mesh_name, material) in OBJECTS.items():
            mesh = meshes[mesh_name]
            scene = placed_scene(mesh_name, material, environment, PLACEMENTS.get(environment.name, Placement()))
            view = make_view(
                Placed(scene, mesh.extent, environment), environment.width, environment.height, mesh.materials
            )
            device = device_frame(mesh, view, EncodedEnvironment(environment, image), manifest)
            measured = losses(mesh, view, environment, image, march, device, with_dists, progress)
            by_frame[f"{environment.name}: {name}"] = measured.by_loss
            if output is not None:
                frames = {loss: picture.image for loss, picture in measured.pictures.items()} | {"device": device}
                for loss, picture in frames.items():
                    write_png(output / f"{environment.name}-{name.replace(', ', '-')}-{loss}.png", picture)
    return by_frame
