"""Linux in QEMU, and beside it a Verilated shell whose memory is QEMU's.

QEMU's memory is a file, which is also the memory behind the shell. QEMU does not trap accesses to the registers, so
they are words of this memory, and a doorbell says which one a program has read or written (doorbell.c). The shell's
interrupt goes to the interrupt controller by QEMU's test protocol.
"""

from __future__ import annotations

import json
import mmap
import os
import socket
import subprocess
import time
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from colonnade.common import processes
from colonnade.common.temporary import temporary_folder
from colonnade.design.generator import GeneratedDesign
from colonnade.device.shell_simulator import SharedMemory, SimulatedTransport
from numpy.typing import NDArray

#: The machine `virt`: where its memory begins, and what Linux may use of it; the registers are behind that.
RAM, LINUX_BYTES, RAM_BYTES = 0x4000_0000, 512 << 20, 528 << 20
REGISTERS, REGISTER_BYTES, PIXELS = 0x6000_0000, 0x10000, 0x5F00_0000
#: The device's shared peripheral interrupt.
INTERRUPT = 112
#: The register space's last word, and what is added to the address of a write in it (doorbell.c).
DOORBELL, WRITE = 0xFFFC, 2
#: Cycles that the device runs between looks at the doorbell: few after an access, twice as many each time without.
LEAST_CYCLES, MOST_CYCLES = 64, 1 << 16
#: Of host time, for all of it.
SECONDS = 3600

QEMU = "qemu-system-aarch64"
MACHINE = ("-cpu", "cortex-a57", "-m", str(RAM_BYTES >> 20), "-nic", "none", "-display", "none")
#: After a panic the machine resets, which ends QEMU.
COMMAND_LINE = f"console=ttyAMA0 mem={LINUX_BYTES >> 20}M panic=-1"


def fail(why: str) -> NoReturn:
    """End with status 1."""
    raise SystemExit(f"linux: {why}")


def board(registers: Path, folder: Path) -> Path:
    """The device tree: QEMU's own, the generated nodes in its root, and the interrupt in the board's cells."""
    subprocess.run([QEMU, "-machine", f"virt,dumpdtb={folder}/virt.dtb", *MACHINE], check=True, capture_output=True)
    command = ["dtc", "-q", "-I", "dtb", "-O", "dts", str(folder / "virt.dtb")]
    machine = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    nodes = (registers / "colonnade.dtsi").read_text()
    interrupt = f"colonnade@{REGISTERS:x} {{ interrupts = <0 {INTERRUPT} 4>; }};"
    (folder / "board.dts").write_text(f"{machine}\n/ {{\n{nodes}\n{interrupt}\n}};\n")
    subprocess.run(["dtc", "-q", "-o", folder / "board.dtb", folder / "board.dts"], check=True)
    return folder / "board.dtb"


class Emulator:
    """QEMU, and two of its protocols: QMP, and the test protocol, which sets inputs of the interrupt controller."""

    def __init__(self, stack: ExitStack, folder: Path, arguments: list[str]) -> None:
        listeners = [self._listener(stack, folder / name) for name in ("qmp", "qtest")]
        ways = ["-qmp", f"unix:{folder}/qmp", "-qtest", f"unix:{folder}/qtest", "-qtest-log", "none"]
        self.program = stack.enter_context(
            processes.started([QEMU, "-machine", "virt,memory-backend=ram", *MACHINE, *arguments, *ways])
        )
        qmp, self._test = (self._stream(stack, listener) for listener in listeners)
        qmp.readline()
        self._say(qmp, '{"execute": "qmp_capabilities"}')
        answer = self._say(qmp, '{"execute": "qom-list", "arguments": {"path": "/machine/unattached"}}')
        (name,) = (each["name"] for each in json.loads(answer)["return"] if each["type"] == "child<arm_gic>")
        self._controller = f"/machine/unattached/{name}"
        self._level = False

    def interrupt(self, level: bool) -> bool:
        """Drive the wire; whether it rises."""
        rises = level and not self._level
        if level != self._level:
            self._say(self._test, f"set_irq_in {self._controller} unnamed-gpio-in {INTERRUPT} {int(level)}")
            self._level = level
        return rises

    @staticmethod
    def _listener(stack: ExitStack, path: Path) -> socket.socket:
        listener = stack.enter_context(socket.socket(socket.AF_UNIX))
        listener.bind(str(path))
        listener.listen()
        listener.settimeout(60)
        return listener

    @staticmethod
    def _stream(stack: ExitStack, listener: socket.socket) -> Any:
        connection = stack.enter_context(listener.accept()[0])
        return stack.enter_context(connection.makefile("rw"))

    @staticmethod
    def _say(stream: Any, line: str) -> str:
        """The answer to a line; events and empty lines are not."""
        stream.write(f"{line}\n")
        stream.flush()
        while (answer := stream.readline()).strip() == "" or '"event"' in answer:
            if not answer:
                fail("QEMU has ended")
        return str(answer)


