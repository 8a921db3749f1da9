"""All registers of a design in its AXI4 shell, word by word: the table behind every description of them."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from colonnade.design.generator import GeneratedDesign
from colonnade.design.manifest import Manifest, Register

#: Bits of a word.
WORD = 32
#: Bytes of the address space.
SPACE = 1 << 16

_EFFECTS = {"interrupt.status": "clears", "interrupt.test": "sets"}

#: The device's register that the shell keeps to itself in a design of frames.
_KEPT = "control.start"


@dataclass(frozen=True)
class BitField:
    """``width`` bits of a word, from bit ``offset`` on."""

    name: str
    offset: int
    width: int


@dataclass(frozen=True)
class RegisterWord:
    """One word of a register.

    Attributes:
        name: A C identifier. The words of a wide number end in ``_low`` and ``_high``.
        address: Bytes from the beginning of its block.
        access: "ro", "rw" or "wo".
        description: One sentence.
        fields: At least one, in the order of their bits.
        effect: What a written 1 does to its bit: "clears", "sets", or None if the bit takes it.
    """

    name: str
    address: int
    access: str
    description: str
    fields: tuple[BitField, ...]
    effect: str | None = None


@dataclass(frozen=True)
class RegisterBlock:
    """Consecutive registers.

    Attributes:
        name: A C identifier.
        base: Its first byte address.
        description: One sentence.
        words: In the order of their addresses.
    """

    name: str
    base: int
    description: str
    words: tuple[RegisterWord, ...]


@dataclass(frozen=True)
class RegisterTable:
    """The registers of a design.

    Attributes:
        version: Of the shell's registers: major in the high half, minor in the low one.
        posted_writes: Writes to the device's registers that the shell takes while a frame runs.
        shell: The shell's block, the same in every design.
        device: The device's block.
    """

    version: int
    posted_writes: int
    shell: RegisterBlock
    device: RegisterBlock


def register_table(design: GeneratedDesign) -> RegisterTable:
    """The registers of a design that was generated with its shell."""
    shell = read_shell(design.dir)
    device = _device_block(design.manifest, shell)
    return RegisterTable(int(shell["version"]), int(shell["postedWrites"]), shell_block(shell), device)


def read_shell(folder: Path) -> dict[str, Any]:
    """The content of ``shell.json``."""
    return dict(json.loads((folder / "shell.json").read_text()))


def shell_block(shell: Mapping[str, Any]) -> RegisterBlock:
    """The shell's registers from ``shell.json``."""
    words: list[RegisterWord] = []
    for register in shell["registers"]:
        fields = tuple(BitField(f["name"], int(f["offset"]), int(f["width"])) for f in register["fields"])
        words += _words(
            register["name"], int(register["address"]), int(register["width"]), register["access"],
            register["description"], fields,
        )  # fmt: skip
    return RegisterBlock("shell", 0, "Registers of the AXI4 shell, the same in every design.", tuple(words))


def _device_block(manifest: Manifest, shell: Mapping[str, Any]) -> RegisterBlock:
    words: list[RegisterWord] = []
    for register in manifest.registers.values():
        if register.name != _KEPT or "rays.tail" in manifest.registers:
            words += _words(
                register.name, 4 * register.address, register.width, register.access, _description(register)
            )
    return RegisterBlock("device", int(shell["deviceBase"]), "Registers of the device.", tuple(words))


def _description(register: Register) -> str:
    kind = "signed" if register.signed else "unsigned"
    limit = "" if register.limit is None else f", at most {register.limit}"
    return f"{register.name}: {kind}, {register.width} bits{limit}."


def _words(
    name: str, address: int, width: int, access: str, description: str, fields: tuple[BitField, ...] = ()
) -> Iterator[RegisterWord]:
    count = -(-width // WORD)
    if count > 2 or (fields and count > 1):
        raise ValueError(f"register {name} has {width} bits")
    for word in range(count):
        part = f"{name}_{('low', 'high')[word]}" if count > 1 else name
        bits = fields or (BitField("value", 0, min(WORD, width - WORD * word)),)
        yield RegisterWord(identifier(part), address + 4 * word, access, description, bits, _EFFECTS.get(name))


def identifier(name: str) -> str:
    """A C identifier: ``lights[0].position.x`` becomes ``lights_0_position_x``."""
    return re.sub(r"\W+", "_", name.replace("]", ""))
