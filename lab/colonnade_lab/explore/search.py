"""A search for the Pareto front by Optuna, in batches, reproducible from its seed."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from colonnade.common.progress import QUIET, Progress

from colonnade_lab.explore.figures import Column
from colonnade_lab.explore.study import FieldValue, Search, value_text
from colonnade_lab.explore.study_file import StudyFile

_CONDITION = re.compile(r"\s*([\w.]+)\s*(>=|<=)\s*([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]{1,3})?)\s*")


def parse_condition(text: str) -> tuple[str, str, float] | None:
    """The figure, operator and number of a constraint; None if it is malformed."""
    match = _CONDITION.fullmatch(text)
    if match is None or not math.isfinite(float(match[3])):
        return None
    return match[1], match[2], float(match[3])


def check_search(file: StudyFile, columns: Sequence[Column]) -> None:
    """Refuse objectives, axes of plots and constraints that name no figure of the study.

    Raises:
        UserError: One is unknown, or a constraint is malformed.
    """
    search = file.study.search
    directed = [column.key for column in columns if column.better]
    where = ("search", "objectives") if search else ("objectives",)
    for name in search.objectives if search else file.study.objectives:
        if name not in directed:
            raise file.error((*where, name), f"no figure {name}; figures of this study: {', '.join(directed)}")
    drawn = [*(column.key for column in columns), *file.study.axes]
    for name in (name for pair in file.study.plots for name in pair):
        if name not in drawn:
            raise file.error(("plots", name), f"no figure {name}; figures and axes of this study: {', '.join(drawn)}")
    for text in search.constraints if search else ():
        condition = parse_condition(text)
        if condition is None:
            raise file.error(
                ("search", "constraints", text), f"{text} is not of the form figure >= number, e.g. psnr_min >= 50"
            )
        if condition[0] not in directed:
            raise file.error(
                ("search", "constraints", text),
                f"no figure {condition[0]}; figures of this study: {', '.join(directed)}",
            )


#: Evaluates points given by their values; the figures of each, or None for a failed one.
Evaluate = Callable[[Sequence[Mapping[str, FieldValue]]], Sequence[Mapping[str, float | None] | None]]


def search_front(
    file: StudyFile, columns: Sequence[Column], evaluate: Evaluate, progress: Progress = QUIET
) -> Iterator[int]:
    """Evaluate points chosen by a sampler, in batches; yields the number of points evaluated so far.

    The first batch begins with the first value of every axis, then the points of ``search.start``.
    A point that the sampler repeats is not counted again.
    The search ends with its budget, or when the sampler finds nothing new.
    """
    import optuna

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    search = file.study.search
    assert search is not None
    # More would propose points that the budget or the grid does not have
    batch = min(search.batch, search.budget, math.prod(len(values) for values in file.study.axes.values()))
    if batch < search.batch and search.batch != _DEFAULT_BATCH:
        progress.note(f"the search takes batches of {batch} points, not {search.batch:,}: it has no more to evaluate")
    signs = {column.key: -1.0 if column.better == "higher" else 1.0 for column in columns}
    study = optuna.create_study(directions=["minimize"] * len(search.objectives), sampler=_sampler(search, batch))
    for start in ({}, *search.start):
        study.enqueue_trial({key: axis.index(start.get(key, axis[0])) for key, axis in file.study.axes.items()})
    known: dict[tuple[str, ...], Mapping[str, float | None] | None] = {}
    idle = 0
    while len(known) < search.budget and idle < _IDLE_BATCHES:
        trials: list[tuple[Any, dict[str, FieldValue]]] = []
        fresh: list[dict[str, FieldValue]] = []
        new: set[tuple[str, ...]] = set()
        with progress.step("choosing points") as report:
            while len(trials) < batch:
                trial = study.ask()
                values = {
                    key: axis[trial.suggest_categorical(key, list(range(len(axis))))]
                    for key, axis in file.study.axes.items()
                }
                trials.append((trial, values))
                name = _name(values)
                if name not in known and name not in new and len(known) + len(fresh) < search.budget:
                    fresh.append(values)
                    new.add(name)
                report(len(trials) / batch)
        known |= dict(zip(map(_name, fresh), evaluate(fresh), strict=True))
        idle = 0 if fresh else idle + 1
        for trial, values in trials:
            found = known.get(_name(values))
            costs = [None if found is None else found.get(key) for key in search.objectives]
            if found is None or any(cost is None for cost in costs):
                study.tell(trial, state=optuna.trial.TrialState.FAIL)
                continue
            for text in search.constraints:
                trial.set_constraint(text, _violation(found, text))
            study.tell(
                trial, [signs[key] * float(cost or 0.0) for key, cost in zip(search.objectives, costs, strict=True)]
            )
        yield len(known)


_DEFAULT_BATCH = Search.__dataclass_fields__["batch"].default

#: Batches without a new point after which a search ends.
_IDLE_BATCHES = 10


def _sampler(search: Search, batch: int) -> Any:
    import optuna

    if search.sampler == "tpe":
        return optuna.samplers.TPESampler(seed=search.seed, n_startup_trials=batch)
    return optuna.samplers.NSGAIISampler(population_size=max(2, batch), seed=search.seed)


def _violation(figures: Mapping[str, float | None], text: str) -> float:
    """How far a point is from a constraint; 0 or less if it holds."""
    condition = parse_condition(text)
    assert condition is not None
    key, operator, bound = condition
    value = figures.get(key)
    if value is None:
        return float("inf")
    return bound - value if operator == ">=" else value - bound


def _name(values: Mapping[str, FieldValue]) -> tuple[str, ...]:
    return tuple(value_text(value) for value in values.values())
