"""The roughness from which on a metal is shown as diffuse: where both are equally far from its blurred reflection."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from textured_files import of_mtl

from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.materials import (
    BLACK,
    COAT_REFLECTANCE,
    LAYERS,
    MIRROR_ROUGHNESS,
    ROUGH_METAL,
    MeshMaterial,
    as_rendered,
    from_gltf,
    in_layer,
)
from colonnade.mesh.materials.palette import with_rendered_metal

ROUGHNESS = np.arange(0.1, 0.75, 0.05)


def surroundings(seed: int, directions: np.ndarray) -> np.ndarray:
    """The light from directions [..., 3]: 40 patches of walls, and a lamp of 10 degrees' radius."""
    random = np.random.default_rng(seed)
    centres = random.normal(size=(41, 3))
    centres /= np.linalg.norm(centres, axis=1)[:, None]
    walls = random.uniform(0.05, 0.9, 40)[(directions @ centres[:40].T).argmax(axis=-1)]
    return np.where(directions @ centres[40] > np.cos(np.radians(10)), 8.0, walls)


def srgb(values: np.ndarray) -> np.ndarray:
    return np.clip(values, 0, 1) ** (1 / 2.2)


def errors(seed: int, samples: int = 400, points: int = 150) -> np.ndarray:
    """Mean squared errors of a mirror and of a diffuse surface on a sphere of a GGX metal, by roughness: [2, n]."""
    random = np.random.default_rng(seed)
    place = random.uniform(-0.99, 0.99, (4 * points, 2))
    place = place[(place**2).sum(axis=1) < 0.98][:points]
    normal = np.column_stack([place, np.sqrt(1 - (place**2).sum(axis=1))])
    eye = np.array([0.0, 0.0, 1.0])
    tangent = np.cross(normal, (0.36, 0.48, 0.8))
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    frame = np.stack([tangent, np.cross(normal, tangent), normal], axis=1)
    one, two = random.random((2, points, samples))

    def around(cosine: np.ndarray) -> np.ndarray:
        sine, angle = np.sqrt(1 - cosine**2), 2 * np.pi * two
        local = np.stack([sine * np.cos(angle), sine * np.sin(angle), cosine], axis=-1)
        return np.asarray(np.einsum("nsi,nij->nsj", local, frame))

    mirror = surroundings(seed, 2 * normal[:, 2:] * normal - eye)
    diffuse = surroundings(seed, around(np.sqrt(one))).mean(axis=1)
    found = []
    for alpha in ROUGHNESS**2:
        cosine = np.sqrt((1 - one) / (1 + (alpha**2 - 1) * one))
        half = around(cosine)
        towards = 2 * half[..., 2:] * half - eye
        to_light, to_eye = np.einsum("nsj,nj->ns", towards, normal), normal[:, 2:]

        def shown(c: np.ndarray, alpha: float = alpha) -> np.ndarray:
            return np.asarray(2 * c / (c + np.sqrt(alpha**2 + (1 - alpha**2) * c**2)))

        visible = (to_light > 0) & (half[..., 2] > 0)
        weight = shown(np.maximum(to_light, 1e-6)) * shown(to_eye) * half[..., 2] / (to_eye * cosine)
        metal = (surroundings(seed, towards) * np.where(visible, weight, 0)).mean(axis=1)
        found.append([((srgb(one_of) - srgb(metal)) ** 2).mean() for one_of in (mirror, diffuse)])
    return np.array(found).T


def test_a_metal_is_a_mirror_up_to_where_diffuse_is_nearer() -> None:
    mirror, diffuse = np.mean([errors(seed) for seed in range(8)], axis=0)
    for roughness, *both in zip(ROUGHNESS, mirror, diffuse, strict=True):
        print(f"roughness {roughness:.2f}: mirror, diffuse ", *(f"{-10 * np.log10(one):.1f} dB" for one in both))
    crossing = np.interp(0.0, np.log(mirror / diffuse), ROUGHNESS)
    print(f"equal at {crossing:.2f}")
    assert abs(crossing - MIRROR_ROUGHNESS) < 0.05


