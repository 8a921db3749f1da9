"""The tables of maps: ``docs/background.md``, and of captures and the live encoder, ``docs/captures.md``.

Reports also have times, which are one machine's; no table shows them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from colonnade_lab.common import paper
from colonnade_lab.common.markdown import markdown
from colonnade_lab.figures.catalog import ENCODINGS, MAP_FRAMES
from colonnade_lab.figures.data import Data


def loss(data: Data) -> str:
    """What the encoded maps of rooms lose."""
    rows = []
    for name, report in data.result("environments").items():
        if name == "accuracy":
            continue
        albedo, relit = (
            ", ".join(f"{report[part][key]:{form}}" for key, form in _LOSSES) for part in ("albedo", "relit")
        )
        off = ", ".join(f"{report['planes'][key]:.2f} cm" for key in ("mean_cm", "p95_cm"))
        rows.append([name, albedo, f"{report['normals']['mean_degrees']:.2f}°", relit, off])
    quality = "PSNR, SSIM, FLIP, DISTS"
    planes = "planes off along the view ray: mean, 95th percentile"
    return markdown(["room", f"albedo: {quality}", "normals, mean", f"relit: {quality}", planes], rows)


_LOSSES = (("psnr", ".1f"), ("ssim", ".3f"), ("flip", ".3f"), ("dists", ".3f"))


def live_rooms(data: Data) -> str:
    """Maps of stills: the offline encoder and the live one."""
    found = data.result("live-rooms")
    rows = []
    for name, report in (found["rooms"] | found["generated"]).items():
        offline, live = report["offline"], report["live"]

        def both(key: str, form: str, scale: float = 1.0, own: tuple[dict[str, float], ...] = (offline, live)) -> str:
            return ", ".join("–" if each[key] is None else format(scale * each[key], form) for each in own)

        cells = (both("psnr", ".2f"), both("degrees", ".2f"), both("off", ".2f", 100), both("mirror", ".1f", 100))
        rows.append([name, both("dists", ".3f"), *cells])
    titles = ["room", "albedo DISTS: offline, live", "PSNR, dB", "normals off by, °", "planes off by 5 cm, %"]
    return markdown([*titles, "mirror rays right, %"], rows)


def live_paths(data: Data) -> str:
    """The live encoder along paths: mean and worst view."""
    rows = [
        [
            name,
            *(f"{scale * report[key][0]:.2f}, {scale * report[key][1]:.2f}" for key, scale in _PATH),
            f"{-report['lost'][0]:+.2f} dB, {report['lost'][1]:+.2f}°",
        ]
        for name, report in data.result("live-paths").items()
    ]
    titles = ["path", "albedo, dB: mean, worst", "normals, °", "planes off by 5 cm, %", "worst against a still"]
    return markdown(titles, rows)


_PATH = (("psnr", 1), ("degrees", 1), ("off", 100))


def moving_frames(data: Data) -> str:
    """Frames of a camera that has moved, by three ways to its maps."""
    keys = (("frame", ".1f"), ("object", ".1f"), ("shadow", ".1f"), ("displacement", ".1f"), ("dists", ".4f"))
    rows = [
        [
            moved,
            *(
                ", ".join("–" if ways[way][key] is None else format(ways[way][key], form) for way in ways)
                for key, form in keys
            ),
        ]
        for moved, ways in data.result("moving-frames").items()
    ]
    titles = [
        "moved",
        "frame, dB: fresh, marched, stale",
        "object, dB",
        "shadow, dB",
        "shadow off by, pixels of 320×240",
    ]
    return markdown([*titles, "frame, DISTS"], rows)


def captures(data: Data) -> str:
    """Mirror rays in rooms as a phone captures them."""
    rows = [
        [
            name,
            "–" if report["noise"] is None else f"{report['estimated']:.2%}",
            f"{report['degrees']:.1f}°",
            ", ".join(f"{100 * report[march]:.1f}" for march in ("depth", "planes", "device")),
        ]
        for name, report in data.result("captures").items()
    ]
    return markdown(["room", "noise found", "normals off by", "mirror rays right, %: depth map, planes, device"], rows)


def encodings(data: Data) -> str:
    """Raw, SLIC and two-level maps: bytes, loss of maps and of frames, gates and memories; the paper's bytes."""
    slic = data.result("paper-maps")
    rooms = [name for name in data.result("environments") if name != "accuracy"]
    own = {
        "slic": ("SLIC", slic, slic["area"]),
        "twoLevel": ("two-level", data.result("environments"), data.result("area-small-asap7")),
    }
    source = round(slic[rooms[0]]["bytes"]["albedo"] * slic[rooms[0]]["ratio"]["albedo"])
    rows = [["raw", f"{source:,}", "1", *["–"] * (len(rooms) + len(MAP_FRAMES) + 2)]]
    for encoding in ENCODINGS:
        title, maps, area = own[encoding]
        losses = (f"{maps[r]['albedo']['psnr']:.1f} dB, {maps[r]['normals']['mean_degrees']:.1f}°" for r in rooms)
        frames = (_frame(slic[f"{encoding}, {frame}"]) for frame in MAP_FRAMES)
        memories = (each for each in area["memories"].values() if each["unit"] == _MAPS_UNIT)
        bits = sum(each["bits"] for each in memories)
        size, ratio = maps[rooms[0]]["bytes"]["albedo"], maps[rooms[0]]["ratio"]["albedo"]
        logic = area["units"][_MAPS_UNIT]["kge"]
        rows.append([title, f"{size:,}", f"{ratio:.1f}", *losses, *frames, f"{logic:.2f}", f"{bits / 8192:.1f}"])
    rows.append(["source paper", paper.MAP_BYTES, f"{paper.MAP_RATIO}", *["–"] * (len(rooms) + len(MAP_FRAMES) + 2)])
    titles = ["maps", "bytes of albedo", "times smaller", *(f"{name}: albedo, normals" for name in rooms)]
    frames_of = (f"frame, {frame}: dB, DISTS" for frame in MAP_FRAMES)
    return markdown([*titles, *frames_of, "logic of the memory, kGE", "its memories, KiB"], rows)


