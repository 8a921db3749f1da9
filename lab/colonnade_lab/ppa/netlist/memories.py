"""Area and energy of memories, which are not synthesised but estimated per bit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from colonnade_lab.common import paper
from colonnade_lab.ppa.netlist.hierarchy import Memory


@dataclass(frozen=True)
class Rate:
    """Cost of a memory bit.

    Attributes:
        um2_per_bit: Area with periphery, µm².
        pj_per_bit: Read energy per bit read, pJ.
    """

    um2_per_bit: float
    pj_per_bit: float


#: An SRAM macro of 1k words of 32 bits, by CACTI 7.
SRAM = {"28 nm": Rate(0.19, 0.05), "45 nm": Rate(0.45, 0.09)}

#: A register file of a dozen words with a read and a write port. This is an assumption without a data sheet: cells of
#: eight transistors, with three times their area for periphery, and the energy of a macro. Latches and multiplexers of
#: standard cells take three times as much area.
REGISTER_FILE = {"28 nm": Rate(1.0, 0.05), "45 nm": Rate(2.4, 0.09)}

#: A memory with fewer words is a register file.
MIN_SRAM_WORDS = 64

#: The paper's chip: the gates of its area at this size make 141 kGE for each unit of its array.
CHIP_NODE, CHIP_GATE_UM2 = "28 nm", 0.49


def chip_unit_kge() -> float:
    """Gate equivalents of the chip per unit of its array, kGE, including memories and all other logic."""
    return paper.MM2 * 1e6 / paper.UNITS / CHIP_GATE_UM2 / 1e3


def rates(memory: Memory) -> Mapping[str, Rate]:
    """The cost of a bit of this memory, by node."""
    return SRAM if memory.depth >= MIN_SRAM_WORDS else REGISTER_FILE


def area_um2(memory: Memory, node: str = CHIP_NODE) -> float:
    """The area of all instances of a memory within one instance of its level, µm²."""
    return memory.count * memory.bits * rates(memory)[node].um2_per_bit


def equivalent_kge(um2: float) -> float:
    """An area in gate equivalents of the chip's node, kGE."""
    return um2 / CHIP_GATE_UM2 / 1e3


def area_mm2(kge: float, um2: float) -> float:
    """The area of gates at the chip's node and of memories, without gaps, mm²."""
    return (kge * 1e3 * CHIP_GATE_UM2 + um2) / 1e6


def describe(memory: Memory) -> Mapping[str, Any]:
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
