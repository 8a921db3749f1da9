"""``colonnade study``: how right a rebuilt room is, and what frames in it lose."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from colonnade.cli.options import FILE, echo, finish, json_option, require_outputs


@click.command(short_help="Measure a rebuilt room, or what AR frames lose in it.")
@click.argument("rooms", type=FILE, nargs=-1, required=True)
@click.option("--frames", is_flag=True, help="Measure frames with objects instead of the rays of spheres.")
@click.option("--no-dists", is_flag=True, help="Leave out DISTS, whose weights (64 MB) are fetched at its first use.")
@click.option("--output", type=FILE, metavar="FOLDER", help="With --frames: write the frames as pictures.")
@json_option
def study(rooms: tuple[Path, ...], frames: bool, no_dists: bool, output: Path | None, json_file: Path | None) -> None:
    """Measure the folders ROOMS against their depth maps.

    Of mirror, matt and glass spheres: which rays meet the right point, with planes of the full maps and with those of
    the attribute memory. With --frames: what clustering, the rebuild and the device's numbers each cost, as dB, FLIP
    and DISTS of the whole frame, of the object and of its shadow. Tables are in Markdown.
    """
    if output is not None and not frames:
        raise click.UsageError("--output is for the pictures of --frames", click.get_current_context())
    require_outputs(json_file, folders=[output])

    from colonnade.common import progress
    from colonnade.common.atomic_files import make_folder

    if output is not None:
        make_folder(output)

    report: dict[str, Any]
    if frames:
        from colonnade.evaluation.studies import ar_losses

        shown = progress.for_terminal()
        with shown.step("measuring frames"):
            by_frame = ar_losses.study_frames(rooms, not no_dists, shown, output)
        echo(ar_losses.table(by_frame))
        report = {
            frame: {loss: {part: asdict(value) for part, value in parts.items()} for loss, parts in by_loss.items()}
            for frame, by_loss in by_frame.items()
        }
    else:
        from colonnade.evaluation.studies import environment_accuracy

        with progress.for_terminal().step("measuring the rooms"):
            reports = environment_accuracy.study_rooms(rooms)
        echo(environment_accuracy.table(reports))
        report = {name: asdict(value) for name, value in reports.items()}
    finish(report, json_file)
