"""The process of one job: ``python -m colonnade_lab.explore.worker JOB FOLDER``.

JOB is a pickled (kind, arguments, inputs), written by `colonnade_lab.explore.jobs.run` for this process alone. FOLDER
receives the files of the result. The process ends when its parent does.
"""

from __future__ import annotations

import ctypes
import os
import pickle
import signal
import sys
from pathlib import Path

from colonnade.common.processes import guarded

#: Linux: the signal that a process receives when its parent ends.
_PR_SET_PDEATHSIG = 1


def main() -> None:
    """Run the job; a wrong input gives one line on standard error and status 2."""
    from colonnade.common.errors import UserError

    from colonnade_lab.explore import work

    kind, arguments, inputs = pickle.loads(Path(sys.argv[1]).read_bytes())
    try:
        getattr(work, kind)(Path(sys.argv[2]), *inputs, **arguments)
    except UserError as error:
        print(f"colonnade: error: {' '.join(str(error).split())}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    parent = os.getppid()
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() == parent:
        guarded(main)
