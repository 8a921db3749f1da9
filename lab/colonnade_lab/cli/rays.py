"""``colonnade rays``: rays of applications a second."""

from __future__ import annotations

from dataclasses import astuple
from pathlib import Path

import click
from colonnade.cli.options import MESH, Command, configuration_options, echo, finish, json_option, require_outputs


@click.command(cls=Command)
@configuration_options
@click.option("--mesh", type=MESH, metavar="MESH", default="teapot", show_default=True, help="Mesh that the rays hit.")
@click.option("--rays", "count", type=click.IntRange(1), default=100_000, show_default=True, help="Rays of each kind.")
@json_option
def rays(config: str, overrides: tuple[str, ...], mesh: str, count: int, json_file: Path | None) -> None:
    """Count the rays that the model and Embree answer a second, and what the model and its caches read for one.

    "shuffled" rays have no order; the others have that of `colonnade.rays.Scene.order`.
    """
    require_outputs(json_file)

    from colonnade.mesh.load import load_mesh

    from colonnade_lab.common.text_table import Column, Table
    from colonnade_lab.evaluation.rays import measured, report

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
