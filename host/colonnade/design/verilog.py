"""The text of generated Verilog, as keys of caches and digests of figures read it."""

from __future__ import annotations

import re

_PLACE = re.compile(r"\bat \w+\.scala:\d+")


def without_places(verilog: str) -> str:
    """The same Verilog without the lines of Chisel in messages of assertions, which a moved line changes."""
    return _PLACE.sub("", verilog)
