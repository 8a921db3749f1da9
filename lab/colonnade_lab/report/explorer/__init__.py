"""The report of a study: one self-contained HTML page, and the same charts as static plots.

Both read ``study.json`` and the pictures of a study's folder, and nothing else.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from colonnade.common.atomic_files import make_folder, replacing

#: Writes a file.
Write = Callable[[Path, bytes], None]

REPORT_NAME = "report.html"
PLOTS_NAME = "plots"


def replace_file(path: Path, data: bytes) -> None:
    """Write a file whole, and its folder where missing."""
    make_folder(path.parent)
    with replacing(path) as stream:
        stream.write(data)


def write_report(folder: Path, write: Write = replace_file) -> Path:
    """Write ``report.html`` from the study in `folder`; returns its path.

    The page opens without a network: scripts, charts and pictures are part of it. The same study gives the same bytes.

    Raises:
        UserError: ``study.json`` or a picture is missing or unreadable, or the page cannot be written.
    """
    from colonnade_lab.report.explorer.page import page
    from colonnade_lab.report.explorer.study import read_study

    text = page(read_study(folder), folder)
    path = folder / REPORT_NAME
    write(path, text.encode())
    return path


def write_plots(folder: Path, write: Write = replace_file) -> list[Path]:
    """Write the charts of the study in `folder` as SVG and PNG into ``plots``; returns their paths.

    Raises:
        UserError: ``study.json`` is missing or unreadable, or a plot cannot be written.
    """
    from colonnade_lab.report.explorer.plots import write_all
    from colonnade_lab.report.explorer.study import read_study

    return write_all(read_study(folder), folder / PLOTS_NAME, write)
