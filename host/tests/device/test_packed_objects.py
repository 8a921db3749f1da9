"""Objects as instances: pictures equal one mesh's, and an object moves while the records stay."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from animated_documents import arm
from textured_files import FOUR

from colonnade import _core
from colonnade.common import notes
from colonnade.common.errors import UserError
from colonnade.common.image_io import encode_srgb
from colonnade.common.types import Floats
from colonnade.design.generator import manifest_for
from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import render_model
from colonnade.mesh.materials.texture import Texture
from colonnade.quality.image_metrics import psnr
from colonnade.registers.instances import instance_registers, transform_values, unit_transform
from colonnade.render.hit_faces import hit_faces
from colonnade.scene.model import Camera, Material, MeshSource, ObjectKey, Scene, SceneObject, Transform
from colonnade.scene.object_mesh import object_mesh
from colonnade.scene.object_pose import rotation_about
from colonnade.scene.prepared.device_scene import DeviceScene
from colonnade.scene_image.file import SceneImage

SIZE = (120, 90)
RED, MIRROR = Material(albedo=(0.8, 0.2, 0.1)), Material(kind="mirror")
OBJECTS = (
    SceneObject(mesh=MeshSource("sphere:3"), material=RED, transform=Transform(translate=(-1.2, 0.0, 0.0))),
    SceneObject(
        mesh=MeshSource("torus"), material=MIRROR, transform=Transform((0.0, 30.0, 70.0), 0.9, (1.3, 0.0, 0.2))
    ),
    SceneObject(
        mesh=MeshSource("sphere:3"), material=MIRROR, transform=Transform(scale=0.6, translate=(0.0, 1.5, -1.0))
    ),
)


@pytest.fixture(scope="module")
def manifest() -> Manifest:
    return manifest_for("tiny", ("frame.instances=3", "frame.maxBounces=4")).manifest


def scene(*objects: SceneObject) -> Scene:
    camera = Camera(position=(2.0, 2.5, 6.0), target=(0.0, 0.3, 0.0))
    return Scene(objects[0].mesh, objects=objects, camera=camera)


def joined(described: Scene, manifest: Manifest) -> DeviceScene:
    """The objects as one mesh: the design has fewer instances."""
    return DeviceScene.of(described, _without(manifest))


def _without(manifest: Manifest) -> Manifest:
    """The design with fewer instances than objects."""
    return replace(manifest, config={**manifest.config, "frame": {**manifest.config["frame"], "instances": 0}})


def picture(prepared: DeviceScene, manifest: Manifest) -> Floats:
    frame = render_model(manifest, prepared.image, prepared.registers(SIZE))
    assert frame.is_object.mean() > 0.05 and not frame.errors
    return encode_srgb(frame.colour / 4095.0)


@pytest.mark.parametrize("count", [2, 3])
def test_instances_show_what_one_mesh_shows(count: int, manifest: Manifest) -> None:
    described = scene(*OBJECTS[:count])
    instances, one = DeviceScene.of(described, manifest), joined(described, manifest)
    assert len(instances.image.header.instances) == count and not one.image.header.instances
    found, expected = picture(instances, manifest), picture(one, manifest)
    assert psnr(expected, found) >= 40.0
    turned = DeviceScene.of(scene(*OBJECTS[:count][::-1]), manifest)
    assert psnr(picture(turned, manifest), found) >= 40.0


def test_a_mesh_of_several_objects_is_packed_once(manifest: Manifest) -> None:
    first, _, third = DeviceScene.of(scene(*OBJECTS), manifest).image.header.instances
    assert (first.root, third.root) == (0, 0)
    assert first.material_base != third.material_base
    glass = replace(OBJECTS[2], material=Material(kind="glass"))  # another bit in its leaves
    first, other = DeviceScene.of(scene(OBJECTS[0], glass), manifest).image.header.instances
    assert first.root != other.root


def test_an_object_moves_without_packing(manifest: Manifest) -> None:
    place = Transform((20.0, 0.0, 10.0), 1.1, (1.5, 0.8, -0.6))
    before = DeviceScene.of(scene(*OBJECTS), manifest)
    moved = before.with_transform(2, place)
    packed = DeviceScene.of(scene(OBJECTS[0], replace(OBJECTS[1], transform=place), OBJECTS[2]), manifest)
    assert moved.image.records is before.image.records
    np.testing.assert_array_equal(moved.image.records, packed.image.records)
    assert moved.registers(SIZE) == packed.registers(SIZE)
    assert psnr(picture(before, manifest), picture(moved, manifest)) < 35.0
    assert moved.mesh is not None and packed.mesh is not None
    np.testing.assert_array_equal(moved.mesh.corner_normals, packed.mesh.corner_normals)
    assert moved.image.header.parts[1].edge == pytest.approx(packed.image.header.parts[1].edge)


def test_faces_are_those_of_the_object_that_is_hit(manifest: Manifest) -> None:
    prepared = DeviceScene.of(scene(*OBJECTS), manifest)
    view, mesh = prepared.view(SIZE), prepared.mesh
    assert mesh is not None
    frame = render_model(manifest, prepared.image, prepared.registers(SIZE))
    x, y = np.arange(SIZE[0])[None, :, None], np.arange(SIZE[1])[:, None, None]
    rays = view.direction + x * view.step_x + y * view.step_y
    depth = frame.distance / (prepared.image.header.frame.scale * np.abs(rays).max(axis=2))
    positions = view.origin + depth[..., None] * rays
    faces = hit_faces(prepared.image, frame)
    assert ((faces >= 0) == frame.is_object).all()
    starts = [part.first_face for part in mesh.parts]
    for number, transform in enumerate(one.transform for one in OBJECTS):
        mine = (np.searchsorted(starts, faces, side="right") - 1 == number) & (faces >= 0)
        assert mine.sum() > 50
        if number != 1:  # a sphere
            radii = np.linalg.norm(positions[mine] - np.array(transform.translate), axis=1)
            assert np.ptp(radii) < 0.1 * transform.scale


def with_notes(described: Scene, manifest: Manifest) -> tuple[DeviceScene, list[str]]:
    lines: list[str] = []
    with notes.opened(lines.append):
        return DeviceScene.of(described, manifest), lines


def test_more_objects_than_instances_are_one_mesh_by_a_note(manifest: Manifest) -> None:
    fourth = replace(OBJECTS[0], transform=Transform(translate=(0.0, -2.0, 0.0)))
    many, lines = with_notes(scene(*OBJECTS, fourth), manifest)
    assert not many.image.header.instances
    assert lines == ["the objects are packed as one mesh: they are 4, frame.instances is 3"]
    assert not with_notes(scene(*OBJECTS), manifest)[1]
    with pytest.raises(UserError, match=r"raise frame\.instances"):
        many.with_transform(1, Transform())
    with pytest.raises(UserError, match="there is no object 4"):
        DeviceScene.of(scene(*OBJECTS), manifest).with_transform(4, Transform())


def test_objects_that_no_transform_holds_are_one_mesh_by_a_note(manifest: Manifest) -> None:
    prepared, lines = with_notes(scene(OBJECTS[0], replace(OBJECTS[1], transform=Transform(scale=1e-6))), manifest)
    assert not prepared.image.header.instances
    assert ["object 2 is too small for the scene" in line for line in lines if "one mesh" in line] == [True]


def test_instances_move_and_bend_as_the_objects_of_one_mesh(tmp_path: Path, manifest: Manifest) -> None:
    file = arm().write(tmp_path / "arm.gltf")
    keys = (ObjectKey(0.5, turn=40.0, translate=(0.2, 0.3, 0.0)), ObjectKey(rotate=(20.0, 0.0, 60.0)))
    bent = SceneObject(
        mesh=MeshSource(path=file, animation="bend"),
        material=RED,
        transform=Transform((0.0, 20.0, 0.0), 0.5, (0.2, -1.2, 0.6)),
    )
    described = scene(OBJECTS[0], replace(OBJECTS[1], motion=keys), bent)
    instances, one = DeviceScene.of(described, manifest), joined(described, manifest)
    assert len(instances.image.header.instances) == 3
    still = instances.image
    for progress in (0.0, 0.3, 0.5, 1.0):
        pose = described.at(progress)
        found, expected = (picture(each.lit_at(pose), manifest) for each in (instances, one))
        assert psnr(expected, found) >= 38.0
        assert (instances.lit_at(pose).image.records != still.records).any() == (progress > 0)
    # A pose does not depend on the one before
    again = instances.lit_at(described.at(1.0)).lit_at(described.at(0.3))
    assert again.registers(SIZE) == instances.lit_at(described.at(0.3)).registers(SIZE)
    np.testing.assert_array_equal(again.image.records, instances.lit_at(described.at(0.3)).image.records)
    with pytest.raises(UserError, match=r"leave out object\.motion"):
        instances.with_transform(1, Transform())


def test_registers_of_a_motion_are_those_of_the_target(tmp_path: Path, manifest: Manifest) -> None:
    """Word by word: of the clip file, whose times are the host's."""
    keys = (ObjectKey(0.5, turn=40.0, translate=(0.2, 0.3, 0.0)), ObjectKey(rotate=(20.0, 0.0, 60.0)))
    bent = replace(OBJECTS[2], mesh=MeshSource(path=arm().write(tmp_path / "arm.gltf"), animation="bend"))
    prepared = DeviceScene.of(scene(OBJECTS[0], replace(OBJECTS[1], motion=keys), bent), manifest)
    target, seconds = target_motion(prepared.clip_file(), manifest), prepared.image.moves.seconds  # type: ignore[union-attr]
    known: dict[int, int] = {}
    before = -1
    edge = float(np.ptp(np.concatenate([one.corners for one in prepared.image.header.instances]), axis=0).max())
    for progress in np.linspace(0.0, 1.0, 21).tolist():
        time = round(progress * seconds * 2**16)
        known |= pairs_of(target.writes(time, before))
        before = time
        header = prepared.lit_at(prepared.scene.at(progress)).image.header
        assert header.frame == prepared.image.header.frame
        assert prepared.mesh is not None
        for one, placed in zip(header.instances, prepared.mesh.objects, strict=True):
            exact = placed.transform_at(progress * seconds)
            corners = one.box @ exact[:3, :3].T + exact[:3, 3]
            assert np.abs(one.corners - corners).max() < 2.0**-12 * edge
        registers = instance_registers(header.instances, header.frame, manifest)
        del registers["scene.instances"]
        words = [pair for name, value in registers.items() for pair in manifest.registers[name].encode(value)]
        assert known == dict(words)
        assert header.bounds_low == tuple(registers[f"bounds.low.{axis}"] for axis in "xyz")
    still = target.writes(before, before)
    assert still == b""
    ((root, duration),) = target.meshes()
    assert root == header.instances[2].root and duration == round(seconds * 2**16)


