"""What memories cost: they are never synthesised, but added by an area and an energy per bit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from colonnade.ppa.netlist.hierarchy import Memory


@dataclass(frozen=True)
class Rate:
    """What a bit of memory takes.

    Attributes:
        um2_per_bit: area, periphery included.
        pj_per_bit: energy of a read, for each bit that is read.
    """

    um2_per_bit: float
    pj_per_bit: float


#: By CACTI 7, a macro of 1k words of 32 bits.
SRAM = {"28 nm": Rate(0.19, 0.05), "45 nm": Rate(0.45, 0.09)}

#: A register file of a dozen words, one port to read and one to write. An assumption, without a data sheet: cells of
#: eight transistors, and periphery that takes three times their area. Latches and multiplexers of standard cells take
#: three times as much. The energy is that of a macro.
REGISTER_FILE = {"28 nm": Rate(1.0, 0.05), "45 nm": Rate(2.4, 0.09)}

#: A memory of fewer words is a register file.
LEAST_SRAM_WORDS = 64

#: The chip's gate: 5.53 mm² of 80 render units are counted as 141 kGE each.
CHIP_MM2, CHIP_UNITS = 5.53, 80
CHIP_NODE, CHIP_GATE_UM2 = "28 nm", 0.49


def chip_unit_kge() -> float:
    """Gate equivalents, in thousands, that the chip has for a render unit, its memories and the rest included."""
    return CHIP_MM2 * 1e6 / CHIP_UNITS / CHIP_GATE_UM2 / 1e3


def rates(memory: Memory) -> Mapping[str, Rate]:
    """What a bit of this memory takes, by node."""
    return SRAM if memory.depth >= LEAST_SRAM_WORDS else REGISTER_FILE


def area_um2(memory: Memory, node: str = CHIP_NODE) -> float:
    """The area of all memories of a kind in one instance of their level."""
    return memory.count * memory.bits * rates(memory)[node].um2_per_bit


def equivalent_kge(um2: float) -> float:
    """An area as gates of the chip's node."""
    return um2 / CHIP_GATE_UM2 / 1e3


def area_mm2(kge: float, um2: float) -> float:
    """Gates at the chip's node and the area of memories, placed without gaps."""
    return (kge * 1e3 * CHIP_GATE_UM2 + um2) / 1e6


def described(memory: Memory) -> Mapping[str, Any]:
    """A memory in a report."""
    return {
        "level": memory.level,
        "unit": memory.unit,
        "count": memory.count,
        "depth": memory.depth,
        "width": memory.width,
        "ports": memory.ports,
        "bits": memory.bits * memory.count,
        "um2": {node: area_um2(memory, node) for node in SRAM},
        "read_pj": {node: rate.pj_per_bit * memory.width for node, rate in rates(memory).items()},
        "kge": equivalent_kge(area_um2(memory)),
    }
