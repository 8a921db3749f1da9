"""The console of Linux on a display of the device's memory: one rule in Python and in C, and who gets it back."""

from __future__ import annotations

import os
import signal
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from colonnade.common.errors import UserError
from colonnade.design import toolchain
from colonnade.design.generator import GeneratedDesign, shell_manifest_for
from colonnade.device import console
from colonnade.device.console import ConsoleGuard
from colonnade.device.shell_device import ShellDevice

DRIVER = toolchain.project_root() / "driver"
BASE, SIZE = 0xBF00_0000, 0x10000
#: Displays of a machine, what becomes of the console, and the line of a display that begins where the memory does.
#: START:BYTES:LINE; "no-console" and "deaf" are of the machine (driver/tests/console.c).
CASES = {
    "bf000000:8000:512": ("graphics text", 512),
    "absent bf000000:20000:512": ("graphics text", 512),
    "bf008000:100000:1024": ("graphics text", 0),
    "80000000:3f000001:64": ("graphics text", 0),
    "bf010000:8000:512": ("", 0),
    "bef00000:100000:512": ("", 0),
    "unknown": ("", 0),
    "0:8000:512": ("", 0),
    "absent": ("", 0),
    "bf000000:8000:512 no-console": ("", 512),
    "bf000000:8000:512 deaf": ("error", 0),
    "80000000:8000:64 denied": ("error", 0),
}


class Machine:
    """Linux as files, whose ioctl answers as displays and the console do."""

    def __init__(self, folder: Path, described: str) -> None:
        self.modes: list[str] = []
        self._displays = described.split()
        for name in ("dev", "sys/class/tty"):
            (folder / name).mkdir(parents=True)
        for number, display in enumerate(self._displays):
            if display != "absent":
                (folder / f"dev/fb{number}").write_text("")
        (folder / "dev/tty0").write_text("")
        if "no-console" not in self._displays:
            (folder / "sys/class/tty/tty0").write_text("")

    def open(self, path: Path, flags: int) -> int:
        number = path.name.removeprefix("fb")
        if number.isdigit() and int(number) < len(self._displays) and self._displays[int(number)] == "denied":
            raise PermissionError(13, "Permission denied")
        return os.open(path, flags)

    def ioctl(self, file: int, request: int, argument: bytes | int) -> bytes:
        name = Path(f"/proc/self/fd/{file}").readlink().name
        if isinstance(argument, int):
            assert (name, request) == ("tty0", 0x4B3A)
            if "deaf" in self._displays:
                raise PermissionError(1, "Operation not permitted")
            self.modes.append("graphics" if argument else "text")
            return b""
        assert request == 0x4602
        parts = self._displays[int(name.removeprefix("fb"))].split(":")
        if len(parts) < 3:
            raise OSError(25, "Inappropriate ioctl for device")
        return struct.pack("@16sLI", b"simple", int(parts[0], 16), int(parts[1], 16)) + argument[28:]


@pytest.fixture
def machine(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Machine:
    machine = Machine(tmp_path, request.param)
    monkeypatch.setattr(console, "ROOT", tmp_path)
    monkeypatch.setattr(console.fcntl, "ioctl", machine.ioctl)
    monkeypatch.setattr(console, "os", type("os", (), {**vars(os), "open": machine.open}))
    return machine


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory, design: GeneratedDesign) -> Path:
    from colonnade.integration.design_header import design_header
    from colonnade.integration.register_table import register_table

    folder = tmp_path_factory.mktemp("console")
    (folder / "colonnade_design.h").write_text(design_header(register_table(design), design.manifest))
    sources = [DRIVER / "tests/console.c", DRIVER / "examples/target_files.c", *(DRIVER / "src").glob("colonnade*.c")]
    command = ["gcc", "-std=c11", "-Wall", "-Wextra", "-Werror", "-fsanitize=address,undefined"]
    includes = [f"-I{DRIVER / 'include'}", f"-I{DRIVER / 'examples'}", f"-I{folder}"]
    subprocess.run([*command, *includes, *sources, "-o", folder / "console"], check=True)
    return folder / "console"


@pytest.fixture(scope="module")
def design() -> GeneratedDesign:
    return shell_manifest_for("tiny", ())


@pytest.mark.parametrize(("machine", "expected"), CASES.items(), indirect=["machine"], ids=list(CASES))
def test_python_sets_the_console_aside_where_a_display_shows_the_memory(
    machine: Machine, expected: tuple[str, int]
) -> None:
    handlers = [signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)]
    modes, _ = expected
    if modes == "error":
        with pytest.raises(
            UserError, match=r"^/dev/(fb1|tty0): (Permission denied|Operation not permitted): .*run as root$"
        ):
            ConsoleGuard(BASE, SIZE)
        assert machine.modes == []
    else:
        guard = ConsoleGuard(BASE, SIZE)
        assert machine.modes == modes.split()[:1]
        guard.close()
        guard.close()
        assert machine.modes == modes.split()
    assert [signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)] == handlers


def test_c_has_the_same_rule(program: Path) -> None:
    for described, (modes, line) in CASES.items():
        done = subprocess.run([program, f"{BASE:x}", f"{SIZE:x}", *described.split()], capture_output=True, text=True)
        if modes == "error":
            assert done.returncode == 2 and len(done.stderr.splitlines()) == 1 and done.stdout == "", described
        else:
            assert (done.returncode, done.stderr) == (0, ""), described
            words = done.stdout.split()
            assert words == [*modes.split()[:1], "line", str(line), *modes.split()[1:]], described


PROGRAM = """
import fcntl, os, signal, sys
from colonnade.device.console import ConsoleGuard
from colonnade.device import console
console._shows = lambda *_: True
console.ROOT = console.Path(sys.argv[1])
for number in (signal.SIGTERM, signal.SIGHUP):  # nohup ignores one
    signal.signal(number, signal.SIG_DFL)
fcntl.ioctl = lambda file, request, mode: os.write(1, b"graphics\\n" if mode else b"text\\n")
guard = ConsoleGuard(0, 1)
if os.fork() == 0:
    guard.close()
    os._exit(0)
os.wait()
{end}
"""


@pytest.mark.parametrize(
    "end", ["1 / 0", "os.kill(os.getpid(), signal.SIGTERM)", "os.kill(os.getpid(), signal.SIGHUP)"]
)
def test_the_console_comes_back_when_a_program_ends(tmp_path: Path, end: str) -> None:
    Machine(tmp_path, "absent")
    done = subprocess.run([sys.executable, "-c", PROGRAM.format(end=end), tmp_path], capture_output=True, text=True)
    assert done.stdout.split() == ["graphics", "text"], done.stderr
    assert done.returncode == (1 if "/" in end else -getattr(signal, end[-8:-1].strip(". ")))


def test_a_device_that_is_not_there_closes_its_way(design: GeneratedDesign) -> None:
    class Nothing:
        base = size = 0
        is_closed = False

        def read32(self, address: int) -> int:
            return 0

        write32 = wait = read32

        def close(self) -> None:
            self.is_closed = True

    way = Nothing()
    with pytest.raises(UserError, match="no Colonnade answers"):
        ShellDevice(way, design)
    assert way.is_closed
