"""The parts of ``tools/light``: see its usage."""

from __future__ import annotations

import sys
from dataclasses import asdict
from pathlib import Path

from colonnade.common import progress
from colonnade.common.atomic_files import made_folder, write_json
from colonnade.common.errors import UserError
from colonnade.common.processes import tool

from colonnade_lab.evaluation.light.rooms import ROOMS
from colonnade_lab.evaluation.light.user_rooms import REPORT, known_room


def main() -> None:
    """Run the part that the first argument names."""
    part, *arguments = sys.argv[1:]
    parts = {"job": _job, "store": _store, "frames": _frames, "assets": _assets, "asset": _asset}
    parts |= {"defaults": _defaults, "shots": _shots}
    parts[part](arguments)


def _job(arguments: list[str]) -> None:
    """ROOM[/FRAME] FILE: write what the path tracer needs."""
    from colonnade_lab.evaluation.light.jobs import write_job

    (name, _, frame), file = arguments[0].partition("/"), arguments[1]
    room = known_room(name)
    if frame and frame not in room.frames:
        raise UserError(f"there is no frame {frame} of {name}: choose from {', '.join(room.frames)}")
    write_job(Path(file), room, frame or None)


def _store(arguments: list[str]) -> None:
    """ROOM FILE: store what the path tracer made."""
    from colonnade_lab.evaluation.light.files import store

    name, file = arguments
    store(name, Path(file))


def _frames(arguments: list[str]) -> None:
    """FOLDER [ROOM…] [--json FILE]: measure the frames of rooms, or of all; scenes and pictures are in the folder."""
    from colonnade_lab.evaluation.light import columns, report

    options = arguments.index("--json") if "--json" in arguments else len(arguments)
    folder, names = Path(arguments[0]), tuple(arguments[1:options]) or tuple(ROOMS)
    for name in names:
        known_room(name)
    with made_folder(folder):
        results: dict[str, columns.FrameResult] = {}
        strips: dict[str, list[report.Strip]] = {}
        for name, result, pictures in columns.measure(folder, names, progress.for_terminal()):
            results[name] = result
            room, _, frame = name.rpartition("-")
            kind = f"users-{frame}" if known_room(room).is_users else frame
            strips.setdefault(kind, []).append(report.write_pictures(folder, name, pictures))
        for kind, rows in strips.items():
            report.write_strips(folder / f"light-{kind}.jpg", rows)
    print(report.table(results))
    if "--json" in arguments:
        found = {name: asdict(result) for name, result in results.items()}
        write_json(Path(arguments[arguments.index("--json") + 1]), {"config": columns.CONFIG, "frames": found})


def _defaults(arguments: list[str]) -> None:
    """FOLDER [ROOM…] [--json FILE]: compare the default command with other settings in users' rooms, or in all."""
    from colonnade_lab.evaluation.light import columns, defaults, report

    options = arguments.index("--json") if "--json" in arguments else len(arguments)
    folder, names = Path(arguments[0]), tuple(arguments[1:options]) or tuple(REPORT)
    for name in names:
        if name not in REPORT:
            raise UserError(f"{name} is not a user's room: choose from {', '.join(REPORT)}")
    with made_folder(folder):
        results: dict[str, defaults.DefaultResult] = {}
        for name, result, pictures in defaults.measure_defaults(folder, names, progress.for_terminal()):
            results[name] = result
            report.write_frames(folder / name.replace(": ", "-").replace(" ", "-"), pictures)
    print(defaults.table(results))
    if "--json" in arguments:
        found = {name: asdict(result) for name, result in results.items()}
        write_json(Path(arguments[arguments.index("--json") + 1]), {"config": columns.CONFIG, "frames": found})


def _shots(arguments: list[str]) -> None:
    """FOLDER: write the scenes of varied objects in rooms, and print their files."""
    from colonnade_lab.evaluation.light.shots import write_shots

    with made_folder(Path(arguments[0])):
        print("\n".join(map(str, write_shots(Path(arguments[0])))))


def _assets(arguments: list[str]) -> None:
    """FOLDER [FILE…]: write what the path tracer needs of glTF files, or of the pages'."""
    from colonnade_lab.evaluation.light.assets import sample_files, write_jobs

    folder, *files = map(Path, arguments)
    write_jobs(folder, files or sample_files())


def _asset(arguments: list[str]) -> None:
    """FOLDER [--json FILE]: compare Colonnade's pictures of glTF files with the path tracer's."""
    from colonnade_lab.evaluation.light.assets import COMMIT, REPOSITORY, compare

    results = compare(Path(arguments[0]))
    print("\n".join(f"{name}: {own.psnr:.1f} dB, FLIP {own.flip:.3f}" for name, own in results.items()))
    if "--json" in arguments:
        found = {name: asdict(result) for name, result in results.items()}
        report = {"repository": REPOSITORY, "revision": COMMIT, "files": found}
        write_json(Path(arguments[arguments.index("--json") + 1]), report)


if __name__ == "__main__":
    tool(main)
