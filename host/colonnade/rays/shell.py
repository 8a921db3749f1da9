"""A device for rays in its AXI4 shell, simulated or on a board, as a backend of `colonnade.rays.Scene`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from colonnade.common.arguments import checked
from colonnade.common.errors import UserError
from colonnade.design.generator import GeneratedDesign
from colonnade.device.shell_base import Shell
from colonnade.device.transport import Transport
from colonnade.rays.device import RayBackend, registers_text
from colonnade.rays.recorded import RayRecords
from colonnade.scene_image.dram_image import PAGE_BYTES

#: The ring has 2^SIZE_LOG slots, of which all but one take batches; tags lie behind it.
_SIZE_LOG, _BATCH_BYTES, _TAG_BYTES = 4, 64, 4
_WORDS = {"rays": 0, "hits": 8, "done": 48}


class RayShell(Shell, RayBackend):
    """A device for rays, by the driver in C (driver/src/colonnade_batches.c) over a transport.

    Records lie at the beginning of the memory; behind them are the ring of batches, their tags, rays and hits.

    Args:
        transport: The way to it; closed with the device, and if this fails.
        design: Its design with the shell, and `queries`.

    Raises:
        UserError: There is no device, or one of another design; of any call: the memory is too small.
    """

    @checked
    def __init__(self, transport: Transport, design: GeneratedDesign) -> None:
        from colonnade import _core

        Shell.__init__(self, transport, design)
        self._registers = _core.RayRegisters(registers_text(design.manifest.registers))
        if not self._design.numbers["rays_tail"]:
            transport.close()
            self._check("noRays")
        self.close = transport.close

    def load(self, values: Mapping[str, int], records: bytes, count: int) -> None:
        """See `RayBackend`."""
        self._registers.keep_sums(self._word)
        self._ring = self._loaded(RayRecords(np.frombuffer(records, np.uint8).reshape(count, -1)))
        self._require_memory("the ring of batches", self._ring, PAGE_BYTES)
        low, high, base = (
            [values[f"{name}.{axis}"] for axis in "xyz"] for name in ("bounds.low", "bounds.high", "placement.base")
        )
        scale = values["placement.mantissa"], values["placement.exponent"]
        self._check(self._driver.set_rays(low, high, count, *scale, base))
        end = self.transport.base + self.transport.size
        self._check(self._driver.open_ring(self._ring, _SIZE_LOG, (self._ring, end // _BATCH_BYTES * _BATCH_BYTES)))

    def submit(self, batch: bytes, rays: bytes, size: int) -> tuple[int, bytes]:
        """See `RayBackend`."""
        (answer,) = self.run([(batch, rays, size)])
        return answer

    def run(self, batches: Sequence[tuple[bytes, bytes, int]]) -> list[tuple[int, bytes]]:
        """Hand over batches one after the other, without waiting for their ends; what `submit` returns for each."""
        if len(batches) >= 1 << _SIZE_LOG:
            raise UserError(f"there are {len(batches)} batches: hand over {(1 << _SIZE_LOG) - 1} at most")
        free, tags = self._ring + PAGE_BYTES, self._ring + (_BATCH_BYTES << _SIZE_LOG)
        slots = []
        self._begin(None)
        for number, (batch, rays, size) in enumerate(batches):
            words = {"rays": free, "hits": self._stored("the rays", free, rays), "done": tags + _TAG_BYTES * number}
            free = words["hits"] + -(-size // PAGE_BYTES) * PAGE_BYTES
            self._require_memory("the hits", words["hits"], free - words["hits"])
            for name, at in _WORDS.items():
                batch = batch[:at] + words[name].to_bytes(8, "little") + batch[at + 8 :]
            error, slot = self._driver.next_batch()
            self._check(error)
            self.transport.store(slot, batch)
            self._check(self._driver.submit())
            slots.append((words["done"], words["hits"], size))
        self._check(self._driver.wait_batches())
        return [
            (int.from_bytes(self.transport.fetch(done, _TAG_BYTES), "little"), self.transport.fetch(hits, size))
            for done, hits, size in slots
        ]

    def counters(self) -> dict[str, int]:
        """See `RayBackend`."""
        sums: dict[str, int] = self._registers.sums(self._word)
        return sums

    def _word(self, address: int) -> int:
        return self.transport.read32(self._table.device.base + 4 * address)
