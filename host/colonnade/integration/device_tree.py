"""A device tree node of the device, for Linux's UIO driver."""

from __future__ import annotations

from colonnade.integration.register_table import SPACE, RegisterTable


def device_tree(table: RegisterTable, base: int, interrupt: int) -> str:
    """The node at the byte address ``base``, in one cell of 32 bits or in two. ``interrupt`` is a cell.

    Interrupt cells and the memory region are the board's: edit them.
    """
    major = table.version >> 16
    address = f"{base >> 32:#x} {base & 0xFFFFFFFF:#x}" if base >> 32 else f"{base:#x}"
    cells = "two address cells" if base >> 32 else "one address cell"
    return f"""\
/* Include it in the node of a bus with {cells} and one size cell. */
colonnade@{base:x} {{
    compatible = "colonnade,axi-{major}", "generic-uio";
    reg = <{address} {SPACE:#x}>;
    interrupts = <{interrupt}>;
}};
"""
