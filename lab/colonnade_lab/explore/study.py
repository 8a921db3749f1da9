"""The schema of a study file; `study_file` reads it.

A study names hardware configurations, the frames that they render, and what is measured. All keys and defaults are the
fields of `Study`; an unknown key is refused.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import field
from typing import Annotated, Any, Literal

from annotated_types import Ge, Gt, Interval, Le, MinLen
from colonnade.common.errors import UserError
from colonnade.common.frame_size import parse_size
from colonnade.common.limits import MAX_DESIGNS
from colonnade.common.terminal_text import one_line
from pydantic import AfterValidator, BeforeValidator, ConfigDict, PlainValidator, Strict, StrictBool
from pydantic.dataclasses import dataclass

from colonnade_lab.explore.norm import Norm
from colonnade_lab.explore.render_index import Norms

#: The fastest clock for power, MHz.
MAX_CLOCK = 1e6

_STRICT = ConfigDict(extra="forbid")


def _field_value(value: Any) -> Any:
    """Refuse what is no value of a configuration field."""
    if isinstance(value, bool | int | str):
        return value
    if isinstance(value, float) and math.isfinite(value):
        return value
    if isinstance(value, dict):
        return value
    raise ValueError(f"must be a number, true or false, text in quotes, or a table, not {quoted(value)}")


def _frame_size(value: Any) -> Any:
    """The size of a frame: ``[96, 72]``, or ``"96x72"`` as on the command line."""
    try:
        return parse_size(value) if isinstance(value, str) else value
    except UserError as error:
        raise ValueError(str(error)) from None


#: A value of a configuration field: a number, a Boolean, text such as a precision, or a whole section.
FieldValue = Annotated[bool | int | float | str | dict[str, Any] | None, PlainValidator(_field_value)]

#: The way in which the axes combine.
Combination = Literal["grid", "one-by-one", "list", "search"]

_Count = Annotated[int, Strict(), Ge(1)]
_Names = tuple[Annotated[str, MinLen(1)], ...]
_Size = Annotated[tuple[_Count, _Count], BeforeValidator(_frame_size)]


@dataclass(frozen=True, config=_STRICT)
class Design:
    """The configuration that every point starts from.

    Attributes:
        config: Preset, or precision in the paper's notation. A JSON file is relative to the study.
        set: Changes to it, ``key.path=value``.
    """

    config: str = "small"
    set: _Names = ()


@dataclass(frozen=True, config=_STRICT)
class NamedPoint:
    """A point beside the axes'.

    Attributes:
        name: Its name in tables and plots.
        set: Fields and their values.
        children: Most children of a node of the packer's tree.
    """

    name: Annotated[str, MinLen(1)]
    set: Mapping[str, FieldValue] = field(default_factory=dict)
    children: Literal[2, 4] = 4


@dataclass(frozen=True, config=_STRICT)
class Workload:
    """The frames: each scene with each mesh.

    Attributes:
        scenes: Scene files, relative to the study.
        meshes: Names or files; empty: the mesh of each scene.
        size: Width and height in pixels, ``[640, 480]`` or ``"640x480"``.
        reduce: Frames of meshes with at most so many triangles, each in place of the mesh itself.
    """

    scenes: Annotated[_Names, MinLen(1)]
    meshes: _Names = ()
    reduce: tuple[_Count, ...] = ()
    size: _Size = (640, 480)


@dataclass(frozen=True, config=_STRICT)
class Quality:
    """Pictures of the bit-exact model, compared with Embree's and with the baseline's.

    Attributes:
        dists: Measure DISTS, whose weights are a download of 64 MB.
    """

    dists: StrictBool = True


@dataclass(frozen=True, config=_STRICT)
class Tests:
    """Box tests, triangle tests and node reads of the bit-exact model, and the records of the scene.

    Attributes:
        same_pictures: The pictures of each point with the baseline's `children` must equal the baseline's.
    """

    same_pictures: StrictBool = False


@dataclass(frozen=True, config=_STRICT)
class Cycles:
    """Cycles of frames.

    Attributes:
        meshes: Meshes of the workload; empty: all.
        backend: The cycle model, or the RTL in a simulator. The RTL takes designs that the model does not know.
        check: Of the model: the RTL counts a frame of the first and of the last point, too. They are those of a
            search's `start`.
    """

    meshes: _Names = ()
    backend: Literal["rtl", "model"] = "model"
    check: StrictBool = True


@dataclass(frozen=True, config=_STRICT)
class Area:
    """Gates, memories and timing paths, with each library."""


@dataclass(frozen=True, config=_STRICT)
class Power:
    """Gate-level power of one row, with each library.

    Attributes:
        meshes: Meshes of the workload; empty: all.
        size: Width and height of the frame, pixels; without it one that the window replays completely.
        cycles: Cycles to replay on the gates, at most.
        clock: MHz.
    """

    meshes: _Names = ()
    size: _Size | None = None
    cycles: _Count = 4000
    clock: Annotated[float, Gt(0), Le(MAX_CLOCK)] = 200.0


def _norm_at(x: float) -> AfterValidator:
    """Refuses text that is no norm, or has no positive value for the baseline."""

    def checked(text: str) -> str:
        if not Norm(text)(x) > 0:
            raise ValueError(f"the norm {text!r} has no value above 0 for the baseline, x = {x:g}")
        return text

    return AfterValidator(checked)


@dataclass(frozen=True, config=_STRICT)
class RenderIndex:
    """Norms of the RenderIndex, expressions of ``x``: `colonnade_lab.explore.norm`.

    Attributes:
        loss: Of the DISTS loss, %.
        power: Of the energy per ray, over the baseline's.
        area: Of the area, over the baseline's.
    """

    loss: Annotated[str, _norm_at(0.0)] = Norms().loss.text
    power: Annotated[str, _norm_at(1.0)] = Norms().power.text
    area: Annotated[str, _norm_at(1.0)] = Norms().area.text

    @property
    def norms(self) -> Norms:
        """The norms as functions."""
        return Norms(Norm(self.loss), Norm(self.power), Norm(self.area))


@dataclass(frozen=True, config=_STRICT)
class Search:
    """A search for the Pareto front over the axes.

    Attributes:
        budget: Points to evaluate, at most.
        objectives: Figures to minimise or maximise, as they are better.
        constraints: Conditions ``figure >= number`` or ``figure <= number``.
        sampler: ``nsga2`` or ``tpe`` of Optuna.
        batch: Points to evaluate before the sampler learns from them: the population of ``nsga2``.
        seed: Seed of the sampler: the same study gives the same points.
        start: Values of axes that the search begins with, after the first value of every axis. An axis that one of them
            leaves out has its first value.
    """

    budget: Annotated[int, Strict(), Interval(ge=1, le=MAX_DESIGNS)]
    objectives: Annotated[_Names, MinLen(2)]
    constraints: _Names = ()
    sampler: Literal["nsga2", "tpe"] = "nsga2"
    batch: _Count = 8
    seed: Annotated[int, Strict(), Interval(ge=0, le=2**32 - 1)] = 1
    start: tuple[dict[str, FieldValue], ...] = ()


@dataclass(frozen=True, config=_STRICT)
class Study:
    """A study.

    Attributes:
        title, description: Text for the report.
        combine: ``grid``: all combinations of the axes; ``one-by-one``: each value of each axis alone, after the
            unchanged design; ``list``: the named points only; ``search``: points that a search chooses.
        baseline: Name of the point that the others are compared with.
        libraries: Names of standard-cell libraries, whose files the command line gives; empty: Yosys's generic gates.
        objectives: Figures whose Pareto front is reported.
        plots: Pairs of figures or axes that are drawn beside the objectives', each horizontal, then vertical.
        render_index: Norms of the RenderIndex.
        quality, tests, cycles, area, power: The measures; one without a table is not taken.
        design: The configuration that every point starts from.
        axes: Values of configuration fields.
        point: Points beside the axes'.
        workload: The frames.
        search: The search, for ``combine = "search"``.
    """

    title: str
    workload: Workload
    description: str = ""
    combine: Combination = "grid"
    baseline: str | None = None
    libraries: _Names = ()
    objectives: _Names = ()
    plots: tuple[tuple[Annotated[str, MinLen(1)], Annotated[str, MinLen(1)]], ...] = ()
    render_index: RenderIndex = field(default_factory=RenderIndex)
    design: Design = field(default_factory=Design)
    axes: Mapping[str, Annotated[tuple[FieldValue, ...], MinLen(1)]] = field(default_factory=dict)
    point: tuple[NamedPoint, ...] = ()
    quality: Quality | None = None
    tests: Tests | None = None
    cycles: Cycles | None = None
    area: Area | None = None
    power: Power | None = None
    search: Search | None = None

    def __post_init__(self) -> None:
        problem = self._problem()
        if problem is not None:
            raise ValueError(problem)

    def _problem(self) -> str | None:
        """What contradicts itself; None if nothing does."""
        if (self.combine == "search") != (self.search is not None):
            return 'combine: a search needs combine = "search" and a table [search]'
        if self.combine == "list" and (self.axes or not self.point):
            return "combine: a list has [[point]] tables and no [axes]"
        if self.combine != "list" and not self.axes:
            return 'combine: no [axes]; use combine = "list" for [[point]] tables alone'
        if not any((self.quality, self.tests, self.cycles, self.area, self.power)):
            return "nothing is measured: give [quality], [tests], [cycles], [area] or [power]"
        if self.workload.reduce and not self.workload.meshes:
            return "workload.reduce: the meshes of scenes stay as they are: name workload.meshes"
        if self.tests is not None and self.tests.same_pictures and self.baseline is None:
            return 'tests.same_pictures: the same as which point: give baseline = "NAME"'
        for key, names in (("libraries", self.libraries), ("objectives", self.objectives)):
            twice = [name for name, count in Counter(names).items() if count > 1]
            if twice:
                return f"{key}: {twice[0]} is named twice"
        if self.search is not None and len(self.search.start) >= self.search.budget:
            return "search.start: the budget ends before these points and the first one: give fewer, or a larger budget"
        for values in self.search.start if self.search else ():
            for key, value in values.items():
                if value not in self.axes.get(key, ()):
                    return f"search.start: {key} = {value_text(value)} is not a value of the axes"
        if self.power is not None and not self.libraries:
            return 'power: the gates need a library: give libraries = ["NAME"]'
        for name, part in (("cycles", self.cycles), ("power", self.power)):
            unknown = [mesh for mesh in (part.meshes if part else ()) if mesh not in self.workload.meshes]
            if unknown:
                return f"{name}.meshes: {unknown[0]} is not in workload.meshes"
        return None


def value_text(value: FieldValue) -> str:
    """A value as ``--set`` takes it."""
    return value if isinstance(value, str) else json.dumps(value)


def quoted(value: Any) -> str:
    """A value in a message."""
    text = json.dumps(value, ensure_ascii=False, default=str)
    return one_line(text if len(text) <= _MAX_QUOTED else f"{text[:_MAX_QUOTED]}…")


#: Characters of a value in a message.
_MAX_QUOTED = 60
