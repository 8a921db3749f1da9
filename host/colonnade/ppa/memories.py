"""What memories cost: they are never synthesised, but added by an area and an energy per bit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from colonnade.ppa.hierarchy import Memory


@dataclass(frozen=True)
class Sram:
    """SRAM of one node, periphery included (CACTI 7, a macro of 1k words of 32 bits).

    Attributes:
        um2_per_bit: area.
        pj_per_bit: energy of a read, for each bit that is read.
    """

    um2_per_bit: float
    pj_per_bit: float


SRAM = {"28 nm": Sram(0.19, 0.05), "45 nm": Sram(0.45, 0.09)}

#: The chip's gate: 5.53 mm² of 80 render units are counted as 141 kGE each.
CHIP_MM2, CHIP_UNITS = 5.53, 80
CHIP_NODE, CHIP_GATE_UM2 = "28 nm", 0.49


def chip_unit_kge() -> float:
    """Gate equivalents, in thousands, that the chip has for a render unit, its memories and the rest included."""
    return CHIP_MM2 * 1e6 / CHIP_UNITS / CHIP_GATE_UM2 / 1e3


def equivalent_kge(bits: float) -> float:
    """The area of so many bits as gates of the chip's node."""
    return bits * SRAM[CHIP_NODE].um2_per_bit / CHIP_GATE_UM2 / 1e3


def area_mm2(kge: float, bits: float) -> float:
    """Gates and memories at the chip's node, placed without gaps."""
    return (kge * 1e3 * CHIP_GATE_UM2 + bits * SRAM[CHIP_NODE].um2_per_bit) / 1e6


def described(memory: Memory) -> Mapping[str, Any]:
    """A memory in a report."""
    bits = memory.bits * memory.count
    return {
        "level": memory.level,
        "unit": memory.unit,
        "count": memory.count,
        "depth": memory.depth,
        "width": memory.width,
        "ports": memory.ports,
        "bits": bits,
        "um2": {node: sram.um2_per_bit * bits for node, sram in SRAM.items()},
        "read_pj": {node: sram.pj_per_bit * memory.width for node, sram in SRAM.items()},
        "kge": equivalent_kge(bits),
    }
