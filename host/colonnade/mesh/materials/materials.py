"""Maps the materials of mesh files to the device's three kinds: diffuse, mirror and glass.

| | glTF | MTL |
|---|---|---|
| albedo | base colour factor, linear | `Kd`, sRGB but of Blender; for glass `Tf` if given |
| mirror | metallic factor of at least ½; faces of a map (`gltf_metal`) | `Pm` of at least ½, or `illum` 3 or 5 |
| roughness of mirrors and glass, or of the coat of a diffuse surface below ½ | roughness factor | `Pr` |
| glass | transmission factor above ½ | `d` below ½, else `Tr` from ½ to 1, or `illum` 4, 6, 7 or 9 |
| clear coat | `KHR_materials_clearcoat`, its factors | – |
| alpha | `alphaMode` with the factor of the base colour and its texture | `map_d` |
| index of refraction | `KHR_materials_ior` | `Ni` |
| emission of a diffuse surface, scaled to at most 1 | emissive factor times `KHR_materials_emissive_strength` | `Ke` |

`as_rendered` says what a rough mirror becomes. Unlit materials of glTF are matt. The readers add base-colour textures.
What a material holds beyond this is counted as lost.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

from colonnade.mesh import losses as lost
from colonnade.mesh.losses import Loss

Vector = tuple[float, float, float]

#: Surface kinds of the device.
Kind = Literal["diffuse", "mirror", "glass"]
KINDS: tuple[Kind, ...] = get_args(Kind)

#: Default index of refraction of glass, as in glTF.
GLASS_IOR = 1.5

#: Roughness up to which a mirror or glass counts as smooth, and below which a diffuse surface counts as glossy.
SMOOTH_ROUGHNESS, GLOSSY = 0.1, 0.5
#: Roughness up to which a metal is nearer to a mirror than to a diffuse surface of its colour (docs/shading.md).
MIRROR_ROUGHNESS = 0.35
#: Roughness from which on metal reflects the light cube where light is gathered, not the room (docs/gather.md).
SHARP_ROUGHNESS = 0.25
#: The largest roughness of glass.
GLASS_ROUGHNESS = 0.5
#: Extensions of glTF materials that are used.
USED_EXTENSIONS = (
    "KHR_materials_transmission",
    "KHR_materials_ior",
    "KHR_materials_emissive_strength",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_clearcoat",
    "KHR_materials_unlit",
)
#: Textures whose readers count what is lost of them.
_READ_TEXTURES = ("baseColorTexture", "diffuseTexture", "normalTexture")
#: What coats reflect, and glass of lights: between 0.04, where it faces the eye, and 0.09, the mean over a sphere.
COAT_REFLECTANCE = 0.06
#: Roughness from which on mirrors and glass have highlights: the device's narrowest lobe's.
HIGHLIGHT_ROUGHNESS = 0.125
#: The kind of a surface that spreads light cube and lights in a lobe, as the layers of a frame have it (`in_layer`).
ROUGH_METAL = "rough metal"
#: The layers of a frame, which are added: surfaces, their coats, and what the marks of lamps do not show.
Layer = Literal["surface", "coat", "highlight", "glass highlight", "clear coat"]
LAYERS: tuple[Layer, ...] = get_args(Layer)
#: The layers of lights alone, and the radiance of a lamp that surfaces already show in the device's numbers, by its
#: mark: what a mirror brings is at most 1, and glass reflects so little of the mark that all of it counts.
MARKS: Mapping[Layer, float] = {"highlight": 1.0, "glass highlight": 16.0}
#: A channel of an emission in a file, at most.
BRIGHTEST = 1e6
#: No emission.
DARK = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Alpha:
    """The transparency of a material, before `colonnade.mesh.materials.coverage` has cut it away.

    Attributes:
        factor: Factor of the texture's alpha, 0 to 1.
        cutoff: Alpha from which on the surface is shown.
        blends: The file asks for blending.
    """

    factor: float = 1.0
    cutoff: float = 0.5
    blends: bool = False


@dataclass(frozen=True)
class MeshMaterial:
    """A surface material.

    Attributes:
        kind: diffuse, mirror or glass; in the layers of a frame also `ROUGH_METAL`.
        albedo: Linear, 0 to 1: diffuse reflectance, or tint of reflected or refracted light.
        ior: Index of refraction of glass.
        roughness: Of a mirror or glass, 0 to 1: 0 reflects sharply. Of a diffuse surface its clear coat's;
            0: it has none.
        has_corner_colours: The surface has the colours of `Mesh.corner_colours`, times `albedo`.
        texture: The surface has the colours of this one of `Mesh.textures`, times `albedo`.
        emission: Linear, 0 to 1: the light that a diffuse surface or rough metal emits towards the eye.
        alpha: Transparency of the file's material; a loaded mesh has none.
        coverage: The share of its surface that is there: each pass of a frame shows all of it, or what is behind.
        clear_coat: The share of its surface under a clear coat, and the roughness of that.
    """

    kind: str = "diffuse"
    albedo: Vector = (0.8, 0.8, 0.8)
    ior: float = GLASS_IOR
    has_corner_colours: bool = False
    texture: int | None = None
    emission: Vector = (0.0, 0.0, 0.0)
    alpha: Alpha | None = None
    roughness: float = 0.0
    coverage: float = 1.0
    clear_coat: tuple[float, float] = (0.0, 0.0)


#: What is not there: glass without refraction and tint.
CLEAR = MeshMaterial("glass", (1.0, 1.0, 1.0), 1.0)
#: Material of meshes without one, and what is not in a layer.
PLAIN, BLACK = MeshMaterial(), MeshMaterial(albedo=(0.0, 0.0, 0.0))


def as_rendered(material: MeshMaterial, gathers: bool) -> MeshMaterial:
    """A material as the device shows it: what has a roughness left spreads its reflections, or is seen through blurred.

    Args:
        material: Of a mesh, or of a scene.
        gathers: The scene gathers light. Otherwise rough metal is a smooth mirror or a diffuse surface, glass is
            smooth, and there are no coats.
    """
    if material.kind == "diffuse" and gathers:
        is_coated = 0.0 < material.roughness < GLOSSY
        return replace(material, roughness=max(material.roughness, SHARP_ROUGHNESS) if is_coated else 0.0)
    if gathers:
        limit = GLASS_ROUGHNESS if material.kind == "glass" else 1.0
        return replace(material, roughness=min(material.roughness, limit))
    is_diffuse = material.kind == "mirror" and material.roughness > MIRROR_ROUGHNESS
    kind = "diffuse" if is_diffuse else material.kind
    return replace(material, kind=kind, roughness=0.0, clear_coat=PLAIN.clear_coat)


def in_pass(material: MeshMaterial, threshold: float | None) -> MeshMaterial:
    """A material in a pass of a frame: itself or `CLEAR`, as often as its coverage says.

    Args:
        material: The material.
        threshold: Of the pass, 0 to 1; None, the only one: from half coverage on itself, else a pane of its colour.
    """
    if material.coverage >= 1.0:
        return material
    whole = replace(material, coverage=1.0)
    if threshold is not None:
        return whole if threshold < material.coverage else CLEAR
    if material.coverage >= 0.5:
        return whole
    red, green, blue = (1.0 - material.coverage * (1.0 - value) for value in material.albedo)
    return replace(CLEAR, albedo=(red, green, blue))


def is_lit(material: MeshMaterial) -> bool:
    """Whether lights and light cube light a material, as it is rendered; others show what their rays find in a room."""
    is_rough = material.kind == "mirror" and material.roughness >= SHARP_ROUGHNESS
    return is_rough or material.kind in ("diffuse", ROUGH_METAL)


def microfacet_albedo(roughness: float) -> float:
    """The share of light that white GGX microfacets reflect at once, the mean over a sphere: a fit, within 0.01."""
    alpha = roughness**2
    return 1.0 - alpha**2 / (0.25 + 0.9 * alpha + 0.55 * alpha**2)


def in_layer(material: MeshMaterial, layer: Layer) -> MeshMaterial:
    """A material, as it is rendered, in a layer of a frame: `BLACK` if it is not in it.

    Rough metal has the mean of the light that microfacets do not hide from each other.
    """
    share, roughness = material.clear_coat
    material = replace(material, clear_coat=PLAIN.clear_coat)
    if material == CLEAR:
        return CLEAR
    if layer == "clear coat":
        kind = "mirror" if roughness < SHARP_ROUGHNESS else ROUGH_METAL
        return MeshMaterial(kind, (share * COAT_REFLECTANCE,) * 3, roughness=roughness) if share > 0 else BLACK
    if material.kind == "mirror":
        is_sharp = material.roughness < SHARP_ROUGHNESS
        red, green, blue = (value * microfacet_albedo(material.roughness) for value in material.albedo)
        material = replace(material, kind="mirror" if is_sharp else ROUGH_METAL, albedo=(red, green, blue))
        if layer == "highlight" and is_sharp and material.roughness >= HIGHLIGHT_ROUGHNESS:
            return replace(material, kind=ROUGH_METAL, emission=DARK)
    if layer == "surface":
        return replace(material, roughness=0.0) if material.kind == "diffuse" else material
    is_coated = layer == "coat" and material.kind == "diffuse" and material.roughness > 0
    has_highlights = layer == "glass highlight" and material.kind == "glass"
    if is_coated or (has_highlights and material.roughness >= HIGHLIGHT_ROUGHNESS):
        return MeshMaterial(ROUGH_METAL, (COAT_REFLECTANCE,) * 3, roughness=material.roughness)
    return BLACK


def gltf_surface(material: Mapping[str, Any]) -> Mapping[str, Any]:
    """The metallic-roughness values of a material from a glTF file's JSON, also of one with specular-glossiness.

    An unlit one is matt.
    """
    surface = material.get("pbrMetallicRoughness")
    extensions = material.get("extensions", {})
    older = extensions.get("KHR_materials_pbrSpecularGlossiness")
    if "KHR_materials_unlit" in extensions:
        colours = {key: value for key, value in (surface or {}).items() if key.startswith("baseColor")}
        return colours | {"metallicFactor": 0.0, "roughnessFactor": 1.0}
    if isinstance(older, Mapping):
        found = {"metallicFactor": 0.0, "roughnessFactor": 1.0 - _number(older.get("glossinessFactor"), 1.0)}
        named = (("diffuseFactor", "baseColorFactor"), ("diffuseTexture", "baseColorTexture"))
        return found | {name: older[old] for old, name in named if old in older}
    return {"metallicFactor": 0.0} if surface is None else surface


def metal_factors(material: Mapping[str, Any]) -> tuple[float, float]:
    """The factors of metallic and roughness of a material from a glTF file's JSON."""
    surface = gltf_surface(material)
    return _number(surface.get("metallicFactor"), 1.0), _number(surface.get("roughnessFactor"), 1.0)