def test_a_program_moves_an_object_by_a_pose_in_metres(manifest: Manifest) -> None:
    """Also where the scene itself is turned in the view's world."""
    prepared, random = DeviceScene.of(scene(*OBJECTS), manifest), np.random.default_rng(4)
    header = prepared.image.header
    registers = [one for one in manifest.registers.values() if one.access == "rw"]
    end = max(one.address + one.words for one in registers)
    first = min(one.address for one in registers)
    view = _core.TargetView(manifest.format_words, first, end, prepared.view_file(SIZE))

    def rotation() -> tuple[Floats, list[int]]:
        matrix, _ = np.linalg.qr(random.normal(size=(3, 3)))
        matrix *= np.sign(np.linalg.det(matrix))
        return matrix, np.rint(matrix * 2.0**30).astype(int).ravel().tolist()

    def fixed(vector: Floats) -> list[int]:
        return np.rint(vector * 2.0**32).astype(int).tolist()

    for one in header.instances * 10:
        (own, own_words), (turn, turn_words) = rotation(), rotation()
        own_place, shift, pivot = random.uniform(-1, 1, size=(3, 3))
        view.set_object(fixed(own_place), own_words)
        linear, exponent, place = transform_values(one, header.frame)
        twice = [2 * value for value in linear], exponent - 1, place  # with all bits
        linear, exponent, place = view.move(fixed(shift), turn_words, fixed(pivot), *twice)
        world, move = np.eye(4), np.eye(4)
        world[:3, :3], world[:3, 3] = own, own_place
        move[:3, :3], move[:3, 3] = turn, pivot + shift - turn @ pivot
        moved = np.linalg.inv(world) @ move @ world @ np.array(one.transform)
        expected = unit_transform(replace(one, transform=tuple(map(tuple, moved))), header.frame)
        found = np.ldexp(np.array(linear, float).reshape(3, 3), exponent)
        assert np.abs(found - expected[0]).max() < 2.0**-26
        assert np.abs(np.ldexp(np.array(place, float), -20) - expected[1]).max() < 2.0**-8
    values = transform_values(header.instances[0], header.frame)
    for wrong, error in (
        ((fixed(shift), [0] * 9, fixed(pivot), *values), "badPose"),
        ((fixed(shift), turn_words, [1 << 61, 0, 0], *values), "badPose"),
        ((fixed(shift * 1e6), turn_words, fixed(pivot), *values), "tooFar"),
        ((fixed(shift), turn_words, fixed(pivot), values[0], values[1], [1 << 60, 0, 0]), "outside"),
        ((fixed(shift), turn_words, fixed(pivot), values[0], 1 << 30, values[2]), "outside"),
    ):
        with pytest.raises(ValueError, match=error):
            view.move(*wrong)


