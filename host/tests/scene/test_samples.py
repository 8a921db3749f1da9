"""Sample points of a frame: well distributed, the centre for one sample; their effect on the view."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from colonnade.common import notes
from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.materials import MARKS, MeshMaterial
from colonnade.scene.model import Camera, Light, MeshSource, Motion, Paths, PointLight, Scene
from colonnade.scene.object_pose import Placed
from colonnade.scene.parser import load_scene
from colonnade.scene.passes import frame_passes, light_shares, of_a_device
from colonnade.scene.samples import CENTRE, PERIOD, Sample, disc_point, samples_of_frame, square_points
from colonnade.scene.view import View, make_view

TEAPOT = Scene(MeshSource(name="teapot:2"))
EXTENT = load_mesh("teapot:2").extent
SIZE = (32, 24)


@given(count=st.integers(1, 300), dimension=st.integers(0, 8))
def test_each_interval_of_an_axis_has_one_point_in_its_middle(count: int, dimension: int) -> None:
    points = square_points(count, dimension)
    assert points.shape == (count, 2) and points.min() > 0.0 and points.max() < 1.0
    for axis in points.T:
        np.testing.assert_allclose(np.sort(axis), (np.arange(count) + 0.5) / count, rtol=1e-15)
    np.testing.assert_allclose(points.mean(axis=0), 0.5, atol=1e-12)


@pytest.mark.parametrize("log", range(9))
@pytest.mark.parametrize("dimension", [0, 3])
def test_a_power_of_two_has_a_point_in_every_elementary_rectangle(log: int, dimension: int) -> None:
    points = square_points(1 << log, dimension)
    for across in range(log + 1):
        cells = np.floor(points * (1 << across, 1 << (log - across))).astype(int)
        assert len({tuple(cell) for cell in cells}) == 1 << log


def test_dimensions_are_the_same_set_in_other_orders() -> None:
    first, *others = (square_points(16, dimension) for dimension in range(4))
    for other in others:
        assert {tuple(point) for point in other} == {tuple(point) for point in first}
        assert not np.array_equal(other, first)
        assert abs(np.corrcoef(first[:, 0], other[:, 0])[0, 1]) < 0.6


def test_the_points_of_four_samples_are_fixed() -> None:
    """Pictures of the documentation and of users depend on them."""
    np.testing.assert_array_equal(square_points(4, 0) * 8, [[1, 1], [5, 5], [3, 7], [7, 3]])
    np.testing.assert_array_equal(square_points(4, 1) * 8, [[7, 3], [3, 7], [1, 1], [5, 5]])


@pytest.mark.parametrize("count", [1, 4])
def test_frames_together_have_a_gathered_ray_in_each_interval(count: int) -> None:
    frames = [samples_of_frame(count, 1, number) for number in range(PERIOD)]
    for ray in range(2):
        points = np.array([sample.gather[ray] for frame in frames for sample in frame])
        for axis in points.T:
            np.testing.assert_array_equal(np.sort(axis * count * PERIOD // 256), np.arange(count * PERIOD))
    assert [replace(sample, gather=()) for sample in frames[3]] == [replace(sample, gather=()) for sample in frames[0]]


def test_one_sample_is_the_centre() -> None:
    assert samples_of_frame(1, 2) == (replace(CENTRE, lights=((0.0, 0.0), (0.0, 0.0))),)
    assert CENTRE.light(5) == (0.0, 0.0)


@given(x=st.floats(0, 1), y=st.floats(0, 1))
def test_discs_are_squares_of_equal_area(x: float, y: float) -> None:
    """The square of half the edge becomes the disc of half the radius."""
    radius = np.hypot(*disc_point(x, y))
    assert radius == pytest.approx(2 * max(abs(x - 0.5), abs(y - 0.5)), abs=1e-12)
    a, b = disc_point(x, y)
    assert np.sign(a) * np.sign(x - 0.5) >= 0 and np.sign(b) * np.sign(y - 0.5) >= 0


def view_of(scene: Scene, sample: Sample) -> View:
    return make_view(Placed(replace(scene, sample=sample), EXTENT), *SIZE)


def direction(view: View, x: float, y: float) -> Floats:
    return np.asarray(view.direction + x * view.step_x + y * view.step_y)


def test_a_shift_moves_all_rays_by_a_part_of_a_pixel() -> None:
    view, shifted = view_of(TEAPOT, CENTRE), view_of(TEAPOT, Sample(pixel=(0.25, -0.5)))
    np.testing.assert_allclose(direction(shifted, 3, 4), direction(view, 3.25, 3.5), atol=1e-12)
    np.testing.assert_array_equal(shifted.origin, view.origin)


@pytest.mark.parametrize("focus", [None, 3.5])
def test_rays_through_the_lens_meet_in_the_plane_in_focus(focus: float | None) -> None:
    scene = replace(TEAPOT, camera=Camera(position=(1.0, 2.0, 9.0), target=(0.0, 1.0, 0.0), aperture=0.4, focus=focus))
    distance = focus or float(np.linalg.norm([1.0, 1.0, 9.0]))
    pinhole, edge = view_of(scene, CENTRE), view_of(scene, Sample(lens=(0.6, -0.8)))
    assert np.linalg.norm(edge.origin - pinhole.origin) == pytest.approx(0.2)
    for x, y in ((0, 0), (31, 23), (15.5, 11.5)):
        at_focus = pinhole.origin + distance * direction(pinhole, x, y)
        np.testing.assert_allclose(edge.origin + distance * direction(edge, x, y), at_focus, atol=1e-12)
    axis = direction(pinhole, 15.5, 11.5)
    assert (edge.origin - pinhole.origin) @ axis == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("light", [Light(radius=0.5), Light(position=(3.0, 8.0, 1.0), radius=0.5)])
def test_an_area_light_is_a_disc_that_faces_the_object(light: Light) -> None:
    scene = replace(TEAPOT, light=light)
    middle, pose = view_of(scene, CENTRE).light, Placed(scene, EXTENT).pose
    np.testing.assert_allclose(middle, view_of(replace(TEAPOT, light=replace(light, radius=0.0)), CENTRE).light)
    for sample in samples_of_frame(16, 1):
        offset = (view_of(scene, sample).light - middle) * pose.scale
        assert np.linalg.norm(offset) == pytest.approx(0.5 * np.hypot(*sample.lights[0]))
        assert offset @ (middle - EXTENT.centre) == pytest.approx(0.0, abs=1e-9)


def test_a_light_in_the_centre_of_the_object_faces_the_camera() -> None:
    scene = replace(TEAPOT, light=Light(position=tuple(EXTENT.centre), radius=0.5))
    view = view_of(scene, Sample(lights=((1.0, 0.0),)))
    assert np.linalg.norm(view.light - EXTENT.centre) == pytest.approx(0.5)


@given(shutter=st.floats(0, 1), frames=st.integers(1, 20), turn=st.sampled_from([360.0, 90.0]))
@settings(max_examples=30)
def test_the_shutter_opens_for_a_part_of_the_interval(shutter: float, frames: int, turn: float) -> None:
    motion = Motion(turn=turn, shutter=shutter)
    scene = replace(TEAPOT, motion=motion).with_samples(8)
    progress = scene.frame_progress(frames)
    interval = progress[1] if frames > 1 else 1.0
    for start in progress:
        times = [one.motion_progress for one in frame_passes(scene.at(start), exposure=scene.opening(frames))]
        expected = start + (np.arange(8) + 0.5) / 8 * shutter * interval
        np.testing.assert_allclose(np.sort(times), np.minimum(expected, 1.0), atol=1e-12)


@pytest.mark.parametrize(("samples", "kinds"), [(1, "s"), (2, "sschg"), (6, "sssssschg"), (8, "sssschgsssschg")])
def test_other_layers_have_a_pass_after_four_of_surfaces(samples: int, kinds: str) -> None:
    scene, mirror = replace(TEAPOT, paths=Paths(gather=1)).with_samples(samples), MeshMaterial("mirror")
    every = {
        "c": MeshMaterial(roughness=0.3),
        "h": replace(mirror, roughness=0.2),
        "g": MeshMaterial("glass", roughness=0.2),
    }
    for left_out in ("", "h", "hg"):
        layers = "".join(
            one.sample.layer[0] for one in frame_passes(scene, [every[key] for key in every if key not in left_out])
        )
        assert layers == "".join(kind for kind in kinds if kind not in left_out)
    without = (
        MeshMaterial(roughness=0.6),
        MeshMaterial("glass", roughness=0.1),
        *(replace(mirror, roughness=roughness) for roughness in (0.0, 0.1, 0.3)),
    )
    assert {one.sample.layer for one in frame_passes(scene, without)} == {"surface"}


@pytest.mark.parametrize(("falloff", "distance"), [(0.0, 3.0), (2.0, 3.0), (2.0, 0.4)])
def test_highlights_are_of_the_light_that_marks_do_not_show(falloff: float, distance: float) -> None:
    """Which is that of a disc with the radiance 1 of the device, or of all of the mark's in glass."""
    x, y, z = Placed(TEAPOT, EXTENT).pose.to_world(EXTENT.centre)
    light = Light(colour=(2.0, 0.05, 0.0), position=(x, y + distance, z), radius=0.3, falloff=falloff or None)
    scene = replace(TEAPOT, light=light, exposure=0.5)
    scene = replace(scene, paths=Paths(gather=1))
    surfaces, *others = (view_of(scene, Sample(layer=layer)) for layer in ("surface", *MARKS))
    assert surfaces.gather is not None
    whole, at_object = surfaces.lights[0].colour, (falloff / distance) ** 2 if falloff else 1.0
    for highlights, mark in zip(others, (1.0, 16.0), strict=True):
        assert highlights.gather is None and not highlights.ambient.any()
        of_mark = (whole - highlights.lights[0].colour) * at_object
        np.testing.assert_allclose(of_mark, np.minimum(whole * at_object, mark * (0.3 / distance) ** 2))


