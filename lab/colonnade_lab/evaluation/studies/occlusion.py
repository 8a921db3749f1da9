"""Study: how much of an object that stands partly behind furniture is shown and hidden correctly.

The frames are also compared with the reference's in the rooms' real geometry (``--truth``).
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from colonnade.common.image_io import encode_srgb, write_png
from colonnade.common.progress import QUIET, Progress
from colonnade.common.types import Floats
from colonnade.quality.image_metrics import psnr
from colonnade.scene.model import Background, Colour, Light, Material, MeshSource, Scene, Transform
from numpy.typing import NDArray

from colonnade_lab.evaluation.studies.furnished_rooms import FURNISHED, Furnished
from colonnade_lab.evaluation.studies.thin_furniture import behind_thin_things, kind_of

if TYPE_CHECKING:
    from colonnade.maps.encoded import EncodedEnvironment
    from colonnade.mesh.materials.mesh import Mesh
    from colonnade.reference.render import ReferenceResult
    from colonnade.scene.view import View

    from colonnade_lab.evaluation.studies.synthetic_attic import SyntheticRoom

#: Nearer surfaces of the room than this, in metres, hide the object in the truth: Embree's precision.
EPSILON = 1e-5


@dataclass(frozen=True)
class OcclusionResult:
    """The pixels of a frame whose rays meet the object.

    Attributes:
        pixels: Their number, hidden or not.
        hidden: The share that the room hides.
        right: The share that shows what is nearer in truth: object or room.
        lost, kept: The shares that show the room in place of the object, and the object in place of the room.
        without: `right` of a frame without occlusion.
        tolerance: Of the device, metres along the ray's dominant axis.
        agrees: The share that shows the same of object and room as the reference in the real room.
        psnr, object_psnr: Of the frame in the photo against that reference, all pixels and these, decibels.
    """

    pixels: int
    hidden: float
    right: float
    lost: float
    kept: float
    without: float
    tolerance: float
    agrees: float
    psnr: float
    object_psnr: float


def true_occlusion(mesh: Mesh, view: View, made: SyntheticRoom) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """The pixels whose rays meet the object, and pixels that show it, bool [height, width] each.

    Args:
        mesh: The object.
        view: Its camera and pose in the room.
        made: The room, with its whole surface.
    """
    from colonnade.reference.embree import RayTracer, Triangles
    from colonnade.reference.render import primary_directions

    # From world space over the maps' view space to mesh space
    assert view.view_to_mesh is not None
    in_mesh = _in_view(made) @ view.view_to_mesh[:, :3].T + view.view_to_mesh[:, 3]
    walls = RayTracer(Triangles(in_mesh, made.surface.faces))
    directions = primary_directions(view, slice(0, view.height))
    origins = np.broadcast_to(view.origin, directions.shape)
    distances = []
    for tracer in (RayTracer(mesh), walls):
        faces = tracer.first_hits(origins, directions)
        hit = np.flatnonzero(faces >= 0)
        distance = np.full(len(faces), np.inf)
        distance[hit] = tracer.surface_points(faces[hit], origins[hit], directions[hit]).t
        distances.append(distance.reshape(view.height, view.width))
    epsilon = EPSILON * _mesh_units(view)
    return np.isfinite(distances[0]), distances[0] < distances[1] + epsilon


def _mesh_units(view: View) -> float:
    """Mesh units in a metre."""
    assert view.view_to_mesh is not None
    return float(np.cbrt(np.linalg.det(view.view_to_mesh[:, :3])))


def standing(case: Furnished, mesh: Mesh, material: Material | None = None) -> Scene:
    """The scene of a case: its object with its foot at its place, a lamp above, and ambient light."""
    from colonnade.scene.object_pose import rotation_matrix

    scale = case.size / mesh.extent.edge
    turned = rotation_matrix(Transform(rotate=(0.0, case.turn, 0.0)))
    foot = mesh.extent.centre @ turned.T
    foot[1] = (mesh.extent.outline @ turned.T)[:, 1].min()
    x, y, z = (float(value) for value in np.array(case.foot) - foot * scale)
    return Scene(
        MeshSource(case.mesh),
        transform=Transform((0.0, case.turn, 0.0), scale, (x, y, z)),
        material=material or Material("diffuse", (0.75, 0.6, 0.5)),
        light=Light((0.6, 2.2, 0.6), colour=(0.75, 0.72, 0.65), falloff=1.6),
        ambient=Colour((0.35, 0.36, 0.38)),
        background=Background(room=Path(case.mesh)),
    )


def measure(
    case: Furnished,
    made: SyntheticRoom,
    mesh: Mesh,
    config: str = "small",
    progress: Progress = QUIET,
    output: Path | None = None,
) -> OcclusionResult:
    """Compare the device's frame of a case, by the bit-exact model, with the truth; ``output`` is its picture."""
    from colonnade.common.accumulation import Accumulation
    from colonnade.design.generator import manifest_for
    from colonnade.device.bit_exact import render_model
    from colonnade.maps.cache import encoded_environment
    from colonnade.maps.encoded import EncodedEnvironment
    from colonnade.maps.layout import AttributeLayout
    from colonnade.registers.frame import registers_of
    from colonnade.render.composite import composited
    from colonnade.scene.object_pose import Placed
    from colonnade.scene.view import make_view
    from colonnade.scene_image.environment import with_environment
    from colonnade.scene_image.packer import pack

    environment = made.environment
    layout = AttributeLayout(width=environment.width, height=environment.height)
    encoded = EncodedEnvironment(environment, encoded_environment(environment, layout))
    hardware = f"physicalAttributeMemory={json.dumps(layout.to_config())}"
    manifest = manifest_for(config, (hardware,), progress).manifest
    scene = standing(case, mesh)
    view = make_view(Placed(scene, mesh.extent, environment), environment.width, environment.height, mesh.materials)
    packed = with_environment(pack(mesh, manifest, view.materials), encoded, manifest)
    registers = registers_of(view, packed.header, manifest, encoded, relit=False)
    frame = render_model(manifest, packed, registers)
    picture = composited(Accumulation.of_frame(frame), environment.photo)
    if output is not None:
        write_png(output, picture)

    meets, visible = true_occlusion(mesh, view, made)
    truth = _true_frame(mesh, view, made, encoded)
    sums = Accumulation.of_pixels(truth.image, truth.object_mask, truth.shadow_ratio)
    pair = encode_srgb(composited(sums, environment.photo)), encode_srgb(picture)
    steps = packed.header.frame.scale * 2.0 ** manifest.numbers["gridFraction"]
    shown, visible = frame.is_object[meets], visible[meets]
    return OcclusionResult(
        pixels=int(meets.sum()),
        hidden=float(np.mean(~visible)),
        right=float(np.mean(shown == visible)),
        lost=float(np.mean(~shown & visible)),
        kept=float(np.mean(shown & ~visible)),
        without=float(np.mean(visible)),
        tolerance=registers["environment.occlusionTolerance"] / steps / _mesh_units(view),
        agrees=float(np.mean(shown == truth.object_mask[meets])),
        psnr=psnr(*pair),
        object_psnr=psnr(*(image[meets][np.newaxis] for image in pair)),
    )


