"""What the counters of a frame say about its speed: which unit or port is busiest, where context cycles go, and what
better memory or better units could buy."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

#: Counters of busy cycles by the unit's name: cycles in which its narrowest stage holds work, summed over all of them.
UNITS = {
    "ray set-up": "busyRaySetup",
    "box unit": "busyBoxUnit",
    "triangle unit": "busyTriangleUnit",
    "shader": "busyShader",
}

#: Counters of context cycles by what the context did, summed over all render units; what is left is `LEAVING`.
CONTEXT_CYCLES = {
    "no pixel": "idleContexts",
    "set-up": "contextsSetUp",
    "waits for a record": "waitRecord",
    "waits for a unit": "waitUnit",
    "box unit and stack": "contextsBox",
    "triangle unit": "contextsTriangles",
    "shader": "contextsShading",
}

#: Context cycles from the end of a ray to the pixel's departure, or to the next ray.
LEAVING = "leaving"

#: Ports of the column: one read a cycle and bank, one pixel a cycle and stream.
PORTS = ("memory banks", "pixel streams")

#: Share of the context cycles in which the context has a pixel. Contexts are no bottleneck of their own.
RENDER_UNIT = "render unit"


@dataclass(frozen=True)
class Shape:
    """How much of everything a design has.

    Attributes:
        units: render units.
        triangle_units: triangle tests beside each other, of all render units.
        contexts: of all render units.
        columns: columns, each with a pixel stream.
        banks: of all columns.
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
        lanes, contexts = int(config["units"]["triangleLanes"]), int(config["array"]["contexts"])
        return Shape(units, units * lanes, units * contexts, columns, banks)


def figures(report: Mapping[str, Any]) -> dict[str, Any]:
    """The figures of one frame.

    Args:
        report: of `colonnade.render.frames.frame_report`, from the RTL.

    Returns:
        ``utilisation``, by unit and port, 0 to 1; ``bottleneck``, the busiest of them; ``stalls``, shares of all
        context cycles that add up to 1; ``per_ray``, for each in-box ray; ``snoop_share``, of the records that contexts
        took; ``limits``, in-box rays per cycle that each unit or port alone would allow; ``bounds``, the least of those
        of the units and of the ports.
    """
    counters, cycles = report["counters"], report["cycles"]
    shape = Shape.of(report["config"])
    use = utilisation(counters, cycles, shape)
    resources = {name: share for name, share in use.items() if name != RENDER_UNIT}
    rate = report["rays_per_cycle_in_box"]
    return {
        "utilisation": use,
        "bottleneck": max(resources, key=lambda name: resources[name]),
        "stalls": stalls(counters, cycles, shape),
        "per_ray": per_ray(counters),
        "snoop_share": _ratio(counters["snoopHits"], records_taken(counters)),
        "limits": {name: _bound(rate, [share]) for name, share in resources.items()},
        "bounds": {
            "perfect_memory": _bound(rate, (use[name] for name in UNITS)),
            "perfect_units": _bound(rate, (use[name] for name in PORTS)),
        },
    }


def utilisation(counters: Mapping[str, int], cycles: int, shape: Shape) -> dict[str, float]:
    """Share of the frame's cycles in which each kind of unit or port was busy, averaged over all of its kind."""
    instances = {unit: shape.triangle_units if unit == "triangle unit" else shape.units for unit in UNITS}
    return {
        RENDER_UNIT: 1.0 - _ratio(counters["idleContexts"], cycles * shape.contexts),
        **{unit: _ratio(counters[counter], cycles * instances[unit]) for unit, counter in UNITS.items()},
        "memory banks": _ratio(counters["recordReads"], cycles * shape.banks),
        "pixel streams": _ratio(counters["raysPrimary"], cycles * shape.columns),
    }


def stalls(counters: Mapping[str, int], cycles: int, shape: Shape) -> dict[str, float]:
    """Where the contexts were: shares of contexts × render units × cycles, which add up to 1."""
    everything = cycles * shape.contexts
    shares = {name: _ratio(counters[counter], everything) for name, counter in CONTEXT_CYCLES.items()}
    known = sum(counters[counter] for counter in CONTEXT_CYCLES.values())
    return shares | {LEAVING: _ratio(everything - known, everything)}


def records_taken(counters: Mapping[str, int]) -> int:
    """Records that contexts took, by own reads or another's.

    Every accepted read was asked for by one context, which takes its record and counts no snoop hit for it; every other
    record taken is a snoop hit. So the sum of both counters is exact.
    """
    return counters["recordReads"] + counters["snoopHits"]


def per_ray(counters: Mapping[str, int]) -> dict[str, float]:
    """Work for each in-box ray, shadow rays and the attributes of hits included.

    Each record taken is a node, the attributes of a hit, or a record of triangles: what is left of the first two.
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
    """The rate at which the busiest of some resources would be busy all the time; None when none was used."""
    busiest = max(shares)
    return rate / busiest if busiest > 0 else None


def _ratio(part: float, whole: float) -> float:
    return part / whole if whole else 0.0