def test_without_keys_one_pass_is_the_scene() -> None:
    assert frame_passes(TEAPOT.at(0.25)) == [replace(TEAPOT.at(0.25), sample=replace(CENTRE, lights=((0.0, 0.0),)))]
    assert TEAPOT.blurs == []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[frame]\nsamples = 0", "frame.samples must be a whole number from 1 to 1024"),
        ("[frame]\nsamples = 1025", "frame.samples must be a whole number"),
        ("[frame]\nsamples = 2.5", "frame.samples must be a whole number"),
        ("[light]\nradius = -1", "light.radius must be a number from 0 to 1e"),
        ("[light]\nradius = inf", "light.radius must be a number"),
        ("[[light]]\n[[light]]\nradius = 'big'", "light.radius must be a number"),
        ("[camera]\naperture = -0.1", "camera.aperture must be a number from 0"),
        ("[camera]\naperture = 0.1\nfocus = 0", "camera.focus must be a number from 1e-06"),
        ("[camera]\nfocus = 2.0", "camera.focus needs camera.aperture"),
        ('[background]\nroom = "r"\n[camera]\naperture = 0.1', r"the camera is the room's: give camera.position"),
        ("[motion]\nshutter = 1.5", "motion.shutter must be a number from 0 to 1"),
    ],
)
def test_wrong_values_are_one_line(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "scene.toml").write_text(f'[mesh]\nname = "teapot:2"\n{text}\n')
    with pytest.raises(UserError, match=message):
        load_scene(tmp_path / "scene.toml")


