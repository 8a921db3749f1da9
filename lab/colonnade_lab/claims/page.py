"""The page of ``make paper``: one HTML file with the outcome of each claim and the plots, without links to files."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from html import escape
from pathlib import Path

from colonnade.common.atomic_files import replacing

from colonnade_lab.claims.outcome import Outcome

_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; max-width: 1080px; margin: 2em auto; padding: 0 1em; color: #222; }
table { border-collapse: collapse; width: 100%; }
td, th { border-bottom: 1px solid #ddd; padding: 4px 8px; text-align: left; vertical-align: top; }
th { background: #f4f4f4; }
td.no { background: #fbd9d3; font-weight: bold; }
td.out { color: #777; }
tr.claim td { border-top: 2px solid #999; }
.plots { display: grid; grid-template-columns: repeat(auto-fit, minmax(460px, 1fr)); gap: 1em; }
figure { margin: 0; }
img { width: 100%; }
figcaption { font-weight: bold; }
"""


def write(
    file: Path,
    title: str,
    lines: Sequence[str],
    outcomes: Sequence[Outcome],
    plots: Sequence[tuple[str, str, Path | None]],
) -> None:
    """Write the page.

    Args:
        file: The HTML file.
        title: Its title.
        lines: What is said before the table.
        outcomes: The claims.
        plots: Those of `colonnade_lab.claims.plots.draw`.
    """
    rows = "".join(_rows(outcome) for outcome in outcomes)
    pictures = "".join(_plot(*plot) for plot in plots)
    text = f"""<!doctype html>
<html lang="en"><meta charset="utf-8"><title>{escape(title)}</title><style>{_STYLE}</style>
<h1>{escape(title)}</h1>
{"".join(f"<p>{escape(line)}</p>" for line in lines)}
<h2>Claim by claim</h2>
<table><tr><th>claim</th><th>the paper</th><th>measured</th><th>page</th><th>now</th><th>equal</th></tr>{rows}</table>
<h2>The paper's figures, from the data of docs/paper.md</h2>
<p>Dotted lines are the paper's own values.</p>
<div class="plots">{pictures}</div>
</html>
"""
    with replacing(file) as stream:
        stream.write(text.encode())


def _rows(outcome: Outcome) -> str:
    head = f"<td>{escape(outcome.claim)}</td><td>{escape(outcome.paper)}</td>"
    if outcome.reason is not None:
        kind = "no" if outcome.failed else "out"
        word = "failed" if outcome.failed else "left out"
        return (
            f'<tr class="claim">{head}<td colspan="3">{escape(outcome.reason)}</td><td class="{kind}">{word}</td></tr>'
        )
    rows = []
    for index, figure in enumerate(outcome.figures):
        first = head if index == 0 else "<td></td><td></td>"
        cells = "".join(f"<td>{escape(text)}</td>" for text in (figure.what, figure.page or "–", figure.now))
        equal = '<td class="no">no</td>' if not figure.is_equal else f"<td>{'yes' if figure.page else '–'}</td>"
        rows.append(f"<tr{' class=claim' if index == 0 else ''}>{first}{cells}{equal}</tr>")
    return "".join(rows)


def _plot(name: str, title: str, file: Path | None) -> str:
    caption = f"<figcaption>{escape(name)}: {escape(title)}</figcaption>"
    if file is None:
        return f"<figure>{caption}<p>Not measured.</p></figure>"
    data = base64.b64encode(file.read_bytes()).decode()
    return f'<figure>{caption}<img alt="{escape(title)}" src="data:image/png;base64,{data}"></figure>'
