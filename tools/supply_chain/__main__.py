"""Regenerates the locks, or checks them offline: ``python tools/supply_chain check`` or ``… UV [--upgrade]``."""

from __future__ import annotations

import sys

import jars
import python_locks
import sbom


def main(arguments: list[str]) -> int:
    """Run the command; returns the exit status, 1 if a check fails."""
    if arguments == ["check"]:
        faults = [*python_locks.check(), *sbom.check()]
        for fault in faults:
            print(f"lock: {fault}", file=sys.stderr)
        return 1 if faults else 0
    print("lock: resolving the Python packages", flush=True)
    python_locks.write(arguments[0], upgrade="--upgrade" in arguments)
    print("lock: resolving the artifacts of sbt's build", flush=True)
    jars.write()
    print("lock: writing sbom.json", flush=True)
    sbom.write()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
