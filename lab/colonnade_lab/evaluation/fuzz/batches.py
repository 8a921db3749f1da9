"""Batches of rays, right and wrong ones, at a device for rays in its AXI4 shell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from colonnade.common.progress import Progress
from colonnade.design.generator import GeneratedDesign
from colonnade.device.shell_simulator import Bus
from colonnade.rays.scene import FAN, SENSOR
from colonnade.scene_image.device_image import device_image
from colonnade.scene_image.dram_image import PAGE_BYTES, dram_image

from colonnade_lab.evaluation.fuzz.bench import Planned, Result
from colonnade_lab.evaluation.fuzz.rays import (
    KNOWN,
    MAX_COUNT,
    MOST_RAYS,
    RESPONSE,
    RayBatch,
    RayScene,
    any_batch,
    any_floats,
    ray_bytes,
)
from colonnade_lab.evaluation.fuzz.shell import FuzzedShell, ShellBench, any_bus, differing

#: The memory: image, scene, and the window: what wrong batches may name, the ring, tags, and the rays
#: and hits of each batch of a case.
_MEMORY, _IMAGE, _SCENE = 1 << 20, 0x1000, 0x40000
_WINDOW, _WINDOW_END = 0x80000, 0xF0000
_RING, _RING_LOG, _TAGS, _AREAS = _WINDOW + 0x3000, 4, _WINDOW + 0x3800, _WINDOW + 0x4000
_RAY_BYTES, _HIT_BYTES = 32 * MOST_RAYS, 16 * MOST_RAYS
_MOST_BATCHES = 8

#: Addresses have so many bits.
_REACH = 1 << 40
_ERROR_BIT = 1 << 31
_FIELDS = ("rays", "hits", "done", "count", "mode", "origin")
#: Sums that are the model's.
_COUNTERS = ("rays", "raysRefused")

#: Of 1024 answers of the memory.
_ERRORS = (1, 20, 200, 1024)


@dataclass(frozen=True)
class PlacedBatch:
    """A batch in the ring, and what docs/rays.md says of it.

    Attributes:
        batch: Its words with their addresses, and the bytes of its place for rays.
        place: Where that is.
        hits: Of the model; None: no run, or it fails.
        fails: Its tag, if it has one, has the error bit.
    """

    batch: RayBatch
    place: int
    hits: bytes | None
    fails: bool

    @property
    def has_tag(self) -> bool:
        """Whether it has a place for a tag."""
        done = int(self.batch.words["done"])
        return done != 0 and done % 4 == 0 and _fits(done // 64 * 64, 64)

    @property
    def written(self) -> slice:
        """Bytes of hits that it may write."""
        words = self.batch.words
        if not _is_legal(words):
            return slice(0, 0)
        first, end = (
            min(max(at, _WINDOW), _WINDOW_END) for at in (int(words["hits"]), int(words["hits"]) + self.batch.size)
        )
        return slice(first, end)


@dataclass(frozen=True)
class PlannedBatches(Planned):
    """Batches that are in the ring together, and the legal one after them.

    Attributes:
        bus: The memory meanwhile.
        reset: Cycles after which a soft reset ends them; None: none.
        batches: The first ones.
        legal: The last one.
        counters: Sums of the model over the batches.
    """

    bus: Bus
    reset: int | None
    batches: tuple[PlacedBatch, ...]
    legal: PlacedBatch
    counters: dict[str, int]


class BatchBench(ShellBench[PlannedBatches]):
    """Batches of a device for rays."""

    kinds = ("rays", "batches", "bus")
    memory = _MEMORY

    def __init__(self, design: GeneratedDesign, progress: Progress) -> None:
        super().__init__(design, progress)
        self.scene = RayScene(design.manifest)

    def plan(self, seed: int, kind: str) -> PlannedBatches:
        """See `Bench`: legal batches; some with wrong fields; at a memory that fails, or ended by a soft reset."""
        random = np.random.default_rng(seed)
        hostility = {"rays": 0.0, "batches": 0.5, "bus": 0.2}[kind]
        changes, batches = [], []
        before = self.scene.counters()
        for number in range(int(random.integers(1, _MOST_BATCHES + 1))):
            placed, change = self._placed(random, number, hostility)
            batches.append(placed)
            changes.append(change)
        counters = {name: self.scene.counters()[name] - before[name] for name in _COUNTERS}
        reset = errors = None
        if kind == "bus" and random.random() < 0.5:
            reset = int(random.integers(200 if random.random() < 0.5 else 4000))
            changes.append(f"reset after {reset} cycles")
        elif kind == "bus":
            errors = int(random.choice(_ERRORS))
            changes.append(f"{errors} of 1024 answers are errors")
        bus = any_bus(random, errors or 0)
        legal, _ = self._placed(random, 0, 0.0)
        return PlannedBatches(seed, kind, "; ".join(changes), bus, reset, tuple(batches), legal, counters)

    def sums(self) -> dict[str, int]:
        """See `Bench`."""
        return {name: self._sums[name] for name in ("batches", "rays")}

    def _placed(self, random: np.random.Generator, number: int, hostility: float) -> tuple[PlacedBatch, str]:
        """A batch for a place, and its description."""
        batch, wrong = any_batch(random), []
        place = _AREAS + number * (_RAY_BYTES + _HIT_BYTES)
        words = batch.words
        words["rays"], words["hits"], words["done"] = place, place + _RAY_BYTES, _TAGS + 4 * number
        words["tag"] = random.integers(1 << 31)
        if random.random() < 0.05:
            words["done"] = 0
        if random.random() < hostility:
            names = [_FIELDS[int(random.integers(len(_FIELDS)))] for _ in range(int(random.integers(1, 4)))]
            for name in dict.fromkeys(names):
                words[name] = _wrong(random, name, words)
                wrong.append(f"{name} = {words[name]}")
        moved = int(words["rays"]) - place
        if moved and moved % 64 == 0 and _fits(place + moved, ray_bytes(words)):
            words["rays"] = _WINDOW_END  # what lies elsewhere in the window is not known
        rest = any_floats(random, _RAY_BYTES // 4).tobytes()
        batch = RayBatch(words, batch.rays + rest[len(batch.rays) :])
        hits, done = self.scene.answer(batch) if _is_legal(words) else None, int(words["done"])
        fits = _fits(int(words["rays"]), ray_bytes(words)) and _fits(int(words["hits"]), batch.size)
        fails = hits is None or not fits or (done != 0 and not _fits(done // 64 * 64, 64))
        change = f"{words['count']} rays of mode {int(words['mode']):#x}"
        return PlacedBatch(
            batch, place, None if fails else hits, fails
        ), f"{change} with {', '.join(wrong) or 'no fault'}"

    def _set_up(self, shell: FuzzedShell) -> None:
        """Load the records, and set all registers."""
        values = dict(self.scene.values)
        shell.load(_IMAGE, device_image(self.scene.image, self.manifest))
        if self.manifest.config["columnBvhMemory"]["cache"]:
            shell.transport.store(_SCENE, dram_image(self.scene.image, self.manifest))
            values |= {"dram.page": _SCENE // PAGE_BYTES, "control.invalidate": 1}
        window = {"rays.windowBase": _WINDOW, "rays.windowEnd": _WINDOW_END, "interrupt.enable": 0}
        shell.write(values | window | {"ring.base": _RING, "ring.sizeLog": _RING_LOG, "control.start": 1})

    def _run(self, shell: FuzzedShell, plan: PlannedBatches) -> Result:
        shell.transport.set_bus(plan.bus)
        found, outcome = self._batches(shell, plan.batches, plan.reset, plan.bus.errors > 0)
        if plan.kind == "rays":
            found += [
                f"counters.{name} {value} instead of {plan.counters[name]}"
                for name in _COUNTERS
                if (value := shell.read(f"counters.{name}")) != plan.counters[name]
            ]
        if plan.reset is None:
            shell.write({"control.start": 1})
        else:
            self._set_up(shell)
        shell.transport.set_bus(replace(plan.bus, errors=0))
        legal, _ = self._batches(shell, (plan.legal,), None, False)
        shell.write({"control.start": 1})
        return Result.of(outcome, found, legal)

    def _batches(
        self, shell: FuzzedShell, batches: Sequence[PlacedBatch], reset: int | None, has_errors: bool
    ) -> tuple[list[str], str]:
        """Run batches from the ring; what differs, and the outcome."""
        self._sums["batches"] += len(batches)
        self._sums["rays"] += sum(int(each.batch.words["count"]) for each in batches if each.hits is not None)
        head = shell.read("rays.head")
        for number, each in enumerate(batches):
            shell.transport.store(_RING + 64 * ((head + number) % (1 << _RING_LOG)), each.batch.words.tobytes())
            shell.transport.store(each.place, each.batch.rays)
        before = shell.content()
        tail = (head + len(batches)) % (1 << 16)
        for value in dict.fromkeys(((head + len(batches) // 2) % (1 << 16), tail)):
            shell.write({"rays.tail": value})
        if reset is not None:
            shell.transport.run(reset)
            shell.reset()
            return _changed(before, shell.content(), batches, may_end=True), "changed"
        shell.until_zero("status")
        found = []
        if (at := shell.read("rays.head")) != tail:
            found.append(f"rays.head {at} instead of {tail}")
        after, fails = shell.content(), any(each.fails for each in batches)
        errors = {name: shell.read(name) for name in shell.errors}
        if not has_errors and (errors["errors.batch"] != 0) != fails:
            found.append(f"errors.batch {errors['errors.batch']} of {'a wrong' if fails else 'no wrong'} batch")
        found += [f"{name} is set" for name, value in errors.items() if value and name != "errors.batch"]
        found += _changed(before, after, batches, has_errors=has_errors)
        if any(errors.values()):
            return found, "flagged"
        return found, "changed" if any(each.fails for each in batches) else "same"


def _changed(
    before: Any, after: Any, batches: Sequence[PlacedBatch], has_errors: bool = False, may_end: bool = False
) -> list[str]:
    """What memory has that docs/rays.md does not say.

    Args:
        before: The memory before the batches.
        after: And after them.
        batches: In their order.
        has_errors: The memory may have failed in any of them.
        may_end: A reset has ended them at any moment.
    """
    found, expected, opened = [], before.copy(), np.zeros(len(before), bool)
    for each in batches:
        tag, done, hits = int(each.batch.words["tag"]), int(each.batch.words["done"]), each.hits
        if each.has_tag:
            answered, old = (int(content[done : done + 4].view("<u4")[0]) for content in (after, before))
            wanted = tag | (_ERROR_BIT if each.fails else 0)
            if answered != wanted and not (
                (has_errors and answered in (old, tag | _ERROR_BIT)) or (may_end and answered == old)
            ):
                found.append(f"tag {answered:#x} instead of {wanted:#x}")
            if answered != wanted:
                hits = None
            opened[done : done + 4] = True
        elif has_errors or may_end:
            hits = None
        if hits is None:
            opened[each.written] = True
        else:
            expected[each.written] = np.frombuffer(hits, np.uint8)
    return found + differing(after, expected, opened, "memory")


def _is_legal(words: Any) -> bool:
    """The batch has runs, if it is not a wrong sensor's."""
    mode, addresses = int(words["mode"]), [int(words[name]) for name in ("rays", "hits", "done")]
    is_known = mode & RESPONSE != RESPONSE and mode & (FAN | SENSOR) != FAN | SENSOR and not mode & ~KNOWN
    is_aligned = (addresses[0] | addresses[1]) % 64 == 0 and addresses[2] % 4 == 0
    return is_known and is_aligned and max(addresses) < _REACH and 0 < int(words["count"]) <= MAX_COUNT


def _fits(first: int, size: int) -> bool:
    """All bursts of these bytes are in the window."""
    return first >= _WINDOW and first + -(-size // 64) * 64 <= _WINDOW_END


def _wrong(random: np.random.Generator, name: str, words: Any) -> Any:
    """A value that a field of a right batch should not have, or of limits and origin any."""
    if name == "origin":
        return random.integers(0, 1 << 32, 3, dtype=np.uint32).view(np.float32)
    if name == "count":
        return (0, MAX_COUNT + 1, 1 << 31, (1 << 32) - 1, int(random.integers(1, MOST_RAYS + 1)))[
            int(random.integers(5))
        ]
    if name == "mode":
        return int(words["mode"]) ^ 1 << int(random.integers(32))
    # Hits that leave the window at its end overwrite nothing of other batches
    places = (0, _IMAGE, _WINDOW - 64, _WINDOW_END, _MEMORY, _REACH - 64, _WINDOW_END - 64, _WINDOW_END - 4096)
    if random.random() < 0.5:
        return places[int(random.integers(len(places) - 2 * (name == "done")))]
    if random.random() < 0.5:
        return int(words[name]) + (1 << int(random.integers(40, 63)))
    return int(words[name]) + int(random.integers(1, 4 if name == "done" else 64))
