"""The tables of ``docs/light-comparison.md``, frames against a path tracer, and of fitted lights."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from colonnade_lab.common.markdown import markdown
from colonnade_lab.figures.data import Data
from colonnade_lab.figures.facts import MEGAHERTZ, facts

Frame = Mapping[str, Any]
#: Frames whose cost is given: samples, gathered rays of a path, and passes, a quarter more with coats.
_COSTS = ((1, 1, 1), (4, 1, 5), (16, 1, 20), (16, 2, 20))
#: Columns that are compared by material and at mirrors.
_MATERIALS = ("probe, rasteriser", "ambient light", "1 pass, filtered", "16 passes, filtered", "photo alone")
#: The data of users' rooms, and columns of them that are compared by material.
USERS, _USERS_MATERIALS = "light-users", ("probe, rasteriser", "16 passes, filtered", "photo alone")


def _of(data: Data, suffix: str, part: str = "light") -> dict[str, Frame]:
    """The frames of a kind by room."""
    frames = data.result(part)["frames"]["frames"]
    return {name.removesuffix(suffix): own for name, own in frames.items() if name.endswith(suffix)}


def _columns(frames: Mapping[str, Frame]) -> list[str]:
    return list(next(iter(frames.values()))["qualities"])


def _means(frames: Mapping[str, Frame], column: str, part: str, *keys: str) -> str:
    """Mean over the rooms of values of a part of the frame: dash without them."""
    own = [frame["qualities"][column] for frame in frames.values()]
    names = [part, *(f"{part}_{key}" for key in keys)]
    if any(one.get(name) is None for one in own for name in names):
        return "–"
    values = [_mean([one[name] for one in own]) for name in names]
    return ", ".join(f"{value:.3f}" if index else f"{value:.1f}" for index, value in enumerate(values))


def quality(data: Data, part: str = "light") -> str:
    """PSNR of the rough objects by room, and means of PSNR, FLIP and DISTS of objects, changed room and frame."""
    frames = _of(data, "-rough", part)
    rows = []
    for column in _columns(frames):
        objects = ["–"] * (len(frames) + 1)
        if column != "no object":
            each = [f"{frame['qualities'][column]['object']:.1f}" for frame in frames.values()]
            objects = [*each, _means(frames, column, "object", "flip", "dists")]
        # Open Image Denoise filters the objects alone.
        others = ["–", "–"]
        if "OIDN" not in column:
            others = [_means(frames, column, "room", "flip"), _means(frames, column, "frame", "flip", "dists")]
        rows.append([column, *objects, *others])
    return markdown(["dB, FLIP, DISTS", *frames, "objects", "room", "frame"], rows)


def users_materials(data: Data) -> str:
    """PSNR of each object of users' rooms, and the light of matt ones and mirrors against the truth."""
    rows, rooms = [], list(_of(data, "-rough", USERS))
    for frames in (_of(data, f"-{frame}", USERS) for frame in ("rough", "clear")):
        for kind in next(iter(frames.values()))["qualities"][_USERS_MATERIALS[0]]["things"]:
            for column in _USERS_MATERIALS:
                own = [frame["qualities"][column] for frame in frames.values()]
                light = [f", {one['brightness']:.2f}" if kind in ("matt", "mirror") else "" for one in own]
                cells = [f"{one['things'][kind]:.1f}{part}" for one, part in zip(own, light, strict=True)]
                rows.append([f"{kind}: {column}", *cells])
    return markdown(["dB, light", *rooms], rows)


def materials(data: Data) -> str:
    """PSNR of each object, in the mean of the rooms."""
    every = [found for frame in ("rough", "clear", "blurred") if (found := _of(data, f"-{frame}"))]
    kinds = [list(next(iter(frames.values()))["qualities"]["ambient light"]["things"]) for frames in every]
    rows = []
    for column in filter(_MATERIALS.__contains__, _columns(every[0])):
        cells = [
            f"{_mean([own['qualities'][column]['things'][kind] for own in frames.values()]):.1f}"
            for frames, own_kinds in zip(every, kinds, strict=True)
            for kind in own_kinds
        ]
        rows.append([column, *cells])
    return markdown(["mean of the rooms, dB", *(kind for own in kinds for kind in own)], rows)


