"""The paper's RenderIndex: Norm(DISTS loss) × Norm(power) × Norm(area), the lower the better.

The paper leaves Norm open. Here power and area are ratios to the baseline's. Power is that at equal rates of rays,
which is energy per ray: otherwise a slow design wins. The loss is the mean DISTS distance from the baseline's frames;
its norm is ``1 + loss / SCALE``. So a loss of 0 is worth 1, not 0, and cannot win by itself: a loss of `SCALE` has to
be paid for by half of the power or half of the area. A study may have other norms (`Norms`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from colonnade_lab.explore.norm import Norm

#: The DISTS loss that doubles the index, %.
SCALE = 1.0

#: Scales, %, for the dependence of the ranking on this choice; the definition is the first.
SCALES = (SCALE, 0.03, 10.0)

#: The choice of Norm that has the paper's term, power.
PRINTED = "as printed, with power"

#: What is added to all three shares of the ranges by the norm over ranges.
OFFSET = 0.1


@dataclass(frozen=True)
class Terms:
    """What the index of a point is made of; all but the loss are relative to the baseline.

    Attributes:
        loss: DISTS distance from the baseline's frames, %.
        dists: DISTS distance from Embree's frames.
        energy: Energy per ray.
        energy_28nm: The same, with the gates' energy scaled to 28 nm, at which the memories' is given.
        power: Mean power, whatever the rate of rays.
        area: Area of the array.
    """

    loss: float
    dists: float
    energy: float
    energy_28nm: float
    power: float
    area: float


@dataclass(frozen=True)
class Norms:
    """The three norms.

    Attributes:
        loss: Of the DISTS loss, %.
        power: Of the energy per ray over the baseline's.
        area: Of the area over the baseline's.
    """

    loss: Norm = field(default_factory=lambda: Norm(f"1 + x / {SCALE:g}"))
    power: Norm = field(default_factory=lambda: Norm("x"))
    area: Norm = field(default_factory=lambda: Norm("x"))

    @property
    def definition(self) -> str:
        """The index in words."""
        terms = ((self.loss, "DISTS loss, %"), (self.power, "energy per ray"), (self.area, "area"))
        product = " × ".join(f"({norm.text}) of {term}" for norm, term in terms)
        return (
            f"RenderIndex = {product}; lower is better. The DISTS loss is the mean DISTS distance from the baseline's "
            "frames. Energy per ray is power at equal rates of rays; it and area are relative to the baseline's."
        )


def index_rows(
    points: Sequence[Mapping[str, Any]], baseline: str, libraries: Sequence[str], norms: Norms | None = None
) -> list[dict[str, Any]]:
    """The index and its factors, for each library and point that has them; None where a norm has no value.

    Args:
        points: Points of ``study.json`` with their figures.
        baseline: Name of the point whose power and area are 1.
        libraries: Names of the libraries.
        norms: None: the default ones.
    """
    by, rows = norms or Norms(), []
    for library in libraries:
        terms = _terms(points, baseline, library)
        for name, own in terms.items():
            values = (by.loss(own.loss), by.power(own.energy), by.area(own.area))
            factors = dict(zip(("norm_loss", "norm_power", "norm_area"), values, strict=True))
            row = {"name": name, "library": library, "loss": own.loss, **factors, "index": math.prod(values)}
            rows.append({key: None if value != value else value for key, value in row.items()})
    return rows


def sensitivity(points: Sequence[Mapping[str, Any]], baseline: str, libraries: Sequence[str]) -> list[dict[str, Any]]:
    """The ranking by other choices of Norm, for each library."""
    return [
        {"choice": choice, "library": library, "ranking": sorted(found, key=lambda name: (found[name], name))}
        for library in libraries
        for choice, found in indices(points, baseline, library).items()
    ]


def indices(points: Sequence[Mapping[str, Any]], baseline: str, library: str) -> dict[str, dict[str, float]]:
    """The index of each point that has all terms, by choice of Norm; empty without the baseline's terms."""
    terms = _terms(points, baseline, library)
    if not terms:
        return {}
    choices: dict[str, Callable[[Terms], float]] = {f"1 + loss / {scale:g} %": _by_scale(scale) for scale in SCALES}
    choices["energy × area alone"] = _by_scale(math.inf)
    choices["DISTS to Embree in place of the loss"] = lambda own: own.dists * own.energy * own.area
    choices[PRINTED] = lambda own: (1 + own.loss / SCALE) * own.power * own.area
    choices["energy at 28 nm"] = lambda own: (1 + own.loss / SCALE) * own.energy_28nm * own.area
    shared = [[getattr(own, key) for own in terms.values()] for key in ("loss", "energy", "area")]
    ranges = [(min(column), max(column)) for column in shared]
    choices["shares of the ranges (a 0 wins)"] = _by_ranges(ranges, 0.0)
    choices[f"shares of the ranges + {OFFSET:g}"] = _by_ranges(ranges, OFFSET)
    return {choice: {name: value(own) for name, own in terms.items()} for choice, value in choices.items()}


def _by_scale(scale: float) -> Callable[[Terms], float]:
    return lambda own: (1 + own.loss / scale) * own.energy * own.area


def _by_ranges(ranges: Sequence[tuple[float, float]], offset: float) -> Callable[[Terms], float]:
    """The product of each term's share of its range, plus an offset."""

    def value(own: Terms) -> float:
        terms = zip((own.loss, own.energy, own.area), ranges, strict=True)
        shares = ((term - low) / (high - low) if high > low else 0.0 for term, (low, high) in terms)
        return math.prod(offset + share for share in shares)

    return value


def _terms(points: Sequence[Mapping[str, Any]], baseline: str, library: str) -> dict[str, Terms]:
    """The terms of each point that has all of them."""
    figures = {point["name"]: point["figures"] for point in points}
    base = figures.get(baseline, {})
    ratios = ("dists", *(f"{key}.{library}" for key in ("nj", "nj_28nm", "mw", "array_kge")))
    if any(base.get(key) is None for key in ("dists_loss", *ratios)):
        return {}
    return {
        name: Terms(own["dists_loss"], *(own[key] / base[key] if base[key] else math.inf for key in ratios))
        for name, own in figures.items()
        if all(own.get(key) is not None for key in ("dists_loss", *ratios))
    }
