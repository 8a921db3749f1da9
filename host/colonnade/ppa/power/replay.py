"""Recorded traffic on the gates: a simulation that counts how often every net changes.

Each gate has one delay, from the liberty's tables, so that glitches show; what a net is at the end of a cycle tells
what changes without them. Flip-flops and memories begin with zero, as they do in the simulation that was recorded.
Outputs are held against the recorded ones in every cycle; the data of a stream counts where the stream is valid.

The simulator is ``harness/gates.cpp``. Icarus Verilog was tried first: after more than four minutes of processor time,
and with a gigabyte, it was still elaborating the 150,000 gates of a render unit.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from colonnade.common import cache, processes
from colonnade.common.progress import QUIET, Progress
from colonnade.common.temporary import temporary_folder
from colonnade.design.toolchain import cache_directory, project_root
from colonnade.device.compiler import SAFE, clean_environment, require_compiler, require_right_compiler
from colonnade.device.verilator import run_program
from colonnade.ppa.netlist.hierarchy import Hierarchy
from colonnade.ppa.netlist.mapped import Netlist
from colonnade.ppa.power import gate_netlist
from colonnade.ppa.power.recording import CLOCK, RESET, START, Port, Recording

#: Cycles of reset before the recorded ones.
RESET_CYCLES = 8

#: Of the rest between reset and a frame as many cycles are replayed as leave this remainder, and this once more:
#: counters that run freely, with a period that divides it, are then where they were.
REST_PERIOD = 240


#: Of the compiler.
OPTIONS = ("-std=c++17", "-O2", *SAFE)


@dataclass(frozen=True)
class Activity:
    """What the gates did in the cycles that were counted.

    Attributes:
        cycles: how many.
        changes: of each net, by its number: all changes, glitches included.
        settled: those that a gate without delay would have made: cycles at whose end the net is another.
        high: share of the cycles that end with the net at 1.
        accesses: reads and writes of each memory, in the order of the netlist's boxes.
    """

    cycles: int
    changes: tuple[int, ...]
    settled: tuple[int, ...]
    high: tuple[float, ...]
    accesses: tuple[tuple[int, int], ...]


def replay(
    netlist: Netlist,
    hierarchy: Hierarchy,
    delays: Sequence[int],
    recording: Recording,
    begin: int = 0,
    progress: Progress = QUIET,
) -> Activity:
    """Run the recorded cycles and count from the cycle `begin` on.

    Args:
        netlist: the gates.
        hierarchy: knows the memories' shapes.
        delays: of each net's driver in ps.
        recording: at the ports of the netlist's top.
        begin: first cycle to count.
        progress: shows the steps.

    Raises:
        RuntimeError: the gates' outputs are not the recorded ones, or a net has no driver.
    """
    program = build(progress)
    prelude = _prelude(recording)
    stimulus = [*prelude, *(inputs for inputs, _ in recording.cycles)]
    sizes = [(sum(port.bits for port in ports) + 7) // 8 for ports in (recording.inputs, recording.outputs)]
    with temporary_folder() as folder:
        text = gate_netlist.lines(netlist, hierarchy, delays, recording.inputs, recording.outputs)
        (folder / "netlist").write_text("\n".join(text) + "\n")
        (folder / "stimulus").write_bytes(b"".join(inputs.to_bytes(sizes[0], "little") for inputs in stimulus))
        files = [str(folder / name) for name in ("netlist", "stimulus", "outputs", "counts")]
        command = [str(program), *files[:2], str(len(stimulus)), str(len(prelude) + begin), *files[2:]]
        with progress.step("replaying on the gates") as report:
            run_program(command, folder, report)
        written = (folder / "outputs").read_bytes()
        counts = (folder / "counts").read_text().splitlines()
    found = [written[at : at + sizes[1]] for at in range(len(prelude) * sizes[1], len(written), sizes[1])]
    require_same(recording, [int.from_bytes(value, "little") for value in found])
    return _activity(counts, len(recording.cycles) - begin, netlist)


def build(progress: Progress = QUIET) -> Path:
    """The simulator of gates, compiled once per state of its source, compiler and options."""
    source = Path(__file__).parents[2] / "device" / "harness" / "gates.cpp"
    compiler, version = require_compiler("power")
    parts = (source.read_text(), version, " ".join(OPTIONS))
    digest = hashlib.sha256("".join(f"{len(part)}:{part}" for part in parts).encode()).hexdigest()[:20]

    def make(place: Path) -> None:
        with progress.step("building the simulator of gates"):
            require_right_compiler(compiler, OPTIONS[1:])
            command = [compiler, *OPTIONS, "-o", place / "gates", source]
            done = processes.run(command, env=clean_environment())
        if done.returncode != 0:
            raise RuntimeError(f"the simulator of gates does not build: {done.stderr[:300]}")

    entry = cache_directory(project_root()) / "gates" / digest
    return cache.entry(entry, make, "simulator of gates", progress) / "gates"


def require_same(recording: Recording, found: Sequence[int]) -> None:
    """Fail unless the gates' outputs are the recorded ones, in every cycle."""
    valid = {port.name: recording.of(guard) for port in recording.outputs if (guard := _guard(recording, port))}
    for cycle, ((_, outputs), value) in enumerate(zip(recording.cycles, found, strict=True)):
        if outputs == value:
            continue
        shift = sum(port.bits for port in recording.outputs)
        for port in recording.outputs:
            shift -= port.bits
            want, have = (each >> shift & (1 << port.bits) - 1 for each in (outputs, value))
            if want != have and (port.name not in valid or valid[port.name][cycle]):
                raise RuntimeError(f"the gates differ from the RTL in cycle {cycle}: {port.name} is {have}, not {want}")


