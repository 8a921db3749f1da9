"""Gates of each unit of `tiny`, by Yosys's own cells: what is on record is held against what the sources give.

Run as ``python -m colonnade.ppa.studies.guard FILE`` it writes the record.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

from colonnade.common.atomic_files import write_json
from colonnade.ppa.measure import measure

#: Share by which a unit may differ, for small changes shift what abc finds.
TOLERANCE = 0.02

#: Thousands of gates below which nothing counts.
LEAST_KGE = 0.1


def gates_of_tiny() -> dict[str, float]:
    """kGE of each unit."""
    return {name: round(unit["kge"], 3) for name, unit in measure("tiny")["units"].items()}


def differences(recorded: Mapping[str, float], found: Mapping[str, float]) -> list[str]:
    """A phrase for each unit that is new, gone, or whose area has changed."""
    phrases = [f"{name} is new" for name in found if name not in recorded]
    phrases += [f"{name} is gone" for name in recorded if name not in found]
    for name, before in recorded.items():
        now = found.get(name, before)
        if abs(now - before) > max(TOLERANCE * before, LEAST_KGE):
            phrases.append(f"{name} has {now:.2f} kGE, on record are {before:.2f} ({now / before - 1:+.1%})")
    return phrases


if __name__ == "__main__":
    write_json(Path(sys.argv[1]), gates_of_tiny())
