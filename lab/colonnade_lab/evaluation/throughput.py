"""Throughput analysis of a frame's counters: utilisation, bottleneck, stalls of the contexts, and upper bounds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

#: Counters of busy cycles by unit: cycles in which the unit's narrowest stage holds work, summed over all instances.
UNITS = {
    "ray set-up": "busyRaySetup",
    "box unit": "busyBoxUnit",
    "triangle unit": "busyTriangleUnit",
    "shader": "busyShader",
}

#: Counters of context cycles by the context's state, summed over the array. The remainder is `COMPLETION`.
CONTEXT_CYCLES = {
    "idle": "idleContexts",
    "ray set-up": "contextsRaySetup",
    "record stall": "waitRecord",
    "unit stall": "waitUnit",
    "box unit and stack": "contextsBox",
    "triangle unit": "contextsTriangles",
    "shader": "contextsShading",
}

#: Context cycles from the end of a ray to the output of its pixel, or to the next ray.
COMPLETION = "completion"

#: Ports of a column: each bank reads one record per cycle, each stream delivers one pixel per cycle.
PORTS = ("memory banks", "pixel streams")

#: Share of the context cycles of path units in which the context has a pixel. It is never reported as the bottleneck.
PATH_UNIT = "path unit"


@dataclass(frozen=True)
class Shape:
    """Number of instances in a whole design.

    Attributes:
        units: Traversal units.
        triangle_units: Triangle units.
        contexts: Contexts of the path units.
        columns: Columns, each with a path unit and a pixel stream.
        banks: Memory banks.
    """

    units: int
    triangle_units: int
    contexts: int
    columns: int
    banks: int

    @staticmethod
    def of(config: Mapping[str, Any]) -> Shape:
        """The shape of a configuration."""
        columns = int(config["array"]["columns"])
        units = columns * int(config["array"]["rows"])
        banks = columns * int(config["columnBvhMemory"]["banks"])
        lanes, contexts = int(config["units"]["triangleLanes"]), columns * int(config["units"]["pathContexts"])
        groups = columns * -(-int(config["array"]["rows"]) // int(config["units"]["triangleRows"]))
        return Shape(units, groups * lanes, contexts, columns, banks)


def figures(report: Mapping[str, Any]) -> dict[str, Any]:
    """The throughput figures of one frame.

    Args:
        report: An RTL report of `colonnade.render.report.frame_report`.

    Returns:
        ``utilisation``: busy share of each unit and port, 0 to 1. ``bottleneck``: the busiest of them. ``stalls``:
        shares of all context cycles, with sum 1. ``per_ray``: work per in-box ray, with a cache also ``dram_bytes``, in
        whole beats of the port. ``snoop_share``: snooped share of
        the records taken. ``limits``: in-box rays per cycle at full utilisation of each unit or port. ``bounds``: the
        lowest limit of the units, and of the ports.
    """
    counters, cycles = report["counters"], report["cycles"]
    shape = Shape.of(report["config"])
    use = utilisation(counters, cycles, shape)
    resources = {name: share for name, share in use.items() if name != PATH_UNIT}
    rate = report["rays_per_cycle_in_box"]
    line = report.get("dram_line_bytes")
    dram = {} if line is None else {"dram_bytes": _ratio(counters["dramReads"] * line, counters["raysInBox"])}
    return {
        "utilisation": use,
        "bottleneck": max(resources, key=lambda name: resources[name]),
        "stalls": stalls(counters, cycles, shape),
        "per_ray": per_ray(counters) | dram,
        "snoop_share": _ratio(counters["snoopHits"], records_taken(counters)),
        "limits": {name: _bound(rate, [share]) for name, share in resources.items()},
        "bounds": {
            "perfect_memory": _bound(rate, (use[name] for name in UNITS)),
            "perfect_units": _bound(rate, (use[name] for name in PORTS)),
        },
    }


def utilisation(counters: Mapping[str, int], cycles: int, shape: Shape) -> dict[str, float]:
    """Busy share of the frame's cycles for each kind of unit or port, averaged over its instances, 0 to 1."""
    instances = {
        "ray set-up": shape.columns,
        "box unit": shape.units,
        "triangle unit": shape.triangle_units,
        "shader": shape.columns,
    }
    return {
        PATH_UNIT: 1.0 - _ratio(counters["idleContexts"], cycles * shape.contexts),
        **{unit: _ratio(counters[counter], cycles * instances[unit]) for unit, counter in UNITS.items()},
        "memory banks": _ratio(counters["recordReads"], cycles * shape.banks),
        "pixel streams": _ratio(counters["raysPrimary"], cycles * shape.columns),
    }


def stalls(counters: Mapping[str, int], cycles: int, shape: Shape) -> dict[str, float]:
    """Shares of all context cycles (contexts × cycles) by state, with sum 1."""
    everything = cycles * shape.contexts
    shares = {name: _ratio(counters[counter], everything) for name, counter in CONTEXT_CYCLES.items()}
    known = sum(counters[counter] for counter in CONTEXT_CYCLES.values())
    return shares | {COMPLETION: _ratio(everything - known, everything)}


def records_taken(counters: Mapping[str, int]) -> int:
    """Records that contexts took, from their own reads or from reads of others.

    The sum is exact: each accepted read belongs to one context, which counts no snoop hit for it. Each other record
    taken is a snoop hit.
    """
    return counters["recordReads"] + counters["snoopHits"]


def per_ray(counters: Mapping[str, int]) -> dict[str, float]:
    """Work per in-box ray, including shadow rays and the attributes of hits.

    Each record taken is a node, the attributes of a hit, or a triangle record; the counters give the first two.
    """
    rays = counters["raysInBox"]
    triangle_records = records_taken(counters) - counters["nodeReads"] - counters["hits"]
    return {
        "node_reads": _ratio(counters["nodeReads"], rays),
        "box_tests": _ratio(counters["boxTests"], rays),
        "triangle_records": _ratio(triangle_records, rays),
        "triangle_tests": _ratio(counters["triangleTests"], rays),
        "records_taken": _ratio(records_taken(counters), rays),
        "record_reads": _ratio(counters["recordReads"], rays),
    }


def _bound(rate: float, shares: Iterable[float]) -> float | None:
    """The rate at which the busiest of some resources reaches full utilisation; None if none was used."""
    busiest = max(shares)
    return rate / busiest if busiest > 0 else None


def _ratio(part: float, whole: float) -> float:
    return part / whole if whole else 0.0
