"""Ways to a device in its AXI4 shell: UIO under Linux, and a LiteX server. `ShellDevice` is the same over all."""

from __future__ import annotations

import contextlib
import math
import mmap
import os
import select
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from colonnade.common.errors import UserError, reason_of
from colonnade.device.console import ConsoleGuard

#: Bytes of the shell's registers.
REGISTER_BYTES = 0x10000


class Transport(Protocol):
    """Accesses to the registers and the memory of a device.

    Attributes:
        base: Bus address of the memory that device and host may use, a multiple of 4096.
        size: Bytes of this memory.
        patience: Seconds after which a wait is given up, `math.inf` for a simulator.
    """

    base: int
    size: int
    patience: float

    def read32(self, address: int) -> int:
        """The word of a register, at a byte address from 0 to 0xFFFF."""

    def write32(self, address: int, value: int) -> None:
        """Write the word of a register. Accesses take effect in the order of the calls."""

    def wait(self) -> object:
        """Sleep until an interrupt, or for a while: a tenth of a second at most."""

    def store(self, address: int, data: bytes) -> None:
        """Write to the memory, at a bus address that is a multiple of 4."""

    def fetch(self, address: int, size: int) -> bytes:
        """Read from the memory, at a bus address that is a multiple of 4."""

    def close(self) -> None:
        """Release the way to the device; the device goes on."""


class UioTransport:
    """A device on this machine's bus, by the kernel's UIO: map 0 has the registers, map 1 memory for the device.

    docs/driver.md, "Linux", has the kernel's side. The memory is mapped uncached by ``uio_pdrv_genirq``. While a
    display shows it, the console does not draw there (`ConsoleGuard`).

    Args:
        path: Such as ``/dev/uio0``.
        sysfs: Where the kernel describes its UIO devices.
        page: Distance of the maps in the file, bytes.

    Raises:
        UserError: The device cannot be opened or lacks a map, or the console draws into its memory.
    """

    def __init__(
        self, path: str | Path, sysfs: str | Path = "/sys/class/uio", page: int = mmap.ALLOCATIONGRANULARITY
    ) -> None:
        maps = Path(sysfs) / Path(path).name / "maps"
        self.base, self.size = _number(maps / "map1" / "addr"), _number(maps / "map1" / "size")
        if _number(maps / "map0" / "size") < REGISTER_BYTES:
            raise UserError(f"map 0 of {path} is too small: the registers have {REGISTER_BYTES} bytes")
        self.patience = 10.0
        try:
            self._file = os.open(path, os.O_RDWR | os.O_SYNC)
        except OSError as error:
            raise UserError(f"{path} cannot be opened: {reason_of(error)}") from None
        try:
            self._registers = mmap.mmap(self._file, REGISTER_BYTES)
            self._memory = mmap.mmap(self._file, self.size, offset=page)
        except (OSError, ValueError) as error:
            os.close(self._file)
            raise UserError(f"{path} cannot be mapped: {error}") from None
        self._words = memoryview(self._registers).cast("I")
        self._has_interrupt = True
        self._console = ConsoleGuard(self.base, self.size)

    def read32(self, address: int) -> int:
        """See `Transport`."""
        return int(self._words[address // 4])

    def write32(self, address: int, value: int) -> None:
        """See `Transport`."""
        self._words[address // 4] = value

    def wait(self) -> None:
        """See `Transport`. The kernel has disabled the interrupt when it came: this enables it."""
        if self._has_interrupt:
            try:
                os.write(self._file, (1).to_bytes(4, "little"))
                if select.select([self._file], [], [], 0.1)[0]:
                    os.read(self._file, 4)
                return
            except OSError:  # the device tree names no interrupt
                self._has_interrupt = False
        time.sleep(0.001)

    def store(self, address: int, data: bytes) -> None:
        """See `Transport`."""
        self._memory[address - self.base : address - self.base + len(data)] = data

    def fetch(self, address: int, size: int) -> bytes:
        """See `Transport`."""
        return self._memory[address - self.base : address - self.base + size]

    def close(self) -> None:
        """See `Transport`."""
        self._console.close()
        with contextlib.suppress(OSError, BufferError):
            self._words.release()
            self._registers.close()
            self._memory.close()
            os.close(self._file)


class LitexClient(Protocol):
    """What `LitexTransport` needs of LiteX's ``RemoteClient``: words of 32 bits at bus addresses of the SoC."""

    def read(self, addr: int, length: int | None = None) -> int | Sequence[int]:
        """One word, or `length` consecutive ones."""

    def write(self, addr: int, datas: list[int]) -> object:
        """Write consecutive words."""


class LitexTransport:
    """A device in a LiteX SoC, through a bridge (UART, Ethernet, PCIe, JTAG) and ``litex_server``.

    Args:
        client: LiteX's ``RemoteClient``, open. Its own time-out reads as zeros unless ``raise_on_timeout`` is set.
        registers: Bus address of the device's registers, as `Colonnade.attach` has placed them.
        base: Bus address of memory that the SoC's software does not use, a multiple of 4096.
        size: Bytes of this memory.
    """

    #: Words of a packet.
    BURST = 128

    def __init__(self, client: LitexClient, registers: int, base: int, size: int) -> None:
        if base % mmap.PAGESIZE:
            raise UserError(f"the memory at {base:#x} begins at no multiple of {mmap.PAGESIZE}")
        self.base, self.size = base, size
        self.patience = 60.0
        self._client, self._origin = client, registers

    def read32(self, address: int) -> int:
        """See `Transport`."""
        return self._read(self._origin + address, 1)[0]

    def write32(self, address: int, value: int) -> None:
        """See `Transport`."""
        self._client.write(self._origin + address, [value])

    def wait(self) -> None:
        """See `Transport`. A bridge carries no interrupt."""
        time.sleep(0.001)

    def store(self, address: int, data: bytes) -> None:
        """See `Transport`."""
        words = memoryview(data + bytes(-len(data) % 4)).cast("I").tolist()
        for first in range(0, len(words), self.BURST):
            self._client.write(address + 4 * first, words[first : first + self.BURST])

    def fetch(self, address: int, size: int) -> bytes:
        """See `Transport`."""
        count = -(-size // 4)
        words: list[int] = []
        for first in range(0, count, self.BURST):
            words += self._read(address + 4 * first, min(self.BURST, count - first))
        return b"".join(word.to_bytes(4, "little") for word in words)[:size]

    def close(self) -> None:
        """See `Transport`. The client stays open."""

    def _read(self, address: int, count: int) -> list[int]:
        words = self._client.read(address, count)
        if isinstance(words, int) or len(words) != count:
            raise UserError(f"the LiteX server has not answered a read at {address:#x}: is the bridge open?")
        return [int(word) for word in words]


class PacedTransport:
    """A transport whose waits end after a time: what the driver is given.

    Attributes:
        deadline: `time.monotonic` of the end.
    """

    def __init__(self, transport: Transport) -> None:
        self.read32, self.write32 = transport.read32, transport.write32
        self._transport = transport
        self.deadline = math.inf

    def wait(self) -> None:
        """Sleep as the transport does.

        Raises:
            UserError: The time is over.
        """
        if time.monotonic() > self.deadline:
            raise UserError("the device has not answered in time: wait longer, or reset it")
        self._transport.wait()


def _number(path: Path) -> int:
    """A number of sysfs."""
    try:
        return int(path.read_text(), 0)
    except (OSError, ValueError) as error:
        why = reason_of(error) if isinstance(error, OSError) else str(error)
        raise UserError(f"{path} cannot be read, the device needs two maps: {why}") from None