def normal_scale(material: Mapping[str, Any]) -> float:
    """The scale of the normal map of a material from a glTF file's JSON."""
    return _number(material.get("normalTexture", {}).get("scale"), 1.0)


def from_gltf(material: Mapping[str, Any]) -> MeshMaterial:
    """Convert a material from a glTF file's JSON."""
    surface, extensions = gltf_surface(material), material.get("extensions", {})
    transmission = extensions.get("KHR_materials_transmission", {}).get("transmissionFactor", 0.0)
    ior = _number(extensions.get("KHR_materials_ior", {}).get("ior"), GLASS_IOR)
    colour = _colour(surface.get("baseColorFactor", (1.0, 1.0, 1.0)), (1.0, 1.0, 1.0))
    metallic = _number(surface.get("metallicFactor"), 1.0) if "metallicRoughnessTexture" not in surface else 0.0
    roughness = _number(surface.get("roughnessFactor"), 1.0)
    alpha = _gltf_alpha(material, surface)
    coating = extensions.get("KHR_materials_clearcoat", {})
    share = _share(_number(coating.get("clearcoatFactor"), 0.0))
    coat = (share, _share(_number(coating.get("clearcoatRoughnessFactor"), 0.0)) if share > 0 else 0.0)
    if _number(transmission, 0.0) > 0.5:
        share = alpha.factor if alpha is not None and alpha.blends else 1.0
        red, green, blue = (1.0 - share + share * value for value in colour)
        return MeshMaterial("glass", (red, green, blue), _ior(ior), roughness=_share(roughness), clear_coat=coat)
    if metallic >= 0.5:
        emission = _shown_emission(gltf_emission(material)) if roughness > MIRROR_ROUGHNESS else DARK
        found = MeshMaterial("mirror", colour, emission=emission, alpha=alpha, roughness=_share(roughness))
    else:
        gloss = coat_roughness(roughness)
        emission = _shown_emission(gltf_emission(material))
        found = MeshMaterial("diffuse", colour, emission=emission, alpha=alpha, roughness=gloss)
    return replace(found, clear_coat=coat)


