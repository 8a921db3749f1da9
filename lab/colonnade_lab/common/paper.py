"""The figures that the source paper publishes (Guo, Sapatnekar and Gu, MWSCAS 2024)."""

from __future__ import annotations

from typing import NamedTuple

#: The chip: its clock, the units of its array, its area at 28 nm, and its rate and power.
MEGAHERTZ, UNITS, MM2, MRAYS, MILLIWATTS = 200.0, 80, 5.53, 41.6, 69.5

#: In rays of all kinds.
RAYS_PER_CYCLE = round(MRAYS / MEGAHERTZ, 3)

#: Its efficiency in frames. The paper does not say how many rays a frame has; rate, power and this figure do.
FRAMES_PER_JOULE = 789.7
RAYS_A_FRAME = MRAYS * 1e6 / (FRAMES_PER_JOULE * MILLIWATTS * 1e-3)

#: Section III-A: a frame of the bunny, 640×480, on a laptop without a tree.
LAPTOP_HOURS = 2.5

#: Section IV-A: what the tree gains in run time, and costs in area and memory.
TREE_SPEED_UP, TREE_AREA, TREE_MEMORY = 6.3, 0.057, 0.056

#: Section V: what it costs in power.
TREE_POWER = 0.05

#: Section IV-B: bytes of a map of albedo or of normals as it is and encoded, and its quotient, as published.
SOURCE_MAP_BYTES, MAP_BYTES, MAP_RATIO = "921 KB", "16 KB", 56

#: Section IV-C: the chosen precision, its savings against the baseline, and the range of its loss.
PRECISION, POWER_SAVED, AREA_SAVED, LOSS = "32b32s64d", 0.334, 0.167, (0.006, 0.0165)


class Design(NamedTuple):
    """A column of its table 1, as published; "-" where the paper has no figure."""

    name: str
    process: str
    mm2: str
    architecture: str
    clock: str
    precision: str
    power: str
    frames_per_joule: str


#: Table 1, at peak performance.
DESIGNS = (
    Design("Reconf. SIMT", "90", "16", "SIMT", "100 to 400", "FP32", "0.221", "27.38"),
    Design("RayCore", "-", "-", "FPGA prototype", "500", "FP8, FP16, FP24", "1", "17.7"),
    Design("GTX 1080 Ti", "16", "471", "SIMT", "1,480", "FP32, FP64", "250", "0.003"),
    Design("Adreno 740", "4", "-", "mobile SIMT", "980", "FP16, FP32, FP64", "9.4", "35.21"),
    Design("the paper's chip", "28", "5.5", "ASIC", "200", "INT8 to INT64", "0.0695", "789.7"),
)
