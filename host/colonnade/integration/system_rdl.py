"""Registers in SystemRDL 2.0, from which PeakRDL makes headers, pages and IP-XACT."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from colonnade.integration.register_table import RegisterBlock, RegisterWord

_ACCESS = {"ro": "sw = r; hw = w;", "rw": "sw = rw; hw = r;", "wo": "sw = w; hw = r;"}
_EFFECT = {"clears": " onwrite = woclr; hw = rw;", "sets": " onwrite = woset; hw = rw;"}


def system_rdl(name: str, blocks: Sequence[RegisterBlock]) -> str:
    """An address map with the blocks; with a single block, of its registers."""
    lines = [f"addrmap {name} {{", "    default regwidth = 32;", "    default accesswidth = 32;"]
    if len(blocks) == 1:
        lines += [f'    desc = "{_text(blocks[0].description)}";', *_registers(blocks[0], "    ")]
    else:
        for block in blocks:
            lines += ["    addrmap {", f'        desc = "{_text(block.description)}";', *_registers(block, "        ")]
            lines.append(f"    }} {block.name} @ {block.base:#x};")
    return "\n".join([*lines, "};"]) + "\n"


def _registers(block: RegisterBlock, indent: str) -> Iterator[str]:
    for word in block.words:
        yield f'{indent}reg {{ desc = "{_text(word.description)}";'
        for field in word.fields:
            high = field.offset + field.width - 1
            yield f"{indent}    field {{ {_properties(word)} }} \\{field.name}[{high}:{field.offset}];"
        yield f"{indent}}} \\{word.name} @ {word.address:#x};"


def _properties(word: RegisterWord) -> str:
    access = _ACCESS[word.access]
    return access if word.effect is None else access.split(" hw")[0] + _EFFECT[word.effect]


def _text(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"')
