"""Sums of the passes over a frame: the picture of several samples a pixel (docs/sampling.md)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from colonnade.common.framebuffer import Frame
from colonnade.common.image_io import encode_srgb

#: The device's numbers for the colour 1.0, the shadow ratio 1.0, and the photo's colour 1.0.
WHITE, UNSHADOWED, PHOTO_WHITE = 4095, 4096, 65535

#: The strength of a whole shadow.
WHOLE = 255

#: Weights of red, green and blue in the luminance (Rec. 709).
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])

#: A counter that is a level: the passes' maximum and not their sum.
_LEVEL = "deepestStack"


@dataclass(frozen=True)
class Accumulation:
    """Sums over the samples of each pixel. The device's are exact, so their order does not matter.

    The arrays are uint32 from the device, and float64 from the reference, or where they are blurred.

    Attributes:
        samples: Number of samples of a pixel.
        objects: Colours of the samples that show the object, [height, width, 3].
        background: Colours of the others, [height, width, 3].
        ratio: Shadow ratios of the others, [height, width, 3]; None without a room.
        coverage: Number of samples that show the object, int64 [height, width], or float64 where it is blurred.
        white: The number for the colour 1.0.
        unshadowed: The number for the shadow ratio 1.0.
    """

    samples: int
    objects: npt.NDArray[Any]
    background: npt.NDArray[Any]
    ratio: npt.NDArray[Any] | None
    coverage: npt.NDArray[Any]
    white: float
    unshadowed: float

    @staticmethod
    def of_frame(frame: Frame, white: float = WHITE) -> Accumulation:
        """One sample of each pixel from the device."""
        ratio = None if frame.ratio is None else frame.ratio.astype(np.uint32)
        return Accumulation.of_pixels(frame.colour.astype(np.uint32), frame.is_object, ratio, white, UNSHADOWED)

    @staticmethod
    def of_pixels(
        colour: npt.NDArray[Any],
        is_object: npt.NDArray[np.bool_],
        ratio: npt.NDArray[Any] | None,
        white: float = 1.0,
        unshadowed: float = 1.0,
    ) -> Accumulation:
        """One sample of each pixel."""
        # Products, which take a quarter of the time of `np.where`
        shows = is_object[..., None].astype(colour.dtype)
        objects = colour * shows
        return Accumulation(
            samples=1,
            objects=objects,
            background=colour - objects,
            ratio=None if ratio is None else ratio * (1 - shows),
            coverage=is_object.astype(np.int64),
            white=white,
            unshadowed=unshadowed,
        )

    def __add__(self, other: Accumulation) -> Accumulation:
        """The samples of both."""
        assert (self.white, self.unshadowed) == (other.white, other.unshadowed)
        ratio = None if self.ratio is None or other.ratio is None else self.ratio + other.ratio
        return replace(
            self,
            samples=self.samples + other.samples,
            objects=self.objects + other.objects,
            background=self.background + other.background,
            ratio=ratio,
            coverage=self.coverage + other.coverage,
        )

    def with_layers(self, layers: Iterable[Accumulation]) -> Accumulation:
        """With the object's colours of other layers on its own, as many samples of them as of itself."""
        return replace(self, objects=self.objects + sum(one.objects * (self.samples / one.samples) for one in layers))

    def pixels(self) -> npt.NDArray[np.uint8]:
        """`image` as 8-bit sRGB, uint8 [height, width, 3]; of a few whole numbers by a table, which is faster."""
        values = self.objects + self.background
        if values.dtype.kind == "f" or values.max() >= values.size:
            return encode_srgb(self.image())
        codes = encode_srgb((np.arange(values.max() + 1) / self.white / self.samples).clip(max=1.0))
        return np.asarray(codes[values])

    def same_as(self, other: Accumulation) -> npt.NDArray[np.bool_]:
        """The pixels whose sums are equal, bool [height, width]."""
        same = (self.objects == other.objects) & (self.background == other.background)
        if self.ratio is not None and other.ratio is not None:
            same &= self.ratio == other.ratio
        return np.asarray(same.all(axis=2) & (self.coverage == other.coverage))

    def image(self) -> npt.NDArray[np.float64]:
        """The mean colours, linear, float64 [height, width, 3]."""
        means = (self.objects + self.background) / self.white / self.samples
        return np.asarray(means.clip(max=1.0), dtype=np.float64)

    def before(self, sky: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """The object before a picture of everything else, linear; its samples that miss the object show that."""
        others = (self.samples - self.coverage)[..., None]
        return np.asarray(((self.objects / self.white + sky * others) / self.samples).clip(max=1.0))

    def over(
        self, photo: npt.NDArray[np.float64], strength: npt.NDArray[np.uint8] | None = None
    ) -> npt.NDArray[np.float64]:
        """The object over a photo of the background, with its shadow.

        Args:
            photo: Linear, float64 [height, width, 3].
            strength: Of the shadow, uint8 [height, width], `WHOLE` the whole one; None: it is whole everywhere.

        Returns:
            Linear colours, float64 [height, width, 3]. Each sample that does not show the object shows the photo, times
            its shadow ratio; on the device, rounded to 16 bits (`shadowed_photo`).
        """
        assert self.ratio is not None
        ratio, is_exact = self.ratio, self.unshadowed == UNSHADOWED
        if strength is not None:
            unshadowed = (self.samples - self.coverage)[..., None] * (UNSHADOWED if is_exact else self.unshadowed)
            ratio = weakened(ratio, strength, unshadowed, is_exact)
        background = shadowed_photo(photo, ratio) / PHOTO_WHITE if is_exact else photo * (ratio / self.unshadowed)
        return np.asarray(((self.objects / self.white + background) / self.samples).clip(max=1.0))


def weakened(
    ratio: npt.NDArray[Any], strength: npt.NDArray[np.uint8], unshadowed: npt.NDArray[Any] | int, is_exact: bool = True
) -> npt.NDArray[Any]:
    """Shadow ratios with a strength, as the AXI4 shell computes them (docs/bus-shell.md).

    Args:
        ratio: Shadow ratios, or sums of them, [height, width, 3].
        strength: Of the shadow, uint8 [height, width]; `WHOLE` is a whole one.
        unshadowed: The ratio without a shadow, or the sums of it, [height, width, 1].
        is_exact: Round to the nearest integer.
    """
    part = strength.astype(np.int64)[..., None]
    ratio = part * ratio + (WHOLE - part) * unshadowed
    return np.asarray((ratio + WHOLE // 2) // WHOLE if is_exact else ratio / WHOLE)


def shadowed_photo(photo: npt.NDArray[np.float64], ratio: npt.NDArray[Any]) -> npt.NDArray[np.int64]:
    """A photo times the device's shadow ratios, as the AXI4 shell computes it (docs/bus-shell.md).

    Args:
        photo: Linear, float64 [height, width, 3].
        ratio: Shadow ratios, or sums of them, [height, width, 3]; `UNSHADOWED` is 1.0.

    Returns:
        Linear colours, int64 [height, width, 3]; `PHOTO_WHITE` is 1.0.
    """
    linear = np.rint(photo * PHOTO_WHITE).astype(np.int64)
    return (linear * ratio.astype(np.int64) + UNSHADOWED // 2) // UNSHADOWED


@dataclass
class FramePasses:
    """The frames of a frame's passes, added one by one.

    Attributes:
        first: Frame of the first pass.
        sums: Sums over all passes.
        counters: Sums over all passes; of a level the maximum.
        errors: Error bits of any pass.
        has_squares: Keep `squares`, for the variances.
        squares: Sums over the squared luminance of the samples that show the object, of 1.0, and of the shadow ratios
            of the others, float64 [2, height, width].
        white: The device's number for the colour 1.0.
        albedo_of: The albedo that the frame of a pass of surfaces shows, given its number; None: `albedo` is not kept.
        albedo: Sums over all passes, float64 [height, width, 3].
        layers: The passes of other layers, by name; their counters and errors are also in the frame's.
    """

    first: Frame | None = None
    counters: dict[str, int] = field(default_factory=dict)
    errors: list[str] = field(default_factory=list)
    has_squares: bool = False
    squares: npt.NDArray[np.float64] | None = None
    white: float = WHITE
    albedo_of: Callable[[Frame, int], npt.NDArray[np.float64]] | None = None
    albedo: npt.NDArray[np.float64] | float = 0.0
    layers: dict[str, FramePasses] = field(default_factory=dict)
    _sums: Accumulation | None = None

    def add(self, frame: Frame, layer: str = "surface") -> None:
        """Add the frame of the next pass of a layer; the first one is of surfaces."""
        if layer != "surface":
            self.layers.setdefault(layer, FramePasses(has_squares=self.has_squares, white=self.white)).add(frame)
            self._count(frame)
            return
        if self.has_squares:
            ratio = np.zeros_like(frame.colour) if frame.ratio is None else frame.ratio
            light = np.stack([frame.colour / self.white, ratio / UNSHADOWED]) @ LUMINANCE
            squares = np.where([frame.is_object, ~frame.is_object], light, 0.0) ** 2
            self.squares = squares if self.squares is None else self.squares + squares
        if self.albedo_of is not None:
            self.albedo = self.albedo + self.albedo_of(frame, 0 if self.first is None else self.sums.samples)
        if self.first is None:
            self.first, self.counters, self.errors = frame, dict(frame.counters), list(frame.errors)
            return
        self._sums = self.sums + Accumulation.of_frame(frame, self.white)
        self._count(frame)

    def _count(self, frame: Frame) -> None:
        """Add the counters and errors of a further pass."""
        for name, value in frame.counters.items():
            before = self.counters[name]
            self.counters[name] = max(before, value) if name == _LEVEL else before + value
        self.errors += [error for error in frame.errors if error not in self.errors]

    @property
    def sums(self) -> Accumulation:
        """Sums over all passes; a single one's are made when they are needed."""
        assert self.first is not None
        if self._sums is None:
            self._sums = Accumulation.of_frame(self.first, self.white)
        return self._sums

    @property
    def whole(self) -> Accumulation:
        """`sums` with the other layers'."""
        return self.sums.with_layers(layer.sums for layer in self.layers.values())

    def object_variance(self) -> npt.NDArray[np.float64] | None:
        """The variance of the mean luminance of the object, float64 [height, width]; None of a single pass.

        A pixel with one sample of the object has the largest variance of all pixels.
        """
        return self._variance(0, self.sums.objects / self.white, self.sums.coverage)

    def ratio_variance(self) -> npt.NDArray[np.float64] | None:
        """As `object_variance`, of the luminance of the shadow ratios of samples that show a room."""
        sums = self.sums
        assert sums.ratio is not None
        return self._variance(1, sums.ratio / sums.unshadowed, sums.samples - sums.coverage)

    def _variance(
        self, which: int, total: npt.NDArray[Any], samples: npt.NDArray[Any]
    ) -> npt.NDArray[np.float64] | None:
        """The variance of the mean of a number of samples in each pixel."""
        assert self.squares is not None
        if self.sums.samples == 1:
            return None
        count = np.maximum(samples, 1)
        mean = total @ LUMINANCE / count
        variance = (self.squares[which] / count - mean**2).clip(min=0.0) / np.maximum(count - 1, 1)
        return np.asarray(np.where(samples == 1, variance.max(), variance))

    @property
    def frame(self) -> Frame:
        """The first pass's pixels, with the counters and errors of all passes."""
        assert self.first is not None
        return replace(self.first, counters=self.counters, errors=self.errors)
