"""``colonnade study``: the accuracy of reconstructed rooms, the quality loss of AR frames in them, and baselines."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from typing import Any

import click
from colonnade.cli.options import FILE, Commands, dists_option, echo_lines, finish, json_option, require_outputs

rooms_argument = click.argument("rooms", type=FILE, nargs=-1, required=True)
seeds_argument = click.argument("seeds", metavar="SEEDS", callback=lambda *given: _seeds(given[-1]))
seeds_option = click.option(
    "--rooms",
    "seeds",
    metavar="SEEDS",
    callback=lambda *given: _seeds(given[-1]),
    help="Take generated rooms, such as 0-9,100.",
)
output_option = click.option("--output", type=FILE, metavar="DIR", help="Write the frames as pictures.")


@click.group(cls=Commands)
def study() -> None:
    """Measure reconstructed rooms against their depth maps, AR frames in them, and baselines.

    ROOMS are folders. SEEDS, such as 0-9,100, each generate a room of known geometry. Tables are in Markdown.
    """


@study.command()
@rooms_argument
@json_option
def rays(rooms: tuple[Path, ...], json_file: Path | None) -> None:
    """Rays from mirror, matt and glass spheres: the share that finds the correct point.

    With planes of the full maps, and of the attribute memory.
    """
    _report("environment_accuracy", lambda study, _: study.study_rooms(rooms), json_file)


@study.command()
@rooms_argument
@dists_option
@output_option
@json_option
def frames(rooms: tuple[Path, ...], no_dists: bool, output: Path | None, json_file: Path | None) -> None:
    """Frames with objects: the loss from encoding, reconstruction and fixed-point arithmetic.

    The loss is PSNR, FLIP and DISTS of frame, object and shadow.
    """
    _report("ar_losses", lambda study, on: study.study_frames(rooms, not no_dists, on, output), json_file, output)


@study.command()
@seeds_option
@output_option
@json_option
def occlusion(seeds: list[int] | None, output: Path | None, json_file: Path | None) -> None:
    """Objects behind things: the share of an object's pixels that correctly show it, or the room before it.

    Behind furniture in five synthetic rooms; with --rooms behind a stool, a plant or a lamp in generated rooms.
    """
    _report("occlusion", lambda study, on: study.study(on, output, seeds), json_file, output)


@study.command()
@rooms_argument
@output_option
@json_option
def light(rooms: tuple[Path, ...], output: Path | None, json_file: Path | None) -> None:
    """Relit rooms and a mirror against the photo: PSNR for default and for fitted lights."""
    _report("room_light", lambda study, on: study.study_both(rooms, on, output), json_file, output, "tables")


@study.command()
@rooms_argument
@json_option
def captures(rooms: tuple[Path, ...], json_file: Path | None) -> None:
    """Rooms as a phone would capture them: the share of mirror rays that are right in the room itself.

    Depth of 256x192 with noise, and normals derived from it.
    """
    _report("captured_rooms", lambda study, on: study.study_captures(rooms, on), json_file)


@study.command()
@seeds_argument
@dists_option
@json_option
def generated(seeds: list[int], no_dists: bool, json_file: Path | None) -> None:
    """Rays and encoded maps in generated rooms, and why rays are wrong."""
    _report("unseen_rooms", lambda study, on: study.study_seeds(seeds, not no_dists, on), json_file)


@study.command()
@seeds_argument
@json_option
def views(seeds: list[int], json_file: Path | None) -> None:
    """Cameras beside the maps' in generated rooms: the share of pixels that is right."""
    _report("moved_views", lambda study, on: study.study_seeds(seeds, progress=on), json_file)


@study.command()
@seeds_argument
@dists_option
@json_option
def moved_frames(seeds: list[int], no_dists: bool, json_file: Path | None) -> None:
    """Frames of a camera that has moved, by three ways to its maps, in generated rooms."""
    _report("moving_frames", lambda study, on: study.study_seeds(seeds, not no_dists, on), json_file)


@study.command()
@click.argument("rooms", type=FILE, nargs=-1)
@seeds_option
@dists_option
@json_option
def live(rooms: tuple[Path, ...], seeds: list[int] | None, no_dists: bool, json_file: Path | None) -> None:
    """The encoder of a moving camera against the offline one, in ROOMS or generated rooms: time, loss and rays."""
    if bool(rooms) == (seeds is not None):
        raise click.UsageError("give either ROOMS or --rooms SEEDS", click.get_current_context())
    of, known = ("study_rooms", rooms) if seeds is None else ("study_seeds", seeds)
    _report("live_maps", lambda study, on: getattr(study, of)(known, not no_dists, on), json_file)


@study.command()
@seeds_argument
@json_option
def live_paths(seeds: list[int], json_file: Path | None) -> None:
    """The encoder of a moving camera along a path through each generated room."""
    _report("live_maps", lambda study, on: study.study_paths(seeds, on), json_file, table="path_table")


@study.command()
@click.argument("mesh", default="bunny")
@json_option
def cpu(mesh: str, json_file: Path | None) -> None:
    """A frame of the benchmark on one core: all triangles for all rays in plain C++, and Embree."""
    _report("cpu_baseline", lambda study, on: study.study_mesh(mesh, on), json_file)


@study.command()
@rooms_argument
@click.option("--rtl", is_flag=True, help="Also count cycles, of the RTL of the preset traversal.")
@json_option
def room_mesh(rooms: tuple[Path, ...], rtl: bool, json_file: Path | None) -> None:
    """Mirror rays through a room's mesh in the tree, and through its march."""
    _report("room_mesh", lambda study, on: study.study_rooms(rooms, rtl, on), json_file)


def _report(
    name: str,
    measure: Callable[[Any, Any], Mapping[Any, Any]],
    json_file: Path | None,
    output: Path | None = None,
    table: str = "table",
) -> None:
    """Measure by a module of `colonnade_lab.evaluation.studies` and a progress; print its table of the results."""
    from colonnade.common import progress
    from colonnade.common.atomic_files import made_folder

    require_outputs(json_file, folders=[output])
    module, terminal = import_module(f"colonnade_lab.evaluation.studies.{name}"), progress.for_terminal()
    with nullcontext() if output is None else made_folder(output), terminal.step("measuring"):
        results = measure(module, terminal)
    echo_lines(getattr(module, table)(results))
    finish(_plain(results), json_file)


def _seeds(text: str | None) -> list[int] | None:
    from colonnade_lab.evaluation.studies.unseen_rooms import parse_seeds

    return None if text is None else parse_seeds(text)


def _plain(value: Any) -> Any:
    """Results as JSON: keys are text."""
    return {str(key): _plain(one) for key, one in value.items()} if isinstance(value, Mapping) else asdict(value)
