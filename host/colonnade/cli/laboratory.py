"""The laboratory, which is a distribution of its own."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Any

from colonnade.common.errors import UserError


def laboratory(name: str) -> Any:
    """The module of a command in `colonnade_lab.cli`; a `UserError` if the laboratory is not installed."""
    if find_spec("colonnade_lab") is None:
        advice = "pip install colonnade-lab, or make setup in a checkout"
        raise UserError(f"no colonnade-lab found, which colonnade {name} needs: {advice}")
    return import_module(f"colonnade_lab.cli.{name}")