def room_mesh(data: Data) -> str:
    """Mirror rays through a room's mesh in the tree, and through its march."""
    rows = []
    around = next(each for each in data.result("ray-device")["kinds"] if each["kind"] == _AROUND)
    batches = data.result("area-traversal-asap7")["batches"]
    energy = next(each for each in batches if each["scene"]["kind"] == _AROUND)["glitch_aware"]["at_28nm"]
    edge = data.file("marches")["config"]
    marches = edge["array"]["columns"] * edge["units"]["marches"]
    for name, found in data.result("room-mesh").items():
        own = energy["energy_per_any_ray_nj"] * found["node_reads"] / around["node_reads"]
        tree = f"{found['node_reads']:.1f} nodes, {found['triangle_tests']:.1f} triangles"
        cycles = sum(_MARCH) + _STEP * found["march_steps"]
        rows += [
            [
                *(f"{name}, {found['triangles']:,} triangles", "tree", f"{found['mesh_bytes'] / 1e6:.1f} MB", tree),
                *(f"{found['dram_bytes']:,.0f}", f"{found['cycles']:.1f}", f"{own:.1f}"),
                f"{100 * found['mesh_right']:.1f}",
            ],
            [
                *(
                    f"{name}, planes",
                    "march",
                    f"{found['plane_bytes'] / 1e3:.1f} KB",
                    f"{found['march_steps']:.1f} steps",
                ),
                *("0", f"{cycles / marches:.1f}", "–", f"{100 * found['march_right']:.1f}"),
            ],
        ]
    head = ["room", "by", "scene", "a ray", "bytes of DRAM a ray", "cycles a ray", "nJ a ray"]
    return markdown([*head, "right, %"], rows)


def room_bytes(data: Data) -> str:
    """How many times the bytes of a room's planes its mesh takes."""
    (found,) = data.result("room-mesh").values()
    return f"{found['mesh_bytes'] / found['plane_bytes']:,.0f}"


#: The batch whose energy a node is, and the least cycles of a march: before its first tile and at its end, a tile.
_AROUND, _MARCH, _STEP = "from around, shuffled, hits", (92, 23), 7

#: The unit of `colonnade ppa` that has the physical-attribute memory, in designs whose columns do not share it.
_MAPS_UNIT = "ColumnEnvironment"


def _frame(difference: Mapping[str, Any]) -> str:
    dists = difference["dists"]
    return f"{difference['psnr']:.2f}, {'–' if dists is None else f'{dists:.4f}'}"


TABLES: Mapping[str, Callable[[Data], str]] = {
    "map-loss": loss,
    "live-rooms": live_rooms,
    "live-paths": live_paths,
    "moving-frames": moving_frames,
    "captures": captures,
    "paper-maps": encodings,
    "room-mesh": room_mesh,
}
