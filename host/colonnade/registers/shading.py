"""Registers of ambient light, materials and paths (docs/numbers.md, sections 5 and 6)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.design.manifest import Manifest
from colonnade.mesh.materials.materials import ROUGH_METAL, MeshMaterial
from colonnade.registers.surface_offset import surface_offset
from colonnade.scene.view import View
from colonnade.scene_image.header import ImageHeader

CHANNELS = "rgb"
KINDS = {"diffuse": 0, "mirror": 1, "glass": 2, ROUGH_METAL: 3}
#: Units of the width of reflections, of their slope and of the logarithm of their peak, and of the width of microfacets
#: at mirrors and glass (docs/gather.md).
ALPHA_UNIT, SLOPE_UNIT, OCTAVE, FACET_UNIT = 256, 64, 128, 1024

#: Largest index of refraction whose square fits its register.
MAX_IOR = 2.8


def check_surfaces(view: View, manifest: Manifest) -> None:
    """Refuse more lights, materials or bounces than the design supports.

    Raises:
        UserError: The message names the limit and its setting.
    """
    frame = manifest.config["frame"]
    for what, count, setting in (
        ("lights", len(view.lights), "lights"),
        ("materials", len(view.materials), "materials"),
    ):
        if count > int(frame[setting]):
            raise UserError(
                f"the scene has {count} {what}, the hardware supports {frame[setting]}:"
                f" leave some out or raise frame.{setting}"
            )
    if view.gather is not None and not manifest.gathers:
        raise UserError("paths.gather asks for gathered light, which this hardware lacks: set frame.gather=true")
    maximum = int(frame["maxBounces"])
    shiny = [material for material in view.materials if material.kind in ("mirror", "glass")]
    if shiny and maximum == 0:
        raise UserError(
            f"the scene has {shiny[0].kind}, the hardware supports only diffuse surfaces: raise frame.maxBounces from 0"
        )
    if shiny and view.bounces > maximum:
        raise UserError(
            f"the scene traces {view.bounces} bounces, the hardware at most {maximum}: lower paths.bounces or raise"
            " frame.maxBounces"
        )
    for material in shiny:
        if material.kind == "glass" and not 1.0 <= material.ior <= MAX_IOR:
            raise UserError(f"glass has an index of refraction of {material.ior:g}; it must be from 1 to {MAX_IOR}")


def largest_offset(numbers: Mapping[str, int]) -> int:
    """The largest `shading.offset`, grid steps."""
    return max(1, min(1 << (numbers["vertexBits"] - 2 + numbers["gridFraction"]), (1 << (numbers["gridBits"] - 2)) - 1))


def surface_registers(view: View, header: ImageHeader, manifest: Manifest) -> dict[str, int]:
    """Compute the registers of ambient light, background, materials and shading."""
    numbers = manifest.numbers
    white = (1 << numbers["colourBits"]) - 1
    step = header.frame.scale * 2.0 ** numbers["gridFraction"]
    offset = (
        surface_offset(numbers, header.largest_triangle) if view.shadow_offset is None else view.shadow_offset * step
    )
    result = {
        "shading.offset": int(np.clip(np.rint(offset), 1, largest_offset(numbers))),
        "shading.flat": int(view.flat),
        "shading.shadows": int(view.shadows),
        "shading.lights": len(view.lights),
    }
    one = 1 << numbers["lightFraction"]
    max_light = (1 << numbers["lightBits"]) - 1
    result |= _colour("ambient", view.ambient * one, max_light)
    result |= _colour("background", view.background * white, white)
    for index, material in enumerate(view.materials):
        result |= _colour(f"materials[{index}].albedo", np.array(material.albedo) * white, white)
        if manifest.corner_colours:
            result[f"materials[{index}].hasCornerColours"] = int(material.has_corner_colours)
        if manifest.texture is not None:
            result[f"materials[{index}].hasTexture"] = int(material.texture is not None)
        if manifest.emission:
            emission = np.array(material.emission) * (material.kind in ("diffuse", ROUGH_METAL))
            result |= _colour(f"materials[{index}].emission", emission * white, white)
    if manifest.gathers:
        points = () if view.gather is None else view.gather.points
        result["gather.bounces"] = 0 if view.gather is None else view.gather.bounces
        result["gather.parallax"] = header.parallax
        result |= {
            f"gather.points[{i}].{axis}": point[a] for i, point in enumerate(points) for a, axis in enumerate("uv")
        }
    if int(manifest.config["frame"]["maxBounces"]) > 0:
        result["shading.bounces"] = min(view.bounces, int(manifest.config["frame"]["maxBounces"]))
        result["shading.shadowTransmittance"] = int(np.rint(view.shadow_transmittance * one))
        for index, material in enumerate(view.materials):
            result |= _kind(f"materials[{index}]", material, numbers["etaFraction"], one)
    return result


def _kind(name: str, material: MeshMaterial, fraction: int, one: int) -> dict[str, int]:
    result = {f"{name}.kind": KINDS[material.kind]}
    if material.kind != ROUGH_METAL and material.roughness > 0:
        result[f"{name}.lobe.alpha"] = min(round(FACET_UNIT * material.roughness**2), ALPHA_UNIT - 1)
    if material.kind == ROUGH_METAL:
        alpha = min(max(round(ALPHA_UNIT * material.roughness**2), 1), ALPHA_UNIT - 1) / ALPHA_UNIT
        result[f"{name}.lobe.alpha"] = round(ALPHA_UNIT * alpha)
        result[f"{name}.lobe.slope"] = round(SLOPE_UNIT * (1 - alpha**2) / (2 * alpha**2))
        result[f"{name}.lobe.peak"] = round(-2 * OCTAVE * np.log2(alpha))
    if material.kind == "glass":
        normal_reflectance = ((material.ior - 1) / (material.ior + 1)) ** 2
        result[f"{name}.etaFront"] = round(2**fraction / material.ior)
        result[f"{name}.etaBack"] = round(2**fraction * material.ior)
        result[f"{name}.reflectance"] = round(normal_reflectance * one)
    return result


def _colour(name: str, values: Floats, maximum: int) -> dict[str, int]:
    return {f"{name}.{channel}": min(maximum, int(np.rint(values[c]))) for c, channel in enumerate(CHANNELS)}