def test_a_clip_file_leaves_the_offset_of_the_scene(manifest: Manifest) -> None:
    moving = scene(OBJECTS[0], replace(OBJECTS[1], motion=(ObjectKey(turn=90.0),)))
    files = [
        DeviceScene.of(one, manifest).clip_file()
        for one in (moving, replace(moving, light=replace(moving.light, shadow_offset=0.01)))
    ]
    offset = manifest.registers["shading.offset"].address
    assert [offset in pairs_of(target_motion(file, manifest).writes(0)) for file in files] == [True, False]


def target_motion(file: bytes, manifest: Manifest) -> Any:
    registers = [one for one in manifest.registers.values() if one.access == "rw"]
    end = max(one.address + one.words for one in registers)
    return _core.TargetMotion(manifest.format_words, min(one.address for one in registers), end, file)


def pairs_of(writes: bytes) -> dict[int, int]:
    return {int(address): int(word) for address, word in np.frombuffer(writes, "<u4").reshape(-1, 2)}


def test_the_watchdog_waits_for_each_instance(manifest: Manifest) -> None:
    one, three = (
        DeviceScene.of(scene(*OBJECTS[:1], *[OBJECTS[0]] * more), manifest).registers(SIZE)["frame.watchdogCycles"]
        for more in (1, 2)
    )
    assert three > 1.3 * one


