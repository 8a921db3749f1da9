"""A proof of a module, as `src/test/scala/colonnade/Proofs.scala` writes it.

A proof is a module around a unit: `assume` states the contract, `assert` the property, `cover` what can happen. Its
file is SystemVerilog of firtool, named after the module. Beside it lie `proof.json`, the result, and where it fails
a waveform.
"""

from __future__ import annotations

import argparse
import json
import resource
from pathlib import Path

from colonnade.common.processes import tool

from colonnade_lab.common.yosys import run_yosys
from colonnade_lab.units import aiger
from colonnade_lab.units.checks import Checks, read_checks
from colonnade_lab.units.engines import ask

#: Cycles for which the assumptions of a proof without a bound are kept.
KEPT = 20

#: A proof in all cycles: equal registers become one, then property-directed reachability.
_PROVE = "scorr; dc2; pdr -s -f"


def objection(file: Path, cycles: int | None = None) -> str | None:
    """What is wrong with a proof; None where it holds.

    Args:
        file: The module `STEM` and those below it.
        cycles: Cycles after the reset for which it is to hold; None: all.
    """
    checks = read_checks(file.read_text(), file.stem, cycles or KEPT)
    if not any(label.startswith("assertion") for label in checks.texts):
        return f"{file.stem}: nothing is asserted"
    folder = file.parent
    (folder / "checks.sv").write_text(checks.verilog)
    script = ["read_verilog -sv -formal checks.sv", f"hierarchy -check -top {file.stem}", *aiger.flatten(free=True)]
    kinds = {"assertions": "c:*cover_*", "covers": "c:*assertion_*"}
    run_yosys([*script, *aiger.write_circuits("model", kinds)], folder, file.with_suffix(".log"))
    found = _violation(file, checks, cycles) or _emptiness(folder, checks, cycles)
    if found is None:
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        result = {
            "module": file.stem,
            "cycles": cycles,
            "assertions": len(checks.texts) - len(checks.covers),
            "covers": len(checks.covers) - 1,
            "cpuSeconds": round(usage.ru_utime + usage.ru_stime, 2),
        }
        file.with_name("proof.json").write_text(json.dumps(result) + "\n")
    return found and f"{file.stem}: {found}"


def _frames(cycles: int) -> int:
    """Frames of abc that show a number of cycles: one of reset comes before, one for the last checks after."""
    return cycles + 2


def _violation(file: Path, checks: Checks, cycles: int | None) -> str | None:
    """The earliest violation of an assertion."""
    circuit = file.with_name("assertions.aig")
    question = f"bmc3 -F {_frames(cycles)}" if cycles else _PROVE
    answer = ask(circuit, question)
    if answer.failed and not cycles:
        # The first violation, whatever pdr came upon
        answer = ask(circuit, f"bmc3 -F {min(answer.failed.values()) + 1}")
    for output, frame in answer.failed.items():
        waveform = file.with_suffix(".vcd")
        aiger.write_waveform(file.parent, "model", "assertions", answer.values, frame + 1, waveform)
        text = checks.texts[aiger.claims(file.parent, "assertions")[output]]
        return f"violated in cycle {frame - 1} after the reset: {text}; see {waveform}"
    if answer.is_open or not (cycles or answer.is_proved):
        return f"neither proved nor violated in {answer.seconds:.0f} CPU seconds"
    return None


def _emptiness(folder: Path, checks: Checks, cycles: int | None) -> str | None:
    """Why the proof says nothing, if it does not."""
    circuit, names = folder / "covers.aig", aiger.claims(folder, "covers")
    # abc's own loop over the claims of a circuit ends in a fault at times
    search = f"bmc3 -F {_frames(cycles or KEPT)}"
    left = [name for claim, name in enumerate(names) if not ask(circuit, f"cone -O {claim}; {search}").failed]
    if not cycles and "cover_kept" not in left:
        left = [name for name in left if not ask(circuit, f"cone -O {names.index(name)}; {_PROVE}").failed]
    if "cover_kept" in left:
        return checks.texts["cover_kept"]
    if left:
        return f"cannot happen{f' within {cycles} cycles' if cycles else ''}: {checks.texts[left[0]]}"
    return None


def main() -> None:
    """The command line; exit status 1 and a line where a proof does not hold."""
    parser = argparse.ArgumentParser(description="Prove a module that Proofs.scala has written.")
    parser.add_argument("file", type=Path)
    parser.add_argument("--cycles", type=int, help="the first cycles after the reset; without it all")
    options = parser.parse_args()

    def run() -> None:
        found = objection(options.file, options.cycles)
        if found is not None:
            print(found)
            raise SystemExit(1)

    tool(run)


if __name__ == "__main__":
    main()
