"""Refits of meshes that bend, by the unit of the AXI4 shell: right and wrong ones (docs/bus-shell.md)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from colonnade.common.progress import Progress
from colonnade.design.generator import GeneratedDesign
from colonnade.device.shell_simulator import Bus

from colonnade_lab.evaluation.fuzz.bench import Planned, Result
from colonnade_lab.evaluation.fuzz.plans import (
    LINE_BYTES,
    LINE_VERTICES,
    RECORD_BYTES,
    BentMesh,
    Effect,
    any_plan,
    bent_meshes,
    effect_of,
    vertex_words,
)
from colonnade_lab.evaluation.fuzz.shell import FuzzedShell, ShellBench, any_bus, differing

_MEMORY = 1 << 18
#: Parts of the memory for plan, vertices and records, in any order. No refit reads or writes beyond its own.
_PART = _MEMORY // 4

#: Bits of `refit.errors`.
_ALIGNMENT, _RESPONSE, _PLAN = 1, 2, 4

#: Of 1024 answers of the memory.
_ERRORS = (1, 20, 200, 1024)


@dataclass(frozen=True)
class Refit:
    """A refit and what comes of it.

    Attributes:
        settings: Registers by name.
        plan: uint32 [e, 4].
        vertices: uint32 [v, 4], whole lines.
        records: Of the driver's C, uint8 [n, 32]; None: it is no refit of a mesh.
        result: Registers after it, by name; of a refit of a mesh alone.
        effect: What its plan does.
    """

    settings: dict[str, int]
    plan: Any
    vertices: Any
    records: Any
    result: Mapping[str, int]
    effect: Effect

    @property
    def is_aligned(self) -> bool:
        """It is not refused."""
        plan, vertices, records = (self.settings[f"refit.{name}"] for name in ("plan", "vertices", "records"))
        return (plan | vertices) % LINE_BYTES == 0 and records % RECORD_BYTES == 0


@dataclass(frozen=True)
class PlannedRefit(Planned):
    """A refit, and the legal one after it.

    Attributes:
        bus: The memory meanwhile.
        reset: Cycles after which a soft reset ends the first one; None: none.
        refit: The first one.
        legal: The one after it.
    """

    bus: Bus
    reset: int | None
    refit: Refit
    legal: Refit


class RefitBench(ShellBench[PlannedRefit]):
    """Refits by a shell with the unit."""

    kinds = ("vertices", "plans", "bus")
    memory = _MEMORY

    def __init__(self, design: GeneratedDesign, progress: Progress) -> None:
        super().__init__(design, progress)
        self.meshes = bent_meshes(design.manifest)

    def plan(self, seed: int, kind: str) -> PlannedRefit:
        """See `Bench`: a mesh of any vertices; any plan and registers; a memory that fails, or a soft reset."""
        random = np.random.default_rng(seed)
        reset, errors = None, 0
        if kind == "vertices" or (kind == "bus" and random.random() < 0.6):
            refit, change = self._legal(random)
        else:
            refit, change = self._any(random)
        if kind == "bus" and random.random() < 0.5:
            reset = int(random.integers(60 if random.random() < 0.5 else 3000))
            change += f"; reset after {reset} cycles"
        elif kind == "bus":
            errors = int(random.choice(_ERRORS))
            change += f"; {errors} of 1024 answers are errors"
        bus = any_bus(random, errors)
        return PlannedRefit(seed, kind, change, bus, reset, refit, self._legal(random)[0])

    def sums(self) -> dict[str, int]:
        """See `Bench`."""
        return {name: self._sums[name] for name in ("refits", "records")}

    def _legal(self, random: np.random.Generator) -> tuple[Refit, str]:
        """A refit of a mesh at a pose, near one, or of vertices anywhere in the grid, with any normals."""
        mesh = self.meshes[int(random.integers(len(self.meshes)))]
        vertices = mesh.posed(random.random())
        highest = (1 << int(self.manifest.config["geometry"]["vertexBits"])) - 1
        how = int(random.integers(4))
        if how:
            places = vertices[:, :3].astype(np.int64)
            reach = 1 << int(random.integers(1, highest.bit_length() + 1))
            if how == 1:
                places += random.integers(-reach, reach, places.shape)
            elif how == 2:
                places = random.integers(0, highest + 1, places.shape)
            else:
                places = random.choice((0, 1, highest - 1, highest), places.shape)
            limit = 1 << (self.manifest.layouts["triangle"].fields["body.normals[0].u"].width - 1)
            codes = random.integers(-limit, limit, (len(places), 2))
            vertices = vertex_words(np.clip(places, 0, highest), codes)
        count = len(mesh.records)
        root = int(random.integers((1 << self.manifest.layouts["node"].fields["first"].width) - count))
        records, bounds, flat = mesh.refitted(vertices, root, self.manifest)
        result = {f"refit.bounds[{i}]": value for i, value in enumerate(bounds)} | {"refit.flatPairs": flat}
        change = f"{len(mesh.plan)} entries, vertices {('of a pose', 'near a pose', 'anywhere', 'at the ends')[how]}"
        return self._placed(random, mesh, vertices, mesh.plan, root, records, result), change

    def _any(self, random: np.random.Generator) -> tuple[Refit, str]:
        """A refit of any plan, by registers of any values."""
        mesh = self.meshes[int(random.integers(len(self.meshes)))]
        lines, count = -(-len(mesh.posed(0.0)) // LINE_VERTICES), len(mesh.records)
        if random.random() < 0.5:
            lines, count = int(random.integers(0, lines + 1)), int(random.integers(0, count + 1))
        plan = any_plan(random, mesh, lines, count)
        vertices = random.integers(0, 1 << 32, (max(lines, 1) * LINE_VERTICES, 4), dtype=np.uint32)
        root = int(random.integers(1 << self.manifest.layouts["node"].fields["first"].width))
        refit = self._placed(random, mesh, vertices, plan, root)
        settings, changes = dict(refit.settings), [f"{len(plan)} entries of any plan"]
        settings |= {"refit.lines": lines, "refit.count": count}
        if random.random() < 0.3:
            changed = {
                "refit.root": int(random.integers(1 << 24)),
                "refit.entries": int(random.integers(len(plan) + 1)),
            }
            for name in ("plan", "vertices", "records"):
                changed[f"refit.{name}"] = settings[f"refit.{name}"] + int(random.choice((1, 4, 16, 32)))
            name = list(changed)[int(random.integers(len(changed)))]
            settings[name] = changed[name]
            changes.append(f"{name} = {changed[name]}")
        effect = effect_of(plan[: settings["refit.entries"]], lines, count, self.manifest)
        return replace(refit, settings=settings, effect=effect), ", ".join(changes)

    def _placed(
        self,
        random: np.random.Generator,
        mesh: BentMesh,
        vertices: Any,
        plan: Any,
        root: int,
        records: Any = None,
        result: Mapping[str, int] = MappingProxyType({}),
    ) -> Refit:
        """A refit at any places of the memory."""
        rest = -len(vertices) % LINE_VERTICES
        lines = np.concatenate([vertices, random.integers(0, 1 << 32, (rest, 4), dtype=np.uint32)])
        count = len(mesh.records)
        sizes = {"plan": plan.nbytes, "vertices": lines.nbytes, "records": count * RECORD_BYTES}
        settings = {"refit.entries": len(plan), "refit.lines": len(lines) // LINE_VERTICES}
        settings |= {"refit.count": count, "refit.root": root}
        for part, name in zip(random.permutation(4).tolist(), sizes, strict=False):
            unit = RECORD_BYTES if name == "records" else LINE_BYTES
            free = (_PART - sizes[name]) // unit - 2
            settings[f"refit.{name}"] = part * _PART + unit * int(random.integers(free))
        effect = effect_of(plan, settings["refit.lines"], count, self.manifest)
        return Refit(settings, plan, lines, records, result, effect)

    def _set_up(self, shell: FuzzedShell) -> None:
        shell.write({"interrupt.enable": 0})

    def _run(self, shell: FuzzedShell, plan: PlannedRefit) -> Result:
        shell.transport.set_bus(plan.bus)
        found, outcome = self._refit(shell, plan.refit, plan.reset, plan.bus.errors > 0)
        shell.transport.set_bus(replace(plan.bus, errors=0))
        legal, _ = self._refit(shell, plan.legal, None, False)
        return Result.of(outcome, found, legal)

    def _refit(self, shell: FuzzedShell, refit: Refit, reset: int | None, has_errors: bool) -> tuple[list[str], str]:
        """Run a refit; what differs, and the outcome."""
        settings, transport = refit.settings, shell.transport
        self._sums["refits"] += 1
        self._sums["records"] += 0 if refit.records is None else len(refit.effect.written)
        for name, words in (("plan", refit.plan), ("vertices", refit.vertices)):
            at = settings[f"refit.{name}"]
            transport.store(at - at % LINE_BYTES, words.tobytes())
        before = shell.content()
        shell.write({**settings, "refit.control": 1})
        if reset is not None:
            transport.run(reset)
            shell.reset()
        shell.until_zero("refit.status")
        events = shell.events()
        errors, after = shell.read("refit.errors"), shell.content()
        wanted = _ALIGNMENT if not refit.is_aligned else _PLAN if refit.effect.names_nothing else 0
        first, expected, opened = settings["refit.records"], before.copy(), np.zeros(len(before), bool)
        fails = has_errors and errors & _RESPONSE
        if fails and refit.is_aligned:
            # What it has read is not the plan
            opened[first : first + RECORD_BYTES * settings["refit.count"]] = True
            wanted, errors = _RESPONSE, errors & ~_PLAN
        elif refit.is_aligned:
            for record in refit.effect.written:
                of_record = slice(first + RECORD_BYTES * record, first + RECORD_BYTES * (record + 1))
                if reset is not None or refit.records is None:
                    opened[of_record] = True
                else:
                    expected[of_record] = refit.records[record]
        found = differing(after, expected, opened, "memory")
        if errors != (wanted if reset is None else 0):
            found.append(f"refit.errors {errors} instead of {wanted}")
        if reset is not None:
            return found, "changed"
        if events != {"refitDone"}:
            found.append(f"events {sorted(events)} instead of refitDone")
        if not errors:
            found += [
                f"{name} {value} instead of {wanted}"
                for name, wanted in refit.result.items()
                if (value := shell.read(name)) != wanted
            ]
        return found, "flagged" if errors else "changed" if refit.records is None else "same"
