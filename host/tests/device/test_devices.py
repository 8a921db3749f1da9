"""Devices with the same calls: one sequence of register accesses over every transport, and its errors."""

from __future__ import annotations

import copy
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from colonnade.common.errors import UserError
from colonnade.design.generator import GeneratedDesign, shell_design_for
from colonnade.device import console
from colonnade.device.device import Device, ModelDevice
from colonnade.device.shell_device import ShellDevice
from colonnade.device.shell_simulator import SharedMemory, SimulatedTransport
from colonnade.device.transport import LitexTransport, UioTransport
from colonnade.mesh.load import load_mesh
from colonnade.scene.model import MeshSource, Scene
from colonnade.scene.prepared.device_scene import DeviceScene
from colonnade.scene_image.device_image import device_image

SIZE = (20, 6)
#: `test_shell.py` has the same design: its simulator is built once.
CONFIG = ("tiny", ("array.columns=2",))
INTERRUPT_STATUS, INTERRUPT_ENABLE, CONTROL = 0x48, 0x4C, 0x40
POSITION = "camera.position.x"


@pytest.fixture(autouse=True)
def no_display(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Displays of this machine are not the devices' here."""
    monkeypatch.setattr(console, "ROOT", tmp_path)


@pytest.fixture(scope="module")
def design() -> GeneratedDesign:
    return shell_design_for(*CONFIG, bus_bytes=16)


@pytest.fixture(scope="module")
def packed(design: GeneratedDesign) -> DeviceScene:
    return DeviceScene.of(Scene(MeshSource(name="octahedron")), design.manifest, load_mesh("octahedron"))


class Recorded:
    """A transport whose accesses to registers are recorded, except a sleep's: reads that repeat the one before,
    and what enables the interrupt."""

    def __init__(self, transport: Any) -> None:
        self._transport = transport
        self.accesses: list[tuple[Any, ...]] = []

    def read32(self, address: int) -> int:
        if self.accesses[-1:] != [("read", address)] and address != INTERRUPT_ENABLE:
            self.accesses.append(("read", address))
        return self._transport.read32(address)

    def write32(self, address: int, value: int) -> None:
        if address != INTERRUPT_ENABLE:
            self.accesses.append(("write", address, value))
        self._transport.write32(address, value)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._transport, name)


class SimulatedSoc:
    """The calls of LiteX's RemoteClient, for a simulated device at an address of a SoC."""

    REGISTERS = 0x9000_0000

    def __init__(self, device: SimulatedTransport) -> None:
        self._device = device

    def read(self, addr: int, length: int | None = None) -> int | Sequence[int]:
        count = length or 1
        assert count <= 255
        if addr < self.REGISTERS:
            words: list[int] = np.frombuffer(self._device.fetch(addr, 4 * count), "<u4").tolist()
        else:
            if addr == self.REGISTERS + INTERRUPT_STATUS:
                self._device.wait()
            words = [self._device.read32(addr - self.REGISTERS + 4 * word) for word in range(count)]
        return words if length is not None else words[0]

    def write(self, addr: int, datas: list[int]) -> None:
        assert len(datas) <= 255
        if addr < self.REGISTERS:
            self._device.store(addr, np.array(datas, "<u4").tobytes())
        for word, value in enumerate(datas if addr >= self.REGISTERS else ()):
            self._device.write32(addr - self.REGISTERS + 4 * word, value)


