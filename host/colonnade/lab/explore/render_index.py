"""The paper's RenderIndex: Norm(DISTS loss) × Norm(power) × Norm(area), the lower the better.

The paper leaves Norm open. Here power and area are ratios to the baseline's. Power is that at equal rates of rays,
which is energy per ray: otherwise a slow design wins. The loss is the mean DISTS distance from the baseline's frames;
its norm is ``1 + loss / SCALE``. So a loss of 0 is worth 1, not 0, and cannot win by itself: a loss of `SCALE` has to
be paid for by half of the power or half of the area.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

#: The DISTS loss that doubles the index, %.
SCALE = 1.0

#: Scales, %, for the dependence of the ranking on this choice; the definition is the first.
SCALES = (SCALE, 0.1, 0.3, 3.0, 10.0)

#: What is added to all three shares of the ranges by the norm over ranges.
OFFSET = 0.1

#: DISTS loss in %; energy per ray, area and plain power relative to the baseline.
Terms = tuple[float, float, float, float]

DEFINITION = (
    f"RenderIndex = (1 + DISTS loss / {SCALE:g} %) × energy per ray / the baseline's × area / the baseline's; lower is "
    "better. The DISTS loss is the mean DISTS distance from the baseline's frames. Energy per ray is power at equal "
    "rates of rays."
)


def index_rows(points: Sequence[Mapping[str, Any]], baseline: str, libraries: Sequence[str]) -> list[dict[str, Any]]:
    """The index and its factors, for each library and point that has them.

    Args:
        points: Points of ``study.json`` with their figures.
        baseline: Name of the point whose power and area are 1.
        libraries: Names of the libraries.
    """
    rows = []
    for library in libraries:
        terms = _terms(points, baseline, library)
        for name, (loss, power, area, _) in terms.items():
            norms = {"norm_loss": 1 + loss / SCALE, "norm_power": power, "norm_area": area}
            row = {"name": name, "library": library, "loss": loss, **norms}
            rows.append(row | {"index": math.prod(norms.values())})
    return rows


def sensitivity(points: Sequence[Mapping[str, Any]], baseline: str, libraries: Sequence[str]) -> list[dict[str, Any]]:
    """The ranking by other choices of Norm, for each library."""
    found = []
    for library in libraries:
        terms = _terms(points, baseline, library)
        if not terms:
            continue
        choices: dict[str, Callable[[Terms], float]] = {f"1 + loss / {scale:g} %": _by_scale(scale) for scale in SCALES}
        choices["energy × area alone"] = _by_scale(math.inf)
        choices["power in place of energy"] = lambda terms: (1 + terms[0] / SCALE) * terms[3] * terms[2]
        ranges = [(min(column), max(column)) for column in zip(*terms.values(), strict=True)]
        choices["shares of the ranges (a 0 wins)"] = _by_ranges(ranges, 0.0)
        choices[f"shares of the ranges + {OFFSET:g}"] = _by_ranges(ranges, OFFSET)
        for choice, value in choices.items():
            ranking = [name for _, name in sorted((value(term), name) for name, term in terms.items())]
            found.append({"choice": choice, "library": library, "ranking": ranking})
    return found


def _by_scale(scale: float) -> Callable[[Terms], float]:
    return lambda terms: (1 + terms[0] / scale) * terms[1] * terms[2]


def _by_ranges(ranges: Sequence[tuple[float, float]], offset: float) -> Callable[[Terms], float]:
    """The product of each term's share of its range, plus an offset."""

    def value(terms: Terms) -> float:
        shares = (
            (t - low) / (high - low) if high > low else 0.0 for t, (low, high) in zip(terms[:3], ranges, strict=False)
        )
        return math.prod(offset + share for share in shares)

    return value


def _terms(points: Sequence[Mapping[str, Any]], baseline: str, library: str) -> dict[str, Terms]:
    """The terms of each point that has all of them."""
    figures = {point["name"]: point["figures"] for point in points}
    base = figures.get(baseline, {})
    loss, *ratios = "dists_loss", f"nj.{library}", f"array_kge.{library}", f"mw.{library}"
    if any(base.get(key) is None for key in (loss, *ratios)):
        return {}
    found: dict[str, Terms] = {}
    for name, own in figures.items():
        if all(own.get(key) is not None for key in (loss, *ratios)):
            energy, area, power = (own[key] / base[key] for key in ratios)
            found[name] = (own[loss], energy, area, power)
    return found
