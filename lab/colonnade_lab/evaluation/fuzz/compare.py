"""Differences between a frame of the RTL and one of the model, including error bits."""

from __future__ import annotations

from colonnade.common.framebuffer import Frame

from colonnade_lab.evaluation.fuzz.simulator import SimulatedFrame


def differences(simulated: SimulatedFrame, model: Frame) -> list[str]:
    """A description of each difference.

    The watchdog aborts a frame at a time that the model does not know. So if one frame has its error bit, the other
    one must have it too, and nothing else is compared.
    """
    rtl = simulated.frame
    if "watchdog" in rtl.errors or "watchdog" in model.errors:
        return [] if "watchdog" in rtl.errors and "watchdog" in model.errors else [_errors(rtl, model)]
    found = []
    if rtl.errors != model.errors:
        found.append(_errors(rtl, model))
    if simulated.missing:
        found.append(f"{simulated.missing} pixels missing")
    planes = {
        "colours": (rtl.colour != model.colour).any(axis=2),
        "objects": rtl.is_object != model.is_object,
        "triangles": rtl.triangle != model.triangle,
        "instances": rtl.instance != model.instance,
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
