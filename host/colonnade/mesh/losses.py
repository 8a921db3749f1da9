"""What a mesh file holds and a picture does not show: for each kind a line, its number and what is done instead."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from colonnade import _core
from colonnade.common.limits import KEPT_TEXTURE_PIXELS, MAX_PIXELS
from colonnade.common.terminal_text import one_line


@dataclass(frozen=True)
class Loss:
    """A kind of content that is not shown, or shown otherwise.

    Attributes:
        one, several: Subject and verb of the line, in the singular and the plural.
        instead: What is done instead.
    """

    one: str
    several: str
    instead: str

    @staticmethod
    def of(noun: str, what: str, instead: str, plural: str = "") -> Loss:
        """The loss of things with a name; ``what`` is the participle, e.g. "not shown"."""
        return Loss(f"{noun} is {what}", f"{plural or noun + 's'} are {what}", instead)


#: The words of those that the readers of ``cpp/mesh/files`` count, too.
_WORDS = _core.losses()


def _shared(name: str) -> Loss:
    return Loss(*_WORDS[name])


TEXTURES = Loss.of("texture", "not shown", "only textures of the base colour are")
#: Textures of glTF materials by their key.
MAPS = {
    "metallicRoughnessTexture": Loss.of(
        "metallic-roughness map", "averaged", "a face is metal or diffuse, with one roughness"
    ),
    "specularGlossinessTexture": Loss.of("specular-glossiness map", "not shown", "the surface is diffuse"),
    "occlusionTexture": Loss.of("occlusion map", "not shown", "ambient light reaches all surfaces"),
    "emissiveTexture": Loss.of("emission map", "averaged", "a face emits one of four colours"),
}
OUTSIDE_PICTURES = Loss.of(
    "picture of a texture",
    "outside of the mesh's folder",
    "surfaces have their base colour; copies in the folder are read",
    "pictures of textures",
)
NO_PICTURES = _shared("NO_PICTURES")
PICTURE_FORMATS = _shared("PICTURE_FORMATS")
DAMAGED_PICTURES = _shared("DAMAGED_PICTURES")
LARGE_PICTURES = Loss.of(
    "picture of a texture", "too large", f"a picture may have {MAX_PIXELS:,} pixels", "pictures of textures"
)
NO_MAP_UVS = Loss.of(
    "face with a normal map", "smooth", "texture coordinates of the map are missing", "faces with a normal map"
)
NO_UVS = _shared("NO_UVS")
TEXTURED_COLOURS = _shared("TEXTURED_COLOURS")
LIGHTS = Loss.of("light", "not used", "the scene file has the lights")
CAMERAS = Loss.of("camera", "not used", "the scene file has the camera")
ANIMATIONS = Loss.of("animation", "not played", "nodes stand as the file places them")
_BOUND = "meshes have the pose in which they were bound"
SKINS = Loss.of("skin", "not applied", _BOUND)
PLAYABLE_SKINS = Loss.of("skin", "not applied", f"{_BOUND}; mesh.animation of a scene plays an animation")
MORPHS = Loss.of("morph target", "not applied", "meshes have their base shape")
CHANNELS = Loss.of(
    "channel of an animation", "not played", "only those of nodes and morph targets are", "channels of an animation"
)
JOINTS = Loss.of(
    "joint of the animation",
    "missing in the mesh",
    "only those of equal names are moved",
    "joints of the animation",
)
INFLUENCES = Loss.of(
    "vertex with more than four joints",
    "moved by the largest four",
    "others count for little",
    "vertices with more than four joints",
)
HOLES = Loss.of("polygon with holes", "not shown", "export triangles", "polygons with holes")
BEAMS = Loss.of("beam lattice", "not shown", "only faces are rendered")
MATERIAL_GROUPS = Loss.of(
    "group of materials or colours", "not read", "faces have the default material", "groups of materials or colours"
)
WRAPS = Loss.of("wrap of a texture", "not used", "pictures repeat", "wraps of textures")
LINES = _shared("LINES")
POINTS = _shared("POINTS")
BLENDED = _shared("BLENDED")
COVERED = Loss.of(
    "partly transparent material",
    "not blended",
    "from alpha 1/2 on it is opaque, else a tinted pane: frame.samples of 2 or more blend it",
)
COARSE_CUTS = Loss.of("alpha mask", "cut coarsely", "outlines have more detail than the mesh may have faces")
EMISSION = _shared("EMISSION")
BRIGHT = _shared("BRIGHT")
UNLIT = Loss.of("unlit material", "lit", "a matt surface has its base colour")
ROUGH_MIRROR = Loss.of("slightly rough metal", "a perfect mirror", "paths.gather = 1 renders blurred reflections")
ROUGH_METAL = Loss.of("rough metal", "diffuse", "paths.gather = 1 renders blurred reflections")
ROUGH_GLASS = Loss.of("rough glass", "perfectly clear", "paths.gather = 1 renders its roughness", "rough glasses")
ROUGHEST_GLASS = Loss.of("rough glass", "as rough as 1/2", "no glass is rougher", "rough glasses")
PARTLY_METAL = Loss.of("partly metallic material", "rounded to diffuse or mirror", "1/2 and above is a mirror")
PARTLY_GLASS = _shared("PARTLY_GLASS")
LAMPS = Loss.of("slightly rough surface", "without highlights", "frame.samples of 2 or more render those of lamps")
COATS = Loss.of("glossy material", "matt", "paths.gather = 1 and frame.samples of 2 or more render its reflections")
CLEAR_COATS = Loss.of(
    "clear coat", "not shown", "paths.gather = 1 and frame.samples of 2 or more render its reflections"
)
CLIPPED_COLOURS = _shared("CLIPPED_COLOURS")
SCENES = Loss.of("further scene", "not shown", "only the default scene is rendered")
#: A line without a number, the last one: most open surfaces are single-sided, and few are seen from behind.
BACKS = "open single-sided surfaces are shown from behind: viewers show their front only"
SHORT_FACES = _shared("SHORT_FACES")
CROSSED = _shared("CROSSED")
SPARE_CORNERS = Loss.of(
    "corner after the last triangle", "left out", "a triangle has three", "corners after the last triangle"
)
COLOURS = Loss(
    "colour of vertices or faces is the albedo of its faces",
    "colours of vertices or faces are the albedo of their faces",
    "a face has one colour, the mean of its corners",
)
ALPHA = _shared("ALPHA")
FLIPPED = Loss(
    "face has normals that point to its back", "faces have normals that point to their back", "they are negated"
)
_COMPUTED = "normals are computed from the faces"
REPLACED = Loss(
    "corner normal points to the back of its face",
    "corner normals point to the back of their face",
    _COMPUTED,
)
MISSING = _shared("MISSING")
MIXED = Loss.of(
    "closed part with mixed winding", "repaired", "all faces point outward", "closed parts with mixed winding"
)
INVERTED = Loss.of("inside-out closed part", "turned outward", "the faces are reversed")


def shrunk_textures(factor: int) -> Loss:
    """The loss of textures that are kept at a fraction of their width and height."""
    return Loss.of(
        "texture", f"kept at 1/{factor} of the width and height", f"a mesh holds {KEPT_TEXTURE_PIXELS:,} pixels"
    )


def smooth_normals(degrees: float) -> Loss:
    """The loss of normal maps with more detail than corner normals show, so many degrees in the root mean square."""
    return Loss.of("normal map", "smoothed", f"corner normals differ from it by {degrees:.0f} degrees")


def unread_part(reason: str) -> Loss:
    """The loss of a part that the reader of another library passes over."""
    return Loss("part is not read as it stands", "parts are not read as they stand", reason)


def extension_loss(name: str) -> Loss:
    """The loss of an optional glTF extension."""
    return Loss(f"use of the extension {name} is ignored", f"uses of the extension {name} are ignored", "not supported")


@dataclass
class Losses:
    """What one file loses, in the order of discovery, and by kind what the first is named."""

    counts: dict[Loss, int] = field(default_factory=dict)
    names: dict[Loss, str] = field(default_factory=dict)

    def add(self, loss: Loss, count: int = 1, name: str = "") -> None:
        """Count a loss; none for a count of 0."""
        if count > 0:
            self.counts[loss] = self.counts.get(loss, 0) + count
            if name:
                self.names.setdefault(loss, name)

    def lines(self, label: str = "") -> tuple[str, ...]:
        """One line for each kind, after the label."""
        prefix = f"{label}: " if label else ""
        return tuple(
            f"{prefix}{count:,} {loss.one if count == 1 else loss.several}{self._named(loss, count)}: {loss.instead}"
            for loss, count in self.counts.items()
        )

    def _named(self, loss: Loss, count: int) -> str:
        name = one_line(self.names.get(loss, ""))
        return name and (f" ({name})" if count == 1 else f" (the first is {name})")

    def take(self, counted: Iterable[tuple[str, str, bytes, int, bytes]]) -> None:
        """Add what a reader of ``cpp/mesh/files`` has counted: the words of each kind, a number and a name."""
        for one, several, instead, count, name in counted:
            loss = Loss(one, several, instead.decode("utf-8", "surrogateescape"))
            self.add(loss, count, name.decode("utf-8", "surrogateescape"))

    def update(self, others: Iterable[tuple[Loss, int]]) -> None:
        """Add several losses."""
        for loss, count in others:
            self.add(loss, count)