def test_rough_metal_is_diffuse_without_gathered_light(tmp_path: Path) -> None:
    for roughness, kind in ((0.0, "mirror"), (0.35, "mirror"), (0.36, "diffuse"), (1.0, "diffuse")):
        surface = {"baseColorFactor": [1.0, 0.8, 0.3, 1.0], "roughnessFactor": roughness}
        found = from_gltf({"pbrMetallicRoughness": surface})
        assert found == MeshMaterial("mirror", (1.0, 0.8, 0.3), roughness=roughness)
        assert of_mtl(tmp_path, "Pm 1", f"Pr {roughness}").roughness == roughness
        assert as_rendered(found, gathers=False) == MeshMaterial(kind, (1.0, 0.8, 0.3))
        assert as_rendered(found, gathers=True) == found
        assert in_layer(found, "surface").kind == (ROUGH_METAL if roughness > 0.25 else "mirror")


def test_a_glossy_dielectric_has_a_coat_where_light_is_gathered(tmp_path: Path) -> None:
    """In one layer its own colour, in the other its coat; what has none is black there."""
    for roughness, coat in ((0.0, 0.25), (0.3, 0.3), (0.49, 0.49), (0.5, 0.0), (1.0, 0.0)):
        surface = {"baseColorFactor": [1.0, 0.8, 0.3, 1.0], "roughnessFactor": roughness, "metallicFactor": 0.0}
        found = from_gltf({"pbrMetallicRoughness": surface})
        assert found.roughness == coat == of_mtl(tmp_path, f"Pr {roughness}").roughness
        matt = MeshMaterial("diffuse", (1.0, 0.8, 0.3))
        assert as_rendered(found, gathers=False) == matt == in_layer(as_rendered(found, gathers=True), "surface")
        layer = in_layer(replace(as_rendered(found, gathers=True), has_corner_colours=True), "coat")
        assert layer == (MeshMaterial(ROUGH_METAL, (COAT_REFLECTANCE,) * 3, roughness=coat) if coat > 0 else BLACK)
        assert in_layer(found, "highlight") == BLACK
    for roughness in (0.0, 0.1, 0.125, 0.2, 0.25):
        mirror = MeshMaterial("mirror", roughness=roughness, has_corner_colours=True, emission=(1.0, 1.0, 1.0))
        layers = [in_layer(mirror, layer) for layer in LAYERS]
        rough = [roughness == 0.25, False, 0.1 < roughness < 0.25, False, False]
        assert [one.kind == ROUGH_METAL for one in layers] == rough
        assert layers[1] == layers[4] == BLACK and not any(layers[2].emission)
        assert layers[2] == BLACK or layers[2].has_corner_colours
        glass = MeshMaterial("glass", (0.5, 0.0, 0.0), roughness=roughness, has_corner_colours=True)
        untinted = MeshMaterial(ROUGH_METAL, (COAT_REFLECTANCE,) * 3, roughness=roughness)
        highlight = untinted if roughness > 0.1 else BLACK
        assert [in_layer(glass, layer) for layer in LAYERS] == [glass, BLACK, BLACK, highlight, BLACK]


def test_what_rough_surfaces_lose_is_named(tmp_path: Path) -> None:
    """Without gathered light all of it; with it what is rougher than glass can be."""
    mesh = load_mesh("cube")
    materials = (*(MeshMaterial("mirror", roughness=roughness) for roughness in (0.05, 0.2, 0.3, 0.5)), MeshMaterial())
    glass = from_gltf({"extensions": {"KHR_materials_transmission": {"transmissionFactor": 1.0}}})
    assert glass.roughness == 1.0 and of_mtl(tmp_path, "d 0", "Pr 0.2").roughness == 0.2
    mesh = replace(mesh, materials=(*materials, glass))
    glossy = replace(mesh, materials=(MeshMaterial(roughness=0.3),))
    assert "glossy material is matt" in with_rendered_metal(glossy, True)[1][0]
    assert with_rendered_metal(glossy, True, has_layers=True) == (glossy, ())
    # Roughnesses of one material, as a map gives it, count once
    sharp, diffuse = "1 slightly rough metal is a perfect mirror", "1 rough metal is diffuse"
    clear = "1 rough glass is perfectly clear"
    lines = [line.split(": ")[1] for line in with_rendered_metal(mesh, False)[1]]
    assert sorted(lines) == sorted([sharp, diffuse, clear])
    few = "2 slightly rough surfaces are without highlights"
    roughest = "1 rough glass is as rough as 1/2"
    assert sorted(line.split(": ")[1] for line in with_rendered_metal(mesh, True)[1]) == [roughest, few]
    rendered, (line,) = with_rendered_metal(mesh, True, has_layers=True)
    assert line.split(": ")[1] == roughest
    assert [material.roughness for material in rendered.materials] == [0.05, 0.2, 0.3, 0.5, 0.0, 0.5]
