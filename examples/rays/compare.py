"""Compares the results of batches of rays with batches.py's.

usage: compare.py RESULTS EXPECTED
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np


def main(results: Path, expected: Path) -> None:
    """Print the number of bytes that differ; the exit status is 1 if it is not 0."""
    found, wanted = (np.fromfile(path, dtype=np.uint8) for path in (results, expected))
    if len(found) != len(wanted):
        sys.exit(f"{results.name} has {len(found)} bytes, {expected.name} has {len(wanted)}")
    differing = int(np.count_nonzero(found != wanted))
    print(f"{differing} of {len(wanted)} bytes of tags and hits differ from {expected.name}")
    sys.exit(differing > 0)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*map(Path, sys.argv[1:]))
