"""The samples of a frame that gathers light, by a budget of the device's time (docs/sampling.md, "Budget").

The cycle model counts a pass, whatever renders the frame. So a scene and a configuration always give the same number.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from colonnade.common.errors import UserError
from colonnade.design.manifest import Manifest
from colonnade.device.cycle_model import NotedFrame
from colonnade.scene_image.file import SceneImage

#: The most samples that a budget gives; it gives powers of two.
MAX_BUDGET_SAMPLES = 16
#: Clock of the device, hertz.
CLOCK = 200e6


@dataclass(frozen=True)
class Budget:
    """What a budget gives.

    Attributes:
        samples: Of a pixel, a power of two.
        cycles: The cycles of a pass; None for a design that the cycle model does not know.
        seconds: The budget.
    """

    samples: int
    cycles: int | None
    seconds: float

    @staticmethod
    def of(
        manifest: Manifest,
        image: SceneImage,
        registers: Mapping[str, int],
        seconds: float,
        passes: Callable[[int], int] = int,
    ) -> Budget:
        """Count the cycles of a pass of a frame, and how many passes fit.

        Args:
            manifest: The design's manifest.
            image: What the device holds.
            registers: Of a pass in the middle of everything.
            seconds: The budget, at `CLOCK`.
            passes: Passes of a frame of so many samples, with passes of coats.
        """
        try:
            cycles = NotedFrame.of(manifest, image, registers).cycles(manifest)["cycles"]
        except UserError:
            return Budget(1, None, seconds)
        samples = MAX_BUDGET_SAMPLES
        while samples > 1 and passes(samples) * cycles > seconds * CLOCK:
            samples //= 2
        return Budget(samples, cycles, seconds)

    @property
    def note(self) -> str:
        """The line that names the number and where it comes from."""
        what = f"{self.samples} sample{'s' if self.samples > 1 else ''} a pixel"
        if self.cycles is None:
            return f"{what}: no frame.budget for this design, which the cycle model does not know (--samples)"
        why = "within" if self.cycles <= self.seconds * CLOCK else "the least, beyond"
        return (
            f"{what}, {why} frame.budget = {self.seconds:.3g} s at {CLOCK / 1e6:.0f} MHz and about"
            f" {rounded(self.cycles):,} cycles a pass (--samples)"
        )


def rounded(cycles: int) -> int:
    """An estimate with two digits."""
    step = int(10 ** max(len(str(cycles)) - 2, 0))
    return (cycles + step // 2) // step * step