def mirrors(data: Data) -> str:
    """Light of the mirrors against the truth, and where their rays look."""
    frames = _of(data, "-clear")
    rows = []
    for column in filter(_MATERIALS.__contains__, _columns(frames)):
        own = [frame["qualities"][column] for frame in frames.values()]
        rows.append([f"light: {column}", *(f"{one['brightness']:.2f}" for one in own)])
    for kind, title in (("probe", "rays of the probe"), ("colonnade", "rays of Colonnade")):
        errors = [frame["mirrors"][kind] for frame in frames.values()]
        rows.append([title, *(f"{one['median']:.1f}°, {one['high']:.1f}°" for one in errors)])
    return markdown(["mirror teapot", *frames], rows)


def cost(data: Data) -> str:
    """Energy of a frame and frames a second, by samples."""
    found, edge = data.result("light"), facts(data, "edge")
    rows = []
    for samples, gather, passes in _COSTS:
        one = found["pass" if gather == 1 else "two"]
        cycles, rays = one["cycles"], one["rays"]["in_box"]
        second, energy = MEGAHERTZ * 1e6 / cycles / passes, passes * rays * edge["njGlitches"] * 1e-6
        rows.append([f"{samples}, {gather}", f"{cycles:,}", f"{rays:,}", f"{second:,.0f}", f"{energy:.2f}"])
    titles = ["cycles a pass", "in-box rays a pass", "frames a second at 200 MHz", "mJ a frame"]
    return markdown(["samples, gathered rays of a path", *titles], rows)


def assets(data: Data) -> str:
    """PSNR and FLIP of glTF files, and whose they are."""
    found = data.result("assets")
    rows = [[name, f"{own['psnr']:.1f}", f"{own['flip']:.3f}"] for name, own in found["files"].items()]
    return markdown([f"{found['repository']}, commit {found['revision'][:8]}", "dB", "FLIP"], rows)


def fits(data: Data) -> str:
    """Rooms relit by fitted lights, without and with walls."""
    from colonnade_lab.evaluation.studies.room_light import FitQuality, fits_table

    return fits_table({name: FitQuality(**own) for name, own in data.result("room-lights")["fits"].items()})


def choices(data: Data) -> str:
    """A mirror in rooms under default and fitted lights: by choice, values of all rooms."""
    found: dict[str, dict[str, Mapping[str, float]]] = {}
    for name, own in data.result("room-lights")["choices"].items():
        room, _, choice = name.partition(": ")
        found.setdefault(choice, {})[room] = own
    keys = ("relit", "mirror_device", "mirror_right")
    rows = [
        [one, *(", ".join(f"{own[key]:.1f}" for own in rooms.values()) for key in keys)] for one, rooms in found.items()
    ]
    title = f"{', '.join(next(iter(found.values())))} against the photo, dB"
    return markdown([title, "relit", "mirror", "rays that are right"], rows)


def defaults(data: Data) -> str:
    """PSNR of the objects in users' rooms by the default command and by other settings, and the most that it loses."""
    frames = data.result("light-defaults")["frames"]
    groups: dict[str, list[Mapping[str, float]]] = {}
    for name, own in frames.items():
        known, _, where = name.partition(": ")
        groups.setdefault(f"{known}, {where.rpartition('-')[2]}", []).append(own["objects"])
    rows = []
    for title, rooms in groups.items():
        means = [f"{_mean([room[setting] for room in rooms]):.1f}" for setting in rooms[0]]
        rows.append([title, *means, f"{max(max(room.values()) - room['default'] for room in rooms):.1f}"])
    settings = list(next(iter(groups.values()))[0])
    return markdown(["mean of the rooms, dB", *settings, "default below the best, at most"], rows)


def _mean(values: list[float]) -> float:
    return sum(values) / len(values)


TABLES: Mapping[str, Callable[[Data], str]] = {
    "light-users": lambda data: quality(data, USERS),
    "light-users-materials": users_materials,
    "light-defaults": defaults,
    "light-quality": quality,
    "light-materials": materials,
    "light-mirrors": mirrors,
    "light-cost": cost,
    "light-assets": assets,
    "light-fits": fits,
    "light-choices": choices,
}
