"""Imported first by the programs of this folder that use the host: runs them with the Python of .venv."""

from __future__ import annotations

import os
import sys
from pathlib import Path

_ENVIRONMENT = Path(__file__).resolve().parents[1] / ".venv"
_PYTHON = _ENVIRONMENT / "bin" / "python"

if Path(sys.prefix).resolve() != _ENVIRONMENT.resolve():
    if not _PYTHON.exists():
        print("colonnade: error: the host is not installed; run: make setup", file=sys.stderr)
        sys.exit(2)
    os.execv(_PYTHON, [str(_PYTHON), *sys.argv])
