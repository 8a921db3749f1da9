"""Questions to abc about the claims of a circuit."""

from __future__ import annotations

import re
import resource
import subprocess
from dataclasses import dataclass
from pathlib import Path

from colonnade_lab.common.yosys import abc_program

#: CPU seconds after which a question stays open.
LIMIT = 600

# The second where nothing is left for pdr to do, which has no limit of its own
_PROVED = re.compile(r"^Status = 1\b|^All outputs solved or timed out", re.MULTILINE)
_FAILED = re.compile(r"Output +(\d+) (?:of miter .*? )?was asserted in frame +(\d+)")


@dataclass(frozen=True)
class Answer:
    """What abc says.

    Attributes:
        failed: The frames in which claims fail, by their number in the circuit.
        is_proved: All claims hold in all frames.
        is_open: The limit ended the question.
        values: Registers and inputs of the last failure, bits by frame.
        seconds: CPU seconds.
    """

    failed: dict[int, int]
    is_proved: bool
    is_open: bool
    values: str
    seconds: float


def ask(circuit: Path, question: str, limit: int = LIMIT) -> Answer:
    """Ask abc.

    Args:
        circuit: An AIGER file.
        question: Commands, such as `pdr`; `bmc3 -F 9` for nine frames, of which the first is the reset's.
        limit: CPU seconds.
    """
    values = circuit.with_suffix(".values")
    values.unlink(missing_ok=True)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [abc_program(), "-c", f"read {circuit.name}; fold; {question}; print_status; write_cex {values.name}"],
        cwd=circuit.parent,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: _limit(limit),
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    circuit.with_suffix(".log").write_text(done.stdout + done.stderr)
    if "Warning: The last" not in done.stdout and "Status" not in done.stdout and done.returncode == 0:
        raise RuntimeError(f"abc failed: see {circuit.with_suffix('.log')}")
    return Answer(
        {int(output): int(frame) for output, frame in _FAILED.findall(done.stdout)},
        _PROVED.search(done.stdout) is not None and "was asserted" not in done.stdout,
        done.returncode != 0,
        values.read_text().partition("#")[0].strip() if values.is_file() else "",
        after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime,
    )


def _limit(seconds: int) -> None:
    """End this process after so much CPU time."""
    hard = resource.getrlimit(resource.RLIMIT_CPU)[1]
    resource.setrlimit(resource.RLIMIT_CPU, (seconds if hard < 0 else min(seconds, hard), hard))
