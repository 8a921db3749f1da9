"""Replays recorded port values on the gate netlist and counts the transitions of each net.

Each gate has one delay from the liberty's tables, so the count includes glitches. The values at the end of each cycle
give the transitions without glitches. Flip-flops and memories start at zero, as in the recorded simulation. Outputs are
compared with the recorded ones in every cycle; the data of a stream only where the stream is valid.

The simulator is ``gates.cpp``. Icarus Verilog was too slow: it took more than four minutes and a gigabyte to
elaborate the 150,000 gates of a traversal unit.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from pathlib import Path

from colonnade.common import cache, processes
from colonnade.common.progress import QUIET, Progress
from colonnade.common.temporary import temporary_folder
from colonnade.design.toolchain import cache_directory, project_root
from colonnade.device.compiler import SAFE, clean_environment, require_compiler, require_right_compiler
from colonnade.device.verilator import run_program

from colonnade_lab.ppa.netlist.activity import Activity
from colonnade_lab.ppa.netlist.hierarchy import Hierarchy
from colonnade_lab.ppa.netlist.mapped import Netlist
from colonnade_lab.ppa.power import gate_netlist
from colonnade_lab.ppa.power.recording import CLOCK, RESET, START, Port, Recording

#: Cycles of reset before the recorded ones.
RESET_CYCLES = 8

#: The replay has this many idle cycles between reset and start, plus the recorded idle cycles modulo this number. So
#: free-running counters whose period divides it have the recorded values.
IDLE_PERIOD = 240


#: Options of the compiler.
OPTIONS = ("-std=c++17", "-O2", *SAFE)


def replay(
    netlist: Netlist,
    hierarchy: Hierarchy,
    delays: Sequence[int],
    recording: Recording,
    begin: int = 0,
    progress: Progress = QUIET,
) -> Activity:
    """Replay a recording and count transitions from the cycle `begin` on.

    Args:
        netlist: The gates.
        hierarchy: The hierarchy of the design, for the shapes of memories.
        delays: Delay of each net's driver, ps.
        recording: Recording of the ports of the netlist's top.
        begin: First counted cycle.
        progress: Shows the steps.

    Raises:
        RuntimeError: An output differs from the recorded one, or a net has no driver.
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
    """The gate simulator, cached by its source, compiler and options."""
    source = Path(__file__).with_name("gates.cpp")
    compiler, version = require_compiler("power")
    parts = (source.read_text(), version, " ".join(OPTIONS))
    digest = hashlib.sha256("".join(f"{len(part)}:{part}" for part in parts).encode()).hexdigest()[:20]
    entry = cache_directory(project_root()) / "gates" / digest
    with cache.entry(entry, "gate simulator", progress) as empty:
        if empty is not None:
            with progress.step("building the gate simulator"):
                require_right_compiler(compiler, OPTIONS[1:])
                done = processes.run([compiler, *OPTIONS, "-o", empty / "gates", source], env=clean_environment())
            if done.returncode != 0:
                raise RuntimeError(f"the gate simulator does not build: {done.stderr[:300]}")
    return entry / "gates"


def require_same(recording: Recording, found: Sequence[int]) -> None:
    """Raise a `RuntimeError` if an output differs from the recorded one in any cycle."""
    valid = {port.name: recording.of(guard) for port in recording.outputs if (guard := _guard(recording, port))}
    for cycle, ((_, outputs), value) in enumerate(zip(recording.cycles, found, strict=True)):
        if outputs == value:
            continue
        shift = sum(port.bits for port in recording.outputs)
        for port in recording.outputs:
            shift -= port.bits
            expected, actual = (each >> shift & (1 << port.bits) - 1 for each in (outputs, value))
            if expected != actual and (port.name not in valid or valid[port.name][cycle]):
                difference = f"{port.name} is {actual}, not {expected}"
                raise RuntimeError(f"the gates differ from the RTL in cycle {cycle}: {difference}")


def _guard(recording: Recording, port: Port) -> str:
    """The valid port of a stream if `port` is data of the stream, else an empty string."""
    guard = f"{port.name.split('_bits_')[0]}_valid"
    return guard if "_bits_" in port.name and any(each.name == guard for each in recording.outputs) else ""


def _activity(counts: Sequence[str], cycles: int, netlist: Netlist) -> Activity:
    words = [line.split() for line in counts]
    accesses = tuple((int(reads), int(writes)) for kind, reads, writes in _of(words, "memory"))
    found = [(int(changes), int(settled), int(high) / cycles) for _, changes, settled, high in _of(words, "net")]
    # The simulator has no clock net: registers load between two cycles
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
    """Inputs of reset and idle cycles before the start, with the registers of the work."""
    idle = recording.cycles[0][0] & ~_bit(recording.inputs, START)
    reset = _bit(recording.inputs, RESET)
    idle_cycles = IDLE_PERIOD + recording.idle_cycles % IDLE_PERIOD
    return [idle | reset] * RESET_CYCLES + [idle & ~reset] * idle_cycles


def _bit(ports: Sequence[Port], name: str) -> int:
    """Concatenated inputs with only the one-bit port `name` set; 0 if there is no such port."""
    shift = sum(port.bits for port in ports)
    for port in ports:
        shift -= port.bits
        if port.name == name:
            return 1 << shift
    return 0