def _gltf_alpha(material: Mapping[str, Any], surface: Mapping[str, Any]) -> Alpha | None:
    mode, colour = material.get("alphaMode", "OPAQUE"), surface.get("baseColorFactor")
    if mode not in ("MASK", "BLEND"):
        return None
    factor = _number(colour[3], 1.0) if isinstance(colour, Sequence) and len(colour) > 3 else 1.0
    cutoff = _number(material.get("alphaCutoff"), 0.5) if mode == "MASK" else 0.5
    return Alpha(min(max(factor, 0.0), 1.0), min(max(cutoff, 0.0), 2.0), mode == "BLEND")


def _shown_emission(emission: Vector) -> Vector:
    """An emission with a largest channel of at most 1, and its hue."""
    red, green, blue = (value / max(1.0, *emission) for value in emission)
    return red, green, blue


def gltf_emission(material: Mapping[str, Any]) -> Vector:
    """The emission of a material from a glTF file's JSON, which may exceed 1."""
    extension = material.get("extensions", {}).get("KHR_materials_emissive_strength", {})
    strength = _number(extension.get("emissiveStrength"), 1.0)
    factor = _colour(material.get("emissiveFactor"), DARK, BRIGHTEST)
    red, green, blue = (min(max(0.0, strength), BRIGHTEST) * value for value in factor)
    return red, green, blue


