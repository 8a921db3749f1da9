"""A device tree node of the device, for Linux's UIO driver."""

from __future__ import annotations

from colonnade.integration.register_table import SPACE, RegisterTable


def device_tree(table: RegisterTable, base: int, interrupt: int) -> str:
    """The node at the byte address ``base``.

    Interrupt cells and the memory region are the board's: edit them.
    """
    major = table.version >> 16
    return f"""\
/* Include it in the node of a bus with one address cell and one size cell. */
colonnade@{base:x} {{
    compatible = "colonnade,axi-{major}", "generic-uio";
    reg = <{base:#x} {SPACE:#x}>;
    interrupts = <{interrupt}>;
}};
"""
