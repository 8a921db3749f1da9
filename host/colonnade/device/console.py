"""Linux' console on a display that shows the device's memory: kept from drawing there (docs/soc.md, "Linux")."""

from __future__ import annotations

import atexit
import contextlib
import errno
import fcntl
import os
import signal
import struct
import threading
from pathlib import Path
from types import FrameType

from colonnade.common.errors import UserError, reason_of

#: Frame buffers that Linux may have, and requests of <linux/fb.h> and <linux/kd.h>.
_DISPLAYS = 8
_FBIOGET_FSCREENINFO, _KDSETMODE, _KD_TEXT, _KD_GRAPHICS = 0x4602, 0x4B3A, 0, 1
#: Of struct fb_fix_screeninfo: id, smem_start and smem_len.
_SCREEN = struct.Struct("@16sLI")
#: Their default ends a program, and nothing else would give the console back.
_SIGNALS = (signal.SIGTERM, signal.SIGHUP)
#: Of Linux' files.
ROOT = Path("/")


class ConsoleGuard:
    """Keeps the console from drawing into memory while a display shows a part of it.

    It draws again after `close`, after the end of the program, or after SIGTERM or SIGHUP unless the program handles
    them. ``driver/examples/target_uio.c`` has the same rule in C.

    Args:
        base: Bus address of the memory.
        size: Bytes of it.

    Raises:
        UserError: A display or the console cannot be opened.
    """

    def __init__(self, base: int, size: int) -> None:
        self._terminal: int | None = None
        self._process = os.getpid()
        if not any(_shows(f"dev/fb{number}", base, size) for number in range(_DISPLAYS)):
            return
        if not (ROOT / "sys/class/tty/tty0").exists():  # a kernel without consoles on displays
            return
        try:
            self._terminal = os.open(ROOT / "dev/tty0", os.O_RDWR)
            fcntl.ioctl(self._terminal, _KDSETMODE, _KD_GRAPHICS)
        except OSError as error:
            if self._terminal is not None:
                os.close(self._terminal)
                self._terminal = None
            raise UserError(
                f"/dev/tty0: {reason_of(error)}: the console draws on a display that shows the device's memory, and"
                " cannot be kept from it: run as root"
            ) from None
        atexit.register(self.close)
        if threading.current_thread() is threading.main_thread():
            for number in _SIGNALS:
                if signal.getsignal(number) is signal.SIG_DFL:
                    signal.signal(number, self._end)

    def close(self) -> None:
        """Let the console draw again; a fork of the program does not."""
        if self._terminal is None or os.getpid() != self._process:
            return
        with contextlib.suppress(OSError):
            fcntl.ioctl(self._terminal, _KDSETMODE, _KD_TEXT)
        os.close(self._terminal)
        self._terminal = None
        atexit.unregister(self.close)
        if threading.current_thread() is threading.main_thread():
            for number in _SIGNALS:
                if signal.getsignal(number) == self._end:
                    signal.signal(number, signal.SIG_DFL)

    def _end(self, number: int, frame: FrameType | None) -> None:
        self.close()
        signal.signal(number, signal.SIG_DFL)
        signal.raise_signal(number)


def _shows(display: str, base: int, size: int) -> bool:
    """Whether a display shows a part of a memory."""
    try:
        file = os.open(ROOT / display, os.O_RDONLY)
    except OSError as error:
        if error.errno in (errno.EACCES, errno.EPERM):
            raise UserError(f"/{display}: {reason_of(error)}: it may show the device's memory: run as root") from None
        return False
    try:
        content = fcntl.ioctl(file, _FBIOGET_FSCREENINFO, bytes(2 * _SCREEN.size + 64))
    except OSError:
        return False
    finally:
        os.close(file)
    _, start, length = _SCREEN.unpack_from(content)
    return bool(start < base + size and base < start + length)
