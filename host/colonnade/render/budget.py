"""The samples of a frame that gathers light, by a budget of the device's time (docs/sampling.md, "Budget").

The bit-exact model renders a pass, whatever renders the frame, and its cycles are estimated from counters that do not
depend on timing. So a scene and a configuration always give the same number.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import loaded_model, model_frame
from colonnade.scene_image.file import SceneImage

#: The most samples that a budget gives; it gives powers of two.
MAX_BUDGET_SAMPLES = 16
#: Clock of the device, hertz.
CLOCK = 200e6
#: Cycles of a traversal unit for a node, with its share of triangles.
_NODE = 4
#: Cycles of a column for a lookup of the environment, with the ray that it gathers and its light, and at least those of
#: its path over the contexts.
_LOOKUP, _PATH = 4, 400
#: Cycles of a march, and of each of its steps; the steps of a march from a mirror.
_MARCH, _STEP, _STEPS = 212, 10, 18


@dataclass(frozen=True)
class Budget:
    """What a budget gives.

    Attributes:
        samples: Of a pixel, a power of two.
        cycles: Estimate of the cycles of a pass.
        seconds: The budget.
    """

    samples: int
    cycles: int
    seconds: float

    @staticmethod
    def of(
        manifest: Manifest,
        image: SceneImage,
        registers: Mapping[str, int],
        seconds: float,
        passes: Callable[[int], int] = int,
    ) -> Budget:
        """Render a pass of a frame and estimate how many fit.

        Args:
            manifest: The design's manifest.
            image: What the device holds.
            registers: Of a pass in the middle of everything.
            seconds: The budget, at `CLOCK`.
            passes: Those of a frame of so many samples, with those of coats.
        """
        counters = model_frame(loaded_model(manifest, image), registers).counters
        cycles = estimated_cycles(manifest, counters, bool(registers.get("environment.isMapCamera", 1)))
        samples = MAX_BUDGET_SAMPLES
        while samples > 1 and passes(samples) * cycles > seconds * CLOCK:
            samples //= 2
        return Budget(samples, cycles, seconds)

    @property
    def note(self) -> str:
        """The line that names the number and where it comes from."""
        what = f"{self.samples} sample{'s' if self.samples > 1 else ''} a pixel"
        why = "within" if self.cycles <= self.seconds * CLOCK else "the least, beyond"
        return (
            f"{what}, {why} frame.budget = {self.seconds:.3g} s at {CLOCK / 1e6:.0f} MHz and about"
            f" {rounded(self.cycles):,} cycles a pass (--samples)"
        )


def rounded(cycles: int) -> int:
    """An estimate with two digits."""
    step = int(10 ** max(len(str(cycles)) - 2, 0))
    return (cycles + step // 2) // step * step


def estimated_cycles(manifest: Manifest, counters: Mapping[str, int], is_map_camera: bool) -> int:
    """Estimate the cycles of a pass that gathers light: those of traversal units, of lookups and of marches.

    Args:
        manifest: The design's manifest.
        counters: Of the pass; those that do not depend on timing.
        is_map_camera: The camera is that of the room's maps, so only reflections and refractions march.
    """
    array, units = manifest.config["array"], manifest.config["units"]
    columns, rows = int(array["columns"]), int(array["rows"])
    lookups, steps = counters.get("raysEnvironment", 0), counters.get("marchSteps", 0)
    marching = steps // _STEPS if is_map_camera else lookups
    work = max(_LOOKUP, _PATH / int(units["pathContexts"])) * lookups
    work += (_MARCH * marching + _STEP * steps) / int(units["marches"])
    return max(1, round(_NODE * counters["nodeReads"] / (rows * columns) + work / columns))