def test_normals_of_a_mesh_turn_with_its_pose() -> None:
    motion = (ObjectKey(turn=90.0),)
    mesh = object_mesh(scene(replace(OBJECTS[1], motion=motion), OBJECTS[0]))
    turned = mesh.posed(1.0)
    faces = len(mesh.objects[0].faces)
    about = rotation_about((0.0, 1.0, 0.0), 90.0)
    np.testing.assert_allclose(turned.corner_normals[:faces], mesh.corner_normals[:faces] @ about.T, atol=1e-6)
    np.testing.assert_allclose(turned.corner_normals[faces:], mesh.corner_normals[faces:], atol=1e-6)
    assert turned.posed(0.0).vertices == pytest.approx(mesh.posed(0.0).vertices)


def test_instances_may_have_textures_and_colours() -> None:
    manifest = manifest_for("small", ("frame.instances=4",)).manifest
    described = scene(*OBJECTS)
    mesh = object_mesh(described)
    uvs = mesh.vertices[mesh.faces][..., :2]
    texture = Texture("four", FOUR)
    materials = (replace(mesh.materials[0], texture=0, albedo=(1.0, 1.0, 1.0)), *mesh.materials[1:])
    mesh = replace(mesh, textures=(texture,), corner_uvs=uvs, materials=materials)
    images = [DeviceScene.of(described, each, mesh) for each in (manifest, _without(manifest))]
    assert len(images[0].image.header.instances) == 3
    found, expected = (picture(each, manifest) for each in images)
    assert psnr(expected, found) >= 36.0


def test_an_image_file_keeps_its_instances(tmp_path: Path, manifest: Manifest) -> None:
    image = DeviceScene.of(scene(*OBJECTS), manifest).image
    assert SceneImage.load(image.save(tmp_path), manifest).header.instances == image.header.instances
