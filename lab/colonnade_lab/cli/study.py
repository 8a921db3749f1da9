"""``colonnade study``: the accuracy of a reconstructed room, and the quality loss of AR frames in it."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click
from colonnade.cli.options import FILE, dists_option, echo_lines, finish, json_option, require_outputs


@click.command()
@click.argument("rooms", type=FILE, nargs=-1)
@click.option("--frames", is_flag=True, help="Measure frames with objects instead of rays from probe spheres.")
@click.option(
    "--occlusion",
    is_flag=True,
    help="Measure objects behind furniture in synthetic rooms, without ROOMS; with --rooms, behind thin things.",
)
@click.option("--light", is_flag=True, help="Measure relit rooms and mirrors against the photo.")
@click.option("--live", is_flag=True, help="Measure the live encoder against the offline encoder.")
@click.option("--path", is_flag=True, help="With --live and --rooms: the live encoder along a path through each room.")
@click.option("--views", is_flag=True, help="With --rooms: what cameras beside that of the maps see.")
@click.option("--capture", is_flag=True, help="Measure rays in the rooms as a phone would capture them.")
@click.option("--rooms", "seeds", metavar="SEEDS", help="Measure generated rooms, such as 0-9,100, without ROOMS.")
@dists_option
@click.option("--output", type=FILE, metavar="DIR", help="Not for rays: write the frames as pictures.")
@json_option
def study(
    rooms: tuple[Path, ...],
    frames: bool,
    occlusion: bool,
    light: bool,
    live: bool,
    path: bool,
    views: bool,
    capture: bool,
    seeds: str | None,
    no_dists: bool,
    output: Path | None,
    json_file: Path | None,
) -> None:
    """Measure reconstructed rooms against their depth maps. ROOMS are folders.

    By default the command traces rays from mirror, matt and glass spheres, and prints the share that finds the correct
    point: with planes of the full maps, and with those of the attribute memory. With --frames it prints the loss from
    encoding, reconstruction and fixed-point arithmetic. The loss is PSNR, FLIP and DISTS of frame, object and shadow.
    With --occlusion it prints the share of an object's pixels that correctly show the object, or the room before it:
    behind furniture, or with --rooms behind a stool, a plant or a lamp in rooms that a seed generates.
    With --light it prints the PSNR of relit rooms and of a mirror against the photo, for default and for fitted lights.
    With --capture it takes depth of 256x192 from each room, adds noise, derives normals, and prints the share of mirror
    rays that are right in the room itself.
    With --rooms it measures rays and encoded maps in rooms that a seed generates, and counts why rays are wrong.
    With --views and --rooms it measures the pixels of cameras that are not that of the maps: the share that is right.
    With --frames too it measures frames with an object by three ways to the maps of a camera that has moved.
    With --live it measures the encoder of a moving camera: time, loss and rays, in ROOMS or in the rooms of --rooms.
    Tables are in Markdown.
    """
    context = click.get_current_context()
    generated = seeds is not None
    if frames + occlusion + light + live + capture > 1 or (generated and (light or capture or (frames and not views))):
        raise click.UsageError("give one of --frames, --occlusion, --light, --live, --capture and --rooms", context)
    if path and not (live and generated):
        raise click.UsageError("--path needs --live and --rooms", context)
    if views and (not generated or occlusion or live):
        raise click.UsageError("--views needs --rooms, without --occlusion and --live", context)
    if output is not None and not ((frames and not views) or occlusion or light):
        raise click.UsageError("--output needs --frames, --occlusion or --light", context)
    if (occlusion or generated) and rooms:
        option = "--occlusion" if occlusion else "--rooms"
        raise click.UsageError(f"{option} has its own rooms: leave out ROOMS", context)
    if not (occlusion or generated or rooms):
        raise click.UsageError("Missing argument 'ROOMS...'.", context)
    require_outputs(json_file, folders=[output])

    from colonnade.common import progress
    from colonnade.common.atomic_files import made_folder

    from colonnade_lab.evaluation.studies.unseen_rooms import parse_seeds

    report: dict[str, Any]
    with nullcontext() if output is None else made_folder(output):
        if occlusion:
            from colonnade_lab.evaluation.studies import occlusion as study_of_occlusion

            chosen = None if seeds is None else parse_seeds(seeds)
            results = study_of_occlusion.study(progress.for_terminal(), output, chosen)
            echo_lines(study_of_occlusion.table(results))
            report = {name: asdict(value) for name, value in results.items()}
        elif live:
            from colonnade_lab.evaluation.studies import live_maps

            terminal = progress.for_terminal()
            if path and seeds is not None:
                paths = live_maps.study_paths(parse_seeds(seeds), terminal)
                echo_lines(live_maps.path_table(paths))
                report = {name: asdict(value) for name, value in paths.items()}
            else:
                maps = (
                    live_maps.study_rooms(rooms, not no_dists, terminal)
                    if seeds is None
                    else live_maps.study_seeds(parse_seeds(seeds), not no_dists, terminal)
                )
                echo_lines(live_maps.table(maps))
                report = {name: asdict(value) for name, value in maps.items()}
        elif views and frames and seeds is not None:
            from colonnade_lab.evaluation.studies import moving_frames

            errors = moving_frames.study_seeds(parse_seeds(seeds), not no_dists, progress.for_terminal())
            echo_lines(moving_frames.table(errors))
            report = {name: {way: asdict(one) for way, one in ways.items()} for name, ways in errors.items()}
        elif frames:
            from colonnade_lab.evaluation.studies import ar_losses

            terminal = progress.for_terminal()
            with terminal.step("measuring frames"):
                by_frame = ar_losses.study_frames(rooms, not no_dists, terminal, output)
            echo_lines(ar_losses.table(by_frame))
            report = {
                frame: {loss: {part: asdict(value) for part, value in parts.items()} for loss, parts in by_loss.items()}
                for frame, by_loss in by_frame.items()
            }
        elif views and seeds is not None:
            from colonnade_lab.evaluation.studies import moved_views

            moved = moved_views.study_seeds(parse_seeds(seeds), progress=progress.for_terminal())
            echo_lines(moved_views.table(moved))
            report = {str(seed): asdict(value) for seed, value in moved.items()}
        elif seeds is not None:
            from colonnade_lab.evaluation.studies import unseen_rooms

            rooms_of_seeds = unseen_rooms.study_seeds(parse_seeds(seeds), not no_dists, progress.for_terminal())
            echo_lines(unseen_rooms.table(rooms_of_seeds))
            report = {str(seed): asdict(value) for seed, value in rooms_of_seeds.items()}
        elif light:
            from colonnade_lab.evaluation.studies import room_light

            terminal = progress.for_terminal()
            with terminal.step("measuring the light"):
                fits = room_light.study_fits(rooms)
                qualities = room_light.study_light(rooms, terminal, output)
            echo_lines(f"{room_light.fits_table(fits)}\n\n{room_light.table(qualities)}")
            report = {"fits": {name: asdict(value) for name, value in fits.items()}}
            report["choices"] = {name: asdict(value) for name, value in qualities.items()}
        elif capture:
            from colonnade_lab.evaluation.studies import captured_rooms

            captures = captured_rooms.study_captures(rooms, progress.for_terminal())
            echo_lines(captured_rooms.table(captures))
            report = {name: asdict(value) for name, value in captures.items()}
        else:
            from colonnade_lab.evaluation.studies import environment_accuracy

            with progress.for_terminal().step("measuring the rooms"):
                reports = environment_accuracy.study_rooms(rooms)
            echo_lines(environment_accuracy.table(reports))
            report = {name: asdict(value) for name, value in reports.items()}
    finish(report, json_file)