def plain_file(folder: Path, read32: Callable[[int], int], memory: int) -> UioTransport:
    """UIO on a file that has the read-only registers of a device.

    Its interrupt.status keeps what acknowledges write: every command has ended at once.
    """
    words = np.zeros(0x10000 // 4, "<u4")
    words[:12] = [read32(4 * word) for word in range(12)]
    (folder / "uio7").write_bytes(words.tobytes() + bytes(memory))
    for number, (address, size) in enumerate([(0x9000_0000, 0x10000), (0, memory)]):
        described = folder / "sysfs" / "uio7" / "maps" / f"map{number}"
        described.mkdir(parents=True)
        (described / "addr").write_text(f"{address:#x}\n")
        (described / "size").write_text(f"{size:#x}\n")
    return UioTransport(folder / "uio7", folder / "sysfs", page=0x10000)


def frame_of(device: Device, packed: DeviceScene) -> tuple[np.ndarray, dict[str, int]]:
    return device.render(packed, SIZE), device.counters()


@pytest.mark.verilator
def test_all_transports_make_the_same_accesses_and_the_picture_is_the_models(
    design: GeneratedDesign, packed: DeviceScene, tmp_path: Path
) -> None:
    model, model_counters = frame_of(ModelDevice(*CONFIG), packed)
    assert len(np.unique(model)) >= 10

    simulator = Recorded(SimulatedTransport(design, 1 << 20))
    with ShellDevice(simulator, design) as device:
        pixels, counters = frame_of(device, packed)
        np.testing.assert_array_equal(pixels, model)
        assert counters.items() >= model_counters.items() and counters["cycles"] > 500

        uio = Recorded(plain_file(tmp_path, simulator._transport.read32, 1 << 20))
        with ShellDevice(uio, design) as on_file:
            assert frame_of(on_file, packed)[0].shape == model.shape
    content = device_image(packed.image, design.manifest)
    memory = (tmp_path / "uio7").read_bytes()[0x10000:]
    assert memory == content + bytes(len(memory) - len(content))

    with ShellDevice(Recorded(SimulatedTransport(design, 1 << 20)), design) as hidden:
        soc = SimulatedSoc(hidden.transport._transport)
        with ShellDevice(Recorded(LitexTransport(soc, SimulatedSoc.REGISTERS, 0, 1 << 20)), design) as litex:
            pixels, counters = frame_of(litex, packed)
            np.testing.assert_array_equal(pixels, model)
            assert counters.items() >= model_counters.items()
            # A poll of LiteX is the wait for an interrupt elsewhere
            accesses = [one.accesses for one in (simulator, uio, litex.transport)]
    assert accesses[0] == accesses[1] == accesses[2]
    assert sum(one[:2] == ("write", CONTROL) for one in accesses[0]) == 2


@pytest.mark.verilator
@pytest.mark.parametrize("make", [ModelDevice, ShellDevice.simulated])
def test_threads_that_share_a_device_have_their_own_pictures(
    make: Callable[..., Device], packed: DeviceScene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also of calls one by one, under the lock of the device. Each gives way to the other threads before its start."""
    sizes = [SIZE, (12, 9), (8, 5)]
    found: dict[int, list[np.ndarray]] = {0: [], 1: [], 2: []}
    with make(*CONFIG) as device:
        expected = [device.render(packed, size) for size in sizes]
        start = device.start
        monkeypatch.setattr(device, "start", lambda: (time.sleep(0.02), start(), time.sleep(0.02)))

        def work(number: int) -> None:
            for _ in range(3):
                found[number].append(device.render(packed, sizes[number]))
            with device.lock:
                device.set_frame(packed.registers(sizes[number]))
                device.start()
                device.wait()
                found[number].append(device.pixels())

        threads = [threading.Thread(target=work, args=(number,)) for number in found]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    for number, picture in enumerate(expected):
        assert len(found[number]) == 4
        for one in found[number]:
            np.testing.assert_array_equal(one, picture)


@pytest.mark.parametrize("memory", [0, -5, 1 << 36])
def test_a_memory_that_no_bus_has_is_refused(memory: int) -> None:
    with pytest.raises(UserError, match=rf"memory is {memory}: it must be from 4,096 to 4,294,967,296 bytes"):
        ShellDevice.simulated(*CONFIG, memory=memory)


@pytest.mark.verilator
def test_a_device_says_what_is_wrong(design: GeneratedDesign, packed: DeviceScene, tmp_path: Path) -> None:
    """Its memory is a file from a bus address on, which has the image when it is loaded."""
    registers = packed.registers(SIZE)
    memory = tmp_path / "memory"
    memory.write_bytes(bytes(1 << 14))
    shell = SimulatedTransport(design, 1 << 14, shared=SharedMemory(memory, 0x5F00_0000))
    other = ModelDevice("small")
    with pytest.raises(UserError, match="packed for another design"):
        other.load(packed.image)
    for device in (ModelDevice(*CONFIG), ShellDevice(shell, design)):
        with device:
            with pytest.raises(UserError, match="no scene is loaded"):
                device.set_frame(registers)
            device.load(packed.image)
            with pytest.raises(UserError, match="no frame is set"):
                device.start()
            with pytest.raises(UserError, match="no frame was started"):
                device.pixels()
            with pytest.raises(UserError, match="a photo shows behind the object of a room"):
                device.set_frame(registers, np.zeros((6, 20, 3), np.uint8))
            for message, wrong in {
                r"register camera.position.x is missing: give": {k: registers[k] for k in {*registers} - {POSITION}},
                r"register lamp is none of this design": registers | {"lamp": 1},
                r"register camera.position.x is 1.5: it must be a whole number from -2": registers | {POSITION: 1.5},
                r"register camera.position.x is None: it must be": registers | {POSITION: None},
                r"register frame.width is -1: it must be a whole number from 0": registers | {"frame.width": -1},
                r"size 2000x6 is too large": registers | {"frame.width": 2000},
                r"registers is 3: it must be a Mapping": 3,
            }.items():
                with pytest.raises(UserError, match=message):
                    device.set_frame(wrong)
            with pytest.raises(UserError, match="image is None: it must be a SceneImage"):
                device.load(None)
            if isinstance(device, ShellDevice):
                device.set_frame(packed.registers((64, 60)))
                with pytest.raises(UserError, match=r"memory of 16,384 bytes is too small for the frame: \d,\d+ more"):
                    device.start()
                device.set_frame(registers)
                device.start()
                with pytest.raises(UserError, match="a frame runs: wait"):
                    device.set_frame(registers)
                with pytest.raises(UserError, match="has not answered in time"):
                    device.wait(timeout=-1.0)
                device.reset()
                with pytest.raises(UserError, match="no frame is set"):
                    device.start()
                device.set_frame(registers)
                for message, arguments in {
                    r"pixel_format is 9: it must be from 0 to 2": (9,),
                    r"the address of the framebuffer is not aligned: give a multiple": (0, 0x5F00_0004),
                    r"the frame at 0x0 is below the device's memory, which is at 0x5f000000": (0, 0),
                }.items():
                    with pytest.raises(UserError, match=message):
                        device.start(*arguments)
                device.start(1)
                device.wait()
                with pytest.raises(UserError, match="the frame is in rgb565, which has no such pixels: read its lines"):
                    device.pixels()
                assert device.counters()["cycles"] == device.register("counters.cycles") > 0
                with pytest.raises(UserError, match="there is no register lamp"):
                    device.register("lamp")
        device.close()
        for call in (device.start, device.pixels, device.counters, lambda d=device: d.render(packed, SIZE)):
            with pytest.raises(UserError, match="the device is closed: make another one"):
                call()
        with pytest.raises(UserError, match="a device cannot be copied"):
            copy.copy(device)
    content, stored = device_image(packed.image, design.manifest), memory.read_bytes()
    assert stored.startswith(content) and any(stored[len(content) :])


def test_a_way_without_a_device_is_an_error_and_so_is_an_exception_of_an_access(
    design: GeneratedDesign, tmp_path: Path
) -> None:
    with pytest.raises(UserError, match=r"uio3/maps/map1/addr cannot be read, the device needs two maps: No such file"):
        UioTransport("/dev/uio3", tmp_path)
    with pytest.raises(UserError, match=r"no Colonnade answers.*noDevice"):
        ShellDevice(plain_file(tmp_path, lambda address: 0, 4096), design)

    class Unplugged:
        def read(self, addr: int, length: int | None = None) -> int:
            raise ConnectionResetError("the server is gone")

        def write(self, addr: int, datas: list[int]) -> None:
            raise AssertionError("a write after a read that failed")

    with pytest.raises(ConnectionResetError, match="the server is gone"):
        ShellDevice(LitexTransport(Unplugged(), 0, 0, 4096), design)