@dataclass
class Display:
    """The memory of the display.

    Attributes:
        width: Pixels.
        height: Lines.
        stride: Bytes of a line.
    """

    width: int
    height: int
    stride: int

    @property
    def size(self) -> int:
        """Bytes of all lines, in whole pages of Linux."""
        return -(-self.stride * self.height // 4096) * 4096

    def content(self, memory: mmap.mmap) -> bytes:
        """Its bytes in the machine's memory."""
        return memory[PIXELS - RAM : PIXELS - RAM + self.size]

    def pixels(self, content: bytes) -> NDArray[np.uint8]:
        """Lines of XRGB8888 without what is behind their last pixels, shape (height, 4 · width)."""
        lines = np.frombuffer(content, np.uint8, self.stride * self.height).reshape(self.height, self.stride)
        return lines[:, : 4 * self.width]

    def colours(self, content: bytes) -> NDArray[np.uint8]:
        """RGB, shape (height, width, 3)."""
        return self.pixels(content).reshape(self.height, self.width, 4)[:, :, 2::-1]


@dataclass
class Run:
    """What the display had at the first access to the device, at each of its interrupts, and at the end."""

    console: bytes = b""
    interrupts: list[bytes] = field(default_factory=list)
    end: bytes = b""


def boot(kernel: Path, output: Path, design: GeneratedDesign, display: Display) -> Run:
    """Let Linux and the device run until the machine is off; `output` receives the console's log."""
    with ExitStack() as stack:
        folder = stack.enter_context(temporary_folder())
        file = folder / "memory"
        file.write_bytes(b"")
        os.truncate(file, RAM_BYTES)
        stream = stack.enter_context(file.open("r+b"))
        memory = stack.enter_context(mmap.mmap(stream.fileno(), RAM_BYTES))
        device = SimulatedTransport(design, RAM_BYTES, shared=SharedMemory(file, RAM))
        stack.callback(device.close)
        arguments = ["-object", f"memory-backend-file,id=ram,size={RAM_BYTES},mem-path={file},share=on"]
        arguments += ["-kernel", str(kernel), "-initrd", str(output / "initramfs"), "-append", COMMAND_LINE]
        arguments += ["-dtb", str(board(output / "registers", folder)), "-serial", f"file:{output}/console.log"]
        return run(Emulator(stack, folder, [*arguments, "-no-reboot"]), device, memory, display)


def run(emulator: Emulator, device: SimulatedTransport, memory: mmap.mmap, display: Display) -> Run:
    """Execute the accesses that the doorbell tells, and the device's cycles; drive its interrupt."""
    seen = Run()
    cycles, deadline = 0, time.monotonic() + SECONDS
    with memoryview(memory) as all_bytes, all_bytes[REGISTERS - RAM :].cast("I") as words:
        while emulator.program.poll() is None:
            if time.monotonic() > deadline:
                fail(f"Linux has not ended after {SECONDS} seconds")
            command = words[DOORBELL // 4]
            if command != 0:
                seen.console = seen.console or display.content(memory)
                place = command // 4
                if command & WRITE:
                    device.write32(4 * place, words[place])
                else:
                    words[place] = device.read32(4 * place)
            elif cycles == 0:  # no program has opened the device yet
                time.sleep(0.01)
                continue
            cycles = LEAST_CYCLES if command else min(2 * cycles, MOST_CYCLES)
            level = device.run(cycles) < cycles
            if emulator.interrupt(level):
                seen.interrupts.append(display.content(memory))
            if command != 0:
                words[DOORBELL // 4] = 0
            elif level:  # its clock stands still until the program acknowledges
                time.sleep(0.001)
    seen.end = display.content(memory)
    return seen