def _guard(recording: Recording, port: Port) -> str:
    """The port that tells whether `port`, data of a stream, is valid; nothing for other ports."""
    guard = f"{port.name.split('_bits_')[0]}_valid"
    return guard if "_bits_" in port.name and any(each.name == guard for each in recording.outputs) else ""


def _activity(counts: Sequence[str], cycles: int, netlist: Netlist) -> Activity:
    words = [line.split() for line in counts]
    accesses = tuple((int(reads), int(writes)) for kind, reads, writes in _of(words, "memory"))
    found = [(int(changes), int(settled), int(high) / cycles) for _, changes, settled, high in _of(words, "net")]
    # The simulator has no clock: registers take their inputs between two cycles
    for net in netlist.inputs[CLOCK]:
        found[net] = (2 * cycles, 2 * cycles, 0.5)
    for net, enable in netlist.clock_gates():
        share = float(enable) if isinstance(enable, bool) else found[enable][2]
        pulses = round(share * cycles)
        found[net] = (2 * pulses, 2 * pulses, share / 2)
    changes, settled, high = zip(*found, strict=True)
    return Activity(cycles, changes, settled, high, accesses)


def _of(words: Sequence[list[str]], kind: str) -> Iterator[list[str]]:
    return (each for each in words if each[0] == kind)


def _prelude(recording: Recording) -> list[int]:
    """A reset and some rest, with the registers as they are when the frame begins."""
    resting = recording.cycles[0][0] & ~_bit(recording.inputs, START)
    reset = _bit(recording.inputs, RESET)
    rest = REST_PERIOD + recording.rested % REST_PERIOD
    return [resting | reset] * RESET_CYCLES + [resting & ~reset] * rest


def _bit(ports: Sequence[Port], name: str) -> int:
    """The joined inputs in which nothing but the port `name`, of one bit, is set; 0 if there is none."""
    shift = sum(port.bits for port in ports)
    for port in ports:
        shift -= port.bits
        if port.name == name:
            return 1 << shift
    return 0
