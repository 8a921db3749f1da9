"""The power of a row as a sum over the modules that were replayed, and its energy per ray."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from typing import Any

from colonnade_lab.ppa.netlist.hierarchy import LEVELS, PATHS, QUERIES, TRACE
from colonnade_lab.ppa.power.activity import NO_POWER, Power
from colonnade_lab.ppa.power.window import Window

#: The two power figures: from cycles in which a net has changed, and from all its transitions.
KINDS = ("zero_delay", "glitch_aware")

_UNITS = frozenset({*PATHS, *QUERIES, *TRACE, "TriangleUnit"})


class Sum:
    """The power of a row, summed up over the modules that were replayed.

    Attributes:
        records: Power of the reads of records for the row, mW.
    """

    def __init__(self, window: Window, megahertz: float, scale: float) -> None:
        self.records = 0.0
        self._window, self._megahertz, self._scale = window, megahertz, scale
        self._gates: dict[str, dict[str, Power]] = {kind: {} for kind in KINDS}
        self._memories: dict[tuple[str, str], float] = defaultdict(float)

    def add(
        self, module: str, gates: Mapping[str, Mapping[str, Power]], memories_mw: Mapping[tuple[str, str], float]
    ) -> None:
        """Add a module.

        Args:
            module: Name of the module.
            gates: Power by kind and by owner.
            memories_mw: Power of memories by owner and memory, mW.
        """
        part = self._window.shares[module]
        for kind, powers in gates.items():
            for unit, power in by_unit(powers, module).items():
                self._gates[kind][unit] = self._gates[kind].get(unit, NO_POWER) + power * part
        for (owner, memory), milliwatts in memories_mw.items():
            self._memories[_unit(owner, module), memory] += milliwatts * part

    def kinds(self) -> dict[str, float]:
        """Power of memories of the row, and of its records, mW."""
        return {"own": sum(self._memories.values()), "records": self.records}

    def totals(self) -> dict[str, dict[str, Any]]:
        """Power and energies by kind."""
        found = {}
        for kind, powers in self._gates.items():
            total = self._facts(sum(powers.values(), NO_POWER), sum(self.kinds().values()))
            dynamic = total["dynamic_mw"] * self._scale
            both = dynamic + total["memory_mw"]
            scaled = {"dynamic_mw": dynamic, "memory_mw": total["memory_mw"], "total_mw": both}
            # Leakage scales differently, and is left out
            found[kind] = total | self._energies(total["total_mw"]) | {"at_28nm": scaled | self._energies(both)}
        return found

    def units(self) -> dict[str, dict[str, Any]]:
        """Power of each unit with glitches, and its energy per in-box ray by kind."""
        found: dict[str, dict[str, Any]] = {}
        for unit, power in self._gates["glitch_aware"].items():
            memory = sum(milliwatts for (of, _), milliwatts in self._memories.items() if of == unit)
            facts = self._facts(power, memory)
            scaled = {
                kind: self._energy(powers[unit].dynamic * self._scale + facts["memory_mw"], self._window.traced)
                for kind, powers in self._gates.items()
            }
            found[unit] = facts | {"power_mw": facts.pop("total_mw"), "energy_per_ray_nj_at_28nm": scaled}
        return found

    def memories(self) -> list[dict[str, Any]]:
        """Power and energy per in-box ray of each memory, the largest first."""
        return [
            {
                "unit": unit,
                "memory": memory,
                "power_mw": milliwatts,
                "energy_per_ray_nj": self._energy(milliwatts, self._window.traced),
            }
            for (unit, memory), milliwatts in sorted(self._memories.items(), key=lambda item: (-item[1], item[0]))
        ]

    def _facts(self, power: Power, memory: float) -> dict[str, Any]:
        facts = {"clock_mw": power.clock, "dynamic_mw": power.dynamic, "leakage_mw": power.leakage}
        return facts | {"memory_mw": memory, "total_mw": power.dynamic + power.leakage + memory}

    def _energies(self, milliwatts: float) -> dict[str, float | None]:
        """Energy per in-box ray and per ray, nJ."""
        return {
            "energy_per_ray_nj": self._energy(milliwatts, self._window.traced),
            "energy_per_any_ray_nj": self._energy(milliwatts, self._window.rays),
        }

    def _energy(self, milliwatts: float, rays: float) -> float | None:
        # mW × µs = nJ
        return milliwatts * self._window.cycles / self._megahertz / rays if rays else None


def by_unit(powers: Mapping[str, Power], module: str) -> dict[str, Power]:
    """The power of each unit of a replayed module, summed over the modules within it."""
    found: dict[str, Power] = {}
    for owner, power in powers.items():
        unit = _unit(owner, module)
        found[unit] = found.get(unit, NO_POWER) + power
    return found


def _unit(owner: str, module: str) -> str:
    """The innermost unit of an instance's path within a replayed module."""
    rest = LEVELS[0].rest if module == LEVELS[0].top else module
    return next((name for name in reversed(owner.split("/")) if name in _UNITS), rest)
