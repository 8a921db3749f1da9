"""What ``colonnade rays`` prints: rays of applications a second, and the time of Embree's calls."""

from __future__ import annotations

from dataclasses import asdict, astuple
from pathlib import Path

from colonnade.cli.options import echo, finish
from colonnade.mesh.load import load_mesh

from colonnade_lab.common.text_table import Column, Table
from colonnade_lab.evaluation import ray_calls
from colonnade_lab.evaluation.rays import measured, report


def print_rates(config: str, overrides: tuple[str, ...], mesh: str, count: int, json_file: Path | None) -> None:
    """Print the rays that the model and Embree answer a second, and what the model and its caches read for one."""
    table = Table(
        (
            Column("rays", 26, is_text=True),
            Column("model", 9, ",.0f", group="hits"),
            Column("Embree", 9, ",.0f", group="hits"),
            Column("model", 11, ",.0f", group="rays a second"),
            Column("Embree", 11, ",.0f", group="rays a second"),
            Column("nodes", 6, ".1f", group="a ray"),
            Column("triangles", 9, ".1f", group="a ray"),
            Column("DRAM, B", 8, ".0f", group="a ray"),
        ),
        echo,
    )
    rates = []
    for each in measured(load_mesh(mesh), config, overrides, count):
        rates.append(each)
        table.print(*astuple(each))
    finish({"mesh": mesh, "rays": count, "kinds": report(rates)}, json_file)


def print_calls(mesh: str, count: int, json_file: Path | None) -> None:
    """Print the CPU time of a ray by Embree's calls, of the library and of Embree, and by one call with all rays."""
    names = (("rtc…1", 8), ("rtc…16", 8), ("batch", 8))
    groups = ("µs a ray, library", "µs a ray, Embree")
    columns = (Column(name, width, ".2f", group=group) for group in groups for name, width in names)
    table, times = Table((Column("rays", 26, is_text=True), *columns), echo), []
    for each in ray_calls.measured(load_mesh(mesh), count):
        times.append(each)
        table.print(*astuple(each))
    finish({"mesh": mesh, "rays": count, "calls": [asdict(each) for each in times]}, json_file)
