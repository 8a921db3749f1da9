"""Draws charts by Vega-Lite, in a program of its own: ``python -m colonnade_lab.report.explorer.vega SPECS``.

JavaScript runs for seconds, in which Python handles no signal. SPECS is a JSON list of Vega-Lite specifications, and
standard output gets a JSON list of [SVG, PNG in base 64]. Without SPECS it gets Vega, Vega-Lite and Vega-Embed as one
script, which defines `vegaEmbed`.
"""

from __future__ import annotations

import base64
import json
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from colonnade.common import processes
from colonnade.common.temporary import temporary_folder

#: Pixels of a PNG for each of a chart's.
SCALE = 2.0


def drawn(specs: Sequence[Mapping[str, Any]]) -> list[tuple[bytes, bytes]]:
    """The charts as SVG and PNG."""
    if not specs:
        return []
    with temporary_folder() as place:
        file = place / "specs.json"
        file.write_text(json.dumps(list(specs)))
        found = json.loads(_output(place, file))
    return [(svg.encode(), base64.b64decode(png)) for svg, png in found]


@cache
def chart_library() -> str:
    """Vega, Vega-Lite and Vega-Embed as one script, which defines `vegaEmbed`."""
    with temporary_folder() as place:
        script = _output(place)
    assert "</script" not in script.lower()
    return script


def _output(place: Path, *arguments: Path) -> str:
    done = processes.run([sys.executable, "-m", __name__, *arguments], cwd=place)
    if done.returncode != 0:
        lines = [line for line in done.stderr.splitlines() if line.strip()] or [f"status {done.returncode}"]
        raise RuntimeError(f"the charts cannot be drawn: {lines[-1].strip()}")
    return done.stdout


def _main() -> None:
    import vl_convert

    if len(sys.argv) == 1:
        sys.stdout.write(vl_convert.javascript_bundle("window.vegaEmbed = vegaEmbed;"))
        return
    charts = []
    for spec in json.loads(Path(sys.argv[1]).read_text()):
        svg = vl_convert.vegalite_to_svg(spec)
        charts.append((svg, base64.b64encode(vl_convert.svg_to_png(svg, scale=SCALE)).decode()))
    json.dump(charts, sys.stdout)


if __name__ == "__main__":
    _main()