@pytest.mark.parametrize(
    ("frame", "gather", "named"),
    [
        ({"samples": 1}, 1, None),
        ({}, 0, None),
        ({"samples": 4}, 0, "frame.samples = 4 is"),
        ({}, 1, "the samples, coats and highlights of paths.gather are"),
        ({"samples": 4}, 1, "frame.samples = 4 and the samples, coats and highlights of paths.gather are"),
    ],
)
def test_what_a_device_does_not_show_by_itself_is_named(frame: dict[str, int], gather: int, named: str | None) -> None:
    scene = replace(TEAPOT, paths=Paths(bounces=1, gather=gather), frame=replace(TEAPOT.frame, **frame))
    lines: list[str] = []
    with notes.opened(lines.append):
        assert of_a_device(scene).frame.samples == 1
    assert [line.partition(" of colonnade render")[0] for line in lines] == ([] if named is None else [named])


@given(
    strengths=st.lists(st.floats(0.01, 10.0), min_size=3, max_size=8),
    count=st.integers(1, 20),
    slots=st.integers(1, 2),
)
def test_passes_share_lights_without_a_change_of_their_mean(strengths: list[float], count: int, slots: int) -> None:
    """A pass has as many lights as the hardware; a stronger light is in no fewer passes, and none is left out."""
    strengths = sorted(strengths, reverse=True)
    shares = np.array(light_shares(strengths, count, slots))
    assert shares.shape == (count, len(strengths)) and ((shares > 0).sum(axis=1) <= slots).all()
    places = count * slots
    means = shares.mean(axis=0)
    np.testing.assert_allclose(means[:places], means[0])
    np.testing.assert_allclose(means @ strengths, sum(strengths))
    assert not shares[:, places:].any()
    assert (np.diff((shares > 0).sum(axis=0)) <= 0).all()


def test_a_scene_has_the_lights_that_were_found_in_the_mean_of_its_passes() -> None:
    colours = ((0.9, 0.8, 0.7), (0.3, 0.3, 0.4), (0.1, 0.2, 0.1))
    first, *more = (PointLight((float(index), 3.0, 0.0), colour=own) for index, own in enumerate(colours))
    scene = replace(TEAPOT, light=Light(first.position, colour=first.colour), more_lights=tuple(more))
    every = make_view(Placed(scene, EXTENT), *SIZE).lights
    assert len(every) == 3
    shared = replace(scene, pass_lights=2).with_samples(8)
    assert len(make_view(Placed(shared, EXTENT), *SIZE).lights) == 2, "a frame of one pass has the brightest"
    sums = np.zeros((3, 3))
    for one in frame_passes(shared):
        view = make_view(Placed(one, EXTENT), *SIZE)
        assert len(view.lights) == 2
        for light in view.lights:
            sums += [light.colour * np.allclose(light.position, other.position) for other in every]
    np.testing.assert_allclose(sums / 8, colours)
