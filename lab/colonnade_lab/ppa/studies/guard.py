"""Regression check of gate counts: each unit of `tiny`, mapped to Yosys's generic gates, against recorded values.

``python -m colonnade_lab.ppa.studies.guard FILE`` records the values.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

from colonnade.common.atomic_files import write_json

from colonnade_lab.ppa.measure import measure

#: Relative difference that is allowed, since small changes of the source change the result of abc.
TOLERANCE = 0.02

#: Absolute difference that is allowed, kGE.
MIN_KGE = 0.1


def gates_of_tiny() -> dict[str, float]:
    """Area of each unit, kGE."""
    return {name: round(unit["kge"], 3) for name, unit in measure("tiny")["units"].items()}


def differences(recorded: Mapping[str, float], found: Mapping[str, float]) -> list[str]:
    """A description of each unit that is new or missing, or whose area changed."""
    phrases = [f"{name} is new" for name in found if name not in recorded]
    phrases += [f"{name} is missing" for name in recorded if name not in found]
    for name, before in recorded.items():
        now = found.get(name, before)
        if abs(now - before) > max(TOLERANCE * before, MIN_KGE):
            phrases.append(f"{name} has {now:.2f} kGE instead of {before:.2f} ({now / before - 1:+.1%})")
    return phrases


if __name__ == "__main__":
    write_json(Path(sys.argv[1]), gates_of_tiny())
