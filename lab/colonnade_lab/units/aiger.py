"""Circuits of one bit from a design in Yosys, as AIGER, and the waveform of a trace that abc finds in one."""

from __future__ import annotations

import json
from pathlib import Path

from colonnade_lab.common.yosys import run_yosys

#: From one flat module of words to gates. Clocked checks hold a cycle later.
_LOWER = (
    "async2sync",
    "chformal -lower",
    "opt -fast -nodffe -nosdff",
    "dffunmap",
    "opt_clean",
    "setundef -anyseq",
    "simplemap",
    "techmap",
    "opt_clean",
    "aigmap",
    "opt_clean",
)


def flatten(free: bool) -> list[str]:
    """Commands from modules with checks to one flat module of words.

    Args:
        free: Undefined values are any in each cycle, and registers begin with any value. Otherwise all are zero.
    """
    memories = ["opt_clean", "memory_dff", "memory_collect", "memory_map -formal" if free else "memory_map"]
    return [
        "proc -norom",
        "flatten",
        "delete -port o:*",  # abc takes outputs as claims
        *(["setundef -undriven -anyseq", *memories, "setundef -anyseq"] if free else []),
        # Memories first: Yosys fails on their ports that have no undefined enable
        *([] if free else [*memories, "setundef -undriven -zero", "setundef -zero", "zinit -all"]),
        "opt -fast",
    ]


def write_circuits(name: str, kinds: dict[str, str], reset: str = "1,0") -> list[str]:
    """Commands that write circuits of the flat design.

    Args:
        name: Files of the flat design, `NAME.il`.
        kinds: What to leave out, a selection, by the name of the circuit: `KIND.aig` and its map `KIND.json`.
        reset: The input of this name by cycle; the last value stays. `1'z`: any.
    """
    commands = [f"write_rtlil {name}.il", "design -save flat"]
    for kind, left_out in kinds.items():
        commands += ["design -load flat", f"delete {left_out}", f"fminit -seq reset {reset}", *_LOWER]
        commands += [f"write_aiger -I -B -zinit -ywmap {kind}.json {kind}.aig"]
    return commands


def claims(folder: Path, kind: str) -> list[str]:
    """The names of a circuit's checks, in abc's order, without the instances around them."""
    named = json.loads((folder / f"{kind}.json").read_text())["asserts"]
    return [path[-1].lstrip("\\").rpartition(".")[2] for path in named]


def write_waveform(folder: Path, name: str, kind: str, values: str, frames: int, waveform: Path) -> None:
    """Write the values of the flat design in a trace.

    Args:
        folder: Folder of the circuit.
        name: The flat design.
        kind: The circuit.
        values: Its inputs by frame, as abc writes them after the registers.
        frames: Their number.
        waveform: The VCD file.
    """
    map_ = json.loads((folder / f"{kind}.json").read_text())
    count = map_["input_count"]
    values = values[len(values) - count * frames :]
    signals = [(one, is_first) for key, is_first in (("inputs", False), ("inits", True)) for one in map_[key]]
    steps = [
        "".join(values[frame * count + one["input"]] for one, is_first in signals if not is_first or frame == 0)[::-1]
        for frame in range(frames)
    ]
    trace = {
        "format": "Yosys Witness Trace",
        "clocks": map_["clocks"],
        "signals": [
            {"path": one["path"], "offset": one["offset"], "width": 1, "init_only": is_first}
            for one, is_first in signals
        ],
        "steps": [{"bits": bits} for bits in steps],
    }
    (folder / "trace.yw").write_text(json.dumps(trace))
    replay = [f"read_rtlil {name}.il", "delete t:$check", f"sim -q -r trace.yw -vcd {waveform.absolute()}"]
    run_yosys(replay, folder, folder / "trace.log")
