"""State graphs in Graphviz's language, drawn by its program ``dot``."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys

# Larger letters in less space than by default: the graphs have to be legible at the width of a page.
_STYLE = ["-Gnodesep=0.15", "-Granksep=0.3", "-Nfontsize=13", "-Nmargin=0.1,0.04", "-Efontsize=12", "-Ecolor=#2b4a5e"]
_STYLE += ["-Nstyle=rounded,filled", "-Nfillcolor=#eef3f6", "-Ncolor=#2b4a5e", "-Earrowsize=0.7"]


def draw(text: str) -> str:
    """The SVG of a source."""
    if shutil.which("dot") is None:
        sys.exit("diagrams: a graph has changed, and Graphviz draws it; run: sudo apt-get install graphviz")
    # Attributes of the source would take the place of the style
    plain = re.sub(r"^  (node|edge) \[[^\]]*\];\n", "", text, flags=re.MULTILINE)
    fonts = [f"-{kind}fontname=Helvetica" for kind in "GNE"]
    command = ["dot", "-Tsvg", *_STYLE, *fonts, "-Nshape=box"]
    svg = subprocess.run(command, input=plain, capture_output=True, text=True, check=True).stdout
    # Neither the version of the program nor its header: an SVG begins with its element
    return svg[svg.index("<svg") :]
