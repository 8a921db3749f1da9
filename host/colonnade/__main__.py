"""The ``colonnade`` command, and ``python -m colonnade``. It handles signals before it imports the commands."""

from __future__ import annotations

import signal
from typing import NoReturn

if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    # Until then an interrupt ends the process without a traceback
    signal.signal(signal.SIGINT, signal.SIG_DFL)

from colonnade.common.processes import guarded


def main() -> NoReturn:
    """Entry point of the console script."""
    guarded(_run)


def _run() -> None:
    from colonnade.cli.main import cli

    cli.main(prog_name="colonnade")


if __name__ == "__main__":
    main()
