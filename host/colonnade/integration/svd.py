"""Registers as CMSIS-SVD, which debuggers read."""

from __future__ import annotations

import xml.etree.ElementTree as ET

from colonnade.integration.register_table import SPACE, RegisterTable, RegisterWord

_ACCESS = {"ro": "read-only", "rw": "read-write", "wo": "write-only"}
_EFFECT = {"clears": "oneToClear", "sets": "oneToSet"}


def svd(table: RegisterTable, base: int) -> str:
    """The peripheral at the byte address ``base``."""
    device = ET.Element("device", {"schemaVersion": "1.3"})
    _add(device, name="Colonnade", version=f"{table.version >> 16}.{table.version & 0xFFFF}")
    _add(device, description="Array of ray tracers", addressUnitBits=8, width=32, size=32)
    peripheral = ET.SubElement(ET.SubElement(device, "peripherals"), "peripheral")
    _add(peripheral, name="COLONNADE", baseAddress=hex(base))
    block = ET.SubElement(peripheral, "addressBlock")
    _add(block, offset=0, size=hex(SPACE), usage="registers")
    registers = ET.SubElement(peripheral, "registers")
    for part in (table.shell, table.device):
        cluster = ET.SubElement(registers, "cluster")
        _add(cluster, name=part.name, description=part.description, addressOffset=hex(part.base))
        for word in part.words:
            _register(cluster, word)
    ET.indent(device)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ET.tostring(device, encoding="unicode") + "\n"


def _register(cluster: ET.Element, word: RegisterWord) -> None:
    register = ET.SubElement(cluster, "register")
    _add(register, name=word.name, description=word.description, addressOffset=hex(word.address))
    _add(register, access=_ACCESS[word.access])
    if word.effect is not None:
        _add(register, modifiedWriteValues=_EFFECT[word.effect])
    fields = ET.SubElement(register, "fields")
    for field in word.fields:
        _add(ET.SubElement(fields, "field"), name=field.name, bitOffset=field.offset, bitWidth=field.width)


def _add(parent: ET.Element, **texts: str | int) -> None:
    for name, text in texts.items():
        ET.SubElement(parent, name).text = str(text)