def _true_frame(mesh: Mesh, view: View, made: SyntheticRoom, encoded: EncodedEnvironment) -> ReferenceResult:
    """The reference's frame in the real geometry of a room, as with ``colonnade render --truth``."""
    from colonnade.reference.embree import RayTracer, Triangles
    from colonnade.reference.environment.decoded import BoundingPlanes
    from colonnade.reference.environment.true_room import TrueRoom, TrueSurface
    from colonnade.reference.render import render_reference

    environment, faces = made.environment, made.surface.faces
    colours = np.broadcast_to(environment.albedo.mean(axis=(0, 1)), (len(faces), 3))
    surface = TrueSurface(RayTracer(Triangles(_in_view(made), faces)), colours)
    bounding = BoundingPlanes(environment, encoded.image)
    room = TrueRoom(environment, surface, environment.albedo, environment.normals, None, bounding, surface)
    return render_reference(mesh, view, backdrop=room)


def _in_view(made: SyntheticRoom) -> Floats:
    """The vertices of a room's surface in view space, float64 [n, 3]."""
    to_world = made.environment.camera_to_world
    return np.asarray((made.surface.vertices - to_world[:, 3]) @ to_world[:, :3])


def study(
    progress: Progress = QUIET, output: Path | None = None, seeds: Iterable[int] | None = None
) -> dict[str, OcclusionResult]:
    """Measure the cases of `FURNISHED`, or of `thin_furniture` by seed; ``output`` is a folder for the pictures."""
    from colonnade.mesh.load import load_mesh

    thin = None if seeds is None else {f"{kind_of(seed)} {seed}": behind_thin_things(seed) for seed in seeds}
    results = {}
    for name, case in (FURNISHED if thin is None else thin).items():
        picture = None if output is None else output / f"{name}.png"
        with progress.step(f"measuring the {name}"):
            results[name] = measure(case, case.room(name), load_mesh(case.mesh), output=picture)
    return results


def table(results: Mapping[str, OcclusionResult]) -> str:
    """The results as a Markdown table."""
    lines = [
        "| behind | object's pixels | hidden | right | lost, kept | right without occlusion | tolerance, cm |"
        " as the reference in the real room | dB from it: frame, object |"
    ]
    lines.append("|" + "---|" * 9)
    for name, result in results.items():
        shares = (
            f"{result.hidden:.1%} | {result.right:.2%} | {result.lost:.2%}, {result.kept:.2%} | {result.without:.1%}"
        )
        truth = f"{result.agrees:.2%} | {result.psnr:.1f}, {result.object_psnr:.1f}"
        lines.append(f"| {name} | {result.pixels:,} | {shares} | {100 * result.tolerance:.2f} | {truth} |")
    return "\n".join(lines)
