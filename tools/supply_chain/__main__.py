"""Regenerates locks, checks them, or prints the bill of materials: ``UV [--upgrade]``, ``check`` or ``sbom``."""

from __future__ import annotations

import json
import sys

import jars
import python_locks
import sbom


def main(arguments: list[str]) -> int:
    """Run the command; returns the exit status, 1 if a check fails."""
    if arguments == ["check"]:
        faults = python_locks.check()
        for fault in faults:
            print(f"lock: {fault}", file=sys.stderr)
        return 1 if faults else 0
    if arguments == ["sbom"]:
        print(json.dumps(sbom.document(), indent=1))
        return 0
    print("lock: resolving the Python packages", flush=True)
    python_locks.write(arguments[0], upgrade="--upgrade" in arguments)
    print("lock: resolving the artifacts of sbt's build", flush=True)
    jars.write()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
