"""What differs between a frame of the hardware and one of the model, error bits included."""

from __future__ import annotations

from colonnade.common.framebuffer import Frame
from colonnade.evaluation.fuzz.simulator import Delivered


def differences(delivered: Delivered, model: Frame) -> list[str]:
    """In words; empty if they are equal.

    A frame that the watchdog ended was cut at a moment that depends on timing: both must be, nothing else is compared.
    """
    rtl = delivered.frame
    if "watchdog" in rtl.errors or "watchdog" in model.errors:
        return [] if "watchdog" in rtl.errors and "watchdog" in model.errors else [_errors(rtl, model)]
    found = []
    if rtl.errors != model.errors:
        found.append(_errors(rtl, model))
    if delivered.missing:
        found.append(f"{delivered.missing} pixels missing")
    planes = {
        "colours": (rtl.colour != model.colour).any(axis=2),
        "objects": rtl.is_object != model.is_object,
        "triangles": rtl.triangle != model.triangle,
        "distances": (rtl.distance != model.distance) & model.is_object,
    }
    if rtl.ratio is not None and model.ratio is not None:
        planes["ratios"] = (rtl.ratio != model.ratio).any(axis=2)
    found += [f"{int(plane.sum())} {name}" for name, plane in planes.items() if plane.any()]
    found += [
        f"{name} {rtl.counters[name]} instead of {value}"
        for name, value in model.counters.items()
        if rtl.counters[name] != value
    ]
    return found


def _errors(rtl: Frame, model: Frame) -> str:
    return f"errors {', '.join(rtl.errors) or 'none'} instead of {', '.join(model.errors) or 'none'}"