def gltf_losses(material: Mapping[str, Any]) -> list[tuple[Loss, int]]:
    """What a picture does not show of a material of a glTF file's JSON, apart from its extensions.

    The textures of the base colour and of normals are not counted, nor what depends on the scene
    (`colonnade.mesh.materials.palette.with_rendered_metal`).
    """
    surface, extensions = gltf_surface(material), material.get("extensions", {})
    maps = [key for part in (material, surface, *extensions.values()) for key in part if key.endswith("Texture")]
    found = [(lost.MAPS.get(key, lost.TEXTURES), 1) for key in maps if key not in _READ_TEXTURES]
    if any(gltf_emission(material)) and not _is_lit(from_gltf(material)):
        found.append((lost.EMISSION, 1))
    found.append((lost.UNLIT, "KHR_materials_unlit" in extensions))
    transmission = _number(extensions.get("KHR_materials_transmission", {}).get("transmissionFactor"), 0.0)
    metallic = _number(surface.get("metallicFactor"), 1.0)
    if 0.0 < transmission < 1.0:
        found.append((lost.PARTLY_GLASS, 1))
    elif 0.0 < metallic < 1.0:
        found.append((lost.PARTLY_METAL, 1))
    return found


def _is_lit(material: MeshMaterial) -> bool:
    """Whether the lights are seen on a surface, and its emission with them."""
    return material.kind == "diffuse" or material.roughness > MIRROR_ROUGHNESS


def unused_extensions(material: Mapping[str, Any]) -> list[str]:
    """The extensions of a glTF material that are not used."""
    return [name for name in material.get("extensions", {}) if name not in USED_EXTENSIONS]


def _ior(value: float) -> float:
    """Replace values up to 1, which exporters write for an unknown index, by the default."""
    return min(value, 4.0) if value > 1.0 else GLASS_IOR


def coat_roughness(roughness: float) -> float:
    """The roughness of a coat, 0 for none: of a surface that is nearly matt it is not rendered."""
    return max(_share(roughness), SHARP_ROUGHNESS) if roughness < GLOSSY else 0.0


def _share(value: float) -> float:
    return min(max(value, 0.0), 1.0)


def _number(value: Any, default: float) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        return default
    return number if math.isfinite(number) else default


def _colour(values: Any, default: Vector, limit: float = 1.0) -> Vector:
    if not isinstance(values, Sequence) or isinstance(values, str) or len(values) < 3:
        return default
    channels = zip(values[:3], default, strict=True)
    red, green, blue = (min(max(_number(value, fallback), 0.0), limit) for value, fallback in channels)
    return red, green, blue
