"""The page of ``make paper``: one HTML file with the outcome of each claim and the plots, without links to files."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from html import escape
from pathlib import Path

from colonnade.common.atomic_files import replacing

from colonnade_lab.claims.outcome import Outcome
from colonnade_lab.claims.plots import Drawn

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
figure p { margin: 0.2em 0 1em; }
small, code { color: #666; font-size: 80%; }
"""


def write(
    file: Path,
    title: str,
    lines: Sequence[str],
    outcomes: Sequence[Outcome],
    plots: Sequence[Drawn],
) -> None:
    """Write the page.

    Args:
        file: The HTML file.
        title: Its title.
        lines: What is said before the table.
        outcomes: The claims.
        plots: The paper's figures.
    """
    rows = "".join(_rows(outcome) for outcome in outcomes)
    pictures = "".join(_plot(plot) for plot in plots)
    text = f"""<!doctype html>
<html lang="en"><meta charset="utf-8"><title>{escape(title)}</title><style>{_STYLE}</style>
<h1>{escape(title)}</h1>
{"".join(f"<p>{escape(line)}</p>" for line in lines)}
<h2>Claim by claim</h2>
<table><tr><th>claim</th><th>the paper</th><th>measured</th><th>page</th><th>now</th><th>equal</th></tr>{rows}</table>
<h2>The paper's figures, from the data of docs/paper.md</h2>
<p>Dotted lines are the paper's own values. docs/paper.md says why figures differ.</p>
<div class="plots">{pictures}</div>
</html>
"""
    with replacing(file) as stream:
        stream.write(text.encode())


def _rows(outcome: Outcome) -> str:
    command = f"<br><code>{escape(outcome.command)}</code>" if outcome.command else ""
    head = f"<td>{escape(outcome.claim)}{command}</td><td>{escape(outcome.paper)}</td>"
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


def _plot(drawn: Drawn) -> str:
    plot = drawn.plot
    caption = f"<figcaption>{escape(plot.name)}: {escape(plot.title)}</figcaption>"
    if drawn.file is None:
        return f"<figure>{caption}<p>Not measured.</p></figure>"
    data = base64.b64encode(drawn.file.read_bytes()).decode()
    picture = f'<img alt="{escape(plot.title)}" src="data:image/png;base64,{data}">'
    sources = "".join(f"<br>{escape(source)}" for source in drawn.sources)
    return f"<figure>{caption}{picture}<p>{escape(plot.note)}<small>{sources}</small></p></figure>"
