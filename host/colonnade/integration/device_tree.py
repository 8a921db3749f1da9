"""Device tree nodes: the device for Linux's UIO driver, and a framebuffer that it renders into."""

from __future__ import annotations

from dataclasses import dataclass

from colonnade.integration.register_table import SPACE, RegisterTable

#: Bytes of a page of Linux.
PAGE = 4096


@dataclass(frozen=True)
class Display:
    """A framebuffer that a display controller scans out, and that Linux shows as a `simple-framebuffer`.

    Attributes:
        base: Byte address.
        width: Pixels.
        height: Lines.
        tile_size: `frame.tileSize` of the design: a line has whole tile rows.
    """

    base: int
    width: int
    height: int
    tile_size: int

    @property
    def stride(self) -> int:
        """Bytes from a line to the next, XRGB8888."""
        return -(-self.width // self.tile_size) * self.tile_size * 4

    @property
    def size(self) -> int:
        """Bytes of all lines, in whole pages, since UIO maps whole ones: what is behind them is not Linux's own."""
        return -(-self.stride * self.height // PAGE) * PAGE


def device_tree(table: RegisterTable, base: int, interrupt: int, display: Display | None = None, cells: int = 1) -> str:
    """The node at the byte address ``base``.

    Its interrupt cell is the board's, as is the memory region of images without a display: edit them.

    Args:
        table: The registers.
        base: Byte address of the device.
        interrupt: One cell.
        display: The root also has this framebuffer, and the memory of it is reserved and the device's second region.
        cells: Of addresses and of sizes, in the node of the bus and in the root: 1, or 2. They are 2 if an address
            needs it.
    """
    if max(base, display.base if display else 0) >> 32:
        cells = 2
    regions = _region(base, SPACE, cells)
    if display is not None:
        regions += f", {_region(display.base, display.size, cells)}"
    node = f"""\
/* Include it in the node of a bus with {_CELLS[cells]}. */
colonnade@{base:x} {{
    compatible = "colonnade,axi-{table.version >> 16}", "generic-uio";
    reg = {regions};
    interrupts = <{interrupt}>;
}};
"""
    return node if display is None else node + _framebuffer(display, cells)


_CELLS = {1: "one address cell and one size cell", 2: "two address cells and two size cells"}


def _framebuffer(display: Display, cells: int) -> str:
    """Nodes of the root."""
    region = _region(display.base, display.size, cells)
    bus = f"""\
    #address-cells = <{cells}>;
    #size-cells = <{cells}>;
    ranges;"""
    return f"""
/* Include these in the root, which has {_CELLS[cells]}: Linux ignores reserved memory with other cells. */
reserved-memory {{
{bus}
    colonnade_pixels: pixels@{display.base:x} {{
        reg = {region};
        no-map;
    }};
}};
chosen {{
{bus}
    framebuffer@{display.base:x} {{
        compatible = "simple-framebuffer";
        reg = {region};
        memory-region = <&colonnade_pixels>;
        width = <{display.width}>;
        height = <{display.height}>;
        stride = <{display.stride}>;
        format = "x8r8g8b8";
    }};
}};
"""


def _region(address: int, size: int, cells: int) -> str:
    """An address and a size, in so many cells each."""
    words = [number >> 32 * part & 0xFFFFFFFF for number in (address, size) for part in reversed(range(cells))]
    return f"<{' '.join(f'{word:#x}' for word in words)}>"
