"""The modules of a generated design."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from pathlib import Path

from colonnade.common.errors import UserError
from colonnade.design.verilog import without_places
from colonnade.device.simulator_sources import Port, module_ports

_MODULE = re.compile(r"^module (\w+)\b.*?^endmodule\n?", re.MULTILINE | re.DOTALL)
_INSTANCE = re.compile(r"^  (\w+)\s+\w+ \(", re.MULTILINE)
_MEMORY = re.compile(r"^  reg\s+(?:\[(\d+):0\]\s+)?Memory\[0:(\d+)\];", re.MULTILINE)
_COMMENT = re.compile(r"[ \t]*//[^\n]*")


class Modules:
    """Modules by name.

    Attributes:
        texts: SystemVerilog of each module, without comments and places.
        children: Modules that each one instantiates.
    """

    def __init__(self, folder: Path) -> None:
        self.texts: dict[str, str] = {}
        for file in sorted(folder.glob("*.sv")):
            text = _COMMENT.sub("", without_places(file.read_text(encoding="utf-8")))
            self.texts.update({match[1]: match[0] for match in _MODULE.finditer(text)})
        if not self.texts:
            raise UserError(f"{folder} has no SystemVerilog; colonnade generate writes it")
        self.children = {
            name: sorted({kind for kind in _INSTANCE.findall(text) if kind in self.texts and kind != name})
            for name, text in self.texts.items()
        }

    @property
    def top(self) -> str:
        """The module that no other one instantiates; of several the one with most below it."""
        inner = {child for children in self.children.values() for child in children}
        return max(sorted(set(self.texts) - inner), key=lambda name: len(self.closure(name)))

    def lines(self, top: str) -> int:
        """Lines of a module and those below it."""
        return sum(self.texts[name].count("\n") for name in self.closure(top))

    def bits(self, top: str) -> int:
        """Bits of all memories in a module and those below it, each module counted once."""
        found = (match for name in self.closure(top) for match in _MEMORY.finditer(self.texts[name]))
        return sum((int(match[1] or 0) + 1) * (int(match[2]) + 1) for match in found)

    def closure(self, top: str) -> list[str]:
        """A module and those below it."""
        found, pending = {top}, [top]
        while pending:
            new = set(self.children[pending.pop()]) - found
            found |= new
            pending += new
        return sorted(found)

    def bottom_up(self) -> Iterator[str]:
        """All modules, each one after the modules that it instantiates."""
        seen: set[str] = set()

        def visit(name: str) -> Iterator[str]:
            if name not in seen:
                seen.add(name)
                for child in self.children[name]:
                    yield from visit(child)
                yield name

        for name in sorted(self.texts):
            yield from visit(name)

    def ports(self, name: str) -> list[Port]:
        """The ports of a module without its clock."""
        return module_ports(self.texts[name], name)

    def has_clock(self, name: str) -> bool:
        """Whether a module has the port `clock`."""
        return re.search(r"\bclock\b", self.texts[name].partition(");")[0]) is not None

    def digest(self, name: str) -> str:
        """SHA-256 of a module and those below it."""
        text = "".join(self.texts[module] for module in self.closure(name))
        return hashlib.sha256(text.encode()).hexdigest()

    def source(self, top: str, prefix: str = "") -> str:
        """SystemVerilog of a module and those below it, with a prefix before their names."""
        names = self.closure(top)
        text = "\n".join(self.texts[name] for name in names)
        return re.sub(rf"\b({'|'.join(names)})\b", rf"{prefix}\1", text) if prefix else text
