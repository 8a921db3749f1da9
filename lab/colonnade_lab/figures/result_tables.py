"""The tables of README and of ``docs/results.md``: headline figures."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from colonnade_lab.common.markdown import markdown
from colonnade_lab.explore.cycle_errors import CountedFrame, mean_and_worst
from colonnade_lab.figures.catalog import CLASSES, MARCHES, SAMPLES, catalog
from colonnade_lab.figures.data import Data, commands_of
from colonnade_lab.figures.facts import MEGAHERTZ, PRESETS, facts, text

#: Parts of `tools/figures` whose minutes are listed.
_LONGEST = 5
#: A verified frame of `colonnade verify`.
Frame = Mapping[str, Any]


def presets(data: Data) -> str:
    """What each preset is for, and its figures."""
    fpga = data.optional("fpga")
    rows = []
    for preset, purpose in PRESETS.items():
        own = facts(data, preset)
        logic, clock = f"{text(own, 'kge')} kGE", f"{text(own, 'mhz')} MHz"
        if preset == "fpga" and fpga is not None:
            logic, clock = f"{fpga['luts']:,} LUTs", f"{fpga['fmax_mhz']:.0f} MHz, routed"
        figures = (text(own, key) for key in ("raysPerCycle", "mm2", "njGlitches", "framesPerJoule"))
        rays, area, energy, frames = figures
        rows.append([f"`{preset}`", purpose, rays, logic, area, clock, energy, frames])
    titles = ["preset", "for", "in-box rays a cycle", "logic", "mm², 28 nm", "clock", "nJ a ray", "frames/s/W"]
    return markdown(titles, rows)


def headlines(data: Data) -> str:
    """The figures of `edge` that matter most, beside those in the table of presets."""
    own = facts(data, "edge")
    rooms, quality = data.optional("rooms"), data.optional("quality-edge")
    maps = data.optional("environments")
    rows = [["RTL against model", _differences(data)]]
    if quality is not None:
        values = [mesh["reference"]["psnr"] for mesh in quality["meshes"].values()]
        largest = max(mesh["triangles"] for mesh in quality["meshes"].values())
        psnr = f"{min(values):.1f} to {max(values):.1f} dB PSNR on {len(values)} meshes of up to {largest:,} triangles"
        rows.append(["model against the float scene", psnr])
    rows.append(["at the area of the paper's chip", f"{text(own, 'equalArea')} times its rays per cycle"])
    if rooms is not None:
        mean = rooms["mean_cycles"]
        rows.append(["AR frames of 640×480, relit", f"{MEGAHERTZ * 1e6 / mean:,.0f} per second at {MEGAHERTZ:g} MHz"])
    if maps is not None:
        own_maps = maps["living"]
        size, ratio = own_maps["bytes"]["albedo"], own_maps["ratio"]["albedo"]
        rows.append(["maps of a room", f"{size:,} bytes each, {ratio:.1f} times smaller than the source"])
    return markdown(["figures of `edge`", ""], rows)


def _differences(data: Data) -> str:
    """What differs between RTL and model in the frames of the data files."""
    rooms, meshes = data.optional("rooms"), data.optional("equality-small")
    parts = []
    if rooms is not None:
        wrong = sum(frame["differing_pixels"] for frame in rooms["frames"])
        parts.append(f"{wrong} pixels of {len(rooms['frames'])} frames of rooms differ")
    if meshes is not None:
        counts = [sum(mesh["rtl"].values()) for mesh in meshes["meshes"].values()]
        parts.append(f"{sum(counts)} pixels, hits and counters of {len(counts)} meshes on `small`")
    return "; ".join(parts) or "–"


def equality(data: Data) -> str:
    """Frames in which the RTL was compared with the model."""
    rows = []
    meshes = data.result("equality-small")["meshes"]
    wrong = sum(sum(mesh["rtl"].values()) for mesh in meshes.values())
    compared = f"pixels, hits and counters of {len(meshes)} meshes on `small`"
    rows.append([compared, f"{wrong}", _command("equality-small")])
    rooms = data.result("rooms")
    wrong = sum(frame["differing_pixels"] for frame in rooms["frames"])
    size = "×".join(map(str, rooms["size"]))
    rows.append(
        [f"pixels of {len(rooms['frames'])} relit frames of rooms on `edge`, {size}", f"{wrong}", _command("rooms")]
    )
    return markdown(["compared", "differ", "command"], rows)


def fidelity(data: Data) -> str:
    """The model against the float scene by mesh, of `edge` and `lean`."""
    edge, lean = (data.result(f"quality-{preset}")["meshes"] for preset in ("edge", "lean"))
    rows = []
    for name, mesh in edge.items():
        each: list[Frame] = [mesh["reference"], lean[name]["reference"]]
        shares = [f"{100 * own['hit_disagreement']:.4f}" for own in each]
        others = [f"{100 * own['triangle_disagreement']:.2f}" for own in each]
        rows.append([name, f"{mesh['triangles']:,}", shares[0], others[0], *(f"{own['psnr']:.1f}" for own in each)])
    titles = ["mesh", "triangles", "`edge`: hit or miss differs, %", "other triangle, %", "dB", "`lean`: dB"]
    return markdown(titles, rows)


def rates_of_presets(data: Data) -> str:
    """Rays per cycle of the presets, relative to the chip."""
    rows = []
    for preset in PRESETS:
        bench = data.optional(f"bench-{preset}")
        if bench is None:
            continue
        own = facts(data, preset)
        meshes = f"{len(bench['meshes'])}"
        figures = [text(own, key) for key in ("raysPerCycle", "timesChip", "fewest", "most", "mirrorRaysPerCycle")]
        rows.append([f"`{preset}`", meshes, f"**{figures[0]}**", *figures[1:]])
    titles = ["preset", "meshes", "in-box rays per cycle", "against the chip", "lowest mesh", "highest", "as mirrors"]
    return markdown(titles, rows)


def board(data: Data) -> str:
    """The SoC on an FPGA."""
    placed, bench = data.result("fpga"), data.result("bench-fpga")
    available = placed["available"]
    rows = [
        ["clock after routing", f"{placed['fmax_mhz']:.1f} MHz"],
        ["LUTs", f"{placed['luts']:,} of {available['luts']:,}"],
        ["flip-flops", f"{placed['flip_flops']:,}"],
        ["multipliers, block RAMs", f"{placed['dsps']:,}, {placed['block_rams']:,}"],
    ]
    for name, mesh in bench["meshes"].items():
        rate = mesh["rays_per_cycle_in_box"]
        millions = rate * placed["clock_mhz"]
        figures = f"{rate:.4f} in-box rays per cycle, {millions:.2f} million a second at {placed['clock_mhz']:g} MHz"
        rows.append([name, figures])
    return markdown(["`fpga`", ""], rows)


def rooms(data: Data) -> str:
    """Cycles of relit frames in rooms."""
    found = data.result("rooms")
    rows = [[frame["room"], frame["object"], f"{frame['cycles']:,}"] for frame in found["frames"]]
    mean = found["mean_cycles"]
    rows.append(["mean", f"{MEGAHERTZ * 1e6 / mean:,.0f} frames per second at {MEGAHERTZ:g} MHz", f"{mean:,.0f}"])
    return markdown(["room", "object", "cycles"], rows)


def moved_rooms(data: Data) -> str:
    """Cycles of frames of a camera that has moved, by the pixels that march, to 5 %; the rooms have the same shares."""
    found = data.result("moved-rooms")
    rows: dict[str, dict[str, str]] = {}
    for frame in found["frames"]:
        rows.setdefault(frame["room"], {})[f"{5 * round(20 * frame['marched'])} %"] = f"{frame['cycles']:,}"
    shares = next(iter(rows.values()))
    return markdown(
        ["pixels that march", *shares], [[room, *(cells[share] for share in shares)] for room, cells in rows.items()]
    )


def marches(data: Data) -> str:
    """Cycles of a frame whose pixels all march, and the area of the array, by the marches of a column of `edge`."""
    found, rows = data.result("marches"), []
    for count in MARCHES:
        frame, array = found[str(count)], found[f"{count}, area"]["levels"]["array"]
        width, height = frame["size"]
        a_pixel = frame["cycles"] / (width * height)
        rows.append([str(count), f"{frame['cycles']:,}", f"{a_pixel:.2f}", f"{array['mm2_28nm']:.2f}"])
    return markdown(["`units.marches`", "cycles", "a pixel", "array, mm² at 28 nm"], rows)


def cycle_errors(data: Data) -> str:
    """Errors of the cycle model by part, and the frame of the largest one."""
    found, rows = data.result("cycles"), []
    for part, (designs, frames) in CYCLE_PARTS.items():
        if part not in found:
            continue
        counted = [CountedFrame(**frame) for frame in found[part]["frames"]]
        mean, worst = mean_and_worst([frame.error for frame in counted])
        at = next(frame for frame in counted if frame.error == worst)
        name = at.name if len({frame.design for frame in counted}) == 1 else f"{at.design}, {at.name}"
        rows.append([designs, frames, str(len(counted)), f"{mean:.2%}", f"{worst:+.2%}", name])
    return markdown(["design", "frames", "number", "mean error", "largest", "of"], rows)


def gather(data: Data) -> str:
    """Passes of `edge` that gather light, and how near the model is to the reference."""
    found = data.result("gather")
    counters = (found[part]["counters"] for part in ("pass", "whole"))
    passes = [f"{one['cycles']:,} cycles, {one['raysGather']:,} gathered rays" for one in counters]
    rows = [
        ["a pass of the scene above, 640×480", passes[0]],
        ["without the photo, all pixels", passes[1]],
        ["model against reference, 16 samples, 320×240", f"{found['compare']['psnr']:.1f} dB"],
    ]
    return markdown(["gathered light", ""], rows)


def environments(data: Data) -> str:
    """Size and accuracy of the rooms' maps, and of the device's march."""
    found = data.result("environments")
    accuracy = {name.partition(",")[0]: own for name, own in found["accuracy"].items() if name.endswith(", device")}
    names = [name for name in found if name != "accuracy" and found[name]["room"] in accuracy]
    maps = [found[name] for name in names]
    marches = [accuracy[each["room"]] for each in maps]
    study, inspect = (commands_of(catalog()["environments"])[index] for index in (0, 1))
    rows: list[Sequence[str]] = [
        ["bytes of albedo, of normals", *(f"{each['bytes']['albedo']:,} each" for each in maps), f"`{inspect}`"],
        ["reduction from the source maps", *(f"{each['ratio']['albedo']:.1f}×" for each in maps), "the same"],
        ["PSNR of the albedo, dB", *(f"{each['albedo']['psnr']:.1f}" for each in maps), "the same"],
        ["normals off by, mean", *(f"{each['normals']['mean_degrees']:.2f}°" for each in maps), "the same"],
        [
            "mirror rays whose march is right",
            *(f"{100 * each['mirror']['ok']:.1f} %" for each in marches),
            f"`{study}`",
        ],
        ["steps of the march, mean", *(f"{each['mean_steps']:.1f}" for each in marches), "the same"],
    ]
    return markdown(["", *names, "command"], rows)


def rebuilds(data: Data) -> str:
    """Rays of spheres whose march is right, by what the march has of the room."""
    accuracy = data.result("environments")["accuracy"]
    kinds = list(dict.fromkeys(name.partition(", ")[2] for name in accuracy))
    rows = []
    for room in dict.fromkeys(name.partition(",")[0] for name in accuracy):
        marches = [accuracy[f"{room}, {kind}"] for kind in kinds]
        shares = [[f"{100 * one[ray]['ok']:.1f}" for ray in ("mirror", "cosine", "glass")] for one in marches]
        rows.append([room, *(", ".join(own) for own in shares)])
    return markdown(["mirror, cosine, glass: ok, %", *kinds], rows)


def samples(data: Data) -> str:
    """The error of several samples a pixel."""
    found = data.result("samples")
    row = [
        "model against the reference at the most samples, dB",
        *(f"{found[str(number)]['psnr']:.1f}" for number in SAMPLES),
    ]
    return markdown(["samples a pixel", *map(str, SAMPLES)], [row])


def measuring(data: Data) -> str:
    """The minutes of `tools/figures`: its longest parts, classes, and all."""
    entries = catalog()
    minutes = {name: content["seconds"] / 60 for name in entries if (content := data.get(name)) is not None}
    longest = sorted(minutes, key=lambda name: -minutes[name])[:_LONGEST]
    rows = [[f"`{name}`", f"{minutes[name]:.1f}"] for name in longest]
    for occasion in CLASSES:
        of_class = [minutes[name] for name, entry in entries.items() if name in minutes and entry.occasion == occasion]
        rows.append([f"`{occasion}`, {len(of_class)} parts", f"{sum(of_class):.1f}"])
    return markdown(["part", "minutes"], [*rows, [f"all {len(minutes)}", f"{sum(minutes.values()):.1f}"]])


#: Designs and frames of the parts of the entry `cycles`.
CYCLE_PARTS = {
    "edge": ("`edge`", "eight meshes, 640×480"),
    "mirrors": ("`edge`", "the same as mirrors"),
    "lean": ("`lean`", "eight meshes, 640×480"),
    "small": ("`small`", "eight meshes, 640×480"),
    "tiny": ("`tiny`", "eight meshes, 640×480"),
    "scaling": ("`edge`, a field changed", "bunny, teapot, 320×240"),
    "ablation": ("one column, scene on chip", "bunny, teapot, 160×120"),
    "features": ("`edge` with fewer features", "bunny, armadillo, 320×240"),
    "precisions": ("`edge`, precision or units changed", "bunny, 640×480"),
    "trees": ("`tiny` with nodes of 4 and of 2 children, without a tree", "eight meshes, 50 to 2,000 triangles, 32×24"),
    "rooms": ("`edge`", "whole rooms, 640×480"),
    "gather": ("`edge`", "gathered light, 640×480"),
}


def _command(name: str) -> str:
    return f"`{commands_of(catalog()[name])[0]}`"


TABLES: Mapping[str, Callable[[Data], str]] = {
    "presets": presets,
    "headlines": headlines,
    "equality": equality,
    "fidelity": fidelity,
    "rates-of-presets": rates_of_presets,
    "board": board,
    "rooms": rooms,
    "moved-rooms": moved_rooms,
    "marches": marches,
    "cycle-errors": cycle_errors,
    "gather": gather,
    "environments": environments,
    "rebuilds": rebuilds,
    "samples": samples,
    "measuring": measuring,
}
