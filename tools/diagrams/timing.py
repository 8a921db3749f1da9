"""Timing diagrams: WaveDrom's JSON, drawn by schemdraw."""

from __future__ import annotations

import json
import re

import schemdraw
from schemdraw import logic

_STYLE = {
    "yheight": 0.5,
    "ygap": 0.25,
    "risetime": 0.1,
    "fontsize": 12,
    "datafontsize": 11.5,
    "namecolor": "#16222b",
    "tickcolor": "#44545f",
    "edgecolor": "#a33b1f",
    "gridcolor": "#d5dde2",
}


def draw(text: str) -> str:
    """The SVG of a source: WaveDrom's keys, and ``description``, the text for readers who cannot see the picture."""
    wave = json.loads(text)
    description = wave.pop("description")
    schemdraw.use("svg")
    drawing = schemdraw.Drawing(show=False)
    drawing.config(font="Helvetica, Arial, sans-serif", margin=0.2, bgcolor="white")
    drawing.add(logic.TimingDiagram(wave, **_STYLE))
    svg: str = drawing.get_imagedata("svg").decode()
    # Floats in full would differ in their last digits from machine to machine
    svg = re.sub(r"-?\d+\.\d{4,}", lambda number: f"{float(number[0]):.2f}", svg)
    return re.sub(r"(<svg [^>]*>)", rf"\1<title>{description}</title>", svg, count=1) + "\n"
