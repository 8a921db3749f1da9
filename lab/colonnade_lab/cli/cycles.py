"""``colonnade cycles``: cycles of frames by the cycle model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from colonnade.cli.options import (
    MESH,
    SCENE,
    Command,
    configuration_options,
    echo,
    echo_lines,
    finish,
    json_option,
    require_outputs,
    size_option,
    strict_option,
)

if TYPE_CHECKING:
    from colonnade.common.progress import Progress
    from colonnade.design.manifest import Manifest
    from colonnade.scene.model import Scene

#: Meshes of a comparison unless some are named: built in, so that they need no files.
_MESHES = ("teapot", "torus", "sphere:81920")


@click.command(cls=Command)
@click.argument("scene", type=SCENE, required=False)
@configuration_options
@click.option(
    "--mesh", "meshes", multiple=True, type=MESH, metavar="MESH", help="Mesh of the scene. Repeatable with --against."
)
@size_option("Frame size in pixels.  [default: the scene's]")
@click.option(
    "--dram",
    "latency",
    type=click.IntRange(1, 100_000),
    metavar="CYCLES",
    help="Cycles from a read of DRAM to its first data, for one frame.  [default: 100]",
)
@click.option(
    "--against",
    metavar="CONFIG",
    help="Compare with this configuration; HEAD: with --config in the last commit.",
)
@click.option(
    "--liberty",
    "liberties",
    multiple=True,
    metavar="PATH",
    help="With --against: standard cells for the gates of units that differ, as in colonnade ppa. Repeatable.",
)
@strict_option
@json_option
def cycles(
    scene: Path | None,
    config: str,
    overrides: tuple[str, ...],
    meshes: tuple[str, ...],
    size: str | None,
    latency: int | None,
    against: str | None,
    liberties: tuple[str, ...],
    json_file: Path | None,
) -> None:
    """Count the cycles of a frame with the cycle model: in seconds, without a simulator.

    The bit-exact model renders the frame, and its rays go through a model of the units and caches with the latencies
    of the RTL. The counters are the RTL's, within a per cent or two. Without SCENE it is the benchmark's.

    With --against the frames of some meshes are counted on two designs, at three latencies of DRAM: the change of their
    cycles with its scatter, the gates of units that differ, and whether the pictures are equal.
    """
    from colonnade.common import progress
    from colonnade.common.frame_size import parse_size
    from colonnade.design.generator import manifest_for
    from colonnade.design.toolchain import project_root
    from colonnade.scene.parser import load_scene

    from colonnade_lab.evaluation.cycles import require_frames

    context = click.get_current_context()
    if against is None and (len(meshes) > 1 or liberties):
        raise click.UsageError("several --mesh, and --liberty, are with --against", context)
    if against is not None and latency is not None:
        raise click.UsageError("--dram is for one design: --against compares at three latencies", context)
    pixels = parse_size(size) if size is not None else None
    require_outputs(json_file)
    loaded = load_scene(scene or project_root() / "scenes" / "object.toml")
    pixels = pixels or (loaded.frame.width, loaded.frame.height)
    terminal = progress.for_terminal()
    manifest = manifest_for(config, overrides, terminal).manifest
    require_frames([manifest])
    if against is None:
        mesh = loaded.with_mesh(meshes[0]) if meshes else loaded
        finish(_one(mesh, manifest, pixels, latency, terminal), json_file)
        return
    with _other(config, against, terminal) as (other, path):
        require_frames([other])
        names = meshes or (() if scene is not None else _MESHES)
        report = _against(loaded, names, (manifest, other), pixels, terminal)
        report["units"] = _units(((config, overrides), (path, ())), liberties, terminal)
    finish(report, json_file)


def _one(
    scene: Scene, manifest: Manifest, size: tuple[int, int], latency: int | None, progress: Progress
) -> dict[str, Any]:
    """Count and print a frame."""
    from colonnade.common.errors import UserError
    from colonnade.device.cycle_model import DRAM_LATENCY
    from colonnade.scene.prepared.device_scene import DeviceScene

    from colonnade_lab.evaluation.cycles import frame_cycles

    if latency is not None and manifest.config["columnBvhMemory"]["cache"] is None:
        raise UserError("this configuration reads no DRAM: --dram needs columnBvhMemory.cache")
    with progress.step("packing the scene"):
        prepared = DeviceScene.of(scene.with_samples(1), manifest, size=size, progress=progress)
    with progress.step("counting cycles"):
        report = frame_cycles(prepared, size, latency or DRAM_LATENCY)
    rate = report["rays_per_cycle_in_box"]
    echo(f"cycles      {report['cycles']:,}, {rate:.3f} in-box rays a cycle")
    echo(f"busiest     {report['bottleneck']}, {report['utilisation'][report['bottleneck']]:.0%}")
    echo_lines(_shares("busy", report["utilisation"]))
    echo_lines(_shares("contexts", report["stalls"]))
    return report


def _shares(title: str, shares: Mapping[str, float]) -> str:
    """Lines of shares, the title before the first."""
    lines = [f"{name:20} {share:6.1%}" for name, share in shares.items() if share >= 0.0005]
    return "\n".join(f"{title if i == 0 else '':11} {line}" for i, line in enumerate(lines))


def _other(config: str, against: str, progress: Progress) -> Any:
    """The manifest of the design to compare with, and its configuration; of the last commit for HEAD."""
    from contextlib import contextmanager

    @contextmanager
    def found() -> Any:
        from colonnade.common.temporary import temporary_folder
        from colonnade.design.generator import manifest_for

        if against != "HEAD":
            yield manifest_for(against, (), progress).manifest, against
            return
        with temporary_folder() as folder:
            file = folder / "config.json"
            file.write_text(_committed(config))
            yield manifest_for(str(file), (), progress).manifest, str(file)

    return found()


def _committed(config: str) -> str:
    """The text of a configuration in the last commit."""
    from colonnade.common import processes
    from colonnade.common.errors import UserError
    from colonnade.design.config_name import find_configuration
    from colonnade.design.toolchain import project_root

    path = find_configuration(config, (), project_root()).path
    done = processes.run(["git", "show", f"HEAD:./{path.name}"], cwd=path.resolve().parent)
    if done.returncode != 0:
        raise UserError(f"{path} is not in the last commit: name a configuration after --against")
    return done.stdout


def _against(
    scene: Scene,
    meshes: Sequence[str],
    designs: tuple[Manifest, Manifest],
    size: tuple[int, int],
    progress: Progress,
) -> dict[str, Any]:
    """Count and print frames on two designs."""
    from colonnade_lab.common.text_table import Column, Table
    from colonnade_lab.evaluation.cycles import LATENCIES, Change, compare

    table = Table(
        (
            Column("frame", 16, is_text=True),
            Column("cycles", 11, ","),
            Column("against", 11, ","),
            Column("change", 8, "+.1%"),
            Column("pictures", 22, is_text=True),
        ),
        echo,
    )
    frames = []
    middle = LATENCIES.index(100)
    for name in meshes or (scene.mesh.name or "scene",):
        own = (scene.with_mesh(name) if meshes else scene).with_samples(1)
        with progress.step(f"counting cycles of {name}"):
            frame = compare(name, own, None, designs, size)
        frames.append(frame)
        differing = frame.differing_pixels
        first, second = (cycles[middle] for cycles in frame.cycles)
        table.print(
            name, first, second, first / second - 1.0, "equal" if differing == 0 else f"{differing:,} pixels differ"
        )
    change = Change.of(frames)
    echo(f"cycles      {change.mean:+.1%}, {change.scatter:.1%} scatter over {len(LATENCIES)} latencies of DRAM")
    return {
        "configs": [manifest.config for manifest in designs],
        "size": list(size),
        "latencies": list(LATENCIES),
        "frames": [frame.as_json() for frame in frames],
        "change": change.mean,
        "scatter": change.scatter,
    }


def _units(
    configs: Sequence[tuple[str, Sequence[str]]], liberties: tuple[str, ...], progress: Progress
) -> list[dict[str, Any]] | None:
    """Print the gates of units that differ; None without a library."""
    if not liberties:
        echo("gates       not measured: name standard cells by --liberty")
        return None
    from colonnade_lab.evaluation.cycles import changed_units
    from colonnade_lab.ppa.measure import measure

    reports = [measure(config, overrides, liberties, progress=progress) for config, overrides in configs]
    units = changed_units(reports)
    for name, first, second in units:
        echo(f"{name:32} {first:10,.1f} kGE, against {second:10,.1f}")
    echo(f"gates       {len(units)} units differ" if units else "gates       no unit differs")
    return [{"unit": name, "kge": first, "against": second} for name, first, second in units]
