"""The live encoder: legal maps of any room, equal words of every build, losses near the offline encoder's."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from colonnade_lab.evaluation.studies.generated_rooms import generated_room
from colonnade_lab.evaluation.studies.synthetic_attic import write_room
from hypothesis import given, settings
from hypothesis import strategies as st

from colonnade.api.scene import Scene
from colonnade.cli.main import cli
from colonnade.common.errors import UserError
from colonnade.common.image_io import encode_srgb
from colonnade.environment.load import load_environment
from colonnade.environment.model import Environment, EnvironmentCamera
from colonnade.maps import cache
from colonnade.maps.cache import encoded_environment
from colonnade.maps.image import AttributeImage, memory_words
from colonnade.maps.layout import POINTER_BITS, AttributeLayout
from colonnade.maps.live import (
    EXACT_TOLERANCE,
    LiveEncoder,
    LiveFrame,
    LiveMaps,
    _whole_tiles,
    colour_codes,
    encode_colours,
    encode_still,
)
from colonnade.maps.plane_map import PLANE_MODES
from colonnade.maps.planes import PlaneProjection, unpack_planes
from colonnade.maps.quality import angles, ray_errors
from colonnade.maps.two_level import MODES, TwoLevelMap
from colonnade.maps.two_level_encoder import encode_two_level
from colonnade.maps.vectors import AlbedoSpace
from colonnade.quality.image_metrics import psnr

HOST = Path(__file__).resolve().parents[2]
ROOMS = HOST.parent / "scenes" / "rooms"
LAYOUT = AttributeLayout(160, 120, map_bytes=3000, palette_size=64, plane_bytes=1400, planes=32)
#: Distances of the box room's walls and their normals, world space: a camera 1.2 m above the floor looks along -z.
WALLS = np.array([[0, 0, 1.0, -4.0], [0, 1, 0, 0], [0, -1, 0, -2.4], [1, 0, 0, -1.5], [-1, 0, 0, -1.5]])
PAINT = np.array([[0.5, 0.5, 0.5], [0.4, 0.2, 0.1], [0.9, 0.9, 0.9], [0.2, 0.5, 0.2], [0.2, 0.2, 0.5]])


def box_room(right: float = 0.0, turn: float = 0.0, width: int = 160, height: int = 120) -> Environment:
    """A box room of 3 by 4 by 2.4 m with striped walls, from a camera that has moved and turned."""
    sine, cosine = np.sin(turn), np.cos(turn)
    rotation = np.array([[cosine, 0, sine], [0, -1, 0], [sine, 0, -cosine]])
    camera = EnvironmentCamera(120.0, 120.0, 83.0, 58.0, np.column_stack([rotation, [right, 1.2, 0.0]]))
    rays = camera.directions(width, height) @ rotation.T
    eye = camera.to_world[:, 3]
    with np.errstate(divide="ignore"):
        depths = (WALLS[:, 3] - eye @ WALLS[:, :3].T) / (rays @ WALLS[:, :3].T)
    depths = np.where(depths > 0, depths, np.inf)
    which, depth = depths.argmin(axis=2), depths.min(axis=2)
    stripes = 0.7 + 0.3 * (np.floor(4 * (eye + rays * depth[..., None])).sum(axis=2) % 2)
    return Environment("box", PAINT[which] * stripes[..., None], WALLS[which, :3] @ rotation, depth, True, camera, None)


def assert_legal(image: AttributeImage) -> None:
    """No word lies beyond a heap, and every index names an entry."""
    layout, pointers = image.layout, (1 << POINTER_BITS) - 1
    for vectors in (image.albedo, image.normals):
        assert isinstance(vectors, TwoLevelMap)
        mode, pointer = vectors.descriptors & 7, vectors.descriptors >> 3 & pointers
        words = np.array([each.words for each in MODES])[mode]
        assert (np.where(mode > 0, pointer + words, 0) <= layout.heap_words).all() and (pointer[mode == 0] < 16).all()
        assert vectors.palette.max() < 1 << 36 and len(vectors.heap) == layout.heap_words
        v, u = np.mgrid[: layout.height, : layout.width]
        assert vectors.entries_at(u, v, layout).max() < layout.palette_size
    planes = image.planes
    mode, pointer = planes.descriptors & 7, planes.descriptors >> 3
    words = np.array([each.words for each in PLANE_MODES])
    assert mode.max() < len(PLANE_MODES) and (np.where(mode > 0, pointer + words[mode], 0) <= len(planes.heap)).all()
    assert len(planes.heap) == layout.plane_heap_words
    assert planes.ids(layout).max() < layout.infinite_plane and planes.planes[layout.infinite_plane] == 0
    assert planes.bounding.shape == (layout.bounding_planes, 3) and planes.bounding[0, 0] != 0


def all_words(image: AttributeImage) -> bytes:
    return b"".join(words.tobytes() for _, words in memory_words(image))


@settings(max_examples=25)
@given(st.data())
def test_maps_of_any_room_are_legal(data: st.DataObject) -> None:
    """Noise, constant maps, extreme depths and cameras that jump: two frames of them."""
    random = np.random.default_rng(data.draw(st.integers(0, 10**6)))
    layout = replace(
        LAYOUT,
        width=data.draw(st.integers(1, 90)),
        height=data.draw(st.integers(1, 70)),
        palette_size=data.draw(st.sampled_from([4, 17, 256])),
        planes=data.draw(st.sampled_from([2, 5, 128])),
        plane_bytes=data.draw(st.sampled_from([1240, 1700])),
    )
    encoder, shape = LiveEncoder(layout), (layout.height, layout.width)
    for _ in range(2):
        noisy = data.draw(st.sampled_from([0.0, 0.2, 1.0]))
        depth = np.exp2(np.full(shape, random.uniform(4, 30)) + noisy * random.uniform(-6, 6, shape)).clip(0, 2**32 - 1)
        turn, tilt = random.uniform(-3, 3, 2) * noisy
        rotation = np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
        rotation = rotation @ [[1, 0, 0], [0, np.cos(tilt), np.sin(tilt)], [0, -np.sin(tilt), np.cos(tilt)]]
        camera = EnvironmentCamera(
            random.uniform(1, 300), random.uniform(1, 300), *random.uniform(-9, 99, 2),
            np.column_stack([rotation, noisy * random.uniform(-9, 9, 3)]),
        )  # fmt: skip
        grain = random.integers(0, 256, (2, *shape, 3)) if noisy else np.full((2, *shape, 3), random.integers(256))
        albedo, normals = grain.astype(np.uint8)
        assert_legal(encoder.encode(LiveFrame(albedo, normals, depth.astype(np.uint32), camera)).image)


def test_planes_and_colours_of_a_box_are_exact() -> None:
    """Also of later frames, whose palette, planes and ids come from the frames before."""
    encoder, ids = LiveEncoder(LAYOUT), []
    for step in range(4):
        room = box_room(0.05 * step, 0.02 * step)
        maps = encoder.encode(LiveFrame.of(room))
        assert_legal(maps.image)
        depth = maps.image.decoded_depth(PlaneProjection.of(room, maps.image.depth_unit))
        assert (
            np.percentile(ray_errors(room, depth), 99) < EXACT_TOLERANCE and maps.image.depth_unit <= room.depth.min()
        )
        assert np.percentile(angles(room.normals, maps.image.decoded_normals()), 98) < 0.5
        assert psnr(encode_srgb(room.albedo), encode_srgb(maps.image.decoded_albedo())) > 28
        assert np.count_nonzero(maps.image.planes.bounding[:, 0]) >= 5
        ids.append(maps.image.planes.ids(LAYOUT)[100, 80])
    assert len(set(ids)) == 1
    floor = unpack_planes(maps.image.planes.planes[ids[:1]])
    projection = PlaneProjection.of(room, maps.image.depth_unit)
    assert angles(projection.normals(floor), np.array([[0.0, -1.0, 0.0]])).max() < 0.1


def test_errors_and_depths_of_tiles_are_those_of_the_maps() -> None:
    layout, room = AttributeLayout(), load_environment(ROOMS / "office")
    maps = LiveEncoder(layout).encode(LiveFrame.of(room))
    depth = maps.image.decoded_depth(PlaneProjection.of(room, maps.image.depth_unit))
    tiles = [
        values.reshape(30, 16, 40, 16).transpose(0, 2, 1, 3).reshape(30, 40, 256)
        for values in (depth, ray_errors(room, depth))
    ]
    assert np.allclose(maps.tile_nearest, tiles[0].min(axis=2), rtol=1e-4)
    seen = np.isfinite(tiles[0].max(axis=2))
    assert np.allclose(maps.tile_furthest[seen], tiles[0].max(axis=2)[seen], rtol=1e-3)
    low, high = (np.percentile(tiles[1], share, axis=2) for share in (82, 97))
    assert ((maps.tile_error >= low - 1e-4) & (maps.tile_error <= high + 1e-4)).mean() > 0.97


def test_noise_of_depth_widens_the_tolerance() -> None:
    """A noisy wall is one plane if the encoder knows of the noise."""
    random, room = np.random.default_rng(1), box_room()
    frame = LiveFrame.of(replace(room, depth=room.depth * random.normal(1, 0.005, room.depth.shape)))
    used = [np.count_nonzero(LiveEncoder(LAYOUT, noise).encode(frame).image.planes.planes) for noise in (0.0, 0.02)]
    assert used[1] <= 16 < used[0]


@pytest.mark.matrix
@pytest.mark.skipif(shutil.which("g++") is None, reason="g++ is not installed")
def test_words_do_not_depend_on_the_build(tmp_path: Path) -> None:
    """Without optimisation, vectors and undefined behaviour: the same words in every frame."""
    program, sources = tmp_path / "frames", HOST / "cpp" / "live"
    flags = ["-std=gnu++17", "-O0", "-ffp-contract=off", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    files = [Path(__file__).parent / "live_frames.cpp", sources / "live.cpp", sources / "kernels.cpp"]
    subprocess.run(["g++", *flags, "-I", HOST / "cpp", *files, "-o", program], check=True)
    layout, encoder = LAYOUT, LiveEncoder(LAYOUT)
    sizes = [layout.width, layout.height, layout.palette_size, layout.heap_words, layout.planes]
    given, expected = np.array([*sizes, layout.plane_heap_words, layout.bounding_planes], np.int32).tobytes(), b""
    for step in range(3):
        room = box_room(0.1 * step, -0.05 * step)
        grain = np.random.default_rng(step).uniform(0.9, 1.1, (2, *room.depth.shape))
        room = replace(room, albedo=(room.albedo * grain[0, ..., None]).clip(0, 1), depth=room.depth * grain[1] ** 0.1)
        frame, camera = LiveFrame.of(room), room.camera
        lens = [camera.fx, camera.fy, camera.cx, camera.cy, *camera.to_world.ravel(), EXACT_TOLERANCE]
        given += b"".join(_whole_tiles(part, 16).tobytes() for part in (frame.albedo, frame.normals, frame.depth))
        given += np.array(lens).tobytes()
        expected += _returned(encoder.encode(frame))
    found = subprocess.run([program], input=given, capture_output=True, check=True)
    assert found.stdout == expected and not found.stderr


def _returned(maps: LiveMaps) -> bytes:
    """All that the encoder returns, in the order of live_frames.cpp."""
    memories = maps.image.memories()
    order = [(part, name) for part in ("albedo", "normals") for name in ("descriptors", "palette", "heap")]
    order += [("planes", name) for name in ("descriptors", "planes", "heap", "bounding")]
    words = b"".join(memories[part][name].tobytes() for part, name in order)
    tiles = b"".join(part.tobytes() for part in (maps.tile_error, maps.tile_nearest, maps.tile_furthest))
    return words + tiles + np.float64(maps.image.depth_unit).tobytes()


def test_equal_frames_give_equal_words() -> None:
    first, again = (encode_still(box_room(), LAYOUT) for _ in range(2))
    assert all_words(first) == all_words(again)
    assert all_words(first) != all_words(encode_still(box_room(0.1), LAYOUT))


@pytest.mark.parametrize(("room", "decibels", "degrees"), [("living", 0.5, 0.15), ("attic", 0.7, 0.15)])
def test_losses_of_rooms_are_near_those_of_the_offline_encoder(room: str, decibels: float, degrees: float) -> None:
    """The offline losses are as in docs/background.md."""
    environment = load_environment(ROOMS / room)
    image = encode_still(environment, AttributeLayout())
    assert_legal(image)
    albedo, normals = {"living": (30.6, 1.19), "attic": (31.0, 0.40)}[room]
    assert psnr(encode_srgb(environment.albedo), encode_srgb(image.decoded_albedo())) > albedo - decibels
    assert angles(environment.normals, image.decoded_normals()).mean() < normals + degrees
    errors = ray_errors(environment, image.decoded_depth(PlaneProjection.of(environment, image.depth_unit)))
    assert np.mean(errors > 0.05) < 0.01


def test_normals_of_the_next_view_are_as_good_as_those_of_a_first_one(tmp_path: Path) -> None:
    """The palette of the view before is no worse a start than none."""
    for name, walked in (("first", 0.0), ("second", 0.05)):
        write_room(tmp_path / name, generated_room(2, walked=walked).environment)
    first, second = (load_environment(tmp_path / name) for name in ("first", "second"))
    warm, cold = (LiveEncoder(AttributeLayout()) for _ in range(2))
    warm.encode(LiveFrame.of(first))
    errors = [
        float(angles(second.normals, encoder.encode(LiveFrame.of(second)).image.decoded_normals()).mean())
        for encoder in (warm, cold)
    ]
    assert errors[0] < 1.1 * errors[1]


@pytest.mark.parametrize("tile", [8, 16, 32])
def test_textures_of_all_tile_sizes(tile: int) -> None:
    room = box_room(width=150, height=100)
    layout = AttributeLayout(150, 100, tile_size=tile, map_bytes=4000, palette_size=64)
    colours = (room.albedo * np.random.default_rng(1).uniform(0.9, 1.1, room.albedo.shape[:2])[..., None]).clip(0, 1)
    space = AlbedoSpace(layout.field_bits)
    live, offline = (
        psnr(encode_srgb(colours), encode_srgb(found.decoded(layout, space)))
        for found in (encode_colours(colours, layout), encode_two_level(colours, space, layout, 3, 1))
    )
    assert live > offline - 1.0
    assert np.array_equal(colour_codes(np.array([0.0, 1.0])), [0, 255])


def test_tiles_with_nearly_equal_patterns_share_words() -> None:
    room = generated_room(100).environment
    layout = AttributeLayout(room.width, room.height)
    found = encode_colours(room.albedo, layout)
    assert np.array([mode.words for mode in MODES])[found.descriptors & 7].sum() > 1.1 * layout.heap_words


def test_shared_patterns_keep_their_sides() -> None:
    """Tiles of one pattern but for some cells, and often for the first one, whose words begin with the other entry."""
    random = np.random.default_rng(5)
    pattern = random.random((8, 8)) < 0.5
    flips = random.random((15, 20, 8, 8)) < 0.022
    flips[:, ::2, 0, 0] = True
    cells = (pattern ^ flips).transpose(0, 2, 1, 3).reshape(120, 160)
    shade = np.where(cells, 0.6, 0.2).repeat(2, axis=0).repeat(2, axis=1)
    layout = AttributeLayout(320, 240, map_bytes=3000, palette_size=64)
    found = encode_colours(np.repeat(shade[..., None], 3, axis=2), layout).decoded(layout, AlbedoSpace(12))
    assert (np.abs(found[..., 0] - shade) > 0.2).mean() < 0.2


def test_other_layouts_and_sizes_are_refused() -> None:
    for layout in (replace(LAYOUT, tile_size=8), replace(LAYOUT, encoding="slic", map_bytes=9000)):
        with pytest.raises(UserError, match="live encoder writes twoLevel maps with tiles of 16"):
            LiveEncoder(layout)
    with pytest.raises(UserError, match="the maps are 80x60 pixels, the encoder's layout is 160x120"):
        LiveEncoder(LAYOUT).encode(LiveFrame.of(box_room(width=80, height=60)))


def test_it_encodes_unless_it_does_not_write_the_layout(monkeypatch: pytest.MonkeyPatch) -> None:
    packed = [Scene.load("room").pack("small", **options).image for options in ({}, {"encoder": "live"})]
    words = [[section.words for section in image.attributes] for image in packed]
    assert all(np.array_equal(one, other) for one, other in zip(*words, strict=True))
    monkeypatch.setattr(cache, "encode_environment", lambda *_: "offline")
    assert encoded_environment(box_room(), replace(LAYOUT, tile_size=8), encoder=None) == "offline"


def test_the_commands_take_the_encoder() -> None:
    living = ["inspect", "--background", str(ROOMS / "living"), "--no-dists", "--encoder", "live"]
    result = CliRunner().invoke(cli, living)
    assert result.exit_code == 0 and "a 56.2x reduction" in result.output, result.output
    slic = ["render", str(ROOMS.parent / "room.toml"), "--config", "small"]
    slic += ["--set", "physicalAttributeMemory.encoding=slic"]
    for words, message in (
        ([*living, "--encoding", "slic"], "--encoder live needs --background"),
        (["inspect", "folder", "--encoder", "live"], "--encoder live needs --background"),
        (["study", "live", "room", "--rooms", "0"], "give either ROOMS or --rooms SEEDS"),
        (
            [*slic, "--backend", "model", "--encoder", "live"],
            "error: the live encoder writes twoLevel maps with tiles of 16 pixels, not slic maps",
        ),
    ):
        result = CliRunner().invoke(cli, words)
        assert result.exit_code == 2 and message in result.output
