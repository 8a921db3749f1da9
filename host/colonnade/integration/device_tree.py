"""Device tree nodes: the device for Linux's UIO driver, and a framebuffer that it renders into."""

from __future__ import annotations

from dataclasses import dataclass

from colonnade.integration.register_table import SPACE, RegisterTable


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


def device_tree(table: RegisterTable, base: int, interrupt: int, display: Display | None = None) -> str:
    """The node at the byte address ``base``, in one cell of 32 bits or in two. ``interrupt`` is a cell.

    Interrupt cells and the memory region of images are the board's: edit them. With ``display`` the root also has the
    framebuffer, and the memory of it is reserved and the device's second region.
    """
    major = table.version >> 16
    cells = "two address cells" if base >> 32 else "one address cell"
    regions = f"<{_address(base)} {SPACE:#x}>"
    if display is not None:
        regions += f", <{_address(display.base)} {display.stride * display.height:#x}>"
    node = f"""\
/* Include it in the node of a bus with {cells} and one size cell. */
colonnade@{base:x} {{
    compatible = "colonnade,axi-{major}", "generic-uio";
    reg = {regions};
    interrupts = <{interrupt}>;
}};
"""
    return node if display is None else node + _framebuffer(display)


def _framebuffer(display: Display) -> str:
    """Nodes of the root, in the cells of the display's address."""
    size = display.stride * display.height
    cells = 2 if display.base >> 32 else 1
    region = f"<{_address(display.base)} {size:#x}>"
    return f"""
/* Include these in the root: Linux draws its console here until a program maps the framebuffer. */
reserved-memory {{
    #address-cells = <{cells}>;
    #size-cells = <1>;
    ranges;
    colonnade_pixels: pixels@{display.base:x} {{
        reg = {region};
        no-map;
    }};
}};
chosen {{
    #address-cells = <{cells}>;
    #size-cells = <1>;
    ranges;
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


def _address(value: int) -> str:
    """The cells of an address: one of 32 bits, or two."""
    return f"{value >> 32:#x} {value & 0xFFFFFFFF:#x}" if value >> 32 else f"{value:#x}"
